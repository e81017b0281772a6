"""The functions of ``import dvr_cli``: arrays or a mesh of a known library in, and the same out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dvr_cli.api.measuring import compare_meshes, mesh_quality
from dvr_cli.api.metric import metric_source
from dvr_cli.api.options import Names, SmoothOptions, check_known
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.errors import UsageError
from dvr_cli.options import check_names, default
from dvr_cli.report.records import QualityReport, SmoothReport

if TYPE_CHECKING:
    from dvr_cli.api.adapters.registry import CellArrays
    from dvr_cli.report.compare import Comparison


def smooth(
    mesh: Any,
    cells: CellArrays = None,
    **options: Any,
) -> tuple[Any, SmoothReport]:
    """Improve a mesh by directional vertex relaxation (the paper's Algorithm 1).

    mesh: a ``meshio.Mesh``, ``pyvista.UnstructuredGrid`` or ``PolyData``, ``trimesh.Trimesh`` or mesh of
        scikit-fem; or points (N, 2) or (N, 3) with ``cells`` as {type: (n, k) int}, pairs of these, or one
        array (types and node order as in meshio). The input is not altered.
    options: by name those of ``dvr smooth --help``; see SmoothOptions, Selection and Stopping.

    Returns (mesh, report): a new mesh of the same class with the same cells and data, or the new points
    (N, 2|3), and a report with the same figures as the command's. Q1 never decreases.
    Raises UsageError for wrong options, InputError for meshes that cannot be relaxed.

    >>> import numpy as np, dvr_cli
    >>> points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.8, 0.9]])
    >>> triangles = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    >>> moved, report = dvr_cli.smooth(points, {"triangle": triangles}, directions="axis")
    >>> moved[4].round(3).tolist()
    [0.5, 0.5]
    """
    check_known(options)
    return _smooth(mesh, cells, SmoothOptions.of(options))


# the options of ``untangle``
_UNTANGLE = (
    *("boundary", "feature_angle", "fix", "max_deviation", "metric"),
    *("regions", "shape", "straighten", "time_limit"),
)


def untangle(
    mesh: Any,
    cells: CellArrays = None,
    **options: Any,
) -> tuple[Any, SmoothReport]:
    """Make inverted and degenerate elements positive where the held vertices allow it, and no more.

    mesh, cells, and what is returned and raised: as for ``smooth``, whose ``untangle`` does the same before
    relaxing. Only vertices near inverted elements move; the result never has more inverted elements than the
    input, and a mesh without any comes back as it is. options: boundary, feature_angle, fix, max_deviation,
    metric, regions, shape, straighten, time_limit.

    >>> import numpy as np, dvr_cli
    >>> points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [1.5, 0.9]])
    >>> triangles = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    >>> moved, report = dvr_cli.untangle(points, {"triangle": triangles})
    >>> report.before.inverted, report.after.inverted
    (1, 0)
    """
    check_names(options, _UNTANGLE)
    given = {"shape": default("shape", "untangle"), **options}
    return _smooth(mesh, cells, SmoothOptions.of(given, untangle=True, max_iterations=0))


def _smooth(
    mesh: Any,
    cells: CellArrays,
    options: SmoothOptions,
) -> tuple[Any, SmoothReport]:
    """Points or mesh, as they were handed over, and the report."""
    from dvr_cli.api.adapters.registry import as_mesh, with_points  # the command has meshes of its own

    points, report = smooth_mesh(as_mesh(mesh, cells), options)
    return with_points(mesh, points), report


def quality_report(
    mesh: Any,
    cells: CellArrays = None,
    *,
    worst: int = 10,
    regions: Names | np.ndarray = (),
    metric: str | Path | np.ndarray | None = None,
) -> QualityReport:
    """The quality of a mesh, as ``dvr report quality`` gives it.

    mesh, cells: as for ``smooth``. worst: how many of the worst elements to list.
    regions, metric: as for ``smooth``.
    Raises InputError for meshes without elements whose quality is defined.
    """
    from dvr_cli.api.adapters.registry import as_mesh

    options = SmoothOptions(regions=regions, metric=metric)
    return mesh_quality(as_mesh(mesh, cells), worst, options.region_choice, options.metric_source)


def compare(before: Any, *after: Any, metric: str | Path | np.ndarray | None = None) -> Comparison:
    """Rank meshes of one connectivity in the paper's ordering of quality vectors (eq. 2).

    metric: as for ``smooth``, of the first.
    Raises UsageError for one mesh alone, InputError when their cells differ.
    """
    from dvr_cli.api.adapters.registry import as_mesh

    if not after:
        raise UsageError("compare: two or more meshes are needed")
    meshes = [as_mesh(mesh, None) for mesh in (before, *after)]
    return compare_meshes(meshes, metric_source(metric))
