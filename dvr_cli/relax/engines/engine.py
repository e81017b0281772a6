"""The interface of an engine, and what all engines share."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property, partial, reduce
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from dvr_cli.backend import Backend
from dvr_cli.boundary.freedom import Freedom
from dvr_cli.mesh.sums import mean_of_total, total
from dvr_cli.quality.level import LEAST, WORST, level_of
from dvr_cli.quality.mean_ratio import EXPONENT, corner_qualities
from dvr_cli.quality.vector import at_least, ring_minima
from dvr_cli.relax.altitudes import hold_altitudes
from dvr_cli.relax.polish import PLAIN, Aim
from dvr_cli.relax.problem import Problem, ring_arrays
from dvr_cli.relax.steepest import Ascent

if TYPE_CHECKING:
    from dvr_cli.relax.directions import DirectionField
    from dvr_cli.relax.patches.rounds import Rounds
    from dvr_cli.relax.patches.solver import Patch
    from dvr_cli.relax.surface.carriers import Carriers, Standing
    from dvr_cli.relax.surface.walk import Walk

    State = tuple[np.ndarray, Standing | None]
_ROOM = 0.9  # part of the limit on the distance from the input up to which vertices have room to walk
_LONG_PART = 100_000  # corners, where each part has to be put together with the others
_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


class Engine(ABC):
    """The code that updates all vertices of a batch; engines differ in speed, never in result.

    altitude: see ``keep_altitude``. has_coordinates: whether they are in this process, rather than with
    others that are asked for them.
    """

    backend: Backend
    threads = 1
    altitude = 0.0
    has_coordinates = True

    def __init__(self, problem: Problem) -> None:
        """problem: what to relax; the coordinates are those last given to ``load``."""
        self.problem = problem
        self._standing: Standing | None = None
        self._directions = np.zeros((len(problem.rings.vertices), problem.components))
        self._largest_ring = int(problem.rings.sizes.max(initial=0))
        self._rows = ring_arrays(problem)
        self._all = np.ones(len(problem.rings.vertices), dtype=bool)

    @property
    def turns(self) -> str:
        """The engines that took turns, in words for reports; empty where one does all."""
        return ""

    @property
    def batches(self) -> int:
        """Number of batches a sweep has."""
        return len(self.problem.batch_start) - 1

    @property
    def relaxes(self) -> bool:
        """True if there is a vertex to relax."""
        return len(self.problem.rings.vertices) > 0

    @property
    def _place(self) -> np.ndarray:
        """(N,) the row that each vertex of the problem has among coordinates that go in and come out."""
        return self.problem.order

    def load(self, points: np.ndarray) -> None:
        """Start from the coordinates ``points`` (N, d); they are copied.

        Vertices that walk have to be where the input has them.
        """
        self._set(np.asarray(points, dtype=np.float64)[self._place])
        if self.problem.carriers is not None:
            self._standing = self.problem.carriers.standing()

    def keep_altitude(self, bound: float) -> None:
        """Let no move take an element below an altitude of ``bound`` (see ``altitudes``); 0.0 for no rule."""
        self.altitude = bound

    @property
    def points(self) -> np.ndarray:
        """(N, d) copy of the coordinates reached."""
        reached = self._get()
        points = np.empty_like(reached)
        points[self._place] = reached
        return points

    @property
    def coordinates(self) -> np.ndarray:
        """(N, d) the coordinates reached in the problem's numbering; what is written there counts."""
        return self._get()

    @property
    def relaxed_points(self) -> np.ndarray:
        """(m, d) coordinates reached of the relaxed vertices, in the order of the problem's rings."""
        return self._get().take(self.problem.rings.vertices, axis=0)

    def q1(self) -> float:
        """Q1: the worst quality of a corner with a relaxed vertex, infinite if there are none."""
        touched = self.problem.touched
        if not len(touched.vertices):
            return np.inf
        if self.problem.is_surface:
            return float(self.qualities().min())
        return self.worst()[2]

    def worst(self) -> tuple[float, int, float]:
        """Badness, number and quality of the first of the worst touched corners, not in a surface.

        Infinite badness, that of corners that are not positive, orders nothing: quality then is the lowest.
        """
        touched = self.problem.touched
        corner, badness = self._worst_corner()
        candidates = slice(corner, corner + 1) if badness < np.inf else slice(None)
        return badness, corner, float(corner_qualities(self._get(), touched.part(candidates)).min())

    def qualities(self) -> np.ndarray:
        """(C,) quality of each corner with a relaxed vertex."""
        return corner_qualities(self._get(), self.problem.touched, self.backend, self.turned)

    def qualities_of(self, corners: np.ndarray) -> np.ndarray:
        """(k,) quality of some corners ((k,) numbers) of a planar or volume mesh."""
        points, touched = self._get(), self.problem.touched

        def part(lo: int, hi: int) -> np.ndarray:
            return corner_qualities(points, touched.part(corners[lo:hi]), self.backend)

        return np.concatenate(self._in_parts(part, 0, len(corners)))

    @property
    def turned(self) -> np.ndarray | None:
        """(C,) bool, the touched corners of a surface that are turned over; None in other meshes."""
        standing = self._standing
        return None if standing is None or not self.problem.is_surface else standing.turned

    def deviation(self) -> float:
        """The largest distance between the surfaces and curves that vertices walk on and the input's.

        It is measured from both sides; 0 if no vertex walks.
        """
        carriers, standing = self.problem.carriers, self._standing
        if carriers is None or standing is None:
            return 0.0
        from dvr_cli.relax.surface.overlay import renew

        self.backend.twin(renew)(self._get(), carriers.ground, carriers.stars, standing)
        return carriers.deviation(standing, self._get())

    def part_of_limit(self, vertices: np.ndarray) -> float:
        """The part of the limit that the distance from the input takes at ``vertices`` of the mesh.

        Where walls are thin the limit is not what keeps them.
        """
        carriers, standing = self.problem.carriers, self._standing
        if carriers is None or standing is None or not carriers.limit > 0.0:
            return 0.0
        here = np.isin(self.problem.order, vertices) & (carriers.ground.weight_at == 1.0)
        return float(carriers.apart_at(standing)[here].max(initial=0.0)) / carriers.limit

    def state(self) -> State:
        """A copy of where the vertices are, for ``restore``."""
        return copy_of((self._get(), self._standing))

    def restore(self, state: State) -> None:
        """Go back to a state that was copied."""
        self._set(state[0])
        self._standing = state[1]

    def ring_qualities(self, qualities: np.ndarray | None = None) -> np.ndarray:
        """(m,) the worst quality in each ring; qualities: (C,) of the corners, if they are known."""
        problem = self.problem
        known = self.qualities() if qualities is None else qualities

        def part(lo: int, hi: int) -> np.ndarray:
            corners = problem.touched.part(slice(lo, hi))
            return ring_minima(known[lo:hi], corners, len(problem.order), self.backend)

        minima = reduce(np.minimum, self._in_parts(part, 0, len(known), _LONG_PART))
        return minima[problem.rings.vertices]

    # What phases ask of all values that ``qualities`` and ``ring_qualities`` have, wherever these are.

    def mean(self, qualities: np.ndarray) -> float:
        """The mean of the qualities of the corners."""
        count = len(qualities)
        parts = self._in_parts(lambda a, b: total(qualities[a:b], EXPONENT), 0, count, _LONG_PART)
        return mean_of_total(sum(parts), count, EXPONENT)

    def level(self, qualities: np.ndarray, share: float = WORST, least: int = LEAST) -> float:
        """The quality that this share of the corners is below, but so many at least."""
        return level_of(qualities, share, least)

    def lowest(self, values: np.ndarray) -> float:
        """The lowest of the qualities of corners or rings."""
        return float(values.min())

    def share(self, which: np.ndarray) -> float:
        """The share of the corners or rings that are among ``which``, a bool each."""
        return float(which.mean())

    def total(self, number: int) -> int:
        """The sum of a number over all processes that have a part of the problem."""
        return int(number)

    def first_of_lowest(self, values: np.ndarray) -> int:
        """The first of the corners with the lowest of (C,) values; -1 where that is in another process."""
        return int(values.argmin())

    def any(self, which: np.ndarray) -> bool:
        """True if any ring is among ``which``, (m,) bool."""
        return bool(which.any())

    def is_at_least(self, values: np.ndarray, before: np.ndarray) -> bool:
        """True if the quality vector of some qualities of rings is not below that of others."""
        return at_least(np.sort(values), np.sort(before))

    def focused(self, active: np.ndarray) -> tuple[Engine, np.ndarray | None]:
        """An engine that moves the vertices of the rings ``active`` ((m,) bool) alone, of these coordinates.

        It costs as much as there are such rings. Returned with it is what it has to be told of ``active`` by
        ``directions`` and ``move_batch``: nothing, unless it is this engine itself.
        """
        if self.problem.carriers is not None:
            return self, active
        other = self._over(self.problem.of_rings(np.flatnonzero(active)))
        other._set(self._get())  # which shares them
        other.altitude, other.backend = self.altitude, self.backend
        return other, None

    def _over(self, problem: Problem) -> Engine:
        """An engine like this one for another problem."""
        return type(self)(problem)

    def directions(
        self, field: DirectionField, sweep: int, active: np.ndarray | None = None
    ) -> np.ndarray | Ascent:
        """The directions (m, d) of a sweep; zero for rings not ``active`` ((m,) bool, None for all)."""
        points, vertices = self.relaxed_points, self.problem.relaxed
        if active is None:
            return field(sweep, points, vertices)
        found = field(sweep, points[active], vertices[active])
        if isinstance(found, Ascent):
            return found
        directions = np.zeros_like(points)
        directions[active] = found
        return directions

    def now(self) -> float:
        """Seconds by the clock that all go by who move this problem's vertices."""
        return time.perf_counter()

    def hand_over(self) -> bool:
        """Let a quicker engine go on if one has become ready; asked between batches.

        If so, ``backend``, ``threads`` and ``coordinates`` are others afterwards.
        """
        return False

    def move_batch(
        self,
        batch: int,
        directions: np.ndarray | Ascent,
        active: np.ndarray | None = None,
        enough: float = 0.0,
    ) -> int:
        """Relax a batch along given directions (see ``relax_batch``) or those of steepest ascent.

        active: (m,) bool, the rings whose vertices are to move, by default all. Returns how many moved.
        """
        if not isinstance(directions, Ascent):
            chosen = directions if active is None else np.where(active[:, None], directions, 0.0)
            return self.relax_batch(batch, chosen, enough)
        lo, hi = self.problem.batch_start[batch : batch + 2].tolist()
        before = self._placed(lo, hi)
        for band in directions.bands:
            for _ in range(directions.searches):
                if not self.relax_batch(batch, self.steepest(batch, band, active), enough):
                    break
        return int((self._placed(lo, hi) != before).any(axis=1).sum())

    def steepest(self, batch: int, band: float, active: np.ndarray | None = None) -> np.ndarray:
        """(m, d) directions of which those of a batch are of steepest ascent of their rings' minimum quality.

        They hold for the coordinates as they are now; see ``steepest.steepest``. The others mean nothing.
        active: (m,) bool, the rings that are asked about, by default all; others get zero.
        """
        lo, walking, hi = self.problem.parts(batch)
        if lo < walking:
            self._steepest(batch, lo, walking, band, self._all if active is None else active)
        self._point_ahead(walking, hi, band, PLAIN, active)
        freedom, directions = self.problem.freedom, self._directions
        if freedom is not None and lo < walking:  # without what rounding made across lines and planes
            directions[lo:walking] = freedom.directions(directions[lo:walking], np.arange(lo, walking))
        return directions

    def relax_batch(self, batch: int, directions: np.ndarray, enough: float = 0.0) -> int:
        """Move each vertex of a batch to the best point of its line; returns how many moved.

        directions: (m, d), row i for ring i of the problem; a zero row leaves its vertex where it is.
        enough: the badness with which a ring is good enough: its vertex goes no further; 0.0 for none.
        """
        lo, walking, hi = self.problem.parts(batch)

        def move(a: int, b: int) -> int:
            return self._relax(batch, a, b, directions, enough)

        moved = self._moved(lo, walking, move, 0.0, True)
        return moved + self._walk(walking, hi, directions, False, np.inf, PLAIN)

    def polish_batch(
        self, batch: int, limit: float, aim: Aim = PLAIN, active: np.ndarray | None = None
    ) -> int:
        """Move each vertex of a batch towards the lowest price of its ring above the floor.

        It goes by Newton's step (see ``newton``), or where it walks along that direction in which the price
        falls fastest. limit: the badness at the floor; aim: what is paid for; active: (m,) bool, the rings
        whose vertices are to move, by default all. Returns how many moved.
        """
        lo, walking, hi = self.problem.parts(batch)
        visited = self._all if active is None else active

        def move(a: int, b: int) -> int:
            return self._polish(batch, a, b, limit, aim, visited)

        moved = self._moved(lo, walking, move, limit, aim.by_ring)
        self._point_ahead(walking, hi, -1.0, aim, active)
        return moved + self._walk(walking, hi, self._directions, True, limit, aim)

    def _placed(self, lo: int, hi: int) -> np.ndarray:
        """(hi - lo, d) copy of where the vertices of the rings lo .. hi are."""
        return self._get().take(self.problem.rings.vertices[lo:hi], axis=0)

    def _moved(self, lo: int, hi: int, move: Callable[[int, int], int], limit: float, by_ring: bool) -> int:
        """Move the vertices of the rings lo .. hi, no farther than the altitude rule lets them.

        move: moves those of a part, and returns how many, as this does. limit, by_ring: of
        ``altitudes.hold_altitudes``.
        """
        if lo == hi:
            return 0
        if self.altitude <= 0.0:
            return sum(self._in_parts(move, lo, hi))
        hold, rule = self.backend.twin(hold_altitudes), (float(self.altitude), float(limit), by_ring)

        def part(a: int, b: int) -> int:
            before, moved = self._placed(a, b), move(a, b)
            return moved - hold(self._get(), before, a, b, self._rows, *rule) if moved else 0

        return sum(self._in_parts(part, lo, hi))

    def rounds(self) -> Rounds:
        """The rounds of patches from these coordinates, see ``relax.patches``."""
        from dvr_cli.relax.patches.rounds import WholeRounds  # not for runs without patches

        return WholeRounds(self)

    def solve_patches(
        self, points: np.ndarray, patches: Sequence[Patch], time_is_up: Callable[[], bool]
    ) -> list[tuple[float, float]]:
        """Move the vertices of each patch together; returns the largest badness of each before and after.

        points: (N, d), this engine's coordinates, changed in place. The patches share no corner. time_is_up:
        asked before each; once true the rest is left alone, and has the same badness before and after.
        """
        solve = self._solver(points, self.backend)

        def solved(patch: Patch) -> tuple[float, float]:
            return (1.0, 1.0) if time_is_up() else solve(patch)

        return self._each(solved, patches)

    def _solver(self, points: np.ndarray, backend: Backend) -> Callable[[Patch], tuple[float, float]]:
        """The function that moves the vertices of a patch; see ``solve_patches``."""
        from dvr_cli.relax.patches.solver import find_moves, solve_patch  # not for runs without patches

        carriers, standing = self.problem.carriers, self._standing
        if carriers is None or standing is None:
            return partial(backend.twin(solve_patch), points)
        from dvr_cli.relax.surface.joint import move_jointly

        find, move = backend.twin(find_moves), backend.twin(move_jointly)
        walk, ring = self._walkers(carriers, standing), self._ring_of
        rules = carriers.limit, float(self.altitude), self._largest_ring

        def solve(patch: Patch) -> tuple[float, float]:
            with np.errstate(all="ignore"):
                moves = find(points, patch)
                goes = moves.any(axis=1)  # the others count as those that stay
                moving = patch.moving[goes]
                patch.slot[patch.moving] = -1
                patch.slot[moving] = np.arange(len(moving))
                return move(walk, ring[moving], moves[goes], patch.slot, *rules)

        return solve

    def go_jointly(self, vertices: np.ndarray, moves: np.ndarray) -> None:
        """Move relaxed vertices ((n,) in the problem's numbering) together by ``moves`` (n, d).

        Those that walk go from facet to facet. Each goes as far as the rules for boundaries let it; qualities
        and altitudes are not looked at.
        """
        carriers, standing = self.problem.carriers, self._standing
        if carriers is None or standing is None:
            raise ValueError("no vertex walks here")
        from dvr_cli.relax.surface.joint import go_jointly

        slot = np.full(len(self.problem.order), -1, dtype=np.int32)
        slot[vertices] = np.arange(len(vertices))
        walk = self._walkers(carriers, standing)
        self.backend.twin(go_jointly)(walk, self._ring_of[vertices], moves, slot, carriers.limit)

    @cached_property
    def _ring_of(self) -> np.ndarray:
        """(N,) the ring of each vertex of the problem, -1 for those that are not relaxed."""
        vertices = self.problem.rings.vertices
        ring = np.full(len(self.problem.order), -1)
        ring[vertices] = np.arange(len(vertices))
        return ring

    def tangents(self, vertices: np.ndarray) -> tuple[np.ndarray, Freedom]:
        """Those of the vertices ((n,) in the problem's numbering) that walk, and how they begin to.

        That is in the planes of their facets and on the lines of their segments.
        """
        carriers, standing = self.problem.carriers, self._standing
        if carriers is None or standing is None:
            nobody = np.zeros((0, self.problem.components))
            return vertices[:0], Freedom(np.zeros(0, dtype=np.uint8), nobody)
        walking = vertices[standing.at[vertices] >= 0]
        return walking, carriers.tangents(standing, walking)

    def has_room(self, walking: np.ndarray) -> np.ndarray:
        """(n,) bool, those of vertices that walk around which the mesh may still come farther from the input.

        Where a volume's boundary is almost as far as it may come hardly any way leads on, and the others of a
        patch may gain without them. On a surface all would stay: so there they have room.
        """
        carriers, standing = self.problem.carriers, self._standing
        if carriers is None or standing is None or self.problem.is_surface or not len(walking):
            return np.ones(len(walking), dtype=bool)
        return carriers.apart_around(standing, walking) < _ROOM * carriers.limit

    def _walk(self, lo: int, hi: int, directions: np.ndarray, polishing: bool, floor: float, aim: Aim) -> int:
        """Walk the vertices of the rings lo .. hi; see ``walk.walk_rings``."""
        carriers, standing = self.problem.carriers, self._standing
        if lo == hi or carriers is None or standing is None:
            return 0
        from dvr_cli.relax.surface.walk import Purpose, walk_rings  # only where vertices walk

        kernel = self.backend.twin(walk_rings)
        walk = self._walkers(carriers, standing)
        purpose = Purpose(carriers.limit, float(self.altitude), polishing, floor, aim)

        def part(a: int, b: int) -> int:
            return kernel(walk, directions, a, b, purpose, self._largest_ring)

        return sum(self._in_parts(part, lo, hi))

    def _walkers(self, carriers: Carriers, standing: Standing) -> Walk:
        """The arrays that walks read and change."""
        from dvr_cli.relax.surface.walk import Walk

        return Walk(self._get(), self._rows, carriers.ground, carriers.stars, carriers.corners, standing)

    def _point_ahead(self, lo: int, hi: int, band: float, aim: Aim, active: np.ndarray | None) -> None:
        """Set the directions of the vertices of the rings lo .. hi, which walk; see ``walk_directions``."""
        carriers, standing = self.problem.carriers, self._standing
        if lo == hi or carriers is None or standing is None:
            return
        from dvr_cli.relax.surface.walk import walk_directions

        kernel = self.backend.twin(walk_directions)
        walk = self._walkers(carriers, standing)
        visited = self._all if active is None else active

        def part(a: int, b: int) -> None:
            kernel(walk, self._directions, a, b, band, aim, visited, self._largest_ring)

        self._in_parts(part, lo, hi)

    def _each(self, work: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
        """work(item) for each of the items, which are independent, in order."""
        return list(map(work, items))

    def _in_parts(self, work: Callable[[int, int], Any], lo: int, hi: int, least: int = 1) -> list[Any]:
        """work(a, b) for consecutive parts a .. b of lo .. hi, in order; least: their length at least."""
        with np.errstate(all="ignore"):  # corners that are not positive, directions of no length
            return [work(lo, hi)]

    # These get the parts that ``_in_parts`` makes of the rings of a batch, on any thread.

    @abstractmethod
    def _relax(self, batch: int, lo: int, hi: int, directions: np.ndarray, enough: float) -> int:
        """``relax_batch`` for the rings lo .. hi of a batch, whose vertices do not walk."""

    @abstractmethod
    def _polish(self, batch: int, lo: int, hi: int, limit: float, aim: Aim, active: np.ndarray) -> int:
        """``polish_batch`` for the rings lo .. hi of a batch, whose vertices do not walk."""

    @abstractmethod
    def _steepest(self, batch: int, lo: int, hi: int, band: float, active: np.ndarray) -> None:
        """Set their directions to those of ``steepest``, in lines and planes but for rounding."""

    @abstractmethod
    def _worst_corner(self) -> tuple[int, float]:
        """The first of the touched corners with the largest badness, and that badness."""

    @abstractmethod
    def _set(self, points: np.ndarray) -> None:
        """Take over coordinates in the problem's numbering."""

    @abstractmethod
    def _get(self) -> np.ndarray:
        """(N, d) coordinates reached, in the problem's numbering."""


def copy_of(state: State) -> State:
    """A copy of where vertices are."""
    points, standing = state
    return points.copy(), None if standing is None else type(standing)(*(each.copy() for each in standing))
