"""netCDF files of all variants: dimensions, variables, and other values in some of them.

The classic variants (CDF-1, CDF-2 with 64-bit offsets, CDF-5) are read here, byte by byte; netCDF-4 files are
HDF5 files.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files import hdf5

if TYPE_CHECKING:
    import h5py

_TYPES = {1: "i1", 2: "S1", 3: ">i2", 4: ">i4", 5: ">f4", 6: ">f8"}
_TYPES_5 = {7: "u1", 8: ">u2", 9: ">u4", 10: ">i8", 11: ">u8"}  # of CDF-5 alone
_DIMENSION, _VARIABLE, _ATTRIBUTE = 10, 11, 12
_LONGEST_NAME = 1024


class NetCDF(ABC):
    """An open netCDF file.

    dimensions: the length of each; that of the unlimited one is how many records there are.
    """

    dimensions: dict[str, int]

    @property
    @abstractmethod
    def names(self) -> Collection[str]:
        """The names of all variables."""

    @abstractmethod
    def array(self, name: str) -> np.ndarray:
        """The values of a variable, of the type the file stores; raises InputError if they are not there."""

    @abstractmethod
    def text_attribute(self, variable: str, name: str) -> str:
        """An attribute of a variable, "" if it has none of this name."""

    def __contains__(self, name: str) -> bool:
        """True if there is a variable of this name."""
        return name in self.names

    def length(self, dimension: str) -> int:
        """The length of a dimension, 0 for one that the file does not have."""
        return self.dimensions.get(dimension, 0)

    def strings(self, name: str) -> list[str]:
        """The rows of a variable of characters, [] if the file does not have it."""
        if name not in self:
            return []
        rows = self.array(name)
        if rows.dtype != np.dtype("S1") or rows.ndim != 2:
            return []
        return [hdf5.text(row.tobytes()) for row in rows]

    def integers(self, name: str) -> np.ndarray:
        """The values of a variable of whole numbers as int64, none if the file does not have it."""
        if name not in self:
            return np.empty(0, dtype=np.int64)
        array = self.array(name)
        if array.dtype.kind not in "iu":
            raise InputError(f"the variable {name} should hold whole numbers")
        return array.astype(np.int64)


@contextmanager
def open_netcdf(data: bytes) -> Iterator[NetCDF]:
    """Open a netCDF file; raises InputError for what is damaged."""
    if data.startswith(hdf5.SIGNATURE):
        with hdf5.opened(data) as file:
            yield _Hdf5(file)
    else:
        yield _Classic(data)


def with_values(data: bytes, replaced: Mapping[str, np.ndarray]) -> bytes:
    """A netCDF file with other values in some of its variables, which keep their shapes and types."""
    if data.startswith(hdf5.SIGNATURE):
        return hdf5.with_values(data, replaced)
    buffer = bytearray(data)
    variables = _Header(data).variables
    for name, array in replaced.items():
        variables[name].view(buffer)[...] = array
    return bytes(buffer)


@dataclass(frozen=True)
class _Variable:
    """shape, dtype: as stored; begin: where in the file; stride: from record to record, 0 for no records."""

    shape: tuple[int, ...]
    dtype: np.dtype
    attributes: dict[str, str]
    begin: int
    stride: int

    @property
    def size(self) -> int:
        """Bytes of the variable, or of one record of it."""
        return math.prod(self.shape[1:] if self.stride else self.shape) * self.dtype.itemsize

    def view(self, buffer: bytes | bytearray) -> np.ndarray:
        """The values where they stand in the file."""
        if 0 in self.shape:
            return np.empty((0,) * len(self.shape), dtype=self.dtype)
        if not self.stride:
            return np.ndarray(self.shape, self.dtype, buffer, self.begin)
        inner = [self.dtype.itemsize * math.prod(self.shape[k + 1 :]) for k in range(1, len(self.shape))]
        return np.ndarray(self.shape, self.dtype, buffer, self.begin, (self.stride, *inner))


class _Classic(NetCDF):
    """A file of a classic variant."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        header = _Header(data)
        self.dimensions = header.dimensions
        self._variables = header.variables
        _check_places(data, header)

    @property
    def names(self) -> Collection[str]:
        return self._variables.keys()

    def array(self, name: str) -> np.ndarray:
        return self._variables[name].view(self._data)

    def text_attribute(self, variable: str, name: str) -> str:
        return self._variables[variable].attributes.get(name, "")


class _Header:
    """The header of a classic file: its dimensions and variables; end: where it ends."""

    def __init__(self, data: bytes) -> None:
        if data[:3] != b"CDF" or data[3:4] not in (b"\x01", b"\x02", b"\x05"):
            raise InputError("it is no netCDF file")
        self._data = data
        self._version = data[3]
        self._wide = 8 if self._version == 5 else 4  # bytes of a count
        self._types = {**_TYPES, **_TYPES_5} if self._version == 5 else _TYPES
        self.end = 4
        records = self._integer(self._wide)
        names, lengths = [], []
        for _ in range(self._list(_DIMENSION)):
            names.append(self._name())
            lengths.append(self._integer(self._wide))
        self._attributes()
        found: dict[str, tuple[list[int], np.dtype, dict[str, str], int]] = {}
        for _ in range(self._list(_VARIABLE)):
            name = self._name()
            dimensions = [self._integer(self._wide) for _ in range(self._count(self._wide))]
            if any(d >= len(lengths) for d in dimensions):
                raise InputError(f"the variable {name} has a dimension that does not exist")
            attributes = self._attributes()
            dtype = self._type()
            self._integer(self._wide)  # the size, which follows from shape and type
            begin = self._integer(4 if self._version == 1 else 8)
            if name in found:
                raise InputError(f"two variables are called {name}")
            found[name] = dimensions, dtype, attributes, begin
        self._place(found, lengths, records)
        self.dimensions = {name: length or self.records for name, length in zip(names, lengths, strict=True)}

    def _place(
        self,
        found: dict[str, tuple[list[int], np.dtype, dict[str, str], int]],
        lengths: list[int],
        records: int,
    ) -> None:
        """Make the variables; those over the dimension of length 0 come record by record."""
        recorded = {name for name, (dims, *_) in found.items() if dims and lengths[dims[0]] == 0}
        sizes = {
            name: math.prod(lengths[d] for d in found[name][0][1:]) * found[name][1].itemsize
            for name in recorded
        }
        # a lone record variable is not padded to 4 bytes
        stride = sum(-(-size // 4) * 4 if len(sizes) > 1 else size for size in sizes.values())
        if records == 256**self._wide - 1:  # still being written: as many as there are
            first = min((found[name][3] for name in recorded), default=0)
            records = (len(self._data) - first) // stride if stride else 0
        self.records = max(records, 0)
        self.variables = {
            name: _Variable(
                tuple((lengths[d] or self.records) for d in dims),
                dtype,
                attributes,
                begin,
                stride if name in recorded else 0,
            )
            for name, (dims, dtype, attributes, begin) in found.items()
        }

    def _take(self, n: int) -> bytes:
        piece = self._data[self.end : self.end + n]
        if len(piece) < n:
            raise InputError("the file ends within its header")
        self.end += -(-n // 4) * 4
        return piece

    def _integer(self, width: int) -> int:
        return int.from_bytes(self._take(width), "big")

    def _count(self, width: int) -> int:
        """A number of things that follow, each of at least 4 bytes."""
        count = self._integer(width)
        if count > (len(self._data) - self.end) // 4:
            raise InputError("the file ends within its header")
        return count

    def _list(self, tag: int) -> int:
        """The number of entries of a list that begins here."""
        found, count = self._integer(4), self._count(self._wide)
        if found != tag and (found or count):
            raise InputError("its header is damaged")
        return count

    def _name(self) -> str:
        length = self._integer(self._wide)
        if length > _LONGEST_NAME:
            raise InputError(f"its header is damaged: a name has {length} letters")
        return hdf5.text(self._take(length))

    def _type(self) -> np.dtype:
        code = self._integer(4)
        if code not in self._types:
            raise InputError(f"its header is damaged: there is no type of values with the number {code}")
        return np.dtype(self._types[code])

    def _attributes(self) -> dict[str, str]:
        """The attributes listed here that are text."""
        result = {}
        for _ in range(self._list(_ATTRIBUTE)):
            name = self._name()
            dtype = self._type()
            content = self._take(self._integer(self._wide) * dtype.itemsize)
            if dtype.kind == "S":
                result[name] = hdf5.text(content)
        return result


def _check_places(data: bytes, header: _Header) -> None:
    """Raise InputError where variables do not lie in the file, or on top of others."""
    places = []
    for name, variable in header.variables.items():
        if variable.size == 0 or 0 in variable.shape:
            continue
        steps = (variable.shape[0] - 1) * variable.stride if variable.stride else 0
        if variable.begin + steps + variable.size > len(data):
            raise InputError(f"the file ends before the variable {name} does")
        places.append((variable.begin, variable.begin + variable.size, variable.stride > 0, name))
    places.sort()
    first_record = min((place[0] for place in places if place[2]), default=len(data))
    end, last = header.end, "the header"
    for begin, own_end, in_records, name in places:
        if begin < end or (begin > first_record and not in_records):
            raise InputError(f"its header is damaged: the variable {name} lies on top of {last}")
        end, last = own_end, name
    strides = [v.stride for v in header.variables.values() if v.stride]
    if strides and first_record < len(data) and end > first_record + strides[0]:
        raise InputError("its header is damaged: records lie on top of each other")


class _Hdf5(NetCDF):
    """A netCDF-4 file."""

    def __init__(self, file: h5py.File) -> None:
        members = {name: file[name] for name in file}
        self._sets = {name: item for name, item in members.items() if hasattr(item, "dtype")}
        self.dimensions = {
            name: dataset.shape[0]
            for name, dataset in self._sets.items()
            if dataset.shape and hdf5.text(hdf5.attribute(dataset, "CLASS")) == "DIMENSION_SCALE"
        }

    @property
    def names(self) -> Collection[str]:
        return self._sets.keys()

    def array(self, name: str) -> np.ndarray:
        return hdf5.values(self._sets[name])

    def text_attribute(self, variable: str, name: str) -> str:
        return hdf5.text(hdf5.attribute(self._sets[variable], name))
