"""What smoothing makes of the stage of untangling: its phase in the report, and what not to fall behind."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.mesh.domain import Domain
from dvr_cli.quality.measure import Quality
from dvr_cli.relax.phases import Untangled
from dvr_cli.relax.untangle.causes import tangled_elements
from dvr_cli.relax.untangle.phase import Untangling


def untangle_phase(untangling: Untangling, domain: Domain, freedom: Freedom, points: np.ndarray) -> Untangled:
    """The phase of untangling, with what is left tangled in the end, at ``points``."""
    return Untangled(
        phase="untangle",
        sweeps=0,
        stopped_because=untangling.stopped_because,
        rounds=[asdict(one) for one in untangling.rounds],
        left=tangled_elements(domain.flatten(points), domain, freedom),
    )


def weaker(untangled: Quality, before: Quality) -> Quality:
    """What a result that started ``untangled`` must not be worse than: Q1 may be below that ``before``, as
    untangling minds how many elements are inverted, not how much.
    """
    if untangled.q1 is None or before.q1 is None:
        return before
    inverted = min(untangled.inverted, before.inverted)
    return replace(before, q1=min(untangled.q1, before.q1), inverted=inverted)
