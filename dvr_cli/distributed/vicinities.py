"""Vicinities: the corners around some of a rank's corners, beyond its part too, as patches need them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from dvr_cli.backend import Backend
from dvr_cli.boundary.freedom import Freedom, interior_freedom
from dvr_cli.distributed.rows import owner_of, swapped, swapped_rows
from dvr_cli.distributed.shared_parts import Share
from dvr_cli.mesh.corners import SHAPES, ShapeTable
from dvr_cli.mesh.csr import row_entries
from dvr_cli.mesh.ranks import distinct
from dvr_cli.mesh.rings import incidence
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.patches.neighbourhoods import Patches, choose
from dvr_cli.relax.patches.phase import LAYERS
from dvr_cli.relax.patches.solver import Patch


class _Rows(NamedTuple):
    """Some corners and their vertices, by number in the whole.

    ids: (c,) of the corners, vertices: (c, d+1), shapes: (c,). own: the rows of the table that these name
    beyond those that all ranks have, as the shapes do one after the other; None where they name none.
    number: (n,) of the vertices, each once, ascending, colour: (n,), -1 for those that are not relaxed,
    points: (n, d). dimension, axis: (n,), (n, d) of ``Freedom``.
    """

    ids: np.ndarray
    vertices: np.ndarray
    shapes: np.ndarray
    own: ShapeTable | None
    number: np.ndarray
    colour: np.ndarray
    points: np.ndarray
    dimension: np.ndarray
    axis: np.ndarray


@dataclass(frozen=True, eq=False)
class Vicinity:
    """Some corners, in the order of the whole, and their vertices, in that of their numbers there.

    ids: (c,) of the corners, vertices: (c, d+1) in the vicinity's numbering, shapes: (c,) rows of ``table``.
    number: (n,) of the vertices in the whole, points: (n, d), relaxed: (m,) those that are, in the order of
    the rings of the whole. freedom: of the vertices. answerers, homes: (c,) the ranks that answer for each
    corner, and that owns its lowest vertex.
    """

    ids: np.ndarray
    vertices: np.ndarray
    shapes: np.ndarray
    table: ShapeTable
    number: np.ndarray
    points: np.ndarray
    relaxed: np.ndarray
    freedom: Freedom
    answerers: np.ndarray
    homes: np.ndarray
    backend: Backend

    def patches(self, seeds: np.ndarray, layers: np.ndarray) -> list[Patches]:
        """The patch around each of the corners with these ids, as it is where it comes first.

        layers: to be freed around each; the vicinity reaches one step further.
        """
        at = np.argsort(self.ids)
        found = at[np.searchsorted(self.ids[at], seeds)]
        members, start, corner = self._incidence
        around = np.zeros(len(self.ids), dtype=np.int64)
        around[found] = layers
        result = []
        for seed in found:
            one, freed_start, freed, corner_start, corners = self.backend.twin(choose)(
                np.array([seed]), around, 1, members, start, corner
            )
            more = self.vertices[corners], self.shapes[corners]
            result.append(Patches(one, freed_start, self.relaxed[freed], corner_start, corners, *more))
        return result

    def solvable(
        self, patches: list[Patches], enough: float, bearable: list[float], altitude: float
    ) -> list[Patch]:
        """Some patches, one in each of ``patches``, as the solver takes them; no two share a corner.

        enough, altitude: of all, and bearable: of each, see ``Patch``.
        """
        slot = np.full(len(self.points), -1, dtype=np.int32)
        rules = slot, self.table.norm, self.table.factor, self.freedom.dimension, self.freedom.axis
        for one in patches:
            slot[one.freed] = np.arange(len(one.freed))
        each = zip(patches, bearable, strict=True)
        return [Patch(*one.of(0), *rules, enough, most, altitude) for one, most in each]

    @cached_property
    def _incidence(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The relaxed vertices of each corner by place in ``relaxed``, or -1; the corners of each."""
        place = np.full(len(self.number), -1, dtype=np.int32)
        place[self.relaxed] = np.arange(len(self.relaxed))
        start, corner, _, members = self.backend.twin(incidence)(self.vertices, place, len(self.relaxed))
        return members, start, corner


class Vicinities:
    """The source of vicinities; all ranks have to ask for them together."""

    def __init__(self, comm: Any, share: Share, engine: Engine) -> None:
        """engine: of the rank, which has the coordinates."""
        self._comm, self._share, self._engine = comm, share, engine
        problem = share.part.problem
        table = problem.touched.table
        self._common = 0 if len(table.factor) else len(SHAPES[problem.dimension].norm)
        anywhere = interior_freedom(np.ones(len(share.number), dtype=bool), problem.components)
        self._freedom = anywhere if share.freedom is None else share.freedom
        self._own = np.sort(problem.rings.vertices)
        row = np.full(len(share.number), -1, dtype=np.int32)
        row[self._own] = np.arange(len(self._own))
        found = engine.backend.twin(incidence)(problem.touched.vertices, row, len(self._own))
        self._start, self._corner = found[:2]
        self._colour = np.full(len(share.number), -1, dtype=np.int32)
        batches = np.arange(len(problem.batch_start) - 1)
        self._colour[problem.rings.vertices] = np.repeat(batches, np.diff(problem.batch_start))
        for shared in share.part.received:
            self._colour[shared.vertices] = np.repeat(batches, np.diff(shared.start))

    def ids(self, corners: np.ndarray) -> np.ndarray:
        """The ids of some touched corners of this rank."""
        return self._share.ids.of(self._share.part.problem.touched_ids[corners])

    def turns(self, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The order of some touched corners in the whole: by lowest vertex, then by id."""
        share = self._share
        return share.number[share.part.problem.touched.vertices[corners].min(axis=1)], self.ids(corners)

    def relaxed_of(self, corners: np.ndarray) -> np.ndarray:
        """(m, d+1) numbers in the whole of the relaxed vertices of some touched corners, -1 for others."""
        vertices = self._share.part.problem.touched.vertices[corners]
        return np.where(self._colour[vertices] >= 0, self._share.number[vertices], -1)

    def around(self, vertices: np.ndarray, steps: np.ndarray) -> Vicinity:
        """The corners that the relaxed vertices of some corners lead to, in so many steps each.

        vertices: (m, d+1), see ``relaxed_of``, of whatever rank. A step leads to all corners with a common
        relaxed vertex.
        """
        new = done = np.empty(0, dtype=np.int64)
        found = []
        taken = self._comm.allreduce(np.bincount(steps, minlength=LAYERS + 3))
        for step in range(int(taken.nonzero()[0].max(initial=0)), 0, -1):
            begun = vertices[steps == step]
            begun = begun[begun >= 0]
            wanted = distinct(np.concatenate([new, begun]))
            wanted = wanted[~np.isin(wanted, done)]
            done = np.concatenate([done, wanted])
            rows = self._asked(wanted)
            new = np.concatenate([done[:0], *(each.number[each.colour >= 0] for each in rows)])
            found += rows
        return self._vicinity(found)

    def _vicinity(self, found: list[_Rows]) -> Vicinity:
        """The vicinity of all that was found."""
        bounds = self._share.bounds
        found = found or [self._with(np.empty(0, dtype=np.int64))]
        number, first = np.unique(np.concatenate([rows.number for rows in found]), return_index=True)
        colour = np.concatenate([rows.colour for rows in found])[first]
        points = np.concatenate([rows.points for rows in found])[first]
        dimension = np.concatenate([rows.dimension for rows in found])[first]
        axis = np.concatenate([rows.axis for rows in found])[first]
        ids, first = np.unique(np.concatenate([rows.ids for rows in found]), return_index=True)
        vertices = np.concatenate([rows.vertices for rows in found])[first]
        shapes, table = self._joined(found)
        shapes = shapes[first]
        order = np.lexsort((ids, vertices.min(axis=1, initial=number[-1] if len(number) else 0)))
        vertices = np.searchsorted(number, vertices[order]).astype(np.int32)
        relaxed = np.flatnonzero(colour >= 0)
        relaxed = relaxed[np.argsort(colour[relaxed], kind="stable")].astype(np.int32)
        owner = owner_of(number, bounds)
        answerer = np.where(colour >= 0, owner, self._comm.size)
        return Vicinity(
            ids=ids[order],
            vertices=vertices,
            shapes=shapes[order],
            table=table,
            number=number,
            points=np.ascontiguousarray(points),
            relaxed=relaxed,
            freedom=Freedom(dimension, axis),
            answerers=answerer[vertices].min(axis=1, initial=self._comm.size),
            homes=owner[vertices].min(axis=1, initial=self._comm.size),
            backend=self._engine.backend,
        )

    def _joined(self, found: list[_Rows]) -> tuple[np.ndarray, ShapeTable]:
        """(c,) the shapes of all corners that were found, and the table whose rows they are."""
        shapes, own = [], []
        known = self._common
        for rows in found:
            shapes.append(rows.shapes)
            if rows.own is not None:
                later = rows.shapes + (known - self._common)
                shapes[-1] = np.where(rows.shapes < self._common, rows.shapes, later)
                known += len(rows.own.norm)
                own.append(rows.own)
        table = self._share.part.problem.touched.table
        if own:
            table = table.part(np.arange(self._common)).with_rows(own)
        return np.concatenate(shapes), table

    def _asked(self, numbers: np.ndarray) -> list[_Rows]:
        """The corners with any of these relaxed vertices ((k,) by number, ascending), from their owners."""
        owner = owner_of(numbers, self._share.bounds)
        wanted = swapped_rows(self._comm, owner, np.arange(len(numbers)), (numbers,))
        answers = {rank: self._with(some) for rank, (some,) in wanted.items()}
        return list(swapped(self._comm, answers).values())

    def _with(self, numbers: np.ndarray) -> _Rows:
        """The corners with any of some relaxed vertices that this rank owns."""
        share, touched = self._share, self._share.part.problem.touched
        rows = np.searchsorted(self._own, np.searchsorted(share.number, numbers))
        corners = distinct(self._corner[row_entries(self._start, rows)[0]])
        vertices = touched.vertices[corners]
        here = distinct(vertices.ravel())
        points = self._engine.coordinates[here]
        number, freedom = share.number[here], self._freedom
        shapes, own = touched.shapes[corners, 0], None
        if len(touched.table.norm) > self._common and (beyond := shapes >= self._common).any():
            own = touched.table.part(shapes[beyond])
            shapes = shapes.copy()
            shapes[beyond] = self._common + np.arange(len(own.norm), dtype=shapes.dtype)
        return _Rows(
            self.ids(corners),
            share.number[vertices],
            shapes,
            own,
            number,
            self._colour[here],
            points,
            freedom.dimension[here],
            freedom.axis[here],
        )
