"""Records of numbers and lists of numbers, one after the other: as text, or in binary of either byte order.

    property float x            1.5 2
    property list uchar int v   3 0 1 2

A position is counted in numbers in text, and in bytes in a binary file.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import end_of_tokens, parse_numbers, token_spans

_ORDINARY = 1 << 53  # whole numbers below are exact as float64


@dataclass(frozen=True)
class Property:
    """A number, or a list of numbers, that every record of a kind has.

    type: NumPy's name of its type without byte order ("f4"). count: that of the number of items in front
    of a list, "" for a single number. word: where in the file the type is named.
    """

    name: str
    type: str
    count: str = ""
    word: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class Kind:
    """So many records with these properties."""

    name: str
    count: int
    properties: tuple[Property, ...]

    def find(self, *names: str) -> int | None:
        """The index of the first property that goes by one of the names."""
        return next((i for i, p in enumerate(self.properties) if p.name in names), None)


@dataclass(frozen=True, eq=False)
class Places:
    """The places of the records of a kind.

    where: for each property the (n,) positions of its number, or of the first item of its list.
    sizes: for each property the (n,) numbers of items, 1 if it is no list.
    end: the position behind the last record.
    """

    where: list[np.ndarray]
    sizes: list[np.ndarray]
    end: int


class Records:
    """The numbers of a file from ``begin`` on.

    order: "<" or ">" if they are binary, "" if they are text.
    """

    def __init__(self, data: bytes, begin: int, order: str) -> None:
        """Raises InputError for text that holds anything but numbers."""
        self.order = order
        self._bytes = np.frombuffer(data, dtype=np.uint8)
        if order:
            self.begin, self.length = begin, len(data)
            return
        starts, ends = token_spans(self._bytes[begin:])
        self.spans = starts + begin, ends + begin
        self.begin, self.length = 0, len(starts)
        try:
            self._numbers = parse_numbers(data[begin:], len(starts), np.float64)
        except ValueError as error:
            line = data.count(b"\n", 0, _first_wrong(data, begin, len(starts))) + 1
            raise InputError(f"line {line}: not a number where numbers are expected: {error}") from None

    def size(self, type_name: str) -> int:
        """The step in positions from a number of a type to the next one."""
        return np.dtype(type_name).itemsize if self.order else 1

    def values(self, positions: np.ndarray, type_name: str) -> np.ndarray:
        """The numbers at (n,) positions; float64 in text, of their type in a binary file."""
        if not self.order:
            return self._numbers[positions]
        dtype = np.dtype(self.order + type_name)
        return self._bytes[positions[:, None] + np.arange(dtype.itemsize)].view(dtype)[:, 0]

    def whole(self, positions: np.ndarray, type_name: str) -> np.ndarray:
        """The whole numbers at (n,) positions, int64; InputError if one has a fraction."""
        values = self.values(positions, type_name)
        if values.dtype.kind != "f":
            return values.astype(np.int64)
        if not (np.abs(values) < _ORDINARY).all() or (values != np.rint(values)).any():
            raise InputError("there are fractions where whole numbers are expected")
        return values.astype(np.int64)

    def places(self, kind: Kind, begin: int) -> Places:
        """The places of the records of a kind from a position on; InputError if the file ends before."""
        if not kind.properties and kind.count:
            raise InputError(f"element {kind.name} has no properties")
        least = sum(self.size(p.count or p.type) for p in kind.properties)
        if kind.count * least > self.length - begin:
            raise _ends_early(kind)
        if not kind.count:
            none = np.empty(0, dtype=np.int64)
            return Places([none] * len(kind.properties), [none] * len(kind.properties), begin)
        alike = self._alike(kind, begin)
        return self._one_by_one(kind, begin) if alike is None else alike

    def _alike(self, kind: Kind, begin: int) -> Places | None:
        """The records if all lists are as long as those of the first one, else None."""
        first = self._one_by_one(Kind(kind.name, 1, kind.properties), begin)
        width = first.end - begin
        if begin + kind.count * width > self.length:
            return None
        steps = np.arange(kind.count) * width
        where = [place + steps for place in first.where]
        sizes = [np.broadcast_to(size, kind.count) for size in first.sizes]
        for p, place, size in zip(kind.properties, where, sizes, strict=True):
            if p.count and (self.values(place - self.size(p.count), p.count) != size).any():
                return None
        return Places(where, sizes, begin + kind.count * width)

    def _one_by_one(self, kind: Kind, begin: int) -> Places:
        where: list[list[int]] = [[] for _ in kind.properties]
        sizes: list[list[int]] = [[] for _ in kind.properties]
        steps = [
            (self.size(p.type), p.count, self.size(p.count) if p.count else 0, np.dtype(p.count or "u1"))
            for p in kind.properties
        ]
        buffer = self._bytes.tobytes() if self.order else b""
        order = "little" if self.order == "<" else "big"
        at = begin
        for _ in range(kind.count):
            for (size, count, head, dtype), places, lengths in zip(steps, where, sizes, strict=True):
                items = 1
                if count:
                    if at + head > self.length:
                        raise _ends_early(kind)
                    if self.order:
                        items = int.from_bytes(buffer[at : at + head], order, signed=dtype.kind == "i")  # type: ignore[arg-type]
                    else:
                        number = self._numbers[at]
                        items = int(number) if float(number).is_integer() else -1
                    at += head
                if items < 0 or at + items * size > self.length:
                    raise _ends_early(kind)
                places.append(at)
                lengths.append(items)
                at += items * size
        return Places([np.array(w) for w in where], [np.array(s) for s in sizes], at)


def items_of(where: np.ndarray, sizes: np.ndarray, step: int) -> tuple[np.ndarray, np.ndarray]:
    """The positions of the items of all lists, and where each list begins among them.

    where, sizes: (n,) as in Places. step: how far an item advances the position.
    """
    starts = np.cumsum(sizes) - sizes
    nth = np.arange(int(sizes.sum())) - np.repeat(starts, sizes)
    return np.repeat(where, sizes) + nth * step, starts


def _ends_early(kind: Kind) -> InputError:
    return InputError(f"it should have {kind.count} records {kind.name}, but ends early or is damaged")


def _first_wrong(data: bytes, begin: int, count: int) -> int:
    """The rough place of the first word that is no number, of so many words from ``begin`` on."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        end = end_of_tokens(data, begin, middle + 1)
        try:
            parse_numbers(data[begin:end], middle + 1, np.float64)
            low = middle + 1
        except ValueError:
            high = middle
    return end_of_tokens(data, begin, low) or begin
