"""The sections of a Gmsh MSH file, and its header.

A file is a sequence of ``$Name`` ... ``$EndName``. Sections may come in any order, and unknown ones are
passed over, but text outside every section is refused: it is what a damaged section looks like.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from dvr_cli.errors import InputError

_OPENING = re.compile(rb"\s*\$(\w+)[^\n]*\n")
_VERSION = re.compile(rb"\d{1,3}(\.\d{1,3})?")
_BLANK = re.compile(rb"\s*\Z")
_ONCE = {"MeshFormat", "PhysicalNames", "Entities", "PartitionedEntities", "Nodes", "Elements", "Periodic"}
_NAMES = {"ParametricNodes": "Nodes", "NOD": "Nodes", "ELM": "Elements"}
VIEWS = {"NodeData", "ElementData"}


class Section(NamedTuple):
    """A section's place: ``data[start:stop]`` is its body, ``data[opening:end]`` includes its markers."""

    name: str
    opening: int
    start: int
    stop: int
    end: int


class Sections(NamedTuple):
    """The sections dvr reads: those that occur at most once by name, and the views in file order.

    others: the names of those it passes over, comments aside.

    $ParametricNodes of MSH 2 and $NOD of MSH 1 take the place of $Nodes and are found under that name, $ELM
    under that of $Elements.
    """

    once: dict[str, Section]
    views: list[Section]
    others: list[str]


class Header(NamedTuple):
    """The contents of $MeshFormat: version, and the byte order of a binary file ("" for ASCII)."""

    version: str
    byte_order: str


def find_sections(data: bytes) -> Sections:
    """Locate the sections of a file; InputError if it is not made of sections or repeats one."""
    once: dict[str, Section] = {}
    views: list[Section] = []
    others: list[str] = []
    end = 0
    while not _BLANK.match(data, end):
        section = next_section(data, end)
        end = section.end
        key = _NAMES.get(section.name, section.name)
        if key in VIEWS:
            views.append(section)
        elif key in _ONCE and once.setdefault(key, section) is not section:
            raise InputError(f"the file has more than one ${key} section")
        elif key not in _ONCE and key != "Comments":
            others.append(key)
    return Sections(once, views, others)


def opening_of(data: bytes, at: int) -> Section | None:
    """The section that begins at ``at``, as if it filled the rest of the file, None behind the last one.

    InputError for other text.
    """
    if _BLANK.match(data, at):
        return None
    match = _opening(data, at)
    return Section(match[1].decode(), match.start(1) - 1, match.end(), len(data), len(data))


def _opening(data: bytes, at: int) -> re.Match[bytes]:
    match = _OPENING.match(data, at)
    if match is None:
        if at == 0:
            raise InputError("not a Gmsh mesh: it does not begin with $MeshFormat")
        found = quoted(data[at : at + 40].split()[0])
        raise InputError(f"a section is expected where {found} stands: the file is truncated or damaged")
    return match


def next_section(data: bytes, at: int) -> Section:
    """The section that begins at ``at``; InputError if none does, or has no end."""
    match = _opening(data, at)
    name = match[1].decode()
    if name.upper().startswith("END"):
        raise InputError(f"${name} stands where no such section has begun: the file is damaged")
    end = b"$END" if name in ("NOD", "ELM") else b"$End"
    start = match.end()  # what is binary may hold the closing marker by chance, once in 2**72 bytes
    stop = data.find(end + match[1], start)
    if stop < 0:
        raise InputError(f"section ${name} has no {end.decode()}{name}: the file is truncated or damaged")
    return Section(name, match.start(1) - 1, start, stop, stop + len(end + match[1]))


def read_header(data: bytes, sections: Sections) -> Header:
    """Read $MeshFormat, which MSH 1 has not; InputError for versions that are not known, by name."""
    section = sections.once.get("MeshFormat")
    if section is None and "Nodes" in sections.once and sections.once["Nodes"].name == "NOD":
        return Header("1", "")
    if section is None:
        raise InputError("the file has no $MeshFormat section")
    line, _, rest = data[section.start : section.stop].partition(b"\n")
    fields = line.split()
    if len(fields) < 3 or fields[1] not in (b"0", b"1") or not _VERSION.fullmatch(fields[0]):
        raise InputError("section $MeshFormat is damaged")
    version = fields[0].decode()
    if version not in ("2", "2.0", "2.1", "2.2", "3", "3.0", "4", "4.0", "4.1"):
        raise InputError(
            f"MSH format {version} is not supported (1, 2, 3, 4.0 and 4.1 are): "
            "convert it with 'gmsh IN -save -format msh41 -o OUT'"
        )
    if fields[1] == b"0":
        return Header(version, "")
    if fields[2] != b"8":
        raise InputError("binary MSH files with a data size other than 8 are not supported")
    byte_order = {b"\x01\0\0\0": "<", b"\0\0\0\x01": ">"}.get(rest[:4])
    if byte_order is None:
        raise InputError("section $MeshFormat is damaged: it does not give the byte order")
    return Header(version, byte_order)


def read_line(data: bytes, at: int, section: Section) -> tuple[bytes, int]:
    """The line of text that begins at ``at`` in a section, stripped, and where the next one begins."""
    newline = data.find(b"\n", at, section.stop)
    if newline < 0:
        raise InputError(f"section ${section.name} is truncated or damaged")
    return data[at:newline].strip(), newline + 1


def read_count(data: bytes, at: int, section: Section) -> tuple[int, int]:
    """The non-negative integer that stands alone on the line at ``at``, and where the next line begins."""
    line, after = read_line(data, at, section)
    if not re.fullmatch(rb"\d{1,18}", line):
        raise InputError(
            f"section ${section.name} is damaged: a count is expected where {quoted(line)} stands"
        )
    return int(line), after


def quoted(text: bytes) -> str:
    """The beginning of some text of a file, fit for an error message of one line."""
    return repr(text[:40].decode("ascii", "backslashreplace"))
