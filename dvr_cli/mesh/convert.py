"""From and to ``Mesh``: ``meshio.Mesh``, of the same fields, so that nothing is lost, and plain arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.errors import UsageError
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells, Mesh

if TYPE_CHECKING:
    import meshio


def from_meshio(mesh: meshio.Mesh) -> Mesh:
    """A Mesh that shares the arrays of ``mesh`` where their types allow it; all native byte order."""
    n = len(mesh.points)
    links = [np.asarray(link[3], dtype=np.int64).reshape(-1, 2) for link in mesh.gmsh_periodic or []]
    pairs = np.concatenate([np.empty((0, 2), dtype=np.int64), *links])
    return Mesh(
        points=np.asarray(mesh.points, dtype=np.float64),
        cells=[Cells(block.type, _native(np.asarray(block.data))) for block in mesh.cells],
        cell_data={name: [_native(np.asarray(a)) for a in blocks] for name, blocks in mesh.cell_data.items()},
        point_data={name: _native(np.asarray(array)) for name, array in mesh.point_data.items()},
        field_data=dict(mesh.field_data),
        cell_sets=_cell_sets(mesh),
        point_sets={name: part for name, part in mesh.point_sets.items() if _positions(part, n)},
        periodic=pairs[((pairs >= 0) & (pairs < n)).all(axis=1)],
    )


def to_meshio(mesh: Mesh, points: np.ndarray) -> meshio.Mesh:
    """A ``meshio.Mesh`` with the cells and data of ``mesh`` and the coordinates ``points``."""
    import meshio

    return meshio.Mesh(
        points,
        [(block.type, block.vertices) for block in mesh.cells],
        point_data=mesh.point_data,
        cell_data=mesh.cell_data,
        field_data=mesh.field_data,
    )


def from_arrays(
    points: np.ndarray,
    cells: np.ndarray | Mapping[str, np.ndarray] | Sequence[tuple[str, np.ndarray]] | None,
) -> Mesh:
    """A Mesh from points (N, 2|3) and cells as {type: (n, k)}, such pairs, or one array (n, k) of one type.

    Raises UsageError for points without cells, points of another shape, and an array whose number of columns
    does not say which type its cells have.
    """
    if cells is None:
        raise UsageError("cells: needed when points are given")
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise UsageError(f"points: shape {points.shape} is not (N, 2) or (N, 3)")
    if isinstance(cells, np.ndarray):
        pairs: Sequence[tuple[str, np.ndarray]] = [(_only_type(cells, points.shape[1]), cells)]
    else:
        pairs = list(cells.items()) if isinstance(cells, Mapping) else cells
    return Mesh(np.array(points, dtype=np.float64), [Cells(name, np.asarray(array)) for name, array in pairs])


def _only_type(cells: np.ndarray, dimension: int) -> str:
    """The one cell type with as many nodes as an array (n, k) has columns, in a plane or in space."""
    names = [
        kind.name
        for kind in CELL_TYPES.values()
        if cells.ndim == 2 and kind.nodes == cells.shape[1] and 2 <= kind.dimension <= dimension
    ]
    if len(names) == 1:
        return names[0]
    if not names:
        raise UsageError(f"cells: shape {cells.shape} is not (n, k) with the k nodes of a cell type")
    ways = " or ".join(f'{{"{name}": cells}}' for name in names)
    raise UsageError(f"cells: {cells.shape[1]} columns may be several types; give {ways}")


def _native(array: np.ndarray) -> np.ndarray:
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def _cell_sets(mesh: meshio.Mesh) -> dict[str, list[np.ndarray]]:
    """The sets of cells, and the families of a MED file, which meshio keeps beside the mesh.

    What is no list of positions for each block is left out: meshio files the boundaries of Gmsh's entities
    among the sets, and nests sets of sets of Abaqus.
    """
    sets = {
        name: list(parts)
        for name, parts in mesh.cell_sets.items()
        if len(parts) == len(mesh.cells)
        and not name.startswith("gmsh:")
        and all(_positions(part, len(block.data)) for part, block in zip(parts, mesh.cells, strict=True))
    }
    for tag, names in getattr(mesh, "cell_tags", {}).items():
        members = [np.flatnonzero(np.asarray(block) == tag) for block in mesh.cell_data.get("cell_tags", [])]
        for name in names:
            known = sets.get(name, [np.empty(0, dtype=np.int64)] * len(members))
            sets[name] = [np.concatenate(pair) for pair in zip(known, members, strict=True)]
    return sets


def _positions(part: object, n: int) -> bool:
    """True if ``part`` is an array of positions in a list of n."""
    if not isinstance(part, np.ndarray) or part.ndim != 1 or part.dtype.kind not in "iu":
        return False
    return not len(part) or bool(part.min() >= 0 and part.max() < n)
