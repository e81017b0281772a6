"""HDF5 and netCDF files compared object by object, by the libraries that define these formats."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from needs import require


def hdf5_objects(data: bytes) -> dict[str, Any]:
    """Everything in an HDF5 file: by path its kind, type, shape, storage, values and attributes."""
    h5py = require("h5py")
    found: dict[str, Any] = {}

    def note(path: str, item: Any) -> None:
        for name, value in item.attrs.items():
            kind = item.attrs.get_id(name)
            found[f"{path}@{name}"] = (str(kind.dtype), kind.shape, np.asarray(value).tolist())
        if isinstance(item, h5py.Dataset):
            storage = (str(item.dtype), item.shape, item.maxshape, item.chunks, item.compression)
            found[path] = (*storage, item.fletcher32, item.shuffle, np.asarray(item[()]).tobytes())
        else:
            found[path] = ("group", *item)

    with h5py.File(io.BytesIO(data), "r") as file:
        note("/", file)
        file.visititems_links(
            lambda path, link: found.update({f"{path}>": (type(link).__name__, _link_target(link))})
        )
        file.visititems(lambda path, item: note(f"/{path}", item))
    return found


def _link_target(link: Any) -> Any:
    return getattr(link, "filename", None), getattr(link, "path", None)


def netcdf_objects(data: bytes) -> dict[str, Any]:
    """Everything in a netCDF file: its variant, dimensions, attributes, and variables with their values."""
    with require("netCDF4").Dataset("mesh", memory=data) as file:
        file.set_auto_maskandscale(False)
        found: dict[str, Any] = {"": file.data_model}
        for name, dimension in file.dimensions.items():
            found[f"#{name}"] = (len(dimension), dimension.isunlimited())
        for owner in (file, *file.variables.values()):
            where = getattr(owner, "name", "") if owner is not file else ""
            for name in owner.ncattrs():
                value = np.asarray(owner.getncattr(name))
                found[f"{where}@{name}"] = (value.dtype.str, value.tolist())
        for name, variable in file.variables.items():
            values = np.asarray(variable[:])
            found[name] = (str(variable.dtype), variable.dimensions, variable.endian(), values.tobytes())
    return found


def differences(before: dict[str, Any], after: dict[str, Any]) -> set[str]:
    """The objects that are not the same, or only there in one of two."""
    return {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
