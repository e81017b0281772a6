"""Rounds of patches: some that share no corner are chosen, worst first, and solved one beside the other."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.quality.badness import badness_of, quality_growth
from dvr_cli.quality.mean_ratio import corner_qualities
from dvr_cli.relax.patches.neighbourhoods import Neighbourhoods
from dvr_cli.relax.patches.solver import Patch

if TYPE_CHECKING:
    from dvr_cli.relax.engines.engine import Engine

PROGRESS = 0.01  # relative growth of a patch's smallest quality below which a layer more is tried
# Of the level of care: a patch that stays worse is left, as others would get worse for what is beyond help.
_HELPED = 0.5


class Solved(NamedTuple):
    """The result of a round.

    patches, moved: how many patches there were, and vertices that moved, in all processes. seeds: (p,) the
    corners that those of this process were built around, and badness: (p, 2) the largest of each before and
    after. corners: (n,) those that were in patches and this process answers for, quality: (n,) theirs after,
    and grown: (n,) bool, whether their patch has grown enough.
    """

    patches: int
    moved: int
    seeds: np.ndarray
    badness: np.ndarray
    corners: np.ndarray
    quality: np.ndarray
    grown: np.ndarray


def has_grown(badness: np.ndarray, dimension: int) -> np.ndarray:
    """(P,) bool, the patches whose smallest quality has grown enough; badness: (P, 2) before and after."""
    with np.errstate(invalid="ignore"):  # infinite before and after: no growth
        return quality_growth(badness[:, 0], badness[:, 1], dimension) >= PROGRESS


def bearable(enough: float, dimension: int, first: bool) -> float:
    """The badness above which a patch is left as it was, when with ``enough`` it is good enough.

    Infinite for the first patch of a round, around the worst corner of all, and where nothing is enough.
    """
    return np.inf if first or enough == 0.0 else enough * badness_of(_HELPED, dimension)


class Rounds(ABC):
    """The rounds that an engine makes."""

    @abstractmethod
    def solve(
        self,
        worst: np.ndarray,
        quality: np.ndarray,
        layers: np.ndarray,
        most: int,
        enough: float,
        time_is_up: Callable[[], bool],
    ) -> Solved:
        """Choose patches around some corners ``worst`` (w,), the first of which counts most; solve them.

        quality: (C,) of the touched corners, and layers: (C,) to be freed around each. most: how many
        patches. enough: the badness with which a patch is good enough. time_is_up: asked before each patch;
        once true the rest is left alone.
        """


class WholeRounds(Rounds):
    """The rounds of an engine whose problem and coordinates are in this process."""

    def __init__(self, engine: Engine) -> None:
        """engine: whose coordinates are changed in place."""
        self._engine, problem = engine, engine.problem
        self._neighbourhoods = Neighbourhoods(problem, engine.backend)
        n, d = len(problem.order), problem.components
        self._slot = np.full(n, -1, dtype=np.int32)  # of freed vertices: number in their patch
        freedom = Freedom(np.full(n, d, dtype=np.uint8), np.zeros((n, d)))
        if problem.freedom is not None:
            freedom.dimension[problem.rings.vertices] = problem.freedom.dimension
            freedom.axis[problem.rings.vertices] = problem.freedom.axis
        table, self._freedom = problem.touched.table, freedom
        self._rules = table.norm, table.factor, freedom.dimension, freedom.axis

    def solve(
        self,
        worst: np.ndarray,
        quality: np.ndarray,
        layers: np.ndarray,
        most: int,
        enough: float,
        time_is_up: Callable[[], bool],
    ) -> Solved:
        """As in Rounds."""
        engine, touched = self._engine, self._engine.problem.touched
        points = engine.coordinates
        patches = self._neighbourhoods.choose(worst, layers, most)
        parts = [patches.of(patch) for patch in range(len(patches))]
        for freed, _, _ in parts:
            self._slot[freed] = np.arange(len(freed))
        walking, tangents = engine.tangents(patches.freed)
        stays = ~engine.has_room(walking)
        tangents.dimension[stays], tangents.axis[stays] = 1, 0.0  # a line that leads nowhere
        self._freedom.dimension[walking], self._freedom.axis[walking] = tangents.dimension, tangents.axis
        altitude, each = float(engine.altitude), []
        for number, part in enumerate(parts):
            bounds = enough, bearable(enough, touched.dimension, number == 0), altitude
            each.append(Patch(*part, self._slot, *self._rules, *bounds))
        badness = np.array(engine.solve_patches(points, each, time_is_up))
        self._slot[patches.freed] = -1
        grown, turned = has_grown(badness, touched.dimension), engine.turned
        turned = None if turned is None else turned[patches.corners]
        return Solved(
            patches=len(patches),
            moved=int(np.diff(patches.freed_start)[badness[:, 1] < badness[:, 0]].sum()),
            seeds=patches.seeds,
            badness=badness,
            corners=patches.corners,
            quality=corner_qualities(points, touched.part(patches.corners), engine.backend, turned),
            grown=np.repeat(grown, np.diff(patches.corner_start)),
        )
