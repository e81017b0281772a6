"""The DataItems of an XDMF file: arrays as text in the file, or in HDF5 and raw files beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from xml.sax.saxutils import escape, unescape

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import parse_numbers, shown
from dvr_cli.files.xdmf.hdf5 import read_dataset
from dvr_cli.files.xml_places import Edit, Element, resolved

_KINDS = {"float": "f", "int": "i", "uint": "u", "char": "i", "uchar": "u"}
_MOST = 1 << 50  # larger counts can only come from damage


@dataclass(frozen=True)
class Item:
    """An array of numbers.

    form: "xml", "hdf" or "binary".
    dtype: as declared, with its byte order; that of an HDF5 dataset is in its file.
    file, inside: of other forms than "xml": the file, relative to this one, and the name of the dataset.
    seek: where a raw array begins.
    """

    element: Element
    form: str
    shape: tuple[int, ...]
    dtype: np.dtype
    file: str
    inside: str
    seek: int

    @property
    def count(self) -> int:
        return prod(self.shape)


def item_of(data: bytes, element: Element) -> Item:
    """The array in a DataItem element; raises InputError for what is not supported."""
    given = element.attributes
    if given.get("ItemType", "Uniform").lower() != "uniform" or "Reference" in given or element.children:
        raise InputError("a DataItem that is made of others, or refers to another, is not supported")
    form = given.get("Format", "XML").lower()
    form = {"hdf5": "hdf", "h5": "hdf"}.get(form, form)
    if form not in ("xml", "hdf", "binary"):
        raise InputError(f"a DataItem has the format {shown(given['Format'])}, which is not supported")
    if form == "binary" and given.get("Compression", "Raw").lower() != "raw":
        raise InputError("compressed raw files are not supported")
    file, _, inside = text_of(data, element).rpartition(":") if form == "hdf" else ("", "", "")
    if form == "binary":
        file = text_of(data, element)
    if form != "xml" and not file:
        raise InputError("a DataItem names no file")
    dtype = _dtype(given)
    return Item(element, form, _shape(given), dtype, file, inside, _whole(given.get("Seek", "0"), "Seek"))


def text_of(data: bytes, element: Element) -> str:
    """The text of an element without blanks around it."""
    begin, end = element.text
    return unescape(resolved(data, data[begin:end]).decode("utf-8", "replace").strip())


def read_item(data: bytes, item: Item, beside: Callable[[str], bytes]) -> np.ndarray:
    """The numbers of an array, (count,), in native byte order; raises InputError.

    beside: the bytes of a file that the XDMF file names.
    """
    if item.form == "hdf":
        return read_dataset(beside(item.file), item.inside, item.count)
    if item.form == "binary":
        stored = beside(item.file)
        if item.seek + item.count * item.dtype.itemsize > len(stored):
            raise InputError(f"{shown(item.file)} is too short for the {item.count} numbers in it")
        values = np.frombuffer(stored, item.dtype, item.count, item.seek)
        return values.astype(item.dtype.newbyteorder("="))
    begin, end = item.element.text
    try:
        values = parse_numbers(data[begin:end], item.count, np.dtype(f"{item.dtype.kind}8"))
    except ValueError:
        raise InputError(f"a DataItem should be {item.count} numbers, but is something else") from None
    with np.errstate(over="ignore"):
        return values.astype(item.dtype.newbyteorder("="))


def renamed(data: bytes, item: Item, name: str) -> Edit:
    """The edit that makes a DataItem refer to another file."""
    begin, end = item.element.text
    text = data[begin:end]
    at = begin + len(text) - len(text.lstrip())
    old = text.strip().rpartition(b":")[0] if item.form == "hdf" else text.strip()
    return Edit(at, at + len(old), escape(name).encode())


def _shape(given: dict[str, str]) -> tuple[int, ...]:
    words = given.get("Dimensions", "").split()
    if not words:
        raise InputError("a DataItem has no Dimensions")
    shape = tuple(_whole(word, "Dimensions") for word in words)
    if prod(shape) > _MOST:
        raise InputError(f"Dimensions {shown(given['Dimensions'])} cannot be right")
    return shape


def _whole(text: str, what: str) -> int:
    if not (text.isascii() and text.isdigit()) or len(text) > 16:
        raise InputError(f"{what} should be whole numbers, not {shown(text)}")
    return int(text)


def _dtype(given: dict[str, str]) -> np.dtype:
    name = given.get("NumberType", given.get("DataType", "Float"))
    if name.lower() not in _KINDS:
        raise InputError(f"numbers of the type {shown(name)} are not supported")
    width = given.get("Precision", "1" if name.lower() in ("char", "uchar") else "4")
    if width not in ("1", "2", "4", "8") or (_KINDS[name.lower()] == "f" and width not in ("4", "8")):
        raise InputError(f"numbers of the Precision {shown(width)} are not supported")
    big = given.get("Endian", "Native").lower() == "big"
    little = given.get("Endian", "Native").lower() == "little"
    return np.dtype(f"{'>' if big else '<' if little else '='}{_KINDS[name.lower()]}{width}")
