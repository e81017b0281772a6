"""Results in an Exodus file: nodal and element variables of the last time step."""

from __future__ import annotations

import numpy as np

from dvr_cli.files.netcdf import NetCDF


def nodal_variables(file: NetCDF, n_points: int, dimension: int) -> dict[str, np.ndarray]:
    """Point data by name; variables NAMEx, NAMEy (and NAMEz) are one vector NAME.

    Those without a value for each point are left out.
    """
    scalars = {}
    for i, name in enumerate(file.strings("name_nod_var")):
        values = _last(file, "vals_nod_var", i, str(i + 1))
        if name and values is not None and values.shape == (n_points,):
            scalars[name] = values
    result = {}
    for name, values in scalars.items():
        parts = [name[:-1] + letter for letter in _components(name)[:dimension]]
        if parts and all(part in scalars for part in parts):
            if name == parts[0]:
                result[name[:-1].rstrip("_") or name] = np.stack([scalars[p] for p in parts], axis=1)
        else:
            result[name] = values
    return result


def element_variables(file: NetCDF, blocks: list[int], sizes: list[int]) -> dict[str, list[np.ndarray]]:
    """Cell data by name, NaN in blocks that have no values; blocks: their numbers, sizes: cells in each."""
    result = {}
    for i, name in enumerate(file.strings("name_elem_var")):
        found = [_last(file, "", 0, f"vals_elem_var{i + 1}eb{block}") for block in blocks]
        arrays = [
            values if values is not None and values.shape == (n,) else np.full(n, np.nan)
            for values, n in zip(found, sizes, strict=True)
        ]
        if name and not all(np.isnan(array).all() for array in arrays):
            result[name] = arrays
    return result


def _components(name: str) -> str:
    """The letters of the components to which a name belongs by its last one, "" for none."""
    return next((letters for letters in ("XYZ", "xyz") if name[-1] in letters and len(name) > 1), "")


def _last(file: NetCDF, joint: str, index: int, own: str) -> np.ndarray | None:
    """The last time step of a variable.

    joint: what the variable is called in which older files keep all; own: the name, or its end, of a variable
        of its own.
    """
    values = None
    if joint + own in file:
        values = file.array(joint + own)
    elif joint in file and file.array(joint).ndim == 3 and index < file.array(joint).shape[1]:
        values = file.array(joint)[:, index]
    if values is None or values.ndim != 2 or len(values) == 0 or values.dtype.kind != "f":
        return None
    return values[-1].astype(np.float64)
