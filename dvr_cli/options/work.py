"""The options that say what computes, and what a run writes beside the mesh."""

from __future__ import annotations

from dvr_cli.options.record import FILE, POSITIVE_COUNT, RELAXING, REPORTS, RUNS, SWITCH, Option, Values

WORK = (
    Option(
        "engine",
        Values(str, names=("auto", "numpy", "numba")),
        "auto",
        "What computes; the result is the same. auto takes numba if it is installed (dvr-cli[fast]) and "
        "pays; where needed a process of its own compiles it meanwhile.",
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
)
