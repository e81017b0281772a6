"""The numbers in a section of a Gmsh MSH file, read alike from ASCII and from binary.

The kinds of number are named as in ``struct``: "i" an int of 4 bytes, "q" a size of 8, "d" a double. In
ASCII every number is one token, so positions count tokens; in binary they count bytes. Nothing is
allocated from a declared count before the count has been compared with what is there.
"""

from __future__ import annotations

import re
import struct
import warnings
from abc import ABC, abstractmethod
from functools import cache
from typing import ClassVar

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.gmsh.sections import Header, Section

_FORTRAN = re.compile(rb"([0-9.])[dD]([+-]?[0-9])")  # an exponent of double precision


class Numbers(ABC):
    """A reading position in the numbers of a section.

    position: tokens read so far (ASCII), or bytes passed since the beginning of its body (binary).
    length: how far a number of each kind advances the position.
    name: the section's.
    """

    position: int
    length: ClassVar[dict[str, int]]
    name: str

    @abstractmethod
    def record(self, kinds: str) -> list:
        """A few numbers of the kinds given ("3iq": three ints and a size), as Python numbers."""

    @abstractmethod
    def integers(self, kind: str, count: int) -> np.ndarray:
        """``count`` integers."""

    @abstractmethod
    def doubles(self, count: int) -> np.ndarray:
        """``count`` doubles."""

    @abstractmethod
    def tagged(self, count: int, width: int) -> tuple[np.ndarray, np.ndarray]:
        """(count,) ints and (count, width) doubles, an int in front of each row of doubles."""

    @abstractmethod
    def skip(self, kind: str, count: int) -> None:
        """Pass over ``count`` numbers."""

    @abstractmethod
    def finish(self) -> None:
        """Raise InputError unless the section has been read to its end."""

    def ends_early(self) -> InputError:
        return InputError(f"section ${self.name} ends early or declares too much: truncated or damaged")

    def goes_on(self) -> InputError:
        return InputError(f"section ${self.name} holds more than it declares: it is damaged")


class TextNumbers(Numbers):
    """The numbers of an ASCII section, all parsed at once into an array of ``dtype``."""

    length: ClassVar[dict[str, int]] = {"i": 1, "q": 1, "d": 1}

    def __init__(self, data: bytes, section: Section, dtype: type) -> None:
        self.values = parse(data[section.start : section.stop], dtype, section.name)
        self.position = 0
        self.name = section.name

    def _advance(self, count: int) -> np.ndarray:
        if not 0 <= count <= len(self.values) - self.position:
            raise self.ends_early()
        self.position += count
        return self.values[self.position - count : self.position]

    def record(self, kinds: str) -> list:
        kinds = _spelled_out(kinds)
        values = self._advance(len(kinds)).tolist()
        for i, kind in enumerate(kinds):
            if kind != "d":
                if values[i] % 1:  # true for a NaN, too
                    raise self.not_whole()
                values[i] = int(values[i])
        return values

    def integers(self, kind: str, count: int) -> np.ndarray:
        return self.whole(self._advance(count))

    def whole(self, values: np.ndarray) -> np.ndarray:
        """``values`` as int64; InputError if one has a fraction."""
        whole = values.astype(np.int64, copy=False)
        if whole is not values and not np.array_equal(whole, values):
            raise self.not_whole()
        return whole

    def not_whole(self) -> InputError:
        return InputError(f"section ${self.name} has a number with a fraction where a tag or count is due")

    def doubles(self, count: int) -> np.ndarray:
        return self._advance(count)

    def tagged(self, count: int, width: int) -> tuple[np.ndarray, np.ndarray]:
        table = self._advance(count * (1 + width)).reshape(count, 1 + width)
        return self.whole(table[:, 0]), table[:, 1:]

    def skip(self, kind: str, count: int) -> None:
        self._advance(count)

    def finish(self) -> None:
        if self.position != len(self.values):
            raise self.goes_on()


class BinaryNumbers(Numbers):
    """The numbers of a binary section: views of the file's bytes."""

    length: ClassVar[dict[str, int]] = {"i": 4, "q": 8, "d": 8}

    def __init__(self, data: bytes, section: Section, byte_order: str) -> None:
        self._body = memoryview(data)[section.start : section.stop]
        self._byte_order = byte_order
        self.position = 0
        self.name = section.name

    def _advance(self, size: int) -> int:
        if not 0 <= size <= len(self._body) - self.position:
            raise self.ends_early()
        self.position += size
        return self.position - size

    def record(self, kinds: str) -> list:
        packed = _packed(self._byte_order + kinds)
        return list(packed.unpack_from(self._body, self._advance(packed.size)))

    def _array(self, kind: str, count: int) -> np.ndarray:
        at = self._advance(count * self.length[kind])
        return np.frombuffer(self._body, self._byte_order + kind, count, at)

    def integers(self, kind: str, count: int) -> np.ndarray:
        return self._array(kind, count)

    def doubles(self, count: int) -> np.ndarray:
        return self._array("d", count)

    def tagged(self, count: int, width: int) -> tuple[np.ndarray, np.ndarray]:
        row = np.dtype([("tag", self._byte_order + "i4"), ("values", self._byte_order + "f8", (width,))])
        table = np.frombuffer(self._body, row, count, self._advance(count * row.itemsize))
        return table["tag"], table["values"]

    def skip(self, kind: str, count: int) -> None:
        self._advance(count * self.length[kind])

    def finish(self) -> None:
        rest = bytes(self._body[self.position :])
        if rest and not rest.isspace():
            raise self.goes_on()


def read_numbers(data: bytes, section: Section, header: Header, dtype: type = np.float64) -> Numbers:
    """The numbers of a section; ``dtype`` (int64 or float64) is what ASCII tokens are parsed as."""
    if header.byte_order:
        return BinaryNumbers(data, section, header.byte_order)
    return TextNumbers(data, section, dtype)


def parse(text: bytes, dtype: type, name: str) -> np.ndarray:
    """The numbers in ``text``, separated by white space; InputError if there is anything else in it.

    The exponents of Fortran, as in 1.5D-3, are numbers, too.
    """
    if not text or text.isspace():  # NumPy reads a number out of blanks
        return np.empty(0, dtype)
    for spelled in (text, _FORTRAN.sub(rb"\1e\2", text)):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", DeprecationWarning)  # how older NumPy reports stray text
                return np.fromstring(spelled, dtype, sep=" ")
        except (ValueError, DeprecationWarning):
            continue
    raise InputError(f"section ${name} is damaged: it holds something that is not a number")


def is_blank(data: bytes, start: int, stop: int) -> bool:
    """True if nothing but white space lies between two offsets."""
    return stop == start or data[start:stop].isspace()


@cache
def _spelled_out(kinds: str) -> str:
    return "".join(kind * int(times or 1) for times, kind in re.findall(r"(\d*)([iqd])", kinds))


@cache
def _packed(kinds: str) -> struct.Struct:
    return struct.Struct(kinds)
