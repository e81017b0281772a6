"""Measures: the numbers that reports give of a mesh beside its mean ratios, one record a kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dvr_cli.mesh.domain import Domain
from dvr_cli.quality.altitudes import altitude_and_conduction
from dvr_cli.quality.angles import extreme_angles


@dataclass(frozen=True)
class Measure:
    """One number of a mesh, or several that are found together.

    names: in reports as data. labels: in reports in words, in 2D and in 3D. units: the words for what is
        measured, and the unit of each, in reports as data.
    values: the numbers of a domain with coordinates (N, d), NaN for one that it does not have.
    """

    names: tuple[str, ...]
    labels: tuple[tuple[str, ...], tuple[str, ...]]
    units: tuple[tuple[str, str], ...]
    values: Callable[[Domain, np.ndarray], Sequence[float]]


def _altitude_and_conduction(domain: Domain, flat: np.ndarray) -> tuple[float, float]:
    """The smallest altitude, and the conduction bound, NaN where an element has no size."""
    least, bound = altitude_and_conduction(flat, domain.corners.vertices, domain.backend)
    return least, bound if bound < np.inf else np.nan


MEASURES: Sequence[Measure] = [
    Measure(
        ("min_angle", "max_angle"),
        (("min angle (deg)", "max angle (deg)"), ("min dihedral (deg)", "max dihedral (deg)")),
        (("angle", "degree"),),
        lambda domain, flat: extreme_angles(flat, domain.cells, domain.backend),
    ),
    Measure(
        ("min_altitude", "conduction_bound"),
        (("min altitude", "conduction bound"), ("min altitude", "conduction bound")),
        (("altitude", "length unit of the mesh"), ("conduction", "1 / (length unit of the mesh)^2")),
        _altitude_and_conduction,
    ),
]


def measured(domain: Domain, flat: np.ndarray) -> dict[str, float | None]:
    """The measures of a domain with coordinates ``flat`` (N, d) by name, None for what it does not have."""
    result: dict[str, float | None] = {}
    for measure in MEASURES:
        for name, value in zip(measure.names, measure.values(domain, flat), strict=True):
            result[name] = None if np.isnan(value) else float(value)
    return result


def labelled(values: dict[str, float | None], dimension: int) -> list[tuple[str, float | None]]:
    """Label and value of all measures; values: as ``measured`` gives them."""
    return [
        (label, values[name])
        for measure in MEASURES
        for name, label in zip(measure.names, measure.labels[dimension - 2], strict=True)
    ]


def units() -> dict[str, str]:
    """The unit of all that is measured, by the word for it."""
    return dict(unit for measure in MEASURES for unit in measure.units)
