"""Untangling as a phase of smoothing: its record, and the quality that later phases must keep."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.mesh.domain import Domain
from dvr_cli.quality.measure import Quality
from dvr_cli.relax.phases import UntanglePhase
from dvr_cli.relax.untangle.causes import tangled_elements
from dvr_cli.relax.untangle.phase import Untangling


def untangle_phase(
    untangling: Untangling, domain: Domain, freedom: Freedom, points: np.ndarray
) -> UntanglePhase:
    """The phase of untangling, with the elements that stay tangled in the end, at ``points``."""
    return UntanglePhase(
        phase="untangle",
        sweeps=0,
        stopped_because=untangling.stopped_because,
        rounds=[asdict(one) for one in untangling.rounds],
        left=tangled_elements(domain.flatten(points), domain, freedom),
    )


def reference_quality(untangled: Quality, before: Quality) -> Quality:
    """The quality that a run must keep after untangling, given that of the mesh ``untangled`` and ``before``.

    Q1 may be below that of the input: untangling minds how many elements are inverted, not how much.
    """
    if untangled.q1 is None or before.q1 is None:
        return before
    inverted = min(untangled.inverted, before.inverted)
    minimum = min(untangled.minimum, before.minimum)
    return replace(before, q1=min(untangled.q1, before.q1), minimum=minimum, inverted=inverted)
