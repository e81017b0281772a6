"""The picture of a report: meshes coloured by quality above, their diagrams below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from dvr_cli.mesh.domain import Domain
from dvr_cli.quality.measure import Quality
from dvr_cli.report.plot import STYLE, plot_histogram, plot_sweeps, plot_vectors
from dvr_cli.report.plot_mesh import plot_boundary, plot_cut, plot_plane, plot_surface, project
from dvr_cli.report.scale import MEAN_RATIO, Scale

_WIDTH = 9.0  # inches: letters of 9 points are legible where the picture is 800 pixels wide
_MOST = 6  # meshes that are drawn; of more there are only diagrams
_BELOW = 2.8  # inches of the diagrams
_TITLE = 0.3  # inches above each mesh
_BAR = 0.6  # inches of a scale of colours below
_COLUMNS = 3  # planar meshes in a row, but for those that are
_LONG = 0.4  # times as high as wide, or less
_PICKED = 0.05  # share of the elements that is picked out at most


@dataclass(frozen=True, eq=False)
class State:
    """A mesh to be drawn: its name, its points (N, 2|3) as the mesh gives them, its quality.

    kept: (n,) bool, the elements that keep their shape and are drawn apart; None for none. measured: (n,) the
    measure of each element that colours show; None for its quality.
    """

    name: str
    points: np.ndarray
    quality: Quality
    kept: np.ndarray | None = None
    measured: np.ndarray | None = None

    @property
    def values(self) -> np.ndarray:
        """(n,) what colours show of each element."""
        return self.quality.elements if self.measured is None else self.measured

    def colours(self, scale: Scale) -> np.ndarray:
        """(n,) the share of the scale that each element has, masked where it is kept."""
        shares = scale.shares(self.values)
        return shares if self.kept is None else np.ma.masked_array(shares, self.kept)

    @property
    def label(self) -> str:
        """The name, so that matplotlib takes it neither for mathematics nor for one hidden from legends."""
        text = self.name.replace("$", r"\$")
        return f" {text}" if text.startswith("_") else text


def picture(
    domain: Domain,
    states: Sequence[State],
    sweeps: Sequence[Mapping[str, Any]] | None = None,
    scale: Scale = MEAN_RATIO,
) -> Figure:
    """The picture of a mesh in one or more states, and of the sweeps that led from the first to the last.

    domain: that of the mesh in any of the states. sweeps: those of a report, None if there is none. scale: of
    the colours of elements.
    """
    with rc_context(STYLE):
        shown = states if len(states) <= _MOST else []
        views = domain.dimension - 1
        aspect = _aspect(domain, states[0].points)
        fitting = 1 if aspect < _LONG else 2 if len(shown) == 4 else _COLUMNS
        columns = 2 if views == 2 else min(fitting, max(len(shown), 1))
        rows = -(-len(shown) * views // columns)
        width = _WIDTH / (1 if fitting == 1 and views == 1 else max(columns, 2))
        height = rows * (_TITLE + 0.88 * aspect * width) + (_BAR if columns == 1 else 0.0)
        figure = Figure(figsize=(_WIDTH, height + _BELOW), layout="constrained")
        below: Figure | SubFigure = figure
        if shown:
            above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=[height, _BELOW]).ravel()
            _meshes(above, domain, shown, rows, columns, scale)
        axes = below.subplots(1, 2 if sweeps is None else 3, squeeze=False)[0]
        plot_vectors(axes[0], {_with_q1(state): state.quality.vector for state in states})
        plot_histogram(axes[1], {state.label: state.quality.histogram for state in states})
        if sweeps is not None:
            plot_sweeps(axes[2], sweeps, (states[0].quality.q1, states[0].quality.mean))
        return figure


def _meshes(
    figure: SubFigure, domain: Domain, states: Sequence[State], rows: int, columns: int, scale: Scale
) -> None:
    axes = figure.subplots(rows, columns, squeeze=False)
    for one in axes.ravel():
        one.axis("off")
    for i, state in enumerate(states):
        points, elements = domain.flatten(state.points), state.colours(scale)
        most = max(1, int(_PICKED * len(elements)))
        worst = scale.worst(state.values, min(most, len(state.quality.worst)))
        title = f"{state.label}: worst {scale.label} {scale.extreme(state.values):.4g}{scale.unit}"
        if domain.dimension == 2:
            plot = plot_plane if points.shape[1] == 2 else plot_surface
            drawn = plot(axes.ravel()[i], points, domain.cells, elements, worst)
            axes.ravel()[i].set_title(title)
        else:
            plot_boundary(axes[i, 0], points, domain.cells, elements, worst)
            drawn = plot_cut(axes[i, 1], points, domain.cells, elements)
            axes[i, 0].set_title(title)
            axes[i, 1].set_title(f"{state.label}: cut")
    extend = "min" if any(scale.is_beyond(state.values) for state in states) else "neither"
    side, length = ("right", 0.7) if columns > 1 else ("bottom", 0.4)
    bar = figure.colorbar(drawn, ax=axes, location=side, shrink=length, aspect=30, pad=0.02, extend=extend)
    kept = any(state.kept is not None for state in states)
    bar.set_label(f"{scale.label} (light blue: cells that are kept)" if kept else scale.label)
    ticks = [
        tick for tick in MaxNLocator(6).tick_values(scale.bad, scale.good) if 0 <= scale.share(tick) <= 1
    ]
    bar.set_ticks([scale.share(tick) for tick in ticks], labels=[f"{tick:.4g}{scale.unit}" for tick in ticks])


def _aspect(domain: Domain, points: np.ndarray) -> float:
    """Height of a mesh's picture over its width, within what a page has room for."""
    used = domain.flatten(points)[np.unique(domain.corners.vertices)]
    width, height = np.ptp(used if used.shape[1] == 2 else project(used), axis=0)
    return float(np.clip(height / width, 0.1, 1.3)) if width > 0 else 1.0


def _with_q1(state: State) -> str:
    return state.label if state.quality.q1 is None else f"{state.label}: Q1 = {state.quality.q1:.4g}"
