"""The options that say what a good mesh is, and which phases come before and after the sweeps."""

from __future__ import annotations

from dvr_cli.options.record import REPORTS, RUNS, SMOOTH, SWITCH, TEXT, TEXTS, Option, Values, Variant

PURPOSE = (
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
)
