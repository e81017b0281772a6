"""The vertices that walk, as untangling moves them: seen in the planes of their facets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.boundary.freedom import Freedom
from dvr_cli.relax.engines.engine import Engine, copy_of

if TYPE_CHECKING:
    from dvr_cli.relax.engines.engine import State


class Walking:
    """The vertices of an engine, in the mesh's numbering; those that walk are where the input has them."""

    def __init__(self, engine: Engine, points: np.ndarray) -> None:
        """engine: gets the coordinates ``points`` (N, d)."""
        engine.load(points)
        self._engine, order = engine, engine.problem.order
        self._number = np.empty_like(order)
        self._number[order] = np.arange(len(order))

    @property
    def points(self) -> np.ndarray:
        """(N, d) copy of the coordinates reached."""
        return self._engine.points

    @property
    def state(self) -> State:
        """A copy of where all are, for ``restore``."""
        return self._engine.state()

    def restore(self, state: State) -> None:
        """Go back to a state that was copied, and may be asked for again."""
        self._engine.restore(copy_of(state))

    def freedom(self, freedom: Freedom) -> Freedom:
        """The same, with the vertices that walk in the planes and on the lines that they stand on."""
        dimension, axis = freedom.dimension.copy(), freedom.axis.copy()
        problem = self._engine.problem
        vertices, tangents = self._engine.tangents(problem.rings.vertices)
        here = problem.order[vertices]
        dimension[here], axis[here] = tangents.dimension, tangents.axis
        return Freedom(dimension, axis)

    def go(self, vertices: np.ndarray, moves: np.ndarray) -> None:
        """Move vertices (n,) by ``moves`` (n, d), as far as the rules for boundaries let them."""
        self._engine.go_jointly(self._number[vertices], moves)
