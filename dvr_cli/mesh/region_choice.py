"""The regions of a mesh: those its tags and sets of cells tell apart, or those a caller chooses.

Every set with some, but not all of the cells tells regions apart, unless its name says that it is a
partition, or begins with "_" as those do that programs make for themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dvr_cli.errors import UsageError
from dvr_cli.mesh.hashing import mixed
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.ranks import distinct, ranks
from dvr_cli.mesh.regions import is_no_region, region_names

NONE = "none"

# Names of cell data and groups, empty for all that look like regions; "none"; or a number for each cell.
RegionChoice = Sequence[str] | np.ndarray


@dataclass(frozen=True)
class Divider:
    """A set or field that tells regions apart.

    name: of cell data or a set. kind: "cell data", "set" or "given". count: of a set how many of the cells it
    has, else how many values there are.
    """

    name: str
    kind: str
    count: int

    @property
    def text(self) -> str:
        """In words."""
        return f"{self.name} ({self.count} {'cells' if self.kind == 'set' else 'values'})"


def regions_of(
    mesh: Mesh, blocks: list[int], choice: RegionChoice = ()
) -> tuple[np.ndarray, tuple[Divider, ...]]:
    """(n,) a number for each cell of these blocks, equal where all that divides them is; and what that is.

    What says the same of all these cells divides nothing.
    Raises UsageError for a name that no cell data and no group have, or for an array of another length.
    """
    sizes = [len(block.vertices) for block in mesh.cells]
    region, dividers = np.zeros(sum(sizes[b] for b in blocks), dtype=np.int64), []
    if not len(region):
        return region, ()
    if isinstance(choice, np.ndarray):
        tags, names, sets = [("regions", "given", _per_block(choice, sizes))], [], []
    elif choice:
        tags, names, sets = [], *_named(mesh, choice)
    else:
        tags, names, sets = [], region_names(mesh), _sets(mesh)
    tags += [(name, "cell data", mesh.cell_data[name]) for name in names]
    for name, kind, arrays in tags:
        place = ranks(np.concatenate([np.asarray(arrays[b]) for b in blocks]))
        if count := int(place.max()):
            region = ranks(region * (count + 1) + place) if region.any() else place
            dividers.append(Divider(name, kind, count + 1))
    number = np.zeros(len(region), dtype=np.uint64)  # random numbers of a cell's sets, by exclusive or
    first = dict(zip(blocks, np.cumsum([0, *(sizes[b] for b in blocks)]).tolist(), strict=False))
    for i, (name, parts) in enumerate(sets, start=1):
        members = distinct(np.concatenate([np.asarray(parts[b]) + first[b] for b in blocks])).astype(np.int64)
        if 0 < len(members) < len(region):
            number[members] ^= mixed(np.array([i], dtype=np.uint64))
            dividers.append(Divider(name, "set", len(members)))
    if number.any():
        place = ranks(number)
        region = ranks(region * (place.max() + 1) + place)
    return region, tuple(dividers)


def _per_block(choice: np.ndarray, sizes: list[int]) -> list[np.ndarray]:
    """The array of a caller as one array a block."""
    n = sum(sizes)
    if choice.shape != (n,) or choice.dtype.kind not in "iub":
        raise UsageError(
            f"regions: {choice.dtype} of shape {choice.shape}; an integer for each of the {n} cells is needed"
        )
    return np.split(choice, np.cumsum(sizes)[:-1])


def _named(mesh: Mesh, names: Sequence[str]) -> tuple[list[str], list[tuple[str, list[np.ndarray]]]]:
    """The cell data of these names, and the members of the groups of these names; none for "none"."""
    if NONE in names:
        if len(names) > 1:
            raise UsageError(f"regions: {NONE!r} leaves no place for other names")
        return [], []
    data, sets = [], []
    for name in names:
        if name in mesh.cell_data:
            if any(array.ndim != 1 or array.dtype.kind not in "iufb" for array in mesh.cell_data[name]):
                raise UsageError(f"regions: the cell data {name!r} are not one number for each cell")
            data.append(name)
            continue
        from dvr_cli.mesh.groups import group_cells  # most runs name no set

        inside = [np.flatnonzero(mask) for mask in group_cells(mesh, name)]
        if not any(map(len, inside)):
            known = [*mesh.cell_data, *mesh.cell_sets, *mesh.field_data]
            listed = ", ".join(dict.fromkeys(known)) or "none"
            raise UsageError(
                f"regions: no cells of a group and no cell data are called {name!r}; known: {listed}"
            )
        sets.append((name, inside))
    return data, sets


def _sets(mesh: Mesh) -> list[tuple[str, list[np.ndarray]]]:
    """The sets that count as regions where nobody chooses."""
    return [
        (name, parts)
        for name, parts in mesh.cell_sets.items()
        if not name.startswith("_") and not is_no_region(name) and len(parts) == len(mesh.cells)
    ]
