"""Quality gates: --fail-below and --fail-above, and whether a mesh passes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from dvr_cli.errors import UsageError
from dvr_cli.options.output import CELL_MEASURES

if TYPE_CHECKING:
    import numpy as np

    from dvr_cli.mesh.mesh import Mesh
    from dvr_cli.quality.measure import Quality


@dataclass(frozen=True)
class Gate:
    """A bound on a mesh: on its worst quality, or on the values of a measure.

    measure: its name, None for the mean ratio. limit: the bound. below: whether values below it fail, not
    those above.
    """

    measure: str | None
    limit: float
    below: bool


def gates_of(given: Mapping[str, Any]) -> list[Gate]:
    """The gates among the options of a command; UsageError for one that cannot be read."""
    below = [_gate("--fail-below", text, True) for text in given["fail_below"] or ()]
    return below + [_gate("--fail-above", text, False) for text in given["fail_above"] or ()]


def _gate(option: str, text: str, below: bool) -> Gate:
    name, separator, number = text.rpartition("=")
    if separator and name not in CELL_MEASURES:
        raise UsageError(f"{option}: unknown measure {name!r}; known: {', '.join(CELL_MEASURES)}")
    try:
        limit = float(number)
    except ValueError:
        limit = math.nan
    if not separator and (not below or not -1.0 <= limit <= 1.0):
        wanted = "a quality from -1 to 1, or NAME=VALUE" if below else "NAME=VALUE"
        raise UsageError(f"{option}: {text!r} is not {wanted}")
    if not math.isfinite(limit):
        raise UsageError(f"{option}: {number!r} is not a finite number")
    return Gate(name or None, limit, below)


def failures(
    gates: Sequence[Gate], quality: Quality, mesh: Mesh | None = None, points: np.ndarray | None = None
) -> list[str]:
    """The gates that fail, in words; mesh: with coordinates ``points`` instead of its own, of this quality.

    Only gates on measures need the mesh. Raises InputError for a measure that its cells do not have.
    """
    if not gates:
        return []
    from dvr_cli.mesh.domain import domain_of
    from dvr_cli.quality import cell_measures
    from dvr_cli.report.text.lines import gate_failure

    @cache
    def geometry() -> cell_measures.Geometry:
        assert mesh is not None
        assert points is not None
        return cell_measures.Geometry(domain_of(mesh, straighten=True), points)

    texts = []
    for gate in gates:
        if gate.measure is None:
            if quality.minimum < gate.limit:
                texts.append(gate_failure("worst quality", quality.minimum, gate.limit, gate.below))
            continue
        measure = cell_measures.CELL_MEASURES[gate.measure]
        values = measure.of(geometry())
        extreme = float(values.min() if gate.below else values.max())
        if (extreme < gate.limit) if gate.below else (extreme > gate.limit):
            which = f"{'smallest' if gate.below else 'largest'} {measure.name}"
            texts.append(gate_failure(which, extreme, gate.limit, gate.below))
    return texts
