"""The reading position in a legacy VTK file: its words, counts and arrays, ASCII or binary.

No array is allocated, and no number parsed, before the declared count has been compared with the bytes
that are there.
"""

from __future__ import annotations

import re

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import end_of_tokens, parse_numbers, shown

# How VTK writes each type in binary files, byte order (big-endian) aside. "bit" packs 8 values in a byte.
_TYPES = {
    "char": "i1",
    "signed_char": "i1",
    "unsigned_char": "u1",
    "short": "i2",
    "unsigned_short": "u2",
    "int": "i4",
    "unsigned_int": "u4",
    "long": "i8",
    "unsigned_long": "u8",
    "float": "f4",
    "double": "f8",
    "vtkidtype": "i4",
    "vtktypeint8": "i1",
    "vtktypeuint8": "u1",
    "vtktypeint16": "i2",
    "vtktypeuint16": "u2",
    "vtktypeint32": "i4",
    "vtktypeuint32": "u4",
    "vtktypeint64": "i8",
    "vtktypeuint64": "u8",
    "bit": "u1",
}
_WORD = re.compile(rb"\S+")
_INTEGER = re.compile(rb"[+-]?[0-9]{1,18}")
_LINE = re.compile(rb"[^\n]*\n?")


class Scanner:
    """A position in a VTK file.

    data: the whole file.
    position: offset of the next byte to read.
    binary: whether arrays are binary.
    passed: kind and name of each array that was passed over, as it holds no numbers on points or cells.
    """

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.position = 0
        self.binary = False
        self.passed: list[tuple[str, str]] = []

    def peek(self) -> str:
        """The next word in lower case, "" at the end of the file."""
        match = _WORD.search(self.data, self.position)
        return match.group()[:64].decode("latin-1").lower() if match else ""

    def word(self, what: str) -> bytes:
        """The next word; InputError, which names ``what`` it should be, at the end of the file."""
        match = _WORD.search(self.data, self.position)
        if match is None:
            raise InputError(f"the file ends where {what} should follow")
        self.position = match.end()
        return match.group()

    def integer(self, what: str) -> int:
        """The next word, which has to be a whole number."""
        word = self.word(what)
        if not _INTEGER.fullmatch(word):
            raise InputError(f"{what} should be a whole number, not {shown(word)}")
        return int(word)

    def count(self, what: str) -> int:
        """The next word, which has to be a whole number that is not negative."""
        number = self.integer(what)
        if number < 0:
            raise InputError(f"{what} is negative: {number}")
        return number

    def type_name(self, what: str) -> str:
        """The next word, the type of an array, in lower case."""
        return self.word(f"the type of {what}")[:64].decode("latin-1").lower()

    def line(self) -> bytes:
        """The rest of the current line, without its end and blanks around it."""
        match = _LINE.match(self.data, self.position)
        assert match is not None  # the pattern matches the empty string
        self.position = match.end()
        return match.group().strip()

    def extent(self, type_name: str, count: int, what: str) -> tuple[int, int]:
        """Pass over ``count`` values of the given type; where their bytes begin and end.

        Raises InputError if the file ends before, or the type is unknown or has no fixed form (strings).
        """
        if type_name not in _TYPES:
            raise InputError(f"{what}: type {shown(type_name)} is not supported")
        if count == 0:  # nothing is written then, not even the end of the line
            return self.position, self.position
        if self.binary:
            self.end_line(what)
            begin = self.position
            end = begin + (
                (count + 7) // 8 if type_name == "bit" else count * np.dtype(_TYPES[type_name]).itemsize
            )
            if end > len(self.data):
                raise self._truncated(what, f"{end - begin} bytes of data, {len(self.data) - begin} are left")
        else:
            begin = self.position
            found = (
                end_of_tokens(self.data, begin, count) if 2 * count <= len(self.data) - begin + 1 else None
            )
            if found is None:
                raise self._truncated(what, f"{count} numbers, fewer are left")
            end = found
        self.position = end
        return begin, end

    def values(self, type_name: str, count: int, what: str) -> np.ndarray:
        """The next ``count`` values of a type that ``extent`` knows, in native byte order ((count,))."""
        return self.parse(type_name, count, what, self.extent(type_name, count, what))

    def parse(self, type_name: str, count: int, what: str, extent: tuple[int, int]) -> np.ndarray:
        """The values whose bytes ``extent`` has found."""
        dtype = np.dtype(_TYPES[type_name])
        begin, end = extent
        if self.binary:
            if type_name == "bit":
                return np.unpackbits(np.frombuffer(self.data, np.uint8, end - begin, begin), count=count)
            return np.frombuffer(self.data, dtype_of(type_name), count, begin).astype(dtype)
        wide = {"i": np.dtype("i8"), "u": np.dtype("u8"), "f": np.dtype("f8")}[dtype.kind]
        try:
            values = parse_numbers(self.data[begin:end], count, wide)
        except ValueError:
            raise InputError(f"{what} should be {count} numbers, but something else is among them") from None
        with np.errstate(over="ignore"):
            return values.astype(dtype, copy=False)

    def end_line(self, what: str) -> None:
        """Pass over the end of a line, behind which binary data begin."""
        rest = self.line()
        if rest:
            raise InputError(f"{shown(rest)} follows the header of {what}, where its line should end")

    def skip_strings(self, count: int, what: str, in_lines: bool) -> None:
        """Pass over ``count`` strings, each a line or (``in_lines`` False) behind its length."""
        if count > len(self.data) - self.position:
            raise self._truncated(what, f"{count} strings, fewer are left")
        if count:
            self.end_line(what)
        for _ in range(count):
            if in_lines:
                self.line()
                continue
            head = self.data[self.position : self.position + 8]
            size = 1 << (3 - (head[0] >> 6)) if head else 1  # two bits tell how many bytes the length has
            length = int.from_bytes(head[:size], "big") & ((1 << (8 * size - 2)) - 1)
            self.position += size + length
            if self.position > len(self.data):
                raise self._truncated(what, f"{count} strings, fewer are left")

    def skip_metadata(self, components: int) -> None:
        """Pass over the names of components and the information that VTK may write behind an array."""
        if self.peek() != "metadata":
            return
        self.word("METADATA")
        self.line()
        while line := self.line():  # ends with an empty line
            if line.lower().startswith(b"component_names"):
                for _ in range(components):  # which may be empty
                    if self.position == len(self.data):
                        return
                    self.line()

    def _truncated(self, what: str, expected: str) -> InputError:
        return InputError(f"truncated or damaged: {what} should have {expected}")


def dtype_of(type_name: str) -> np.dtype:
    """The numbers of a binary array of this type, as they are in the file."""
    return np.dtype(_TYPES[type_name]).newbyteorder(">")


def is_integer(type_name: str) -> bool:
    """True if values of the type are whole numbers."""
    return _TYPES.get(type_name, "f")[0] in "iu"
