"""Lines of text: rows of figures, how figures are written, and how long lines are broken."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from dvr_cli.report.rows import Value, quality_rows

if TYPE_CHECKING:
    from dvr_cli.quality.measure import Quality
    from dvr_cli.report.records import MeshSummary

WIDTH = 80  # columns where nobody says how many there are
VALUE = 9  # columns of a value
_LABEL = 19  # columns of a row's label


def row(label: str, *values: Value | str) -> str:
    """A label and values in columns."""
    cells = (value if isinstance(value, str) else digits(value, label) for value in values)
    return f"  {label:<{_LABEL}}" + "".join(f" {cell:>{VALUE - 1}}" for cell in cells)


def side_by_side(before: Quality, after: Quality, dimension: int) -> list[str]:
    """Rows of the qualities of a mesh with ``dimension``, before and after."""
    rows = zip(quality_rows(before, dimension), quality_rows(after, dimension), strict=True)
    return [row("", "before", "after"), *(row(name, old, new) for (name, old), (_, new) in rows)]


def with_remark(line: str, remark: str, width: int) -> list[str]:
    """A row with a remark, which has a line of its own where they do not fit into one."""
    fits = len(line) + 2 + len(remark) <= width
    return [f"{line}  {remark}".rstrip()] if fits else [line, f"    {remark}"]


def wrap(lines: Sequence[str], width: int) -> list[str]:
    """Lines of which those longer than ``width`` are broken between words and go on further in."""
    parts = []
    for line in lines:
        indent = " " * (len(line) - len(line.lstrip()) + 4)
        parts += textwrap.wrap(
            line, max(width, 20), subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        ) or [""]
    return parts


def digits(value: Value, label: str = "") -> str:
    """A quality with four decimals, or with an exponent where these would show nothing; other figures."""
    if value is None:
        return "-"
    if isinstance(value, int):
        return str(value)
    if label.endswith("(deg)"):
        return f"{value:.2f}"
    if abs(value) >= 1e3:
        return f"{value:.1f}" if abs(value) < 1e6 else f"{value:.2e}"
    return f"{value:.4f}" if value == 0 or abs(value) >= 1e-3 else f"{value:.1e}"


def counted(number: int, what: str) -> str:
    """A number of things, in the plural but for one."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def kind(mesh: MeshSummary) -> str:
    """The kind of a mesh: a surface, or its dimension."""
    return "surface" if mesh.surface else f"{mesh.dimension}D"


def sweep_line(
    sweep: int,
    phase: str,
    q1: float,
    moved: int,
    seconds: float,
    mean: float | None = None,
    below: float | None = None,
) -> str:
    """One line on a sweep; a phase other than relaxing is named."""
    name = "" if phase == "relax" else f"  {phase}"
    average = "" if mean is None else f"  mean {digits(mean)}"
    share = "" if below is None else f"  {100 * below:.2g} % below care"
    return f"sweep {sweep:3d}{name}  Q1 {digits(q1)}{average}{share}  moved {moved}  {seconds:.2f} s"


def gate_failure(name: str, value: float, limit: float, below: bool) -> str:
    """The reason for which the gate at ``limit`` failed; below: on that side of it."""
    return f"the {name}, {digits(value)}, is {'below' if below else 'above'} {limit:g}"
