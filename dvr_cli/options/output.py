"""The options of files, and of what is printed."""

from __future__ import annotations

from dvr_cli.options.record import (
    COUNT,
    RELAXING,
    REPORTS,
    RUNS,
    SWITCH,
    TEXT,
    TEXTS,
    Option,
    Values,
    Variant,
)

# measures of cells beside the mean ratio, see quality/cell_measures.py
CELL_MEASURES = (
    *("scaled-jacobian", "aspect-ratio", "skewness", "min-angle", "max-angle"),
    *("non-orthogonality", "face-skewness"),
)

OUTPUT = (
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
        (*RUNS, *REPORTS),
        "NAME",
        variants=dict.fromkeys(
            RUNS,
            Variant(
                help="Colour pictures and fill --quality-field with this measure instead of the mean ratio: "
                f"{', '.join(CELL_MEASURES)}."
            ),
        )
        | {
            "compare": Variant(
                help="Judge the meshes by this measure of their cells, the worst first, instead of their "
                f"quality vectors, and colour pictures by it: {', '.join(CELL_MEASURES)}."
            )
        },
        panel="Reports",
    ),
    Option(
        "fail_below",
        TEXTS,
        None,
        "Exit with code 1 if the worst quality is below Q, or the smallest value of a measure below VALUE. "
        "Can be repeated.",
        (*RUNS, *REPORTS),
        "Q|NAME=VALUE",
        variants={
            "compare": Variant(
                help="Exit with code 1 if the worst quality of the last mesh is below Q, or its smallest "
                "value of a measure below VALUE. Can be repeated."
            )
        },
        panel="Reports",
    ),
    Option(
        "fail_above",
        TEXTS,
        None,
        "Exit with code 1 if the largest value of a measure is above VALUE. Can be repeated.",
        (*RUNS, *REPORTS),
        "NAME=VALUE",
        variants={
            "compare": Variant(
                help="Exit with code 1 if the largest value of a measure of the last mesh is above VALUE. "
                "Can be repeated."
            )
        },
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
