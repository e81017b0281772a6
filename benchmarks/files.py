"""End to end: the whole process, binary Gmsh 4.1 in and out, against reading and writing alone."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import meshes
from common import contenders, print_table, run_process, times

_SWEEPS = 20

_DVR_COPY = """
import sys
from pathlib import Path
from dvr_cli.files.reading import open_mesh
from dvr_cli.files.writing import Output
source = open_mesh(Path(sys.argv[1]))
Output(source, Path(sys.argv[2])).write(source.mesh.points)
"""
_MESHIO_COPY = """
import sys
import meshio
mesh = meshio.read(sys.argv[1], file_format="gmsh")
meshio.write(sys.argv[2], mesh, file_format=sys.argv[3], binary=True)
"""


def run(quick: bool) -> None:
    """Print the table of whole processes."""
    rows: list[list[object]] = []
    for n in [2_000] if quick else [17_000, 165_000]:  # about 100,000 and a million tetrahedra
        mesh = meshes.raw_tets_along_curve(n)
        tets = mesh.cells[0].vertices
        with tempfile.TemporaryDirectory() as folder:
            source, target = Path(folder) / "in.msh", Path(folder) / "out.msh"
            meshes.write_msh(mesh, source)
            rows += [[len(tets), *row] for row in _rows(source, target)]
    header = ["tetrahedra", "process", "seconds", "against meshio's read and write", "peak MB"]
    print_table(f"Files: {_SWEEPS} random sweeps, binary .msh 4.1", header, rows)


def _rows(source: Path, target: Path) -> list[list[object]]:
    copies: dict[str, list[str | Path]] = {
        "meshio: read .msh, write .msh": [_MESHIO_COPY, source, target, "gmsh"],
        "meshio: read .msh, write .vtk": [_MESHIO_COPY, source, target.with_suffix(".vtk"), "vtk"],
        "dvr: read and write": [_DVR_COPY, source, target],
    }
    commands: dict[str, list[str | Path]] = {
        label: [sys.executable, "-c", *rest] for label, rest in copies.items()
    }
    dvr: list[str | Path] = [sys.executable, "-m", "dvr_cli", "smooth", source, target]
    dvr += ["--no-report", "-q"]
    sweeps: list[str | Path] = ["-d", "random", "-n", str(_SWEEPS), "--tol", "0"]
    for name, threads in contenders():
        label = f"dvr smooth, {name}, {threads} thread{'s' if threads > 1 else ''}"
        commands[label] = [*dvr, *sweeps, "--engine", name, "--threads", str(threads)]
    commands["dvr smooth, default options"] = dvr
    measured = {}
    for label, command in commands.items():
        run_process(command)  # fills the caches of the disk and of compiled code
        measured[label] = run_process(command)
    reference = next(iter(measured.values())).elapsed
    return [
        [label, used.elapsed, times(reference, used.elapsed), used.memory] for label, used in measured.items()
    ]
