"""The options that say which vertices may move, and where to."""

from __future__ import annotations

from dvr_cli.options.record import (
    COUNT,
    FILE,
    QUALITY,
    RELAXING,
    SMOOTH,
    SWITCH,
    TEXTS,
    Option,
    Values,
    Variant,
)

FREEDOM = (
    Option(
        "boundary",
        Values(str, names=("fixed", "slide", "project")),
        "fixed",
        "Whether vertices of the boundary, of interfaces and of embedded cells stay, slide along straight"
        " lines and planes, so that every region and group keeps its shape, or move along curved ones "
        "too, on those of IN. Vertices of surfaces in space always do.",
        ("smooth", "untangle"),
        recorded=True,
        panel="Boundary and regions",
    ),
    Option(
        "feature_angle",
        Values(float, 0, 180, must="be between 0 and 180 degrees"),
        30.0,
        "Where a curved boundary turns by more than this it is a feature: its vertices stay on the "
        "feature's curve, those of its corners in place.",
        ("smooth", "untangle"),
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
        ("smooth", "untangle"),
        "D",
        recorded=True,
        panel="Boundary and regions",
    ),
    Option(
        "geometry",
        FILE,
        None,
        "The CAD model that IN, a Gmsh file of version 4, was made of (.step, .brep or .geo): vertices that "
        "move on its curves and surfaces end there, with the right parameters (needs dvr-cli[cad]).",
        SMOOTH,
        "FILE",
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
        "keep_height",
        SWITCH,
        None,
        "Take no element below the smallest altitude of the input, which explicit time steps follow; "
        "default: with the default directions and no --metric.",
        RELAXING,
        variants={
            "morph": Variant(
                help="Take no element below the smallest altitude that a step begins with, which explicit "
                "time steps follow."
            )
        },
        recorded=True,
        shown=False,
        panel="Selection",
    ),
)
