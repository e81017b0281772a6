"""Selection: which of the vertices that may move are to be relaxed.

Each criterion only takes freedom away; a vertex is relaxed if it meets them all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dvr_cli.errors import UsageError
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.neighbours import within_rings
from dvr_cli.options import check_fields
from dvr_cli.quality.mean_ratio import element_qualities


@dataclass(frozen=True)
class Selection:
    """The criteria; by default there are none.

    fix: names of groups whose vertices stay. only: names of groups, of which a vertex has to be in one.
    below: a vertex has to be within ``layers`` rings of neighbours of an element of the input that is worse.
    vertices: (k,) a vertex has to be among these, numbered from 0.

    Raises UsageError for values out of range.
    """

    fix: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    below: float | None = None
    layers: int = 0
    vertices: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Check what can be checked without a mesh."""
        check_fields(self)
        if self.layers and self.below is None:
            raise UsageError("layers: counts rings around the elements that below chooses; give that, too")

    def masks(self, mesh: Mesh, domain: Domain) -> dict[str, np.ndarray]:
        """For each criterion, by the name of its option, the vertices that meet it: (N,) bool.

        Raises UsageError for groups and vertices that the mesh does not have.
        """
        masks = {}
        if self.fix:
            masks["--fix"] = ~_in_any(mesh, "fix", self.fix)
        if self.only:
            masks["--only"] = _in_any(mesh, "only", self.only)
        if self.below is not None:
            cells = [block.vertices for block in domain.cells]
            masks["--below"] = within_rings(cells, of_worse(domain, self.below), self.layers)
        if self.vertices is not None:
            masks["--vertices"] = _listed(self.vertices, len(mesh.points))
        return masks


def _in_any(mesh: Mesh, option: str, names: tuple[str, ...]) -> np.ndarray:
    """(N,) bool: the vertices of the groups of these names."""
    from dvr_cli.mesh.groups import group_vertices  # most runs name no group

    try:
        return np.any([group_vertices(mesh, name) for name in names], axis=0)
    except UsageError as error:
        raise UsageError(f"{option}: {error}") from error


def of_worse(domain: Domain, limit: float) -> np.ndarray:
    """(N,) bool: the vertices of elements worse than ``limit``."""
    near = np.zeros(len(domain.points), dtype=bool)
    bad = element_qualities(domain.points, domain.corners) < limit
    ends = np.cumsum([len(block.vertices) for block in domain.cells])
    for block, mask in zip(domain.cells, np.split(bad, ends[:-1]), strict=True):
        near[block.vertices[mask]] = True
    return near


def _listed(vertices: np.ndarray, n: int) -> np.ndarray:
    """(N,) bool: the vertices with these numbers."""
    wrong = vertices[(vertices < 0) | (vertices >= n)]
    if len(wrong):
        raise UsageError(f"vertices: there is no vertex {wrong[0]}; the mesh has {n}, numbered from 0")
    mask = np.zeros(n, dtype=bool)
    mask[vertices] = True
    return mask
