"""XML elements with their places in the bytes of the file, so that parts of it can be replaced.

Shared by the formats written in XML (VTU, VTP, XDMF). expat, which finds the places, reads no external files.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO
from xml.parsers import expat

from dvr_cli.errors import InputError

_ATTRIBUTE = re.compile(rb"\s+([^\s=/>]+)\s*=\s*(\"[^\"]*\"|'[^']*')")
_START_TAG = re.compile(rb"<[^\s/>]+(?:\s+[^\s=/>]+\s*=\s*(?:\"[^\"]*\"|'[^']*'))*\s*(/?)>")
_REFERENCE = re.compile(rb"&([\w.-]+);")
_WIDE = (b"\xff\xfe", b"\xfe\xff", b"\x00<", b"<\x00")  # how UTF-16 begins


@dataclass
class Element:
    """An element of an XML file.

    attributes: as the parser delivers them, references resolved.
    begin: where its start tag begins.
    inside: behind its start tag.
    end_tag: where its end tag begins; ``inside`` if its start tag closes it ("<a/>").
    end: behind the element.
    """

    name: str
    attributes: dict[str, str]
    begin: int
    inside: int = 0
    end_tag: int = 0
    end: int = 0
    children: list[Element] = field(default_factory=list)

    def named(self, *names: str) -> list[Element]:
        """The children with one of these names."""
        return [child for child in self.children if child.name in names]

    def walk(self) -> Iterator[Element]:
        """This element and all in it, in the order of the file."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting.extend(reversed(element.children))

    @property
    def text(self) -> tuple[int, int]:
        """The place of the text at its beginning, in front of any child."""
        return self.inside, self.children[0].begin if self.children else self.end_tag


class _Stop(Exception):
    """Parsing ends here, as what follows is no XML."""


def parse(data: bytes, stop: str | None = None, entities: bool = False) -> Element:
    """The root element of an XML file, with all elements in it.

    stop: the name of an element at whose start tag parsing ends, as what is in it need not be XML; it and
        those around it end where the file does.
    entities: whether the file may declare entities that are plain text, see ``resolved``.
    Raises InputError for what is no XML, for encodings of two bytes a character and other entities.
    """
    if data.startswith(_WIDE):
        raise InputError("XML in UTF-16 is not supported; save it as UTF-8")
    parser = expat.ParserCreate()
    root = Element("", {}, 0)
    stack = [root]

    def start(name: str, attributes: dict[str, str]) -> None:
        begin = parser.CurrentByteIndex
        tag = _START_TAG.match(data, begin)
        if tag is None:
            raise InputError(f"the start tag of {name[:40]} is not understood")
        element = Element(name, attributes, begin, tag.end(), tag.end(), tag.end() if tag[1] else 0)
        stack[-1].children.append(element)
        stack.append(element)
        if name == stop:
            raise _Stop

    def end(name: str) -> None:
        element = stack.pop()
        if not element.end:  # else "<a/>"
            element.end_tag = parser.CurrentByteIndex
            element.end = data.index(b">", element.end_tag) + 1

    def entity(name: str, of_dtd: bool, value: str | None, *declaration: object) -> None:
        if not entities or of_dtd or value is None or set(value) & set("&%<:"):
            raise InputError("XML entities declared in the file are not supported")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.EntityDeclHandler = entity
    try:
        done = 0
        for match in re.finditer(rb"<%b[^>]*>" % stop.encode(), data) if stop else ():
            parser.Parse(data[done : match.end()], False)  # stops here, or that was in a comment
            done = match.end()
        parser.Parse(data[done:], True)
    except _Stop:
        for element in stack:
            element.end_tag = element.end = len(data)
    except expat.ExpatError as error:
        raise InputError(f"damaged XML: {expat.ErrorString(error.code)} in line {error.lineno}") from error
    except ValueError as error:  # an encoding that expat does not know
        raise InputError(f"damaged XML: {error}") from error
    return root.children[0]


def resolved(data: bytes, text: bytes) -> bytes:
    """A text of the file ``data``, which ``parse`` has read, with the entities replaced that it declares."""
    if b"&" not in text:
        return text
    declared: dict[bytes, bytes] = {}

    def entity(name: str, of_dtd: bool, value: str | None, *declaration: object) -> None:
        declared.setdefault(name.encode(), (value or "").encode())

    def start(name: str, attributes: dict[str, str]) -> None:
        raise _Stop

    parser = expat.ParserCreate()
    parser.EntityDeclHandler = entity
    parser.StartElementHandler = start
    with contextlib.suppress(_Stop):
        parser.Parse(data, True)
    return _REFERENCE.sub(lambda match: declared.get(match[1], match[0]), text)


def attribute_place(data: bytes, element: Element, name: str) -> tuple[int, int]:
    """The place in the file of the value of an attribute that ``element`` has, without its quotes."""
    key = name.encode()
    begin = element.begin + len(element.name.encode()) + 1
    for match in _ATTRIBUTE.finditer(data, begin, element.inside):
        if match.group(1) == key:
            return match.start(2) + 1, match.end(2) - 1
    raise KeyError(name)


@dataclass(frozen=True)
class Edit:
    """Bytes that take the place of those from ``begin`` to ``end``."""

    begin: int
    end: int
    replacement: bytes


def write_edited(file: BinaryIO, data: bytes, edits: Iterable[Edit]) -> None:
    """Write ``data`` with the edits, which do not overlap."""
    view = memoryview(data)
    done = 0
    for edit in sorted(edits, key=lambda e: e.begin):
        file.write(view[done : edit.begin])
        file.write(edit.replacement)
        done = edit.end
    file.write(view[done:])


def edited(data: bytes, edits: Iterable[Edit]) -> bytes:
    """``data`` with the edits, which do not overlap."""
    view = memoryview(data)
    parts: list[bytes | memoryview] = []
    done = 0
    for edit in sorted(edits, key=lambda e: e.begin):
        parts += [view[done : edit.begin], edit.replacement]
        done = edit.end
    return b"".join([*parts, view[done:]])
