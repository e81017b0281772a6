"""The domain: what of a mesh can be relaxed, checked and brought into the form the mathematics uses.

Cells of the highest dimension are relaxed. Cells of lower dimension mark boundaries, interfaces and embedded
features; their vertices are not interior, nor are those on a facet that does not separate exactly two cells
of one region.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from dvr_cli.backend import NUMPY, Backend
from dvr_cli.errors import InputError
from dvr_cli.mesh.cell_types import CELL_TYPES, relaxed_dimension
from dvr_cli.mesh.corners import Corners, corners_of
from dvr_cli.mesh.interior import enclosed
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.named_facets import named_facets
from dvr_cli.mesh.orientation import mirrored_cells, unlike_cells, with_mirrored
from dvr_cli.mesh.plane import Plane, plane_of
from dvr_cli.mesh.region_choice import Divider, RegionChoice, regions_of
from dvr_cli.mesh.repeated import repeated_cells, shared_regions, without
from dvr_cli.mesh.second_order import CurvedCells, MidNodes, curved_cells, linear_cells, mid_nodes
from dvr_cli.mesh.simplex import determinants

_LARGEST = 1e50  # its sixth power, which comparing tetrahedra takes, is still a number


@dataclass(frozen=True, eq=False)
class Domain:
    """The part of a mesh that relaxation works on.

    points: (N, d) coordinates, d = 2 or 3; those of a planar mesh are taken in its plane, those of a surface
        in space are three.
    cells: blocks of the cells of dimension d, oriented coherently and positively; one given twice is there
        once.
    cell_ids: (n,) their ids in the mesh: positions counted from 0 through all its blocks.
    repeated: (r, 2) the ids of a cell that has the vertices of another, and of that.
    corners: the corners of these cells.
    region: (n,) region number of each, and divided_by: what tells these regions apart.
    interior: (N,) bool, the vertices that are neither on a boundary, an interface nor a lower cell, and that
        no periodic link ties to another.
    mirrored: how many cells are stored inside out (they stay so in any output).
    plane: the plane of a planar mesh, None for a volume mesh and a surface.
    mids: the nodes of second-order cells that follow their corners, None if there are none.
    curved: those cells that are curved, with all their nodes; none of a surface in space, on which the sign
        of a Jacobian has no meaning.
    straighten: whether curved second-order cells are taken as straight, and mid nodes that move lose their
        offset from the straight edge or face.
    backend: what computes; the results are the same.
    """

    points: np.ndarray
    cells: list[Cells]
    cell_ids: np.ndarray
    repeated: np.ndarray
    corners: Corners
    region: np.ndarray
    divided_by: tuple[Divider, ...]
    interior: np.ndarray
    mirrored: int
    plane: Plane | None
    mids: MidNodes | None
    curved: tuple[CurvedCells, ...]
    straighten: bool
    backend: Backend

    @property
    def dimension(self) -> int:
        """Of the cells: 2 or 3."""
        return self.corners.dimension

    @property
    def is_surface(self) -> bool:
        """True for a surface in space, False for a planar or volume mesh."""
        return self.points.shape[1] > self.dimension

    @property
    def curved_vertices(self) -> np.ndarray:
        """(h,) the vertices that stay because a curved cell has them."""
        none = np.empty(0, dtype=np.int64)
        return none if self.mids is None or self.straighten else self.mids.held

    @property
    def is_tilted(self) -> bool:
        """True if the mesh lies in a plane in general position, so that lifting rounds its coordinates."""
        return self.plane is not None and self.plane.selected is None

    def around(self, vertices: np.ndarray) -> Domain:
        """The same domain with those cells alone that have one of ``vertices`` ((m,)); all points remain.

        Which of them are curved is not kept.
        """
        here = np.zeros(len(self.points), dtype=bool)
        here[vertices] = True
        near = [np.logical_or.reduce([here[v] for v in block.vertices.T]) for block in self.cells]
        cells = [Cells(b.type, b.vertices[mask]) for b, mask in zip(self.cells, near, strict=True)]
        kept = np.concatenate(near)
        return replace(
            self,
            cells=cells,
            cell_ids=self.cell_ids[kept],
            corners=corners_of(cells, self.dimension),
            region=self.region[kept],
            curved=(),
            backend=NUMPY,  # few cells are not worth a kernel
        )

    def flatten(self, points: np.ndarray) -> np.ndarray:
        """Coordinates (N, d) of points given as the mesh gives them."""
        flat = points if self.plane is None else self.plane.flatten(points)
        return np.require(flat, requirements=["C", "W"])  # the layout that kernels are compiled for

    def lift(self, points: np.ndarray, flat: np.ndarray) -> np.ndarray:
        """``points``, given as the mesh gives them, moved to the coordinates ``flat`` (N, d)."""
        lifted = flat.copy() if self.plane is None else self.plane.lift(points, flat)
        if self.mids is not None:
            self.mids.carry(points, lifted, self.straighten)
        return lifted


def domain_of(
    mesh: Mesh,
    straighten: bool = False,
    backend: Backend = NUMPY,
    regions: RegionChoice = (),
    mirrored: np.ndarray | None = None,
) -> Domain:
    """Check a mesh and find its domain.

    straighten: take curved second-order cells as straight; else their vertices are not interior.
    backend: what computes; the result is the same. regions: see ``region_choice``. mirrored: (n,) bool, the
    cells stored inside out, where that is known, as of a part of a mesh; no cell is there twice then.

    Raises InputError for a mesh without planar or volume cells, with coordinates that are not finite, with
    cells that name missing vertices or one vertex twice, or with cells that cannot be relaxed (polygons).
    """
    _check_values(mesh)
    linear = linear_cells(mesh.cells)
    dimension = _highest_dimension(linear)
    _check_types(linear, dimension)
    if dimension > mesh.points.shape[1]:
        raise InputError("volume cells need three coordinates, the points have 2")
    mids = mid_nodes(mesh)
    blocks = [b for b, block in enumerate(linear) if relaxed_dimension(block.type) == dimension]
    stored = [Cells(linear[b].type, linear[b].vertices.astype(np.int32, order="C")) for b in blocks]
    start = np.concatenate([[0], np.cumsum([len(block.vertices) for block in mesh.cells])])
    cell_ids = np.concatenate([np.arange(start[b], start[b + 1]) for b in blocks])
    region, divided_by = regions_of(mesh, blocks, regions)
    again, original = repeated_cells(stored, len(mesh.points), backend)
    repeated = np.stack([cell_ids[again], cell_ids[original]], axis=1)
    if len(again):
        stored = without(stored, again)
        region = np.delete(shared_regions(region, again, original), again)
        cell_ids = np.delete(cell_ids, again)
    points, plane = mesh.points, None
    if dimension == 2:
        plane = plane_of(mesh.points[_used(stored, len(mesh.points))])
        points = mesh.points if plane is None else plane.flatten(mesh.points)
    points = np.require(points, np.float64, ["C", "W"])
    as_stored = corners_of(stored, dimension)
    if mirrored is None:
        mirrored = _mirrored(points, as_stored, stored, backend)
    cells = with_mirrored(stored, mirrored)
    interior = _interior(mesh, linear, stored, blocks, region, backend) & mesh.unlinked
    if mids is not None and not straighten:
        interior[mids.held] = False
    curved: tuple[CurvedCells, ...] = ()
    if mids is not None and points.shape[1] == dimension:
        curved = curved_cells(mesh, mids, cell_ids, mirrored)
    return Domain(
        points=points,
        cells=cells,
        cell_ids=cell_ids,
        repeated=repeated,
        corners=corners_of(cells, dimension) if mirrored.any() else as_stored,
        region=region,
        divided_by=divided_by,
        interior=interior,
        mirrored=int(mirrored.sum()),
        plane=plane,
        mids=mids,
        curved=curved,
        straighten=straighten,
        backend=backend,
    )


def _mirrored(points: np.ndarray, corners: Corners, stored: list[Cells], backend: Backend) -> np.ndarray:
    """(n,) bool: the cells stored inside out; corners: theirs as they are stored."""
    if points.shape[1] > corners.dimension:  # either side of a surface may be its upper one
        return unlike_cells(np.ones(len(corners.start) - 1), stored, backend)
    measures = corners.by_cell(np.add, backend.twin(determinants)(points, corners.vertices))
    return mirrored_cells(measures, stored, backend)


def _interior(
    mesh: Mesh,
    cells: list[Cells],
    stored: list[Cells],
    blocks: list[int],
    region: np.ndarray,
    backend: Backend,
) -> np.ndarray:
    """(N,) bool: vertices inside one region that no cell of lower dimension and no named facet holds."""
    interior = enclosed(stored, region, len(mesh.points), backend)
    facets, _ = named_facets(mesh, relaxed_dimension(stored[0].type) or 0)
    interior[facets[facets >= 0]] = False
    for b, block in enumerate(cells):
        if b not in blocks:
            interior[block.vertices] = False
    return interior


def _used(cells: list[Cells], n_points: int) -> np.ndarray:
    """(N,) bool: the vertices of the cells."""
    used = np.zeros(n_points, dtype=bool)
    for block in cells:
        used[block.vertices] = True
    return used


def is_surface(mesh: Mesh) -> bool:
    """True if the cells that are relaxed are those of a surface in space."""
    return _highest_dimension(linear_cells(mesh.cells)) == 2 and not mesh.is_planar


def _highest_dimension(linear: list[Cells]) -> int:
    """The dimension of cells that can be relaxed, 0 if there are none."""
    return max((relaxed_dimension(block.type) or 0 for block in linear if len(block.vertices)), default=0)


def _check_types(cells: list[Cells], dimension: int) -> None:
    types = [block.type for block in cells if len(block.vertices)]
    for name in types:
        if name not in CELL_TYPES:
            raise InputError(f"cells of type {name!r} are not supported")
    if not types:
        raise InputError("the mesh has no cells")
    if dimension == 0:
        raise InputError(f"the mesh has only {' and '.join(sorted(set(types)))} cells: nothing to relax")


def check_coordinates(points: np.ndarray) -> None:
    """Raise InputError unless all coordinates are finite and small enough to compute with."""
    if is_computable(points):
        return
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InputError(f"the coordinates of vertex {bad[0]} (counted from 0) are not finite")
    raise InputError(f"coordinates beyond {_LARGEST:g} cannot be computed with; choose another unit")


def is_computable(points: np.ndarray) -> bool:
    """True if all coordinates are finite and small enough to compute with."""
    # as 32 bits the limit itself would overflow
    return bool(np.isfinite(points).all()) and float(np.abs(points).max(initial=0.0)) <= _LARGEST


def check_rows(block: Cells) -> None:
    """Raise InputError unless a block has whole numbers, as many a cell as its type has nodes."""
    vertices = block.vertices
    nodes = CELL_TYPES[block.type].nodes if block.type in CELL_TYPES else vertices.shape[-1]
    if vertices.ndim != 2 or vertices.shape[1] != nodes or vertices.dtype.kind not in "iu":
        raise InputError(
            f"{block.type} cells given as {vertices.dtype} array of shape {vertices.shape}; "
            f"integers of shape (n, {nodes}) are needed"
        )


def _check_values(mesh: Mesh) -> None:
    if mesh.points.ndim != 2 or mesh.points.shape[1] not in (2, 3):
        raise InputError(f"points have shape {mesh.points.shape}; 2 or 3 coordinates each are needed")
    check_coordinates(mesh.points)
    start = 0
    for block in mesh.cells:
        vertices = block.vertices
        if not len(vertices):
            continue
        check_rows(block)
        if vertices.min() < 0 or vertices.max() >= len(mesh.points):
            row = int(np.flatnonzero(((vertices < 0) | (vertices >= len(mesh.points))).any(axis=1))[0])
            raise InputError(
                f"cell {start + row} ({block.type}) names a vertex that does not exist; "
                f"there are {len(mesh.points)} vertices"
            )
        twice = np.zeros(len(vertices), dtype=bool)
        for i, j in combinations(range(vertices.shape[1]), 2):
            twice |= vertices[:, i] == vertices[:, j]
        if twice.any():
            row = int(twice.argmax())
            raise InputError(f"cell {start + row} ({block.type}) names one vertex twice")
        start += len(vertices)
