"""The layout of a VTK XML file: its coding, its pieces, and the arrays in them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import shown
from dvr_cli.files.vtkxml.arrays import Coding, Stored, StoredArray, decode, stored_array
from dvr_cli.files.vtkxml.compression import compressor_named
from dvr_cli.files.xml_places import Element, parse

_APPENDED = re.compile(rb"\s*_")
_ORDERS: dict[str, Literal["<", ">"]] = {"LittleEndian": "<", "BigEndian": ">"}
_HEADERS = {"UInt32": "u4", "UInt64": "u8"}
_LISTS_OF_FILES = ("PUnstructuredGrid", "PPolyData", "vtkMultiBlockDataSet", "Collection")
_MOST = 1 << 50  # larger counts can only come from damage


@dataclass(frozen=True)
class Layout:
    """A VTK XML file of one data set.

    data: its bytes.
    coding: how its binary arrays are written.
    appended: where the appended data begin and end, and whether they are base64; None if there are none.
    root: its elements.
    dataset: the element of the data set, which holds the pieces.
    """

    data: bytes
    coding: Coding
    appended: tuple[int, int, bool] | None
    root: Element
    dataset: Element

    @property
    def pieces(self) -> list[Element]:
        return self.dataset.named("Piece")

    def array(self, element: Element, what: str) -> StoredArray:
        """The place of an array; raises InputError."""
        return stored_array(element, self.appended, what)

    def read(self, element: Element, what: str, count: int | None) -> Stored:
        """An array; count: of its numbers, None if it says itself. Raises InputError."""
        return decode(self.data, self.array(element, what), self.coding, count)


def layout_of(data: bytes, kind: str, suffix: str) -> Layout:
    """The layout of a file that has to hold a data set of this kind ("PolyData"), told by ``suffix``.

    Raises InputError for what is no VTK XML file, damaged, or of another kind.
    """
    root = parse(data, stop="AppendedData")
    if root.name != "VTKFile":
        raise InputError(f"not a VTK XML file: it begins with {shown(root.name)}")
    found = root.attributes.get("type", "")
    if found in _LISTS_OF_FILES:
        raise InputError(
            f"a {found} only lists the files of its pieces; give those one by one, or merge them into one"
        )
    if found != kind:
        raise InputError(f"VTK XML of type {shown(found)}, where .{suffix} should hold {kind}")
    datasets = root.named(kind)
    if len(datasets) != 1:
        raise InputError(f"there are {len(datasets)} {kind} elements, where one is needed")
    return Layout(data, _coding(root), _appended(data, root), root, datasets[0])


def count_of(piece: Element, name: str) -> int:
    """The whole number in an attribute of a piece, 0 where it has none."""
    text = piece.attributes.get(name, "0").strip()
    if not (text.isascii() and text.isdigit()) or len(text) > 18 or int(text) > _MOST:
        raise InputError(f"{name} should be a number of things, not {shown(text)}")
    return int(text)


def _coding(root: Element) -> Coding:
    order = root.attributes.get("byte_order", "LittleEndian")
    header = root.attributes.get("header_type", "UInt32")
    if order not in _ORDERS:
        raise InputError(f"byte_order {shown(order)} is neither LittleEndian nor BigEndian")
    if header not in _HEADERS:
        raise InputError(f"header_type {shown(header)} is neither UInt32 nor UInt64")
    name = root.attributes.get("compressor", "")
    dtype = np.dtype(_HEADERS[header]).newbyteorder(_ORDERS[order])
    return Coding(_ORDERS[order], dtype, compressor_named(name) if name else None)


def _appended(data: bytes, root: Element) -> tuple[int, int, bool] | None:
    elements = root.named("AppendedData")
    if not elements:
        return None
    encoding = elements[0].attributes.get("encoding", "base64")
    if encoding not in ("raw", "base64"):
        raise InputError(f"AppendedData with the encoding {shown(encoding)} are not supported")
    mark = _APPENDED.match(data, elements[0].inside)
    end = data.rfind(b"</AppendedData>", elements[0].inside)
    if mark is None or end < 0:
        raise InputError("truncated or damaged: the AppendedData have no mark, or no end")
    return mark.end(), end, encoding == "base64"
