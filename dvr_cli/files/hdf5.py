"""HDF5 files in memory: opened, their datasets read with care, and written in place.

Needs h5py, which the extra ``formats`` installs.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dvr_cli.errors import DvrError, InputError, OutputError

if TYPE_CHECKING:
    import h5py

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_MOST_COMPRESSED = 2000  # values in so many times the bytes they are stored in can only come from damage


def is_there() -> bool:
    """True if h5py is installed."""
    return importlib.util.find_spec("h5py") is not None


@contextlib.contextmanager
def opened(data: bytes) -> Iterator[h5py.File]:
    """An HDF5 file, open for reading; what the library makes of damage becomes an InputError."""
    try:
        import h5py
    except ImportError as error:
        raise InputError(
            f"it needs the package {error.name or 'h5py'} (pip install 'dvr-cli[formats]')"
        ) from error
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            yield file
    except DvrError:
        raise
    except Exception as error:  # h5py raises whatever the C library's trouble looks like to it
        lines = (str(error) or type(error).__name__).splitlines()
        raise InputError(f"damaged, or no HDF5 file: {lines[0]}") from error


def values(dataset: h5py.Dataset) -> np.ndarray:
    """All values of a dataset; raises InputError if it declares more than can be stored in it."""
    stored = dataset.id.get_storage_size()
    if dataset.nbytes > stored * (_MOST_COMPRESSED if dataset.chunks else 1):
        raise InputError(f"{dataset.name} declares {dataset.size} values, but does not hold them")
    return dataset[()]


def text(value: Any) -> str:
    """An attribute, or a dataset of characters, as text up to its end; "" where it is none."""
    if isinstance(value, np.ndarray):
        if (value.dtype.kind in "iu" and value.dtype.itemsize == 1) or value.dtype == np.dtype("S1"):
            value = value.tobytes()
        else:
            value = value.ravel()[0] if value.size == 1 else ""
    if isinstance(value, bytes):
        value = value.split(b"\0")[0].decode("utf-8", "replace")
    if not isinstance(value, str):
        return ""
    return "".join(c if c.isprintable() else "?" for c in value.strip())


def with_values(data: bytes, replaced: Mapping[str, np.ndarray]) -> bytes:
    """The file with other values in some of its datasets; replaced: those by their paths."""
    import h5py

    buffer = io.BytesIO(data)
    try:
        with h5py.File(buffer, "r+") as file:
            for path, array in replaced.items():
                file[path][...] = array
    except Exception as error:
        raise OutputError(f"HDF5 cannot write in place: {(str(error).splitlines() or [''])[0]}") from error
    return buffer.getvalue()


def attribute(item: h5py.HLObject, name: str) -> Any:
    """An attribute of a group or dataset, None if there is none of this name.

    h5py takes what is damaged for what is not there, but for its lists of names.
    """
    return item.attrs[name] if name in list(item.attrs) else None


def members(parent: h5py.Group, path: str = "") -> dict[str, Any]:
    """The members of the group of this path below ``parent``, none if there is no such group."""
    item = _item(parent, path) if path else parent
    return {name: item[name] for name in item} if hasattr(item, "keys") else {}


def dataset_at(parent: h5py.Group, path: str) -> h5py.Dataset | None:
    """The dataset of this path, None if there is none."""
    item = _item(parent, path)
    return item if hasattr(item, "dtype") else None


def _item(parent: h5py.Group, path: str) -> Any:
    """The object at this path, None for nothing; see ``attribute`` for damage."""
    for name in path.split("/"):
        if not hasattr(parent, "keys") or name not in list(parent):
            return None
        parent = parent[name]
    return parent
