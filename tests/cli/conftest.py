"""What the tests of the command line share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import Delaunay

from cli_support import Outcome, write
from dvr_cli.cli.main import main


@pytest.fixture
def dvr(capsys: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    """Run ``dvr`` in this process."""

    def run(*arguments: object) -> Outcome:
        capsys.readouterr()  # what was printed while the meshes were made
        code = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Outcome(code, captured.out, captured.err)

    return run


@pytest.fixture(scope="session")
def cube(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Delaunay mesh of 800 random points in a cube, of some thousand tetrahedra."""
    corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    points = np.concatenate([corners, np.random.default_rng(7).random((800, 3))])
    path = tmp_path_factory.mktemp("cube") / "cube.vtk"
    return write(path, points, {"tetra": Delaunay(points).simplices})
