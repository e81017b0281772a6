"""The table of options: one row each, from which command lines, checks and records are made.

A row says what an option is called, which values it takes, its default, what help says of it and which
commands have it. The commands of ``dvr`` get their options from here, the Python API its checks and defaults,
and reports the options they record. Nothing here imports NumPy, as every start of ``dvr`` reads the table.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from typing import Any

from dvr_cli.errors import UsageError


@dataclass(frozen=True)
class Values:
    """The values an option takes.

    type: of one value: float, int, str, bool or "path". low, high: bounds of a number. names: the only ones
    there are. lengths: the option is that many numbers, separated by commas. many: it can be repeated.
    must: what a value has to be, for messages ("be at least 1"); where it is empty the command line alone
    checks.
    """

    type: type | str
    low: float = -math.inf
    high: float = math.inf
    names: tuple[str, ...] = ()
    lengths: tuple[int, ...] = ()
    many: bool = False
    must: str = ""


# measures of cells beside the mean ratio, see quality/cell_measures.py
CELL_MEASURES = (
    *("scaled-jacobian", "aspect-ratio", "skewness", "min-angle", "max-angle"),
    *("non-orthogonality", "face-skewness"),
)

SWITCH = Values(bool)
TEXT = Values(str)
TEXTS = Values(str, many=True)
FILE = Values("path")
QUALITY = Values(float, -1, 1, must="be a quality, from -1 to 1")
COUNT = Values(int, 0, must="not be negative")
POSITIVE_COUNT = Values(int, 1, must="be at least 1")
NOT_NEGATIVE = Values(float, 0, must="be a number that is not negative")


@dataclass(frozen=True)
class Variant:
    """The differences of an option in one command; None: no difference."""

    default: Any = None
    names: tuple[str, ...] | None = None
    help: str | None = None


@dataclass(frozen=True)
class Option:
    """One option.

    name: as a keyword in Python, "max_iterations"; the command line has dashes for underscores.
    values: which it takes; None stands for "not given" where the default is None.
    help: one or two sentences. commands: those that have it, "smooth", "untangle", "morph", "quality",
        "compare". variants: what is different in some of them.
    metavar: what help shows for the value. flags: names on the command line other than "--name".
    recorded: whether reports of runs record it. shown: whether help shows the default.
    panel: the heading of help that it stands under.
    """

    name: str
    values: Values
    default: Any
    help: str
    commands: tuple[str, ...]
    metavar: str | None = None
    flags: tuple[str, ...] = ()
    variants: Mapping[str, Variant] = field(default_factory=dict)
    recorded: bool = False
    shown: bool = True
    panel: str = "Options"

    @property
    def label(self) -> str:
        """The name as the command line and messages have it, without dashes in front."""
        return self.name.replace("_", "-")

    def of(self, command: str) -> Option:
        """The option as a command has it."""
        variant = self.variants.get(command)
        if variant is None:
            return self
        return replace(
            self,
            default=self.default if variant.default is None else variant.default,
            values=self.values if variant.names is None else replace(self.values, names=variant.names),
            help=variant.help or self.help,
        )

    def check(self, value: Any) -> None:
        """Raise UsageError unless the option takes ``value``."""
        if value is None and self.default is None:
            return
        values = self.values
        if values.names and value not in values.names:
            raise UsageError(f"{self.label}: unknown {value!r}; known: {', '.join(values.names)}")
        if not values.must:
            return
        try:
            good = values.low <= value <= values.high and value < math.inf
        except TypeError:
            good = False
        if not good:
            raise UsageError(f"{self.label}: must {values.must}")

    def record(self, value: Any) -> Any:
        """A value of the option as JSON-ready data."""
        if value is None:
            return None
        convert: Any = str if self.values.type == "path" else self.values.type
        if self.values.many:
            return [value] if isinstance(value, str) else list(value)
        return [convert(one) for one in value] if self.values.lengths else convert(value)


RUNS = ("smooth", "untangle", "morph")
RELAXING = ("smooth", "morph")
REPORTS = ("quality", "compare")
SMOOTH = ("smooth",)

TABLE = (
    Option(
        "displacement",
        FILE,
        ...,
        "By how much vertices move: .npy, .csv or .txt with one row for each vertex of IN. Rows of "
        "vertices that are relaxed are not looked at.",
        ("morph",),
        "FILE",
        panel="Files",
    ),
    Option(
        "near",
        COUNT,
        None,
        "Relax only vertices within K rings of displaced ones.",
        ("morph",),
        "K",
        panel="Selection",
    ),
    Option(
        "directions",
        TEXT,
        "steepest,random",
        "Along what vertices move: a comma-separated list, one entry a sweep, cycled, of random, x, y, z,"
        " axis (= x,y[,z]), circumferential, radial, steepest (ascent of the worst quality around), "
        "narrowing (steepest, three times, for corners ever nearer to the worst), optimal (steepest until "
        "none helps), file:PATH (.npy, .csv or .txt), field:NAME (a vector point "
        "field of IN).",
        RELAXING,
        "SPEC",
        flags=("-d", "--directions"),
        variants={"morph": Variant(default="random")},
        recorded=True,
        panel="Directions",
    ),
    Option(
        "center",
        Values(float, lengths=(2, 3)),
        None,
        "Centre of circumferential and radial; default: the centroid of the points.",
        RELAXING,
        "X,Y[,Z]",
        recorded=True,
        panel="Directions",
    ),
    Option(
        "axis",
        Values(float, lengths=(3,)),
        None,
        "Axis of circumferential and radial in a volume mesh; default: 0,0,1.",
        RELAXING,
        "X,Y,Z",
        recorded=True,
        panel="Directions",
    ),
    Option(
        "max_iterations",
        COUNT,
        100,
        "Sweeps of each phase at most.",
        RELAXING,
        "N",
        flags=("-n", "--max-iterations"),
        recorded=True,
        panel="Stopping",
    ),
    Option(
        "tol",
        NOT_NEGATIVE,
        1e-3,
        "Growth of Q1 in a sweep that counts as progress.",
        RELAXING,
        "EPS",
        recorded=True,
        panel="Stopping",
    ),
    Option(
        "patience",
        POSITIVE_COUNT,
        3,
        "Stop after K sweeps in a row without progress.",
        RELAXING,
        "K",
        recorded=True,
        panel="Stopping",
    ),
    Option(
        "target",
        QUALITY,
        None,
        "A quality that is enough: with the default directions only what is worse is moved, and no further; "
        "with others stop when Q1 reaches Q.",
        RELAXING,
        "Q",
        variants={"morph": Variant(help="Stop when Q1 reaches Q.")},
        recorded=True,
        panel="Stopping",
    ),
    Option(
        "time_limit",
        NOT_NEGATIVE,
        None,
        "Stop after S seconds.",
        ("smooth", "untangle"),
        "S",
        recorded=True,
        panel="Stopping",
    ),
    Option(
        "order",
        Values(str, names=("coloured", "natural", "shuffled")),
        "coloured",
        "Order of the vertices in a sweep.",
        RELAXING,
        recorded=True,
        panel="Directions",
    ),
    Option(
        "seed",
        Values(int, 0, 2**64 - 1, must="be between 0 and 2^64 - 1"),
        0,
        "Seed of random directions and the shuffled order.",
        RELAXING,
        "N",
        recorded=True,
        panel="Directions",
    ),
    Option(
        "boundary",
        Values(str, names=("fixed", "slide", "project")),
        "fixed",
        "Whether vertices of the boundary, of interfaces and of embedded cells stay, slide along straight"
        " lines and planes, so that every region and group keeps its shape, or move along curved ones "
        "too, on those of IN. Vertices of surfaces in space always do.",
        ("smooth", "untangle"),
        variants={
            "untangle": Variant(
                names=("fixed", "slide"),
                help="Whether vertices of the boundary, of interfaces and of embedded cells stay or slide "
                "along straight lines and planes.",
            )
        },
        recorded=True,
        panel="Boundary and regions",
    ),
    Option(
        "feature_angle",
        Values(float, 0, 180, must="be between 0 and 180 degrees"),
        30.0,
        "Where a curved boundary turns by more than this it is a feature: its vertices stay on the "
        "feature's curve, those of its corners in place.",
        SMOOTH,
        "DEG",
        recorded=True,
        panel="Boundary and regions",
    ),
    Option(
        "max_deviation",
        Values(float, 0, must="be a length that is not negative"),
        None,
        "How far a curved boundary may come from that of IN, measured from both; default: 1e-3 of the "
        "diagonal of the bounding box.",
        SMOOTH,
        "D",
        recorded=True,
        panel="Boundary and regions",
    ),
    Option(
        "fix",
        TEXTS,
        (),
        "Keep the vertices of a group in place: a physical group, region or set of IN by name or tag. Can"
        " be repeated.",
        ("smooth", "untangle"),
        "NAME",
        recorded=True,
        panel="Selection",
    ),
    Option(
        "only",
        TEXTS,
        (),
        "Relax only the vertices of a group, or of cells of a type. Can be repeated.",
        SMOOTH,
        "NAME",
        recorded=True,
        panel="Selection",
    ),
    Option(
        "below",
        QUALITY,
        None,
        "Relax only the vertices of elements of IN that are worse than Q.",
        SMOOTH,
        "Q",
        recorded=True,
        panel="Selection",
    ),
    Option(
        "layers",
        COUNT,
        0,
        "With --below: relax K rings of neighbours, too.",
        SMOOTH,
        "K",
        recorded=True,
        panel="Selection",
    ),
    Option(
        "vertices",
        FILE,
        None,
        "Relax only the vertices listed in FILE (.txt, .csv or .npy), numbered from 0.",
        SMOOTH,
        "FILE",
        recorded=True,
        panel="Selection",
    ),
    Option(
        "engine",
        Values(str, names=("auto", "numpy", "numba")),
        "auto",
        "What computes; the result is the same. auto takes numba if it is installed (dvr-cli[fast]) and "
        "pays.",
        RELAXING,
        panel="Performance",
    ),
    Option(
        "threads",
        POSITIVE_COUNT,
        None,
        "Threads of the numba engine; default: all cores.",
        RELAXING,
        "N",
        panel="Performance",
    ),
    Option(
        "mpi",
        SWITCH,
        False,
        "Move vertices on all ranks of an MPI job, as in mpiexec -n 4 dvr smooth IN OUT --mpi (needs "
        "dvr-cli[mpi]): the same bytes as on one. Each rank has one thread unless --threads says otherwise.",
        ("smooth",),
        panel="Performance",
    ),
    Option(
        "report",
        FILE,
        None,
        "Where to write the report: .json, .html with pictures (needs dvr-cli[plot]), or .csv for the "
        "quality vector alone (vertices numbered from 0); default: OUT with its suffix replaced by "
        ".quality.json, none if OUT is -.",
        RUNS,
        "PATH",
        panel="Reports",
    ),
    Option(
        "plot",
        FILE,
        None,
        "Draw the meshes and their qualities: .svg, .png, .pdf, or .html, a page with the report and the "
        "meshes to be turned and cut in a browser (needs dvr-cli[plot]).",
        (*RUNS, *REPORTS),
        "FILE",
        panel="Reports",
    ),
    Option(
        "quality_field",
        SWITCH,
        False,
        "Write the quality of each cell as the cell field 'quality' (NaN for cells of lower dimension), "
        "where IN and OUT differ in format or are .vtu.",
        RUNS,
        panel="Reports",
    ),
    Option("no_report", SWITCH, False, "Write no report.", RUNS, panel="Reports"),
    Option(
        "regions",
        TEXTS,
        (),
        "Regions, between which interfaces stay, are told apart by the cell field or group NAME alone, or by "
        "nothing: none. Can be repeated; default: by all cell fields and sets of cells that look like it.",
        (*RUNS, *REPORTS),
        "NAME|none",
        recorded=True,
        panel="Boundary and regions",
    ),
    Option(
        "shape",
        Values(str, names=("auto", "ideal", "input")),
        "auto",
        "The shape that cells are measured against: ideal (equilateral, square, ...), input (each its own in "
        "IN), or auto: ideal but for cells that are stretched like their neighbours, as in boundary layers; "
        "these are kept as they are.",
        RUNS,
        variants={"morph": Variant(default="input"), "untangle": Variant(default="ideal")},
        recorded=True,
        panel="Target shapes",
    ),
    Option(
        "metric",
        TEXT,
        None,
        "Measure shapes in a metric, a symmetric tensor a vertex: a point field of IN, or a MEDIT .sol or "
        ".solb file. All cells then have the ideal shape in it as target, and none is kept.",
        ("smooth", "untangle", *REPORTS),
        "FIELD|FILE",
        variants={
            "quality": Variant(
                help="Measure shapes in a metric, a symmetric tensor a vertex: a point field of MESH, or a "
                "MEDIT .sol or .solb file."
            ),
            "compare": Variant(
                help="Measure shapes in a metric, a symmetric tensor a vertex: a point field of BEFORE, or a "
                "MEDIT .sol or .solb file."
            ),
        },
        recorded=True,
        panel="Target shapes",
    ),
    Option(
        "straighten",
        SWITCH,
        False,
        "Take curved second-order cells as straight instead of keeping their vertices in place; those "
        "inverted by their curved shape alone are made straight.",
        RUNS,
        recorded=True,
        panel="Target shapes",
    ),
    Option(
        "untangle",
        SWITCH,
        None,
        "Make inverted elements positive first, as dvr untangle does; default: with the default directions "
        "where IN has any. Surfaces in space cannot be untangled.",
        SMOOTH,
        recorded=True,
        shown=False,
        panel="Before and after the sweeps",
    ),
    Option(
        "patches",
        SWITCH,
        None,
        "After the sweeps move the surroundings of the worst elements jointly, worst first, as long as "
        "they gain; default: with the default directions if numba is installed, as it is slow without.",
        SMOOTH,
        recorded=True,
        shown=False,
        panel="Before and after the sweeps",
    ),
    Option(
        "polish",
        SWITCH,
        None,
        "Afterwards raise the mean quality while the quality vector below the level of care does not "
        "decrease; default: with the default directions and no --target.",
        SMOOTH,
        recorded=True,
        shown=False,
        panel="Before and after the sweeps",
    ),
    Option(
        "floor",
        Values(float, 0, 1, must="be a fraction of Q1, from 0 to 1"),
        None,
        "Let --polish lower all but Q1, which stays above this fraction of what was reached; default: no "
        "component of the quality vector below the level of care decreases.",
        SMOOTH,
        "F",
        recorded=True,
        panel="Before and after the sweeps",
    ),
    Option(
        "preset",
        Values(str, names=("paper",)),
        None,
        "The paper's Algorithm 1: random directions, natural order, exactly N sweeps (-n).",
        SMOOTH,
        recorded=True,
        panel="Directions",
    ),
    Option(
        "mesh",
        TEXT,
        None,
        "The mesh to read of a MED file with several.",
        (*RUNS, *REPORTS),
        "NAME",
        panel="Files",
    ),
    Option(
        "input_format",
        TEXT,
        None,
        "Format of the input; default: by its suffix.",
        (*RUNS, *REPORTS),
        "NAME",
        panel="Files",
    ),
    Option(
        "output_format", TEXT, None, "Format of OUT; default: by its suffix.", RUNS, "NAME", panel="Files"
    ),
    Option("json", SWITCH, False, "Print the report as JSON.", REPORTS, panel="Reports"),
    Option(
        "csv",
        SWITCH,
        False,
        "Print the quality vector as CSV: rank, vertex, quality, for each relaxed vertex the worst "
        "quality around it, ascending. Vertices are numbered from 0.",
        ("quality",),
        panel="Reports",
    ),
    Option("worst", COUNT, 10, "List the N worst elements.", ("quality",), "N", panel="Reports"),
    Option(
        "measure",
        Values(str, names=CELL_MEASURES),
        None,
        "Draw the histogram, list the worst elements and colour pictures by this measure instead of the mean "
        f"ratio, and with --csv print its value for each cell: {', '.join(CELL_MEASURES)}.",
        (*RUNS, "quality"),
        "NAME",
        variants=dict.fromkeys(
            RUNS,
            Variant(
                help="Colour pictures and fill --quality-field with this measure instead of the mean ratio: "
                f"{', '.join(CELL_MEASURES)}."
            ),
        ),
        panel="Reports",
    ),
    Option(
        "fail_below",
        TEXTS,
        None,
        "Exit with code 1 if the worst quality is below Q, or the smallest value of a measure below VALUE. "
        "Can be repeated.",
        (*RUNS, "quality"),
        "Q|NAME=VALUE",
        panel="Reports",
    ),
    Option(
        "fail_above",
        TEXTS,
        None,
        "Exit with code 1 if the largest value of a measure is above VALUE. Can be repeated.",
        (*RUNS, "quality"),
        "NAME=VALUE",
        panel="Reports",
    ),
    Option(
        "quiet", SWITCH, False, "Print nothing but errors.", RUNS, flags=("-q", "--quiet"), panel="Reports"
    ),
    Option(
        "verbose",
        SWITCH,
        False,
        "Print a line for each sweep.",
        RELAXING,
        flags=("-v", "--verbose"),
        panel="Reports",
    ),
    # the entry point looks for it among the arguments, as errors of the parser precede any command
    Option("debug", SWITCH, False, "Show the traceback of an error.", (*RUNS, *REPORTS), panel="Reports"),
)
OPTIONS = {option.name: option for option in TABLE}


def default(name: str, command: str = "smooth") -> Any:
    """The default of an option in a command."""
    return OPTIONS[name].of(command).default


def check_fields(options: Any) -> None:
    """Check the fields of a dataclass that are options of the table; raises UsageError."""
    for each in fields(options):
        if each.name in OPTIONS:
            OPTIONS[each.name].check(getattr(options, each.name))


def check_names(given: Iterable[str], known: Iterable[str]) -> None:
    """Raise UsageError, which tells the nearest name, if one that is ``given`` is not ``known``."""
    known = list(known)
    for name in given:
        if name not in known:
            near = get_close_matches(name, known, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise UsageError(f"unknown option {name!r}{hint}")
