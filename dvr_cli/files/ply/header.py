"""The header of a PLY file: its encoding, and the kinds of records that follow.

ply
format ascii 1.0
comment made by hand
element vertex 3
property float x
...
element face 1
property list uchar int vertex_indices
end_header
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import shown
from dvr_cli.files.records import Kind, Property

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
}
_ORDERS = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}
_BEGIN = re.compile(rb"ply[ \t]*(\r\n|\n|\r)")
_MOST = 1 << 40  # larger counts can only come from damage


@dataclass(frozen=True)
class Header:
    """order: "<" or ">" of a binary file, "" of text. kinds: in order. end: where the records begin."""

    order: str
    kinds: list[Kind]
    end: int

    def kind(self, name: str) -> Kind | None:
        """The kind of records of this name."""
        return next((kind for kind in self.kinds if kind.name == name), None)


def read_header(data: bytes) -> Header:
    """Read the header; raises InputError for what is none, or has a type or statement that PLY has not."""
    match = _BEGIN.match(data)
    if match is None:
        raise InputError("not a PLY file: its first line is not 'ply'")
    line_end = match[1]
    order: str | None = None
    kinds: list[tuple[str, int, list[Property]]] = []
    at, number = match.end(), 1
    while True:
        end = data.find(line_end, at)
        line = data[at:end]
        words = line.split()
        number += 1
        if end < 0 or len(line) > 4096:
            raise InputError("its header has no end_header")
        if words == [b"end_header"]:
            break
        if len(words) == 3 and words[0] == b"format" and words[1] in _ORDERS:
            order = _ORDERS[words[1]]
        elif len(words) == 3 and words[0] == b"element" and words[2].isdigit() and len(words[2]) < 16:
            count = int(words[2])
            if count > _MOST or words[1] in [name.encode() for name, *_ in kinds]:
                raise InputError(
                    f"line {number}: {shown(line)} is not valid, or a second element of its name"
                )
            kinds.append((_text(words[1]), count, []))
        elif words and words[0] == b"property" and kinds:
            found = _property(line, at, number)
            if found.name in [p.name for p in kinds[-1][2]]:
                raise InputError(f"line {number}: a second property {shown(found.name)}")
            kinds[-1][2].append(found)
        elif words and words[0] not in (b"comment", b"obj_info"):
            raise InputError(f"line {number}: {shown(line)} is no statement of a PLY header")
        at = end + len(line_end)
    if order is None:
        raise InputError("its header names no format (ascii, binary_little_endian, binary_big_endian)")
    whole = [Kind(name, count, tuple(properties)) for name, count, properties in kinds]
    return Header(order, whole, end + len(line_end))


def _property(line: bytes, at: int, number: int) -> Property:
    words = list(re.finditer(rb"\S+", line))
    texts = [_text(word.group()) for word in words]
    is_list = len(texts) == 5 and texts[1] == "list"
    if not is_list and len(texts) != 3:
        raise InputError(f"line {number}: {shown(line)} is no property")
    types = texts[2:4] if is_list else texts[1:2]
    unknown = [name for name in types if name not in _TYPES]
    if unknown:
        raise InputError(f"line {number}: {shown(unknown[0])} is no type of a PLY property")
    if is_list and _TYPES[types[0]].startswith("f"):
        raise InputError(f"line {number}: the length of a list is no {types[0]}")
    of_type = words[-2]
    return Property(
        texts[-1],
        _TYPES[types[-1]],
        _TYPES[types[0]] if is_list else "",
        (at + of_type.start(), at + of_type.end()),
    )


def _text(word: bytes) -> str:
    return word.decode("utf-8", "backslashreplace")
