"""Untangling as a phase of smoothing: its record, and the quality that later phases must keep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.api.boundary import Moves
from dvr_cli.api.options import SmoothOptions
from dvr_cli.errors import InputError
from dvr_cli.mesh.domain import Domain
from dvr_cli.quality.mean_ratio import DEGENERATE, corner_qualities
from dvr_cli.quality.measure import Quality
from dvr_cli.relax.phases import TANGLED, UntanglePhase

if TYPE_CHECKING:
    from dvr_cli.relax.untangle.phase import Untangling


def untangles(options: SmoothOptions, domain: Domain, before: Quality) -> bool:
    """True if a run untangles: when asked to, by default where vertices are free and elements inverted.

    before: the quality of the domain. Elements that their curved shape alone inverts do not count. Raises
    InputError for a surface that is to be untangled.
    """
    if options.untangle and domain.is_surface:
        raise InputError("a surface in space cannot be untangled; planar and volume meshes can")
    if options.untangle is not None:
        return options.untangle
    if domain.is_surface or not (options.is_free and options.stopping.max_iterations and before.inverted):
        return False
    return bool((corner_qualities(domain.points, domain.corners, domain.backend) < -DEGENERATE).any())


def untangle_phase(untangling: Untangling, left: Mapping[str, int]) -> UntanglePhase:
    """The phase of untangling; left: the elements that stay tangled in the end, see ``tangled_left``."""
    return UntanglePhase(
        phase="untangle",
        sweeps=0,
        stopped_because=untangling.stopped_because,
        rounds=[asdict(one) for one in untangling.rounds],
        left=left,
    )


def tangled_left(domain: Domain, moves: Moves, points: np.ndarray, after: Quality) -> dict[str, int]:
    """The elements that are tangled in the end, at ``points``, by reason: see ``tangled_elements``.

    after: the quality there. A surface has none, as its elements have no sign of their own.
    """
    if domain.is_surface or not after.inverted + after.degenerate:
        return dict.fromkeys(TANGLED, 0)
    from dvr_cli.relax.untangle.causes import tangled_elements

    return tangled_elements(domain.flatten(points), domain, moves.within)


def reference_quality(untangled: Quality, before: Quality) -> Quality:
    """The quality that a run must keep after untangling, given that of the mesh ``untangled`` and ``before``.

    Q1 may be below that of the input: untangling minds how many elements are inverted, not how much.
    """
    if untangled.q1 is None or before.q1 is None:
        return before
    inverted = min(untangled.inverted, before.inverted)
    minimum = min(untangled.minimum, before.minimum)
    return replace(before, q1=min(untangled.q1, before.q1), minimum=minimum, inverted=inverted)
