"""Diagrams of qualities, each drawn into given matplotlib axes: quality vectors, histograms, sweeps.

Quality vectors have a logarithmic horizontal axis as in the paper (Fig. 8 and 9), since the first components
are the ones that count. Colours can be told apart by the colour-blind, and lines by their dashes as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

# from Okabe and Ito's palette, the first two darkened so that lines stand out on white
COLOURS = ("#b35900", "#00306f", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
DASHES: tuple[Any, ...] = ("--", "-", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)))
STYLE: Any = {"font.size": 9.0, "axes.titlesize": 9.0, "legend.fontsize": 8.0, "axes.linewidth": 0.6}
_MANY = 1000  # elements in one bin from which on the others are only seen on a logarithmic axis


def styles(number: int) -> list[dict[str, Any]]:
    """Colour and dashes of ``number`` lines; of two the first is dashed, one alone is not."""
    first = 1 if number == 1 else 0
    lines = range(first, first + number)
    n = len(COLOURS)  # beyond n, the colours come again with other dashes
    return [{"color": COLOURS[i % n], "ls": DASHES[(i + i // n) % len(DASHES)]} for i in lines]


def plot_vectors(axes: Axes, vectors: Mapping[str, np.ndarray]) -> None:
    """Draw quality vectors (m,), ascending, by name: rank of the component on a logarithmic axis, quality."""
    shown = {name: vector for name, vector in vectors.items() if len(vector)}
    for (name, vector), style in zip(shown.items(), styles(len(shown)), strict=True):
        marker = "o" if len(vector) == 1 else None
        axes.semilogx(np.arange(1, len(vector) + 1), vector, marker=marker, label=name, **style)
    axes.set(title="quality vector", xlabel="component (vertices, worst first)", ylabel="mean ratio")
    if not shown:
        _remark(axes, "no relaxed vertex")
        return
    axes.set_ylim(min(0.0, *(1.05 * vector[0] for vector in shown.values())), 1.0)
    axes.grid(alpha=0.3, which="both", lw=0.4)
    axes.legend(loc="best", handlelength=2.6)


def plot_histogram(axes: Axes, histograms: Mapping[str, np.ndarray]) -> None:
    """Draw histograms by name: numbers of elements in equal bins from quality 0 to 1."""
    for (name, counts), style in zip(histograms.items(), styles(len(histograms)), strict=True):
        edges = np.linspace(0.0, 1.0, len(counts) + 1)
        axes.stairs(counts, edges, fill=len(histograms) == 1, label=name, lw=1.5, **style)
    most = max(counts.max() for counts in histograms.values())
    axes.set(title="elements by quality", xlabel="mean ratio", ylabel="elements", xlim=(0.0, 1.0))
    if most > _MANY:
        axes.set(yscale="log", ylim=(0.7, 2.0 * most), ylabel="elements (logarithmic)")
    else:
        axes.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=6))
    axes.grid(alpha=0.3, lw=0.4)
    if len(histograms) > 1:
        axes.legend(loc="best", handlelength=2.6)


def plot_sweeps(
    axes: Axes, sweeps: Sequence[Mapping[str, Any]], before: tuple[float | None, float] | None = None
) -> None:
    """Draw Q1, and the mean of the elements where it is known, over a report's sweeps; phases are marked off.

    before: both at the start.
    """
    axes.set(title="over the sweeps", xlabel="sweep", ylabel="mean ratio")
    if not sweeps:
        _remark(axes, "no sweeps")
        return
    start = [] if before is None else [{"sweep": 0, "q1": before[0], "elements_mean": before[1]}]
    rows = [*start, *sweeps]
    marker = "o" if len(rows) < 30 else None
    _, q1_style, mean_style = styles(3)
    for key, name, style in (("elements_mean", "mean", mean_style), ("q1", "Q1", q1_style)):
        known = [row for row in rows if row.get(key) is not None]
        if len(known) > len(start) or key == "q1":
            x, y = [row["sweep"] for row in known], [row[key] for row in known]
            axes.plot(x, y, marker=marker, ms=2.5, label=name, **style)
    for end, name in _phases(sweeps):
        axes.axvline(end + 0.5, color="0.6", lw=0.6)
        axes.text(end + 0.4, 0.02, name, rotation=90, ha="right", va="bottom", fontsize=7, color="0.4")
    low = min(row["q1"] for row in rows if row["q1"] is not None)
    axes.set_ylim(min(0.0, 1.05 * low), 1.0)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=7))
    axes.grid(alpha=0.3, lw=0.4)
    axes.legend(loc="best", handlelength=2.6)


def _phases(sweeps: Sequence[Mapping[str, Any]]) -> Iterator[tuple[int, str]]:
    """The last sweep of each phase, where there are several, and its name."""
    names = [sweep.get("phase", "relax") for sweep in sweeps]
    if len(set(names)) > 1:
        last = [*(old for old, new in pairwise(sweeps) if old.get("phase") != new.get("phase")), sweeps[-1]]
        yield from ((sweep["sweep"], sweep["phase"]) for sweep in last)


def _remark(axes: Axes, text: str) -> None:
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color="0.4")
    axes.set(xticks=[], yticks=[])
