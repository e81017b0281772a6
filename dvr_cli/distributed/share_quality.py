"""The quality of a mesh that no rank has whole: ``quality.measure`` without gathering what it looks at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dvr_cli.distributed.job import LEAD
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.hashing import mixed
from dvr_cli.mesh.sums import mean_of_total, total
from dvr_cli.quality.mean_ratio import DEGENERATE, EXPONENT, corner_qualities
from dvr_cli.quality.measure import QUANTILES, Element, Quality, element_of, histogram, quantile_places
from dvr_cli.quality.measures import measured
from dvr_cli.quality.vector import ring_minima

_LEAST = ("min_angle", "min_altitude")  # of the measures those of which the whole has the least of all ranks
_WORST = 10


@dataclass(frozen=True, eq=False)
class View:
    """The mesh of a rank, and which of it the rank answers for.

    domain: all cells with a vertex that the rank owns; domain.cell_ids: their ids in the whole. cells: (c,)
    bool, those that it owns. relaxed: (n,) bool, vertices that move, on whatever rank. own: (m,) those of
    them that it owns, ascending, and index: (m,) theirs in the whole.
    """

    domain: Domain
    cells: np.ndarray
    relaxed: np.ndarray
    own: np.ndarray
    index: np.ndarray


def quality_of(comm: Any, view: View, points: np.ndarray, vector: bool) -> Quality:
    """The quality of the whole with coordinates ``points`` (n, D) of the rank's mesh, on all ranks.

    vector: whether the leading rank gets the quality vector and its vertices; those of others are empty, as
    ``elements`` are on all.
    """
    domain, corners = view.domain, view.domain.corners
    flat = domain.flatten(points)
    by_corner = corner_qualities(flat, corners, domain.backend)
    by_cell = corners.by_cell(np.minimum, by_corner)
    elements = by_cell[view.cells]
    touched = corners.with_vertex_in(view.relaxed)
    minima = _minima(view, by_corner)
    count = comm.allreduce(len(elements))
    mean = mean_of_total(comm.allreduce(total(elements, EXPONENT)), count, EXPONENT)
    worst = _first(comm, view, points, by_cell, by_cell, _WORST)
    of_touched = corners.by_cell(np.minimum, np.where(touched, by_corner, np.inf))
    q1 = _first(comm, view, points, by_cell, of_touched, 1)
    fixed = _least(comm, by_corner[np.repeat(view.cells, np.diff(corners.start)) & ~touched])
    ordered = np.sort(elements)
    return Quality(
        q1=_least(comm, minima),
        q1_element=q1[0] if q1 else None,
        fixed_cap=fixed,
        minimum=worst[0].quality,
        mean=mean,
        quantiles=_quantiles(comm, ordered, count),
        inverted=comm.allreduce(int((elements < -DEGENERATE).sum())),
        uncertain=0,
        degenerate=comm.allreduce(int((np.abs(elements) <= DEGENERATE).sum())),
        measures=_measures(comm, measured(domain, flat)),
        histogram=sum(comm.allgather(histogram(ordered))),
        worst=worst,
        elements=np.empty(0),
        **_vector(comm, minima, view.index, vector),
    )


def minima_of(view: View, points: np.ndarray) -> np.ndarray:
    """(m,) the worst quality around each vertex that moves and the rank owns."""
    domain = view.domain
    return _minima(view, corner_qualities(domain.flatten(points), domain.corners, domain.backend))


def _minima(view: View, by_corner: np.ndarray) -> np.ndarray:
    domain = view.domain
    return ring_minima(by_corner, domain.corners, len(domain.points), domain.backend)[view.own]


def is_at_least(comm: Any, values: np.ndarray, before: np.ndarray) -> bool:
    """As ``vector.at_least`` of the vectors of all values of all ranks, and of all those before.

    Each number gets a random one; sums of these up to a value are equal where the numbers up to it are. So
    halving finds the first value that one has more often (any other sums of 64 bits are equal with a chance
    of 2^-64).
    """
    keys = [np.sort(_keys(part)) for part in (values, before)]
    sums = [np.concatenate([[np.uint64(0)], np.cumsum(mixed(part), dtype=np.uint64)]) for part in keys]

    def differ(key: int) -> bool:
        ends = [np.searchsorted(part, np.uint64(key), side="right") for part in keys]
        mine = int(sums[0][ends[0]]) - int(sums[1][ends[1]])
        return bool(comm.allreduce(mine) % (1 << 64))

    if not differ((1 << 64) - 1):
        return True
    first = 0
    for bit in range(63, -1, -1):
        middle = first | 1 << bit
        first = first if differ(middle - 1) else middle
    counts = [comm.allreduce(int(np.searchsorted(part, np.uint64(first), side="right"))) for part in keys]
    return bool(counts[0] < counts[1])


def _least(comm: Any, values: np.ndarray) -> float | None:
    """The least of the values of all ranks, None if there are none."""
    least = min(comm.allgather(float(values.min(initial=np.inf))))
    return None if least == np.inf else least


def _measures(comm: Any, mine: dict[str, float | None]) -> dict[str, float | None]:
    """The measures of the whole; mine: those of this rank's cells, of which some are others' as well."""
    result: dict[str, float | None] = {}
    for name in mine:
        found = [each[name] for each in comm.allgather(mine) if each[name] is not None]
        result[name] = (min(found) if name in _LEAST else max(found)) if found else None
    return result


def _first(
    comm: Any, view: View, points: np.ndarray, by_cell: np.ndarray, values: np.ndarray, number: int
) -> list[Element]:
    """The first cells of all ranks by value, then by id; by_cell, values: (c,) quality, and what counts."""
    cells = np.flatnonzero(view.cells & (values < np.inf))
    if len(cells) > number:
        cells = cells[values[cells] <= np.partition(values[cells], number - 1)[number - 1]]
    cells = cells[np.argsort(values[cells], kind="stable")][:number]
    mine = [(values[cell], element_of(view.domain, points, by_cell, int(cell))) for cell in cells]
    found = [element for elements in comm.allgather(mine) for element in elements]
    return [one for _, one in sorted(found, key=lambda each: (each[0], each[1].cell))[:number]]


def _quantiles(comm: Any, ordered: np.ndarray, count: int) -> dict[float, float]:
    """The quantiles of the values of all ranks; ordered: this rank's, ascending; count: of all."""
    places, sides = quantile_places(count)
    wanted = sorted({k for side in sides.values() for k in side})
    value = dict(zip(wanted, of_rank(comm, ordered, np.array(wanted)), strict=True))
    return {q: float(np.interp(places[q], sides[q], [value[k] for k in sides[q]])) for q in QUANTILES}


def of_rank(comm: Any, values: np.ndarray, wanted: np.ndarray) -> list[float]:
    """The values at some places of the sorted values of all ranks, by halving the range of numbers.

    As 64 bits numbers have an order that is theirs, so 64 halvings find each.
    """
    keys = _keys(values)
    keys.sort()
    low = np.zeros(len(wanted), dtype=np.uint64)
    for bit in range(63, -1, -1):
        middle = low | np.uint64(1 << bit)
        below = sum(comm.allgather(np.searchsorted(keys, middle)))
        low = np.where(below <= wanted, middle, low)
    return _of_keys(low).tolist()


def _keys(values: np.ndarray) -> np.ndarray:
    """Whole numbers in the order of ``values``, float64."""
    bits = (values + 0.0).view(np.uint64)  # one zero
    negative = bits.view(np.int64) < 0
    np.invert(bits, out=bits, where=negative)  # in place, as there may be many
    return np.bitwise_or(bits, np.uint64(1 << 63), out=bits, where=~negative)


def _of_keys(keys: np.ndarray) -> np.ndarray:
    sign = np.uint64(1 << 63)
    return np.where(keys & sign, keys ^ sign, ~keys).view(np.float64)


def _vector(comm: Any, minima: np.ndarray, index: np.ndarray, wanted: bool) -> dict[str, np.ndarray]:
    """The quality vector and its vertices on the leading rank, if wanted."""
    nothing = {"vector": np.empty(0), "vertices": np.empty(0, dtype=np.int64)}
    if not wanted:
        return nothing
    found = comm.gather((minima, index), LEAD)
    if found is None:
        return nothing
    values, vertices = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.lexsort((vertices, values))
    return {"vector": values[order], "vertices": vertices[order]}
