"""Files that a command writes beside a mesh, reports and pictures: checked before the work, written after."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvr_cli.errors import UsageError

if TYPE_CHECKING:
    from dvr_cli.mesh.mesh import Mesh
    from dvr_cli.quality.measure import Quality

PICTURES = (".svg", ".png", ".pdf", ".html")


def check(option: str, path: Path, suffixes: Sequence[str], others: Iterable[Path | None]) -> None:
    """Check the file that ``option`` names: UsageError where it may not be, OutputError where it cannot.

    suffixes: those it may have. others: files that it must not replace.
    """
    from dvr_cli.files import writing

    if path.suffix.lower() not in suffixes:
        known = ", ".join(suffixes)
        raise UsageError(f"{option} {path}: unknown suffix {path.suffix!r}; known: {known}")
    if os.path.realpath(path) in [os.path.realpath(other) for other in others if other is not None]:
        raise UsageError(f"{option} {path}: would overwrite another file of this command")
    if path.suffix.lower() in PICTURES:
        from dvr_cli.report.render import check_plotting

        check_plotting(f"{option} {path}")
    writing.check_writable(path)


def write_picture(
    path: Path,
    mesh: Mesh,
    states: Mapping[str, tuple[Any, Quality]],
    title: str,
    text: str,
    sweeps: Sequence[Mapping[str, Any]] | None = None,
    kept: Any = None,
    measure: str | None = None,
) -> None:
    """Draw a mesh in some states, the points and quality of each by name, into the file at ``path``.

    title, text: heading and report on a page of HTML. sweeps: those from the first state to the last.
    kept: see ``State``. measure: the name of the one that colours show, None for the mean ratio.
    """
    from dvr_cli.files import writing
    from dvr_cli.mesh.domain import domain_of
    from dvr_cli.quality.cell_measures import CELL_MEASURES, Geometry
    from dvr_cli.report.picture import State, picture
    from dvr_cli.report.render import page, render
    from dvr_cli.report.scale import MEAN_RATIO, scale_of

    domain, scale = domain_of(mesh, straighten=True), MEAN_RATIO
    drawn = [State(name, points, quality, kept) for name, (points, quality) in states.items()]
    if measure is not None:
        chosen = CELL_MEASURES[measure]
        values = [chosen.of(Geometry(domain, state.points)) for state in drawn]
        scale = scale_of(chosen, values)
        drawn = [replace(state, kept=None, measured=of) for state, of in zip(drawn, values, strict=True)]
    figure = picture(domain, drawn, sweeps, scale)
    suffix = path.suffix.lower()
    if suffix == ".html":
        from dvr_cli.report.view import view

        data = page(title, figure, text, view(domain, drawn, scale))
    else:
        data = render(figure, suffix)
    writing.write_bytes(path, data)
