"""Datasets of HDF5 files held as bytes: read, and replaced with everything else left as it is."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import shown

if TYPE_CHECKING:
    import h5py

_MOST_COMPRESSED = 2000  # times that a dataset may be larger than its bytes in the file


def read_dataset(data: bytes, name: str, count: int) -> np.ndarray:
    """The ``count`` numbers of a dataset, (count,); raises InputError."""
    with _reported(name), _h5py().File(BytesIO(data), "r") as file:
        dataset = _dataset(file, name)
        size = dataset.size * dataset.dtype.itemsize
        if dataset.size != count:
            raise InputError(f"dataset {shown(name)} has {dataset.size} numbers instead of {count}")
        if size > _MOST_COMPRESSED * dataset.id.get_storage_size():
            raise InputError(f"dataset {shown(name)} was declared, but not written")
        values = np.asarray(dataset[()]).ravel()
        return values.astype(values.dtype.newbyteorder("="), copy=False)


def with_dataset(data: bytes, name: str, values: np.ndarray) -> bytes:
    """The file with other numbers in a dataset; one of another type takes its place if they are of one."""
    with _reported(name), _h5py().File(BytesIO(data), "r") as file:
        dataset = _dataset(file, name)
        dtype, place = dataset.dtype, dataset.id.get_offset()  # None where it is in chunks
        size = dataset.size * dtype.itemsize
    if dtype.newbyteorder("=") == values.dtype and place is not None:
        new = values.astype(dtype).tobytes()
        return b"".join([memoryview(data)[:place], new, memoryview(data)[place + size :]])
    with tempfile.TemporaryDirectory(prefix="dvr-") as folder, _reported(name):
        path = Path(folder) / "mesh.h5"
        path.write_bytes(data)
        with _h5py().File(path, "r+") as file:
            dataset = _dataset(file, name)
            values = values.reshape(dataset.shape)
            if dtype.newbyteorder("=") == values.dtype:
                dataset[...] = values
            else:
                _replace(file, dataset, values)
        return path.read_bytes()


def _replace(file: h5py.File, old: h5py.Dataset, values: np.ndarray) -> None:
    """Put a dataset of another type in the place of one, with its layout and attributes."""
    name, attributes = old.name, dict(old.attrs)
    layout = {"chunks": old.chunks, "maxshape": old.maxshape} if old.chunks else {}
    filters = {"compression": old.compression, "compression_opts": old.compression_opts}
    filters |= {"shuffle": old.shuffle, "fletcher32": old.fletcher32}
    del file[name]
    new = file.create_dataset(name, data=values, **layout, **filters)
    for key, value in attributes.items():
        new.attrs[key] = value


def _dataset(file: h5py.File, name: str) -> h5py.Dataset:
    dataset = file[name]
    if not isinstance(dataset, _h5py().Dataset) or dataset.dtype.kind not in "iuf" or dataset.shape is None:
        raise InputError(f"{shown(name)} is no dataset of numbers")
    return dataset


@contextlib.contextmanager
def _reported(name: str) -> Iterator[None]:
    """Turn what h5py raises on damaged files, and on names that are not there, into InputError."""
    try:
        yield
    except (OSError, KeyError, ValueError, RuntimeError, TypeError, MemoryError) as error:
        cause = " ".join(str(error).split())[:120]
        raise InputError(f"dataset {shown(name)} cannot be read: {cause}") from error


def _h5py() -> ModuleType:
    try:
        import h5py
    except ImportError as error:
        raise InputError("it needs the package h5py (pip install 'dvr-cli[formats]')") from error
    return h5py
