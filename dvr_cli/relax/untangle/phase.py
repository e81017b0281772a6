"""Untangling: a stage before relaxation that makes inverted elements positive where the held vertices allow.

The energy of ``energy`` is minimised in rounds of L-BFGS, with an ε that shrinks with the worst corner,
over the vertices around the inverted elements. A round that does not help enough frees more rings of vertices
for the next. Once all is positive, rounds with next to no ε, each over more vertices, even out what the first
ones squeezed together, as long as it pays. The result never has more inverted elements than the input.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.mesh.corners import Corners
from dvr_cli.mesh.neighbours import within_rings
from dvr_cli.quality.mean_ratio import DEGENERATE, corner_qualities, element_qualities
from dvr_cli.relax.stopping import StopReason
from dvr_cli.relax.untangle.energy import Energy
from dvr_cli.relax.untangle.minimise import minimise

if TYPE_CHECKING:
    from dvr_cli.relax.engines.engine import Engine, State
    from dvr_cli.relax.untangle.walking import Walking

_EVALUATIONS = 400  # of the energy in a round
_PROGRESS = 1e-4  # part of the energy gained in ten steps below which a round ends
_ROUNDS = 20
_PATIENCE = 8  # rounds without fewer inverted elements than ever before after which to give up
_SHRINK = 0.2  # ε in terms of the worst corner; halved with each round in a row that does not help
_LEAST_EPSILON = 1e-6
_RINGS = 2  # of vertices around inverted elements that are free in the first round
_PAYS = 0.9  # part of the excess energy that a round of evening out has to stay below
_PARTS = (1.0, 0.5, 0.25, 0.125)  # of their moves that vertices try where some walk
_EVEN = 1e-3  # mean of 1/Q - 1 below which there is nothing to even out


class OutOfReach(Exception):
    """The part of a mesh that is being untangled is too small."""


@dataclass(frozen=True)
class Round:
    """One round: free vertices, elements inverted or degenerate after it, seconds it took."""

    free: int
    tangled: int
    seconds: float


@dataclass(frozen=True, eq=False)
class Untangling:
    """The result of untangling: coordinates (N, d), the rounds done, why they ended.

    stopped_because: UNTANGLED, STUCK, INTERRUPTED or NOTHING_TO_UNTANGLE. walked: whether vertices walked:
    then the engine that they do so in has these coordinates, else it has to be given them.
    """

    points: np.ndarray
    rounds: list[Round]
    stopped_because: StopReason
    walked: bool = False


def untangle(
    points: np.ndarray,
    corners: Corners,
    freedom: Freedom,
    interrupted: Callable[[], bool] = lambda: False,
    on_round: Callable[[Round], None] | None = None,
    engine: Engine | None = None,
    complete: np.ndarray | None = None,
) -> Untangling:
    """Move vertices so that inverted and degenerate elements become positive.

    points: (N, d); freedom: which vertices may move, and along what. interrupted: asked after each step of
    the minimisation; when true, the best coordinates reached are the result. on_round: called after each
    round. engine: the one in which vertices walk that have no freedom, at ``points``. Vertices far from all
    inverted elements keep their coordinates, and none leaves the bounding box of the points by more than its
    diagonal. Elements that no movement can make positive do not count, see ``inverted_by_held``.
    complete: (N,) bool, of a part of a mesh the vertices all of whose elements are there; raises OutOfReach
    before others would move.
    """
    run = _Run(points, corners, freedom, interrupted, on_round, complete)
    moved = np.zeros(len(points), dtype=bool)
    run.untangle(moved)
    if engine is not None and not run.is_done and not interrupted():
        run.begin_to_walk(engine)
        run.untangle(moved)
    if run.tangled.any():
        return run.result(StopReason.STUCK)
    if not run.rounds:
        return Untangling(points, [], StopReason.NOTHING_TO_UNTANGLE)
    core, rings = moved[corners.vertices].any(axis=1), _RINGS
    excess, before = run.excess(core), np.inf
    while not run.ended and excess > _EVEN and excess < _PAYS * before:
        rings *= 2
        moved = within_rings([corners.vertices], moved, rings)
        run.minimise(moved, 0.0)
        excess, before = run.excess(core), excess
    return run.result(StopReason.UNTANGLED)


def inverted_by_held(points: np.ndarray, corners: Corners, freedom: Freedom) -> np.ndarray:
    """(n_cells,) bool: elements with a corner that is not positive and whose vertices are all held."""
    held = (freedom.dimension == 0)[corners.vertices].all(axis=1)
    flat = np.zeros(len(held), dtype=bool)
    flat[held] = corner_qualities(points, corners.part(held)) <= DEGENERATE
    return corners.by_cell(np.logical_or, flat)


class _Run:
    """The state of untangling, and the best coordinates met so far.

    Coordinates are taken relative to the bounding box, so that no unit of length is too small or too large.
    tangled: (n_cells,) bool, the elements to be made positive. ended: whether to leave it at that.
    """

    def __init__(
        self,
        points: np.ndarray,
        corners: Corners,
        freedom: Freedom,
        interrupted: Callable[[], bool],
        on_round: Callable[[Round], None] | None,
        complete: np.ndarray | None,
    ) -> None:
        self.rounds: list[Round] = []
        self._complete = complete
        self._corners, self._freedom = corners, freedom
        self._interrupted, self._on_round = interrupted, on_round
        self._low, self._high = points.min(axis=0), points.max(axis=0)
        self._diagonal = float(np.linalg.norm(self._high - self._low)) or 1.0
        self._points, self._best = points, points
        self._scaled = self._start = (points - self._low) / self._diagonal
        self._walking: Walking | None = None
        self._best_state: State | None = None
        self._inverted_by_held = inverted_by_held(points, corners, freedom)
        self.tangled, self._key = self._judged(points)
        self.ended = interrupted()

    @property
    def is_done(self) -> bool:
        """True if no element is inverted or degenerate, whatever the reason."""
        return self._key == (0, 0)

    def begin_to_walk(self, engine: Engine) -> None:
        """From now on let vertices walk, beginning with the best coordinates met."""
        from dvr_cli.relax.untangle.walking import Walking

        self._walking = Walking(engine, self._best)
        self._best_state = self._walking.state
        self._scaled = (self._best - self._low) / self._diagonal
        freedom = self._walking.freedom(self._freedom)
        self._inverted_by_held = inverted_by_held(self._best, self._corners, freedom)
        self.tangled, _ = self._judged(self._best)
        self.ended = self._interrupted()

    def untangle(self, moved: np.ndarray) -> None:
        """Rounds until all is positive, or nothing helps; marks in ``moved`` ((N,) bool) what they free."""
        rings, idle, fewest = _RINGS, 0, self.tangled.sum()
        start = best = len(self.rounds)
        while self.tangled.any():
            if self.ended or len(self.rounds) in (best + _PATIENCE, start + _ROUNDS):
                return
            vertices = vertices_of(self.tangled, self._corners, len(moved))
            region = within_rings([self._corners.vertices], vertices, rings)
            moved |= region
            before = self.tangled.sum()
            self.minimise(region, _SHRINK / 2**idle)
            after = self.tangled.sum()
            rings *= 2 if after > before / 2 else 1
            idle = 0 if after < before else idle + 1
            if after < fewest:
                fewest, best = after, len(self.rounds)

    def minimise(self, region: np.ndarray, shrink: float) -> None:
        """One round over the vertices marked in ``region`` ((N,) bool).

        shrink: ε as a part of how negative the worst corner is.
        """
        if self._complete is not None and (region & ~self._complete).any():
            raise OutOfReach
        start = time.perf_counter()
        freedom = self._freedom if self._walking is None else self._walking.freedom(self._freedom)
        freedom = freedom.only(region)
        energy, target, epsilon = self._lowest(freedom, shrink)
        if self._walking is None:
            self._scaled = self._scaled.copy()
            self._scaled[freedom.relaxed] = target
            # a vertex that did not move keeps its very digits
            points = self._points + (self._scaled - self._start) * self._diagonal
        else:
            self._walk(self._walking, energy, target, freedom, epsilon)
            points = self._walking.points
        self.tangled, key = self._judged(points)
        inside = (points >= self._low - self._diagonal) & (points <= self._high + self._diagonal)
        self.ended = self._interrupted() or not inside.all()
        if inside.all() and (key < self._key or key == (0, 0)):
            self._best, self._key = points, key
            self._best_state = None if self._walking is None else self._walking.state
        self.rounds.append(Round(len(freedom.relaxed), sum(key), time.perf_counter() - start))
        if self._on_round is not None:
            self._on_round(self.rounds[-1])

    def _lowest(self, freedom: Freedom, shrink: float) -> tuple[Energy, np.ndarray, float]:
        """The energy over this freedom, the places (m, d) where it is lowest, and the ε it has there."""
        energy = Energy(self._scaled, self._corners, freedom)
        displacements = np.zeros(len(freedom.relaxed) * self._corners.dimension)
        epsilon = float(np.hypot(_LEAST_EPSILON, shrink * min(energy.least(displacements), 0.0)))
        displacements = minimise(
            lambda x: energy.regularised(x, epsilon),
            displacements,
            _EVALUATIONS,
            _PROGRESS,
            self._interrupted,
        )
        return energy, energy.points_after(displacements), epsilon

    def _walk(
        self, walking: Walking, energy: Energy, target: np.ndarray, freedom: Freedom, epsilon: float
    ) -> None:
        """Let vertices with this freedom go to ``target`` (m, d), if the energy is lower where they end."""
        vertices = freedom.relaxed
        here, start = self._scaled[vertices], walking.state
        before = energy.at(here, epsilon)
        for part in _PARTS:
            walking.go(vertices, part * self._diagonal * (target - here))
            reached = (walking.points - self._low) / self._diagonal
            if energy.at(reached[vertices], epsilon) < before:
                self._scaled = reached
                return
            walking.restore(start)

    def excess(self, marked: np.ndarray) -> float:
        """Mean of 1/Q - 1 over the corners ``marked`` ((C,) bool), all of them positive."""
        return float((1 / corner_qualities(self._scaled, self._corners.part(marked))).mean()) - 1

    def result(self, reason: StopReason) -> Untangling:
        """The best coordinates met, and why there was no further round."""
        if self._walking is not None and self._best_state is not None:
            self._walking.restore(self._best_state)
        ended = StopReason.INTERRUPTED if self._interrupted() else reason
        return Untangling(self._best, self.rounds, ended, self._walking is not None)

    def _judged(self, points: np.ndarray) -> tuple[np.ndarray, tuple[int, int]]:
        """The elements to be made positive (n_cells,), and how many of all are inverted and degenerate."""
        quality = element_qualities(points, self._corners)
        inverted, tangled = quality < -DEGENERATE, ~(quality > DEGENERATE)
        return tangled & ~self._inverted_by_held, (int(inverted.sum()), int((tangled & ~inverted).sum()))


def vertices_of(elements: np.ndarray, corners: Corners, n_points: int) -> np.ndarray:
    """(N,) bool: the vertices of the elements marked in ``elements`` ((n_cells,) bool)."""
    vertices = np.zeros(n_points, dtype=bool)
    vertices[corners.vertices[np.repeat(elements, np.diff(corners.start))]] = True
    return vertices
