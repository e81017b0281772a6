"""Families and groups of a MED file: each node and cell is in one family, and a family in several groups."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files import hdf5

if TYPE_CHECKING:
    import h5py


def groups_of(file: h5py.File, mesh: str, kind: str) -> dict[str, list[int]]:
    """The families of each group; kind: ELEME for groups of cells, NOEUD for those of nodes."""
    families = hdf5.members(file, f"FAS/{mesh}/{kind}")
    result: dict[str, list[int]] = {}
    for family in families.values():
        listed = hdf5.dataset_at(family, "GRO/NOM")
        if listed is None:
            continue
        rows = hdf5.values(listed)
        number = hdf5.attribute(family, "NUM")
        if rows.dtype != np.int8 or rows.ndim != 2 or number is None:
            raise InputError(f"{family.name} does not list the names of groups")
        for row in rows:
            result.setdefault(hdf5.text(row), []).append(int(number))
    return result


def members(families: np.ndarray, chosen: list[int]) -> np.ndarray:
    """The numbers of the nodes or cells in one of the families chosen; families: that of each."""
    return np.flatnonzero(np.isin(families, chosen))
