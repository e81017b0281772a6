"""Unfolding as a phase of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.mesh.domain import Domain
from dvr_cli.relax.phases import UnfoldPhase
from dvr_cli.relax.stopping import StopReason

if TYPE_CHECKING:
    from dvr_cli.boundary.unfolding import Unfolding

_NAMED = 10  # folded triangles whose places are recorded


def unfold_phase(unfolding: Unfolding, domain: Domain) -> UnfoldPhase:
    """The record of what was unfolded of the boundary of a domain."""
    left = unfolding.left
    return UnfoldPhase(
        "unfold",
        0,
        StopReason.STUCK if len(left) else StopReason.UNFOLDED,
        found=len(unfolding.folded),
        moved=int((unfolding.points != domain.points).any(axis=1).sum()),
        left=len(left),
        deviation=float(unfolding.off.max(initial=0.0)),
        places=[
            {"vertices": triangle.tolist(), "centroid": np.mean(unfolding.points[triangle], axis=0).tolist()}
            for triangle in left[:_NAMED]
        ],
    )
