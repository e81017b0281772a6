"""The sections $PhysicalNames, $NodeData and $ElementData of a Gmsh file."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.gmsh.numbers import is_blank, parse
from dvr_cli.files.gmsh.sections import Header, Section, quoted, read_count, read_line

_NAME = re.compile(rb'(\d)\s+(-?\d{1,9})\s+"?(.*?)"?')


class View(NamedTuple):
    """One step of a post-processing view on nodes or elements.

    tags: (n,) node tags or element numbers. values: (n, 1), (n, 3) or (n, 9).
    """

    name: str
    on_nodes: bool
    step: int
    tags: np.ndarray
    values: np.ndarray


def read_physical_names(data: bytes, section: Section) -> list[tuple[str, int, int]]:
    """Read $PhysicalNames: the name, tag and dimension of each group."""
    count, at = read_count(data, section.start, section)
    names = []
    for line in filter(None, map(bytes.strip, data[at : section.stop].split(b"\n"))):
        match = _NAME.fullmatch(line)
        if match is None:
            raise InputError(f"section $PhysicalNames is damaged: {quoted(line)} does not name a group")
        names.append((_text(match[3]), int(match[2]), int(match[1])))
    if len(names) != count:
        raise InputError(f"section $PhysicalNames declares {count} names and holds {len(names)}")
    return names


class ViewHead(NamedTuple):
    """The lines in front of the values of a view; at: where these begin, and rows: how many there are."""

    name: str
    step: int
    components: int
    rows: int
    at: int

    @property
    def is_field(self) -> bool:
        """True if the values are scalars, vectors (3) or tensors (9)."""
        return self.components in (1, 3, 9)


def read_view(data: bytes, section: Section, header: Header) -> View | None:
    """Read $NodeData or $ElementData; None if it is neither scalar, vector (3) nor tensor (9)."""
    head = read_view_head(data, section)
    if not head.is_field:
        return None
    numbers, values = _values(data, head.at, section, header, head.rows, head.components)
    return View(head.name, section.name == "NodeData", head.step, numbers, values)


def read_view_head(data: bytes, section: Section) -> ViewHead:
    """Read the lines in front of the values of $NodeData or $ElementData."""
    tags: list[list[bytes]] = []
    at = section.start
    for _ in ("strings", "reals", "integers"):
        count, at = read_count(data, at, section)
        tags.append([])
        for _ in range(count):
            line, at = read_line(data, at, section)
            tags[-1].append(line)
    strings, _, integers = tags
    if len(integers) < 3 or not all(re.fullmatch(rb"-?\d{1,18}", tag) for tag in integers):
        raise InputError(f"section ${section.name} is damaged: its integer tags are wrong")
    step, components, rows = map(int, integers[:3])
    return ViewHead(_text(strings[0].strip(b'"')) if strings else "", step, components, rows, at)


def _values(
    data: bytes, at: int, section: Section, header: Header, count: int, components: int
) -> tuple[np.ndarray, np.ndarray]:
    """(count,) tags and (count, components) values from where they begin to the section's end."""
    if header.byte_order:
        row = np.dtype(
            [("tag", header.byte_order + "i4"), ("value", header.byte_order + "f8", (components,))]
        )
        end = at + count * row.itemsize
        if not at <= end <= section.stop or not is_blank(data, end, section.stop):
            raise _wrong(section, count)
        table = np.frombuffer(data, row, count, at)
        return table["tag"].astype(np.int64), table["value"]
    values = parse(data[at : section.stop], np.float64, section.name)
    if count * (1 + components) != len(values):
        raise _wrong(section, count)
    values = values.reshape(count, 1 + components)
    return np.rint(values[:, 0]).astype(np.int64), values[:, 1:]


def _wrong(section: Section, count: int) -> InputError:
    return InputError(f"section ${section.name} does not hold the {count} values it declares")


def _text(name: bytes) -> str:
    try:
        return name.decode()
    except UnicodeDecodeError:
        return name.decode("latin-1")
