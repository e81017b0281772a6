"""Meshes that no rank has whole: the bytes and reports of one process, from byte ranges of the file."""

import json
from functools import partial
from pathlib import Path

import meshio
import numpy as np
import pytest
from test_ranks import cases_of, in_one_process, job, without_times
from test_ranks import commands_of as commands_for

from dvr_cli.api.away_from_layers import weights_needed
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.shapes import shaped
from dvr_cli.api.shares import takes
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.cli.main import main
from dvr_cli.files.formats import formats_by_suffix
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import domain_of
from gmsh_session import gmsh_session
from meshes import KINDS, boxes_of, random_mesh, tangled
from ranged_files import (
    DATA,
    FILES,
    LINKS,
    METRIC,
    MIXED,
    NUMBERED,
    PARAMETRIC,
    PLANAR,
    gmsh_22,
    tensors_at,
    write_ranged,
)

SAMPLES = Path(__file__).parents[2] / "sample_meshes"
# name of a mesh, and options
RUNS = (
    ("positive", "-d axis,optimal,narrowing -n 6 --shape ideal --keep-height --seed 7"),
    ("positive", "-d random,steepest -n 3"),
    ("22.msh", "-d random -n 60 --tol 1e-3"),  # converged, with what limits it
    ("41.msh", "-d random,steepest -n 2 --tol 0"),
    ("inside-out", "-d random -n 2 --tol 0"),
    ("older", "-d random -n 2 --tol 0"),
    ("positive", "-d random -n 9 --target 0.3"),
    ("orphans", "-d random -n 2 --tol 0"),
    ("hull", "-d random -n 30"),  # the worst is on the boundary
    ("raw.vtu", "-d random -n 2 --tol 0"),
    ("positive", "-d random -n 2 --no-report"),
    ("positive", "--no-patches -n 6"),
    ("41.msh", "--no-patches -n 4 --target 0.5"),
    ("positive", "--no-patches -n 2"),  # descent, sweeps with a level of care, polishing
    ("positive", "-d random -n 2 --polish --floor 0.9"),
    ("positive", "--patches -n 5"),
    ("41.msh", "--patches -n 3 --target 0.5"),
    ("22.msh", "-d random -n 2 --patches"),
    ("positive", "-n 3 --time-limit 3600"),  # the clocks of other ranks are ahead
    ("positive", "--time-limit 1e-9"),
    *((kind, "-d random,steepest,optimal -n 3 --tol 0") for kind in KINDS if kind not in ("tetra", "quad")),
    ("quad", "-n 4"),
    ("mixed3d", "-n 3"),
    ("triangle", "-n 4 --patches"),
    ("hexahedron", "-n 3 --patches"),
    ("5.1-planar.vtk", "-d axis -n 3"),
    ("hexahedron inside-out", "-n 3 --no-patches"),
    ("mixed3d both-ways", "-d random -n 30 --tol 1e-3"),
    ("quad inside-out", "-d random -n 3"),
    ("quad layered", "-n 3"),
    ("hexahedron layered", "-n 2 --boundary slide"),
    ("tetra layered both-ways", "-d random -n 3"),
    ("triangle layered", "-n 2"),
    ("quad layered tangled both-ways", "-n 2 --boundary slide"),
    ("quad layered beside", "-n 3 --patches"),  # made again with weights
    ("quad layered beside", "-n 3 --boundary slide"),
    ("hexahedron layered beside", "-d random -n 3"),  # and once more with others
    ("hexahedron layered beside", "-n 2 --patches"),
    ("triangle layered tangled", "-n 2 --patches"),  # cells that are kept move with inverted ones
    ("tetra layered tangled", "-n 2 --patches"),
    ("hexahedron layered tangled", "-n 2 --no-patches"),
    ("tetra layered tangled both-ways", "-d random -n 30 --tol 1e-3 --boundary slide"),
    ("hexahedron", "--shape input -n 3 --patches"),
    ("triangle", "--shape input -d random -n 40 --tol 1e-3"),
    ("tetra tangled", "--shape input -n 2 --patches"),
    ("tetra", "--metric metric -n 3 --patches"),
    ("hexahedron", "--metric metric -d random,steepest,optimal -n 3 --tol 0 --boundary slide"),
    ("triangle", "--metric metric -d random -n 40 --tol 1e-3 --keep-height"),
    ("quad upright", "--metric metric -n 3 --no-patches"),
    ("mixed3d both-ways", "--metric metric -n 2"),
    ("tetra tangled", "--metric metric -n 2 --patches"),
    ("quad layered", "--metric metric -n 2 --polish"),
    ("raw-data.vtu", "--metric metric -d random -n 2"),
    *((name, "--metric metric -n 3 --patches") for name in METRIC),
    ("41-metric.msh", "--metric metric --boundary slide -d random -n 40 --tol 1e-3"),
    ("tetra real", "-n 3"),
    ("triangle real", "--boundary slide --fix 1 -d random -n 3"),
    ("41-links.msh", "-n 3"),
    ("41-links.msh", "--boundary slide -d random -n 40 --tol 1e-3"),
    ("22-links.msh", "--fix left -d random -n 3"),
    ("partitions.msh", "-n 3"),
    ("hexahedron layered sheet", "-d random -n 30 --tol 1e-3 --patches"),
    ("tetra tangled", "-n 2"),
    ("triangle tangled", "-n 2 --patches"),
    ("hexahedron tangled inside-out", "-n 2"),
    ("tetra tangled both-ways", "-n 2 --boundary slide"),
    ("triangle tangled both-ways crossing", "-n 2"),
    ("tetra tangled crossing", "-n 2"),
    ("quad tangled hopeless", "-n 2"),
    ("tetra tangled hopeless", "-d random -n 30 --tol 1e-3"),  # nobody untangles it
    ("quad tangled", "-d random -n 2 --untangle"),
    ("triangle both-ways", "-d random -n 2 --untangle"),
    ("mixed2d upright", "-d random,y -n 40 --tol 1e-3 --boundary slide"),
    ("quad across", "-n 3 --patches"),
    ("tetra both-ways", "-n 3 --boundary slide"),
    ("triangle both-ways", "-n 3"),
    ("hexahedron both-ways", "-n 2 --patches"),
    *((name, "-n 3") for name in (*MIXED, *PLANAR, *DATA, *NUMBERED, *PARAMETRIC)),
    ("partitions.msh", "--boundary slide -d random -n 3"),
    ("41-gaps.msh", "--boundary slide --fix 1 -d random -n 40 --tol 1e-3"),
    ("22-order.msh", "--regions left -d random -n 3"),
    ("5.1-data.vtk", "-d random -n 2 --regions part --fix 1"),
    ("41-data.msh", "-d random -n 2 --only 7"),
    ("41.msh", "--boundary slide -n 3"),
    ("positive", "--boundary slide -d random -n 3 --tol 0"),
    ("positive", "--boundary slide -n 4 --patches"),
    ("22-mixed.msh", "--boundary slide -n 3"),
    ("quad", "--boundary slide -n 3 --patches"),
    ("hull", "--boundary slide -n 3"),
    ("41-planar.msh", "--boundary slide -d random,x -n 4 --target 0.9"),
    ("hexahedron", "--boundary slide -d steepest -n 3 --polish"),
    ("41.msh", "--regions none -n 3"),
    ("22.msh", "--regions left --boundary slide -n 3"),  # the name of one half
    ("22.msh", "--regions gmsh:geometrical -d random -n 3"),
    ("22.msh", "--fix left -d random -n 3"),
    ("41.msh", "--only 4 --fix 1 -d random -n 60 --tol 1e-3"),
    ("positive", "--below 0.4 --layers 1 -d random -n 3"),
    ("positive", "--below 0.3 --layers 99 -n 3"),
    ("mixed3d", "--below 0.6 -d random -n 40 --tol 1e-3 --boundary slide"),
    ("41.msh", "--regions none --fix triangle --boundary slide -n 3"),
    ("hull", "--fix tetra -n 3"),  # nothing can move
)
# ranks, and one run in so many, where tests may take long
OTHERS = ((1, 6), (2, 4), (3, 3), (4, 2), (8, 4))
COMPILED = ((2, 3), (3, 1), (8, 6))  # the same with the compiled engine
CASES = cases_of((3, 16, "numpy"), OTHERS, COMPILED)


def ranges_of(path):
    return formats_by_suffix(path)[0].ranges_of(path)


def write(folder, name):
    """The file of a mesh, binary VTK with coordinates in 64 bits."""
    if name == "hull":
        return SAMPLES / "random_cube.vtk"
    if name == "partitions.msh":
        return partitioned(folder / name)
    if name in (*FILES, *MIXED, *PLANAR, *DATA, *LINKS, *NUMBERED, *PARAMETRIC, *METRIC):
        return write_ranged(folder, name)
    kind, *how = name.split()
    if kind in KINDS:
        mesh = random_mesh(kind, 1, n=4, noise=0.25)
        if "tangled" in how:
            mesh = tangled(kind, 5, 0.7, 1)
        if "layered" in how:
            mesh = layered(kind, "sheet" in how, 0.9 if "tangled" in how else 0.25, "beside" in how)
        if "crossing" in how:  # of the boundary, a vertex of which is on the other side
            mesh.points[2] += [0.1, 1.0, 0.1][: mesh.points.shape[1]]
        if "hopeless" in how:
            mesh.points[0] += 1.2
        points = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.points.shape[1])))
        axes = {"upright": [2, 0, 1], "across": [1, 2, 0]}.get(" ".join(how), [0, 1, 2])
        points = points[:, axes]  # of a plane in which the first coordinate is the same, or the second
        step = 1 if "inside-out" in how else 3 if "both-ways" in how else 0
        cells = []
        for block in mesh.cells:
            rows = block.vertices.copy()
            if step:
                rows[::step] = rows[::step, CELL_TYPES[block.type].mirror]
            cells.append((block.type, rows))
        path = folder / f"{'-'.join([kind, *how])}.vtk"
        fields = {"metric": tensors_at(points)}
        if "indefinite" in how:
            fields["metric"][-1, 0] = -1.0
        data = {}
        if "real" in how:  # whole numbers, which are tags, and others, and one too large for 64 bits
            part = [np.rint(3.0 * points[rows].mean(axis=1)[:, 0]) for _, rows in cells]
            data = {"material": part, "region": [values / 2.0 for values in part]}
        if "large" in how:
            data["material"][0][:9] = 1e19
        meshio.Mesh(points, cells, fields, data).write(path, file_format="vtk", binary=True)
        return path
    mesh = random_mesh("tetra", 1, n=5, noise=0.25)
    points, cells = mesh.points, mesh.cells[0].vertices
    if name == "inside-out":
        cells = cells[:, [1, 0, 2, 3]]
    if name == "orphans":
        points = np.concatenate([[[9.0, 9.0, 9.0]], points, [[-1.0, 0.5, 0.5]]])
        cells = cells + 1
    path = folder / f"{name}.vtk"
    version = {"older": "vtk42"}.get(name, "vtk")
    meshio.Mesh(points, [("tetra", cells)]).write(path, file_format=version, binary=True)
    return path


def partitioned(path):
    """A box that Gmsh has meshed, and cut into partitions with facets between them: nodes are out of order.

    Those on its boundary have parameters.
    It is written once, as the order of some of it is not always the same.
    """
    if path.exists():
        return path
    with gmsh_session() as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [1], 4, "solid")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.35)
        gmsh.option.setNumber("Mesh.PartitionCreateTopology", 1)
        gmsh.option.setNumber("Mesh.PartitionCreateGhostCells", 1)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.partition(3)
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.option.setNumber("Mesh.SaveParametric", 1)
        gmsh.write(str(path))
    return path


def layered(kind, sheet, noise, beside=False):
    """Boxes, flat ones in four rows near the floor or, higher up, in a single one, shaken above.

    beside: only where they touch the flat ones.
    """
    mesh = boxes_of(kind, 8)
    height = mesh.points[:, -1].copy()
    rows = np.rint(height * 8).astype(int)
    levels = np.array([0.0, 0.01, 0.02, 0.03, 0.04, 0.28, 0.52, 0.76, 1.0])
    mesh.points[:, -1] = levels[rows]
    inner = ((mesh.points > 1e-9) & (mesh.points < 1 - 1e-9)).all(axis=1) & (rows > 4)
    inner &= (rows == 5) | (not beside)
    shake = np.random.default_rng(1).uniform(-noise / 8, noise / 8, mesh.points.shape)
    mesh.points[inner] += shake[inner]
    if sheet:
        levels[:5] = 0.0, 0.08, 0.16, 0.165, 0.24
        mesh.points[rows < 5, -1] = levels[rows[rows < 5]]
    return mesh


def write_apart(folder, name):
    """The same in a folder of its own, as outputs have numbers, too."""
    inputs = folder / "inputs"
    inputs.mkdir(exist_ok=True)
    return write(inputs, name)


commands_of = partial(commands_for, write=write_apart)


@pytest.mark.parametrize(("ranks", "every", "engine"), CASES)
def test_the_bytes_and_reports_are_those_of_one_process(tmp_path, on_ranks, ranks, every, engine):
    """In the usual run of the tests one run in so many."""
    runs, reasons = RUNS[::every], set()
    alone, together = tmp_path / "alone", tmp_path / "together"
    alone.mkdir()
    together.mkdir()
    assert set(in_one_process(alone, commands_of(alone, runs, engine=engine))) == {0}
    commands = commands_of(alone, runs, "--mpi", engine=engine)
    done, ends = job(on_ranks, ranks, together, commands, "in shares")
    assert (done.returncode, done.stderr) == (0, "")
    assert set(ends) == {0}
    for i, run in enumerate(runs):
        (here,), (there,) = (list(folder.glob(f"{i}.[mv]*")) for folder in (together, alone))
        assert here.read_bytes() == there.read_bytes(), run
        if "--no-report" not in run[1]:
            reports = [(folder / f"{i}.quality.json").read_bytes() for folder in (together, alone)]
            assert without_times(reports[0]) == without_times(reports[1]), run
            reasons.add(json.loads(reports[1])["stopped_because"])
    assert {"max-iterations", "target"} <= reasons
    assert "converged" in reasons or every > 1


@pytest.mark.parametrize(
    ("kind", "directions", "runs"), [("quad", "steepest,random", 2), ("hexahedron", "random", 3)]
)
def test_some_meshes_with_layers_need_weights(monkeypatch, kind, directions, runs):
    found = []

    def spy(*arguments):
        found.append(weights_needed(*arguments))
        return found[-1]

    monkeypatch.setattr("dvr_cli.api.away_from_layers.weights_needed", spy)
    options = {"directions": directions, "max_iterations": 3, "patches": False, "engine": "numpy"}
    smooth_mesh(layered(kind, False, 0.25, beside=True), SmoothOptions.of(options))
    assert [weight is None for weight in found] == [False] * (runs - 1) + [True]


@pytest.mark.parametrize("kind", ["triangle", "tetra"])
def test_in_some_meshes_cells_that_are_kept_can_move(kind):
    mesh = layered(kind, False, 0.9)
    shapes = shaped(domain_of(mesh), "auto")
    corners = shapes.plain.corners.vertices[np.repeat(shapes.kept_cells, np.diff(shapes.plain.corners.start))]
    assert shapes.held[corners].any()
    assert not shapes.held[corners].all()


def test_what_is_tangled_goes_to_one_rank_and_no_more(tmp_path, on_ranks):
    mesh, path = boxes_of("triangle", 30), tmp_path / "corner.vtk"
    mesh.points += np.random.default_rng(1).uniform(-0.004, 0.004, mesh.points.shape)
    mesh.points[np.abs(mesh.points - 2 / 30).sum(axis=1).argmin()] += [0.05, 0.02]  # near a corner
    meshio.Mesh(np.pad(mesh.points, ((0, 0), (0, 1))), [("triangle", mesh.cells[0].vertices)]).write(path)
    command = ["smooth", str(path), "out.vtk", "-n", "1", "--no-patches", "--engine", "numpy", "--quiet"]
    (tmp_path / "alone").mkdir()
    assert in_one_process(tmp_path / "alone", [command]) == [0]
    done, ends = job(on_ranks, 3, tmp_path, [[*command, "--mpi"]], "in shares", "in part")
    assert (done.stderr, ends) == ("", [0])
    assert (tmp_path / "out.vtk").read_bytes() == (tmp_path / "alone" / "out.vtk").read_bytes()
    report = json.loads((tmp_path / "out.quality.json").read_text())
    assert report["before"]["inverted"] > report["after"]["inverted"] == 0


@pytest.mark.long
def test_what_is_unusual_has_the_result_of_one_process(tmp_path, on_ranks):
    """A mesh that is flat as a whole, one with a cell twice, one with huge tags: a rank has them whole.

    Of Gmsh's files one with a triangle twice, as for each of its groups.
    """
    tall = random_mesh("tetra", 1, n=5, noise=0.1)
    flat = tall.points * [1.0, 1.0, 0.02]
    plain = random_mesh("tetra", 1, n=3, noise=0.1)
    twice = np.concatenate([plain.cells[0].vertices, plain.cells[0].vertices[:1]])
    meshes = {"layers": (flat, tall.cells[0].vertices), "twice": (plain.points, twice)}
    commands = []
    for name, (points, cells) in meshes.items():
        meshio.Mesh(points, [("tetra", cells)]).write(tmp_path / f"{name}.vtk")
        commands.append(
            ["smooth", str(tmp_path / f"{name}.vtk"), f"{name}-out.vtk", "-d", "random", "-n", "2"]
        )
        commands[-1] += ["--engine", "numpy", "--quiet"]
    commands.append(["smooth", str(write(tmp_path, "tetra real large")), "large-out.vtk", *commands[-1][3:]])
    (tmp_path / "groups.msh").write_bytes(gmsh_22(plain, again="triangle"))
    (tmp_path / "volumes.msh").write_bytes(gmsh_22(plain, again="tetra"))
    for name in "groups", "volumes":
        commands.append(["smooth", str(tmp_path / f"{name}.msh"), f"{name}-out.msh", *commands[-1][3:]])
    done, ends = job(on_ranks, 3, tmp_path, [[*command, "--mpi"] for command in commands])
    assert (done.stderr, ends) == ("", [0] * 5)
    (tmp_path / "alone").mkdir()
    assert in_one_process(tmp_path / "alone", commands) == ends
    for path in (tmp_path / "alone").iterdir():
        here = (tmp_path / path.name).read_bytes()
        assert without_times(here) == without_times(path.read_bytes()), path.name
    kept = json.loads((tmp_path / "layers-out.quality.json").read_text())["shape"]["kept"]
    assert kept > 0


def test_a_mesh_is_replaced_by_its_result_even_if_that_is_not_good_enough(tmp_path, on_ranks, capsys):
    path = write(tmp_path, "positive")
    before = path.read_bytes()
    words = ["-d", "random", "-n", "2", "--engine", "numpy", "--quiet", "--no-report", "--fail-below", "0.9"]
    assert main(["smooth", str(path), str(tmp_path / "expected.vtk"), *words]) == 1
    said = capsys.readouterr().err
    done, ends = job(on_ranks, 2, tmp_path, [["smooth", path.name, path.name, *words, "--mpi"]], "in shares")
    assert (ends, done.stderr) == ([1], said)
    assert "0.9" in said
    assert before != path.read_bytes() == (tmp_path / "expected.vtk").read_bytes()


def test_a_damaged_file_is_one_line(tmp_path, on_ranks):
    """Cells that name no vertex, an offset that is wrong, a file that ends too soon."""
    path = write(tmp_path, "positive")
    whole, (part,) = path.read_bytes(), dict(ranges_of(path).cells)["tetra"].parts
    cells = part.rows
    number = bytearray(whole)
    number[cells.offset(20) : cells.offset(20) + 8] = (10**6).to_bytes(8, "big")
    offset = bytearray(whole)
    start = part.sure[1].rows.offset(5)
    offset[start : start + 8] = (3).to_bytes(8, "big")
    damaged = {"number.vtk": bytes(number), "offset.vtk": bytes(offset), "end.vtk": whole[:-30]}
    damaged |= damaged_files(tmp_path)
    for name, data in damaged.items():
        (tmp_path / name).write_bytes(data)
    words = ["-d", "random", "--engine", "numpy", "--mpi"]
    commands = [["smooth", name, f"out{Path(name).suffix}", *words] for name in damaged]
    done, ends = job(on_ranks, 3, tmp_path, commands)
    assert ends == [3] * len(damaged)
    lines = zip(damaged, done.stderr.splitlines(), strict=True)
    assert [f" {name}: " in line for name, line in lines] == [True] * len(damaged)
    assert not list(tmp_path.glob("out*"))


@pytest.mark.long
def test_what_a_file_cannot_keep_is_a_note(tmp_path, on_ranks, capsys):
    """The nodes of one of two blocks lose their parameters."""
    path = write(tmp_path, "41-parametric.msh")
    command = ["smooth", path.name, "out.msh", "-n", "2", "--engine", "numpy", "--no-report"]
    assert in_one_process(tmp_path, [command]) == [0]
    expected = [line for line in capsys.readouterr().err.splitlines() if "note: out.msh" in line]
    done, ends = job(on_ranks, 3, tmp_path, [[*command, "--mpi"]], "in shares")
    assert ends == [0]
    assert [line for line in done.stderr.splitlines() if "note: out.msh" in line] == expected
    assert "60 nodes" in expected[0]


@pytest.mark.long
def test_what_is_no_metric_is_one_line(tmp_path, on_ranks, capsys):
    path = write(tmp_path, "tetra indefinite")
    words = ["--engine", "numpy", "--quiet"]
    commands = [["smooth", path.name, "out.vtk", "--metric", name, *words] for name in ("metric", "size")]
    expected = in_one_process(tmp_path, commands)
    said = capsys.readouterr().err
    done, ends = job(on_ranks, 3, tmp_path, [[*command, "--mpi"] for command in commands])
    assert (ends, done.stderr) == (expected, said)
    assert expected == [3, 2]
    assert not list(tmp_path.glob("out*"))


def damaged_files(folder):
    """Files that look whole at first: a number in the middle of an array is wrong, or the end is cut off."""
    found = {}
    for name in "41.msh", "41-gaps.msh", "22.msh", "raw.vtu":
        path = write_ranged(folder, name)
        whole, ranges = path.read_bytes(), ranges_of(path)
        cells = dict(ranges.cells)["tetra"].parts[0].rows
        size = np.dtype(cells.dtype).itemsize
        at = cells.offset(9) + (cells.columns - 1) * size
        found[f"number-{name}"] = whole[:at] + (10**6).to_bytes(size, "little") + whole[at + size :]
        found[f"cut-{name}"] = whole[:-40]
    at = ranges_of(folder / "41.msh").numbers.parts[1].rows.offset(3)
    whole = (folder / "41.msh").read_bytes()
    found["tag-41.msh"] = whole[:at] + bytes(8) + whole[at + 8 :]
    return found


@pytest.mark.parametrize(
    "fault", ["a full disk", "a rank fails to send", pytest.param("interrupted", marks=pytest.mark.long)]
)
def test_a_job_that_ends_early_leaves_nothing_half_written(tmp_path, on_ranks, fault):
    runs = [("positive", "-d random -n 9 --tol 0")]
    command = [word for word in commands_of(tmp_path, runs, "--mpi")[0] if word != "--quiet"]
    before = {path.name for path in tmp_path.iterdir()}
    done, ends = job(on_ranks, 3, tmp_path, [command], "in shares", fault)
    new = {path.name for path in tmp_path.iterdir()} - before - {"codes.json", "commands.json"}
    if fault == "interrupted":
        assert ends == [130]
        report = json.loads((tmp_path / "0.quality.json").read_text())
        assert (report["stopped_because"], len(report["sweeps"])) == ("interrupted", 1)
        assert new == {"0.vtk", "0.quality.json"}
        return
    assert new == set()
    if fault == "a full disk":
        assert ends == [4]
        assert done.stderr.splitlines()[-1].startswith("dvr: error: 0.vtk: ")
    else:
        assert (done.returncode != 0, ends) == (True, None)
        assert "dvr: internal error on rank 2: MemoryError: nothing left" in done.stderr


def test_runs_that_need_the_whole_mesh_are_not_taken():
    assert takes(SmoothOptions(directions="random,steepest"))
    assert takes(SmoothOptions(patches=False))
    assert takes(SmoothOptions(patches=True))
    assert takes(SmoothOptions(directions="random", polish=True, floor=0.9))
    assert takes(SmoothOptions(boundary="slide"))
    assert takes(SmoothOptions(shape="input"))
    assert takes(SmoothOptions(metric="field"))
    assert takes(SmoothOptions(metric=np.ones((3, 3, 3))))
    assert takes(SmoothOptions(fix="a", only="b", below=0.3, vertices=[1], regions="none"))
    others = [{"directions": "radial"}, {"boundary": "project"}]
    others += [{"regions": np.zeros(3, dtype=int)}]
    others += [{"order": "natural"}]
    for other in others:
        assert not takes(SmoothOptions(**{"directions": "random"} | other)), other
