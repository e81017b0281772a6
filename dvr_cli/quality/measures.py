"""Measures: the numbers that reports give of a mesh beside its mean ratios, one record a kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dvr_cli.mesh.domain import Domain
from dvr_cli.quality.angles import extreme_angles


@dataclass(frozen=True)
class Measure:
    """One number of a mesh, or several that are found together.

    names: in reports as data. labels: in reports in words, in 2D and in 3D. unit: the word for what is
        measured, and its unit, in reports as data.
    values: the numbers of a domain with coordinates (N, d), NaN for one that it does not have.
    """

    names: tuple[str, ...]
    labels: tuple[tuple[str, ...], tuple[str, ...]]
    unit: tuple[str, str]
    values: Callable[[Domain, np.ndarray], Sequence[float]]


MEASURES: Sequence[Measure] = [
    Measure(
        ("min_angle", "max_angle"),
        (("min angle (deg)", "max angle (deg)"), ("min dihedral (deg)", "max dihedral (deg)")),
        ("angle", "degree"),
        lambda domain, flat: extreme_angles(flat, domain.cells, domain.backend),
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
    return dict(measure.unit for measure in MEASURES)
