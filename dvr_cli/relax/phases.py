"""The phases of a run: their guarantees (docs/design.md, "Guarantees") and their records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from dvr_cli.relax.stopping import StopReason

# The guarantee of each phase: it holds after every batch.
GUARANTEES = {
    "untangle": "there are never more inverted elements than in the input",
    "unfold": "the boundary stays within the bound on the deviation, and no cell of a volume gets worse",
    "morph": "no element is inverted or degenerate after any substep",
    "descent": "Q1 stays at or above that of the start, and the quality vector does not end below it",
    "relax": "the quality vector never decreases in the paper's ordering, so neither does Q1",
    "patches": "the quality vector never decreases in the paper's ordering, so neither does Q1",
    "polish": "the quality vector below the level of care never decreases; with --floor Q1 stays above that",
}

# The elements that untangling leaves tangled, by reason; see ``untangle.causes.tangled_elements``.
TANGLED = ("elements", "hopeless", "crossing")


@dataclass(frozen=True)
class Phase:
    """The record of one phase.

    phase: its name, a key of GUARANTEES. sweeps: how many it made. stopped_because: why it ended.
    """

    phase: str
    sweeps: int
    stopped_because: StopReason

    def record(self) -> dict[str, Any]:
        """The phase as JSON-ready data, with what it guarantees."""
        fields = asdict(self)
        name = fields.pop("phase")
        return {"phase": name, "guarantee": GUARANTEES[name], **fields}


@dataclass(frozen=True)
class PolishPhase(Phase):
    """A phase of polishing; floor: below which no quality fell."""

    floor: float


@dataclass(frozen=True)
class UntanglePhase(Phase):
    """A phase of untangling.

    rounds: a record of each, see ``untangle.phase.Round``. left: the elements that stay tangled, see
    ``untangle.causes.tangled_elements``.
    """

    rounds: Sequence[Mapping[str, Any]]
    left: Mapping[str, int]


@dataclass(frozen=True)
class UnfoldPhase(Phase):
    """A phase of unfolding.

    found: how many triangles lay folded; moved: how many vertices moved; left: how many triangles still lie
    folded, and places: the vertices and the centroid of the first of them. deviation: how far the boundary
    has come from the input's at most.
    """

    found: int
    moved: int
    left: int
    deviation: float
    places: Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class MorphPhase(Phase):
    """A phase of morphing; fraction: the part of the displacement that was made; substeps: their records."""

    fraction: float
    substeps: Sequence[Mapping[str, Any]]
