"""The arrays of VTK's XML files: text, base64 or raw bytes, in the element or appended, compressed or not.

Binary arrays are a header of whole numbers and the data. Without compression the header is the number of
bytes, and base64 runs through both. With compression it is the number of blocks, the size of a block and of
the last one (0: as the others), and the compressed size of each; base64 of the blocks begins anew.
"""

from __future__ import annotations

import binascii
import re
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from typing import Literal

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import parse_numbers, shown, token_spans, write_replaced
from dvr_cli.files.vtkxml.compression import Compressor
from dvr_cli.files.xml_places import Element

_TYPES = {
    "Int8": "i1",
    "UInt8": "u1",
    "Int16": "i2",
    "UInt16": "u2",
    "Int32": "i4",
    "UInt32": "u4",
    "Int64": "i8",
    "UInt64": "u8",
    "Float32": "f4",
    "Float64": "f8",
}
_BLOCK = 1 << 15  # bytes VTK compresses in one go
_BLANKS = re.compile(rb"\s*")


@dataclass(frozen=True)
class Coding:
    """The coding of a file's binary arrays: order "<" or ">", the type of headers, and the compression."""

    order: Literal["<", ">"]
    header: np.dtype
    compressor: Compressor | None


@dataclass(frozen=True)
class StoredArray:
    """An array of the file.

    name: of the array, for messages.
    dtype: native type of its values.
    form: "ascii", "base64" or "raw".
    begin: where the array begins: its text, or its header.
    limit: where it ends at the latest.
    """

    name: str
    dtype: np.dtype
    form: str
    begin: int
    limit: int


@dataclass(frozen=True, eq=False)
class Stored:
    """An array as its bytes say.

    values: (count,) in the array's type.
    begin, end: where its bytes are, without blanks around them.
    blocks: the compressed bytes of each block, and block_size: of all but the last before.
    """

    values: np.ndarray
    begin: int
    end: int
    blocks: list[bytes]
    block_size: int


def is_numeric(element: Element) -> bool:
    """True if the values of an array are numbers of a type known here."""
    return element.name == "DataArray" and element.attributes.get("type") in _TYPES


def stored_array(element: Element, appended: tuple[int, int, bool] | None, what: str) -> StoredArray:
    """The array in a DataArray element whose values are numbers.

    appended: where the appended data begin and end, and whether they are base64; None if there are none.
    """
    if not is_numeric(element):
        raise InputError(f"{what} has the type {shown(element.attributes.get('type', ''))}: not supported")
    dtype = np.dtype(_TYPES[element.attributes["type"]])
    form = element.attributes.get("format", "ascii")
    if form == "appended":
        if appended is None:
            raise InputError(f"{what} should be among the AppendedData, but there are none")
        begin, end, base64 = appended
        offset = element.attributes.get("offset", "")
        if not (offset.isascii() and offset.isdigit() and len(offset) < 19) or begin + int(offset) > end:
            raise InputError(f"{what}: its offset {shown(offset)} leads out of the AppendedData")
        return StoredArray(what, dtype, "base64" if base64 else "raw", begin + int(offset), end)
    if form not in ("ascii", "binary"):
        raise InputError(f"{what} has the format {shown(form)}, which is not supported")
    return StoredArray(what, dtype, "ascii" if form == "ascii" else "base64", *element.text)


def decode(data: bytes, array: StoredArray, coding: Coding, count: int | None) -> Stored:
    """The values of an array; count: how many there have to be, None if its header alone says.

    An array as text needs a count. Raises InputError for anything damaged.
    """
    if array.form == "ascii":
        return _decode_text(data, array, count or 0)
    try:
        stream = _Stream(data, array)
        if coding.compressor is None:
            size = _words(stream.read(coding.header.itemsize, 0), coding)[0]
            _check_size(array, size, count)
            # base64 runs through header and data
            payload = stream.read(size, coding.header.itemsize)
            blocks, block_size = [], 0
        else:
            sizes, block_size, last = _block_sizes(stream, coding)
            total = block_size * (len(sizes) - 1) + last if sizes else 0
            _check_size(array, total, count)
            packed = stream.read(sum(sizes), 0)
            ends = np.cumsum([0, *sizes]).tolist()
            blocks = [packed[a:b] for a, b in pairwise(ends)]
            wanted = [block_size] * (len(blocks) - 1) + [last]
            payload = b"".join(map(coding.compressor.decompress, blocks, wanted))
    except ValueError as error:  # binascii.Error among them
        raise InputError(f"truncated or damaged: {array.name} cannot be decoded ({error})") from error
    values = np.frombuffer(payload, array.dtype.newbyteorder(coding.order)).astype(array.dtype)
    return Stored(values, stream.begin, stream.end, blocks, block_size)


def encode(coding: Coding, base64: bool, values: np.ndarray, before: Stored | None = None) -> bytes:
    """The bytes of an array: its header and ``values``, as a file of this coding has them.

    before: what it was; blocks whose values have not changed keep their compressed bytes, all keep their
        size.
    """
    payload = values.astype(values.dtype.newbyteorder(coding.order)).tobytes()
    header = coding.header.newbyteorder(coding.order)
    if coding.compressor is None:
        whole = np.array([len(payload)], header).tobytes() + payload
        return binascii.b2a_base64(whole, newline=False) if base64 else whole
    if before is None or not before.block_size or before.values.dtype != values.dtype:
        size, old, blocks = _BLOCK, b"", []
    else:
        size, blocks = before.block_size, before.blocks
        old = before.values.astype(values.dtype.newbyteorder(coding.order)).tobytes()
    parts = []
    for i, begin in enumerate(range(0, len(payload), size)):
        part = payload[begin : begin + size]
        same = i < len(blocks) and part == old[begin : begin + size]
        parts.append(blocks[i] if same else coding.compressor.compress(part))
    words = [len(parts), size, len(payload) % size, *map(len, parts)]
    head, body = np.array(words, header).tobytes(), b"".join(parts)
    if not base64:
        return head + body
    return binascii.b2a_base64(head, newline=False) + binascii.b2a_base64(body, newline=False)


def text_with(data: bytes, array: StoredArray, changed: np.ndarray, values: np.ndarray) -> bytes:
    """The text of an "ascii" array with the numbers marked in ``changed`` ((count,) bool) replaced."""
    text = data[array.begin : array.limit]
    starts, ends = token_spans(np.frombuffer(text, np.uint8))
    file = BytesIO()
    write_replaced(file, text, starts[changed], ends[changed], values[changed])
    return file.getvalue()


class _Stream:
    """The bytes of a binary array, one part after the other, base64 or raw.

    begin: where its bytes begin, blanks passed over; end: behind what has been read.
    """

    def __init__(self, data: bytes, array: StoredArray) -> None:
        self._base64 = array.form == "base64"
        self._text = memoryview(data)[: array.limit]
        blank = _BLANKS.match(data, array.begin, array.limit) if self._base64 else None
        self.begin = self.end = blank.end() if blank else array.begin

    def read(self, size: int, after: int) -> bytes:
        """The next ``size`` bytes; after: how many were read already of the same run of base64."""
        if not self._base64:
            begin, end = self.end, self.end + size
        else:
            begin = self.begin if after else self.end
            end = begin + -(-(size + after) // 3) * 4
        if end > len(self._text):
            raise ValueError("it is too short")
        self.end = end
        if not self._base64:
            return bytes(self._text[begin:end])
        decoded = binascii.a2b_base64(self._text[begin:end], strict_mode=True)
        if len(decoded) < size + after:
            raise ValueError("it is too short")
        return decoded[after : after + size]


def _decode_text(data: bytes, array: StoredArray, count: int) -> Stored:
    wide = np.dtype(f"{array.dtype.kind}8")
    try:
        values = parse_numbers(data[array.begin : array.limit], count, wide)
    except ValueError:
        raise InputError(
            f"{array.name} should be {count} numbers, but has more, fewer or something else among them"
        ) from None
    with np.errstate(over="ignore"):
        narrow = values.astype(array.dtype)
    if array.dtype.kind != "f" and (narrow != values).any():
        raise InputError(f"{array.name} has numbers that its type cannot hold")
    return Stored(narrow, array.begin, array.limit, [], 0)


def _words(head: bytes, coding: Coding) -> list[int]:
    return np.frombuffer(head, coding.header.newbyteorder(coding.order)).tolist()


def _block_sizes(stream: _Stream, coding: Coding) -> tuple[list[int], int, int]:
    """The compressed size of each block, and the sizes before of all but the last, and of that."""
    width = coding.header.itemsize
    head = stream.read(3 * width, 0)
    count, size, last = _words(head, coding)
    if count == 0:
        return [], size, 0
    if count > 1 << 40 or size > 1 << 62:
        raise ValueError("its header cannot be right")
    sizes = _words(stream.read(count * width, 3 * width), coding)
    if not size or last > size:
        raise ValueError("its header cannot be right")
    return sizes, size, last or size


def _check_size(array: StoredArray, size: int, count: int | None) -> None:
    if size % array.dtype.itemsize or (count is not None and size != count * array.dtype.itemsize):
        wanted = "" if count is None else f", not the {count * array.dtype.itemsize} of {count} numbers"
        raise ValueError(f"it has {size} bytes{wanted}")
