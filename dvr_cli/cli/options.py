"""Options that several commands have, and the values they take."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Literal

import typer

from dvr_cli.errors import DvrError, InputError


class Vector(tuple[float, ...]):
    """Coordinates given as X,Y or X,Y,Z."""


def number(low: float, high: float = math.inf) -> Callable[[str], float]:
    """A parser for numbers of which only finite ones from ``low`` to ``high`` are taken."""
    bounds = f"of at least {low:g}" if high == math.inf else f"from {low:g} to {high:g}"

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and low <= value <= high):
            raise typer.BadParameter(f"{text!r} is not a number {bounds}")
        return value

    return parse


def vector(*lengths: int) -> Callable[[str], Vector]:
    """A parser for that many finite numbers, separated by commas."""

    def parse(text: str) -> Vector:
        try:
            value = Vector(float(part) for part in text.split(","))
        except ValueError:
            value = Vector()
        if len(value) not in lengths or not all(math.isfinite(x) for x in value):
            wanted = " or ".join(str(n) for n in lengths)
            raise typer.BadParameter(f"{text!r} is not {wanted} numbers separated by commas")
        return value

    return parse


@contextmanager
def naming(path: Path | str, kind: type[DvrError] = InputError) -> Iterator[None]:
    """Put the name of the file before the message of an error of this kind."""
    try:
        yield
    except kind as error:
        stream = "standard input" if kind is InputError else "standard output"
        raise kind(f"{stream if path == Path('-') else path}: {error}") from error


quality_value = number(-1, 1)

FailBelow = Annotated[
    float | None,
    typer.Option(parser=quality_value, metavar="Q", help="Exit with code 1 if the worst quality is below Q."),
]
InputFormat = Annotated[
    str | None, typer.Option(metavar="NAME", help="Format of the input; default: by its suffix.")
]
OutputFormat = Annotated[
    str | None, typer.Option(metavar="NAME", help="Format of OUT; default: by its suffix.")
]
Fix = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help="Keep the vertices of a group in place: a physical group, region or set of IN by name or "
        "tag. Can be repeated.",
    ),
]
Report = Annotated[
    Path | None,
    typer.Option(
        metavar="PATH",
        help="Where to write the report: .json, .html with pictures (needs dvr-cli[plot]), or .csv for the "
        "quality vector alone (vertices numbered from 0); default: OUT with its suffix replaced by "
        ".quality.json, none if OUT is -.",
    ),
]
Plot = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Draw the meshes and their qualities: .svg, .png, .pdf, or .html, a page with the report "
        "(needs dvr-cli[plot]).",
    ),
]
QualityField = Annotated[
    bool,
    typer.Option(
        "--quality-field",
        help="Write the quality of each cell as the cell field 'quality' (NaN for cells of lower dimension), "
        "where IN and OUT differ in format or are .vtu.",
    ),
]
NoReport = Annotated[bool, typer.Option("--no-report", help="Write no report.")]
Straighten = Annotated[
    bool, typer.Option("--straighten", help="Take curved second-order cells as straight instead of refusing.")
]
TimeLimit = Annotated[float | None, typer.Option(parser=number(0), metavar="S", help="Stop after S seconds.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Print nothing but errors.")]
Directions = Annotated[
    str,
    typer.Option(
        "-d",
        "--directions",
        metavar="SPEC",
        help="Along what vertices move: a comma-separated list, one entry a sweep, cycled, of random, x, "
        "y, z, axis (= x,y[,z]), circumferential, radial, steepest (ascent of the worst quality around), "
        "optimal (steepest until none helps), file:PATH (.npy, .csv or .txt), field:NAME (a vector point "
        "field of IN).",
    ),
]
Center = Annotated[
    Vector | None,
    typer.Option(
        parser=vector(2, 3),
        metavar="X,Y[,Z]",
        help="Centre of circumferential and radial; default: the centroid of the points.",
    ),
]
Axis = Annotated[
    Vector | None,
    typer.Option(
        parser=vector(3),
        metavar="X,Y,Z",
        help="Axis of circumferential and radial in a volume mesh; default: 0,0,1.",
    ),
]
MaxIterations = Annotated[
    int, typer.Option("-n", "--max-iterations", min=0, metavar="N", help="Sweeps of each phase at most.")
]
Tol = Annotated[
    float,
    typer.Option(parser=number(0), metavar="EPS", help="Growth of Q1 in a sweep that counts as progress."),
]
Patience = Annotated[
    int, typer.Option(min=1, metavar="K", help="Stop after K sweeps in a row without progress.")
]
Target = Annotated[
    float | None, typer.Option(parser=quality_value, metavar="Q", help="Stop when Q1 reaches Q.")
]
Order = Annotated[
    Literal["coloured", "natural", "shuffled"],
    typer.Option(help="Order of the vertices in a sweep.", metavar="coloured|natural|shuffled"),
]
Seed = Annotated[
    int, typer.Option(min=0, metavar="N", help="Seed of random directions and the shuffled order.")
]
EngineName = Annotated[
    Literal["auto", "numpy", "numba"],
    typer.Option(
        "--engine",
        help="What computes; the result is the same. auto takes numba if it is installed (dvr-cli[fast]) "
        "and pays.",
        metavar="auto|numpy|numba",
    ),
]
Threads = Annotated[
    int | None, typer.Option(min=1, metavar="N", help="Threads of the numba engine; default: all cores.")
]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="Print a line for each sweep.")]
Json = Annotated[bool, typer.Option("--json", help="Print the report as JSON.")]
# main looks for it among the arguments, as errors of the parser precede any command
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
