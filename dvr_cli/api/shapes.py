"""The targets that the corners of a domain are measured against, as ``--shape`` and ``--metric`` say."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.mesh.corners import Corners
from dvr_cli.mesh.domain import Domain
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.stretching import coherent
from dvr_cli.quality.targets import FORMED, Targets, with_targets

if TYPE_CHECKING:
    from dvr_cli.quality.metric import Metric


@dataclass(frozen=True, eq=False)
class Shaped:
    """A domain whose corners have targets of their own.

    domain: the domain with these targets; plain: the same with ideal ones.
    held: (N,) bool, the vertices of kept cells, which are not relaxed.
    targets: which cells have their own shape for it, None where none has.
    metric: the metric that the ideal shapes are seen in, None for the usual one.
    quality: (C,) of the plain corners in the input, None where it was not needed or has no sign.
    """

    domain: Domain
    plain: Domain
    held: np.ndarray
    targets: Targets | None = None
    metric: Metric | None = None
    quality: np.ndarray | None = None

    @property
    def kept(self) -> int:
        """The number of cells that are measured against their own shape."""
        return 0 if self.targets is None else int(self.targets.kept.sum())

    @property
    def max_aspect(self) -> float:
        """The largest aspect among the cells that are kept, or that a metric asks for; 1 where none is."""
        if self.metric is not None:
            return self.metric.max_aspect
        return 1.0 if self.targets is None else self.targets.max_aspect

    @property
    def kept_cells(self) -> np.ndarray | None:
        """(n,) bool: the cells that are kept as they are, None where there are none."""
        return None if self.targets is None or self.targets.max_aspect == 1.0 else self.targets.kept

    @property
    def own_quality(self) -> np.ndarray | None:
        """(C,) of the corners of ``domain`` in the input, where it is that of the plain ones."""
        return self.quality if self.domain is self.plain else None

    def corners_free_to_move(self) -> Corners:
        """The corners with the same targets, formed also where no vertex is relaxed."""
        if self.targets is None or not self.held.any():
            return self.domain.corners
        nowhere = np.zeros_like(self.held)
        return with_targets(self.plain.points, self.plain.corners, replace(self.targets, held=nowhere))


def shaped(domain: Domain, shape: str, tensors: np.ndarray | None = None) -> Shaped:
    """The domain with the targets that ``shape`` asks for: "ideal", "auto" or "input".

    "auto" keeps cells whose stretching is coherent, and holds their vertices; "input" makes the own
    shape of every cell that is positive its target, and holds none.
    tensors: (N, k, k) of a metric, in which all cells then have the ideal shape for their target, whatever
    ``shape`` says; InputError where there can be no metric, see ``quality.metric``.
    """
    nowhere = np.zeros(len(domain.points), dtype=bool)
    if tensors is not None:
        from dvr_cli.quality.metric import metric_on

        metric = metric_on(domain, tensors)
        return Shaped(replace(domain, corners=metric.corners), domain, nowhere, metric=metric)
    if shape == "ideal":
        return Shaped(domain, domain, nowhere)
    quality = corner_qualities(domain.points, domain.corners, domain.backend)
    targets = coherent(domain, quality) if shape == "auto" else _own_shapes(domain, quality)
    signed = None if domain.is_surface else quality
    if targets is None:
        return Shaped(domain, domain, nowhere, quality=signed)
    corners = with_targets(domain.points, domain.corners, targets)
    return Shaped(replace(domain, corners=corners), domain, targets.held, targets, quality=signed)


def _own_shapes(domain: Domain, quality: np.ndarray) -> Targets | None:
    """Targets that are the own shapes of all positive cells, None if there are none.

    quality: (C,) of the domain's corners.
    """
    positive = domain.corners.by_cell(np.minimum, quality) > FORMED[domain.dimension]
    nowhere = np.zeros(len(domain.points), dtype=bool)
    return Targets(positive, nowhere, 1.0) if positive.any() else None
