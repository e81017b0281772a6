"""Start-up: what the command costs before and beside the work, against an interpreter that does nothing."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from statistics import median

import meshio

import meshes
from common import print_table, processes, times


def run(quick: bool) -> None:
    """Print the table of short processes."""
    runs = 3 if quick else 10
    python = [sys.executable]
    dvr = [sys.executable, "-m", "dvr_cli"]
    numpy = ["-q", "--engine", "numpy", "-d", "random"]
    with tempfile.TemporaryDirectory() as folder:
        tiny = _written(Path(folder) / "tiny.vtk", 100)
        thousand = _written(Path(folder) / "thousand.vtk", 1_000)
        target = Path(folder) / "out.vtk"
        commands: dict[str, list[str | Path]] = {
            "python -c pass": [*python, "-c", "pass"],
            "python -c 'import numpy'": [*python, "-c", "import numpy"],
            "python -c 'import meshio'": [*python, "-c", "import meshio"],
            "dvr --version": [*dvr, "--version"],
            "dvr smooth -d random, 100 vertices, numpy": [*dvr, "smooth", tiny, target, *numpy],
            "dvr smooth -d random, 1,000 vertices, numpy": [*dvr, "smooth", thousand, target, *numpy],
            "dvr smooth, 100 vertices, default options": [*dvr, "smooth", tiny, target, "-q"],
            "dvr smooth, 1,000 vertices, default options": [*dvr, "smooth", thousand, target, "-q"],
        }
        taken = {label: processes(command, runs) for label, command in commands.items()}
    reference = median(taken["python -c pass"])
    rows = [
        [label, 1000 * all_of_it[0], 1000 * median(all_of_it), times(reference, median(all_of_it))]
        for label, all_of_it in taken.items()
    ]
    header = ["process", "least ms", "median ms", "against python -c pass"]
    print_table(f"Start-up: {runs} runs each, tetrahedra in binary .vtk", header, rows)


def _written(path: Path, n: int) -> Path:
    mesh = meshes.raw_tets(n)
    meshio.Mesh(mesh.points, {"tetra": mesh.cells[0].vertices}).write(path, file_format="vtk", binary=True)
    return path
