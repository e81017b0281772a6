"""Which targets the corners of a domain are measured against, as ``--shape`` says (docs/design.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dvr_cli.mesh.domain import Domain
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.quality.stretching import coherent
from dvr_cli.quality.targets import FORMED, Targets, with_targets


@dataclass(frozen=True)
class Shaped:
    """A domain whose corners have targets of their own.

    domain: the domain with these targets; plain: the same with ideal ones.
    held: (N,) bool, the vertices with kept cells only, which are not relaxed.
    kept: how many cells are measured against their own shape. max_aspect: the largest aspect among them.
    """

    domain: Domain
    plain: Domain
    held: np.ndarray
    kept: int = 0
    max_aspect: float = 1.0


def shaped(domain: Domain, shape: str) -> Shaped:
    """The domain with the targets that ``shape`` asks for: "ideal", "auto" or "input".

    "auto" keeps cells whose stretching is coherent, and holds the vertices inside them; "input" makes the own
    shape of every cell that is positive its target, and holds none.
    """
    nowhere = np.zeros(len(domain.points), dtype=bool)
    if shape == "ideal":
        return Shaped(domain, domain, nowhere)
    targets = coherent(domain) if shape == "auto" else _own_shapes(domain)
    if targets is None:
        return Shaped(domain, domain, nowhere)
    held = targets.held_vertices(domain.corners, len(domain.points)) if shape == "auto" else nowhere
    corners = with_targets(domain.points, domain.corners, targets, held)
    kept = int(targets.kept.sum())
    return Shaped(replace(domain, corners=corners), domain, held, kept, targets.max_aspect)


def with_targets_of(domain: Domain, before: Domain) -> Domain:
    """The domain measured against the coherent shapes of another one with the same cells and vertices."""
    targets = coherent(before)
    if targets is None:
        return domain
    nowhere = np.zeros(len(domain.points), dtype=bool)
    return replace(domain, corners=with_targets(before.points, before.corners, targets, nowhere))


def _own_shapes(domain: Domain) -> Targets | None:
    """Targets that are the own shapes of all positive cells, None if there are none."""
    quality = corner_qualities(domain.points, domain.corners, domain.backend)
    positive = domain.corners.by_cell(np.minimum, quality) > FORMED[domain.dimension]
    return Targets(positive.astype(np.float64), 1.0) if positive.any() else None
