"""Groups: physical groups, regions and sets of a mesh, found by name or by tag.

Names come from three places: ``field_data`` gives a tag and a dimension to a name (Gmsh, Netgen),
``cell_sets`` and ``point_sets`` list their members (OBJ, Abaqus, FLAC3D, Exodus). Gmsh allows one name for
several groups; all but the first are filed as "NAME (dim D, tag T)". Tags are numbers in the cell data:
physical groups where the mesh has some, else whatever tells regions apart.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from dvr_cli.errors import UsageError
from dvr_cli.mesh.cell_types import CELL_TYPES, topological_dimension
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.regions import region_names

_PHYSICAL = re.compile(r"gmsh:physical(:\d+)?")
_TAG = re.compile(r"-?\d{1,18}")
_LISTED = 20  # tags that an error message lists


def group_cells(mesh: Mesh, name: str, regions: Sequence[str] | None = None) -> list[np.ndarray]:
    """The cells of the groups called ``name``: a boolean array for each block, all False for none.

    A name that several groups bear means all of them; a number that is no name means the groups with that
    tag, of any dimension. The name of a cell type that is no name of a group means all cells of that type, of
    any order. regions: the cell data that tell regions apart, if they are known.
    """
    alike = re.compile(re.escape(name) + r"( \(dim \d, tag -?\d+\))?")
    inside = [np.zeros(len(block.vertices), dtype=bool) for block in mesh.cells]
    named = [group for key, group in _tagged(mesh).items() if alike.fullmatch(key)]
    for mask, members in zip(inside, mesh.cell_sets.get(name, []), strict=False):
        mask[members] = True
    if not named and name not in _names(mesh) and _TAG.fullmatch(name):
        named = [(int(name), dimension) for dimension in range(4)]
    if not named and name not in _names(mesh) and name in CELL_TYPES:
        for block, mask in zip(mesh.cells, inside, strict=True):
            linear = CELL_TYPES[block.type].linear if block.type in CELL_TYPES else None
            mask |= name in (block.type, linear.name if linear else "")
    dimensions = [topological_dimension(block.type) for block in mesh.cells]
    for key in _tag_arrays(mesh, regions):
        for tag, dimension in named:
            if tag == 0 and _PHYSICAL.fullmatch(key):
                continue  # how Gmsh's cells say that they are in no group
            for b, mask in enumerate(inside):
                if dimensions[b] == dimension:
                    mask |= np.asarray(mesh.cell_data[key][b]) == tag
    return inside


def group_vertices(mesh: Mesh, name: str) -> np.ndarray:
    """(N,) bool: the vertices of the groups called ``name`` and of their cells, as for ``group_cells``.

    Raises UsageError, which lists the groups there are, if nothing is in a group of that name.
    """
    inside = np.zeros(len(mesh.points), dtype=bool)
    inside[mesh.point_sets.get(name, [])] = True
    for block, mask in zip(mesh.cells, group_cells(mesh, name), strict=True):
        inside[block.vertices[mask]] = True
    if not inside.any():
        raise UsageError(f"nothing is in a group {name!r}; the groups are: {_listing(mesh)}")
    return inside


def is_physical(name: str) -> bool:
    """True if cell data of this name have tags of physical groups."""
    return _PHYSICAL.fullmatch(name) is not None


def _tagged(mesh: Mesh) -> dict[str, tuple[int, int]]:
    """Tag and dimension of each name in the field data; other field data are left out."""
    pairs = {name: np.asarray(value) for name, value in mesh.field_data.items()}
    return {
        name: (int(pair[0]), int(pair[1]))
        for name, pair in pairs.items()
        if pair.shape == (2,) and pair.dtype.kind in "iu"
    }


def _names(mesh: Mesh) -> list[str]:
    return list(dict.fromkeys([*_tagged(mesh), *mesh.cell_sets, *mesh.point_sets]))


def _tag_arrays(mesh: Mesh, regions: Sequence[str] | None = None) -> list[str]:
    """The cell data that hold tags of groups."""
    physical = [name for name in mesh.cell_data if _PHYSICAL.fullmatch(name)]
    if any(np.any(block) for name in physical for block in mesh.cell_data[name]):
        return physical
    found = region_names(mesh) if regions is None else regions
    return [name for name in found if name not in ("gmsh:physical", "dvr:region")]


def _listing(mesh: Mesh) -> str:
    """The groups with members: names, then the tags of each array."""
    names = [
        name
        for name in _names(mesh)
        if len(mesh.point_sets.get(name, [])) or any(mask.any() for mask in group_cells(mesh, name))
    ]
    kinds = [", ".join(names)] if names else []
    for key in _tag_arrays(mesh):
        blocks = [np.unique(np.asarray(block)) for block in mesh.cell_data[key]]
        tags = [str(int(tag)) for tag in np.unique(np.concatenate(blocks)) if tag or key[:5] != "gmsh:"]
        more = [f"{len(tags) - _LISTED} more"] if len(tags) > _LISTED else []
        kinds += [f"{key} {', '.join([*tags[:_LISTED], *more])}"] if tags else []
    return "; ".join(kinds) or "none"
