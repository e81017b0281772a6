"""The compiled engine gives the same bytes as the NumPy engine, on any number of threads."""

import itertools
import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dvr_cli
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.backend import COMPILED
from dvr_cli.errors import UsageError
from dvr_cli.files.reading import open_mesh
from dvr_cli.kept import may_be_kept
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.relax.directions import direction_field
from dvr_cli.relax.engines import choice
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from dvr_cli.relax.polish import Aim
from dvr_cli.relax.problem import build_problem
from dvr_cli.relax.schedule import ORDERS
from dvr_cli.relax.steepest import OPTIMAL, STEEPEST
from dvr_cli.relax.stopping import Stopping
from dvr_cli.relax.sweeps import relax
from meshes import KINDS, delaunay, hexagon, random_freedom, random_mesh
from needs import require

require("numba")

from dvr_cli.relax.engines import numba_engine  # noqa: E402
from dvr_cli.relax.engines.numba_engine import NumbaEngine  # noqa: E402

SAMPLES = sorted(
    path
    for path in (Path(__file__).parents[3] / "sample_meshes").iterdir()
    if path.suffix in (".msh", ".vtk", ".vtu", ".obj")
)
DIRECTIONS = ("random", "axis", "circumferential", "radial", "random,x,radial", "steepest,random", "optimal")


@pytest.fixture(autouse=True)
def threads_however_small_the_mesh(monkeypatch):
    monkeypatch.setattr(numba_engine, "_LEAST", 1)
    monkeypatch.setattr("dvr_cli.relax.engines.engine._LONG_PART", 1)


def result(mesh, engine, sweeps=4, threads=1, straighten=False, **options):
    """Coordinates, and Q1 and moved vertices of each sweep."""
    stopping = Stopping(max_iterations=sweeps, tol=0.0)
    options = SmoothOptions(
        engine=engine, threads=threads, straighten=straighten, stopping=stopping, **options
    )
    points, report = smooth_mesh(mesh, options)
    assert (report.engine, report.threads) == (engine, threads if engine == "numba" else 1)
    return points.tobytes(), [(sweep["q1"], sweep["moved"]) for sweep in report.sweeps]


# an order sorts vertices of corners of any type, so each type goes with one order, and each order with three
@pytest.mark.parametrize(("kind", "order"), [*zip(KINDS, itertools.cycle(ORDERS), strict=False)])
def test_same_bytes_for_every_element_type_and_order(kind, order):
    mesh = random_mesh(kind, 1)
    assert result(mesh, "numba", order=order) == result(mesh, "numpy", order=order)


@pytest.mark.parametrize("directions", DIRECTIONS)
@pytest.mark.parametrize("kind", ["triangle", "mixed3d"])
def test_same_bytes_for_every_kind_of_direction(kind, directions):
    mesh = random_mesh(kind, 2)
    assert result(mesh, "numba", directions=directions) == result(mesh, "numpy", directions=directions)


@pytest.mark.parametrize("kind", ["triangle", "mixed3d"])
def test_same_bytes_on_any_number_of_threads(kind):
    mesh = random_mesh(kind, 3, n=4)
    expected = result(mesh, "numpy")
    for threads in (1, 2, 3, 7):
        assert result(mesh, "numba", threads=threads) == expected, threads


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.name)
def test_same_bytes_on_the_sample_meshes(path):
    mesh = open_mesh(path).mesh
    assert result(mesh, "numba", threads=2, sweeps=2) == result(mesh, "numpy", sweeps=2)


@pytest.mark.parametrize("examples", [5, pytest.param(60, marks=pytest.mark.long)])
def test_same_bytes_whatever_the_mesh(examples):
    """Tangled meshes and extreme scales included."""

    @settings(max_examples=examples, deadline=None)
    @given(st.sampled_from(KINDS), st.integers(0, 10**6), st.floats(0, 0.6), st.integers(-30, 30))
    def check(kind, seed, noise, scale):
        mesh = random_mesh(kind, seed, noise=noise)
        scaled = Mesh(mesh.points * 2.0**scale, mesh.cells)
        assert result(scaled, "numba", seed=seed) == result(scaled, "numpy", seed=seed)

    check()


@pytest.mark.parametrize("examples", [8, pytest.param(60, marks=pytest.mark.long)])
def test_same_bytes_where_directions_follow_the_ring(examples):
    """Steepest ascent, the optimum and polishing, with and without restricted freedom."""

    @settings(max_examples=examples, deadline=None)
    @given(
        st.sampled_from(KINDS),
        st.integers(0, 10**6),
        st.floats(0, 0.9),
        st.integers(-30, 30),
        st.booleans(),
        st.sampled_from([1, 3]),
    )
    def check(kind, seed, noise, scale, whole, threads):
        same_where_directions_follow_the_ring(kind, seed, noise, scale, whole, threads)

    check()


def same_where_directions_follow_the_ring(kind, seed, noise, scale, whole, threads):
    mesh = random_mesh(kind, seed, n=2, noise=noise)
    mesh = Mesh(mesh.points * 2.0**scale, mesh.cells)
    domain = domain_of(mesh)
    freedom = None if whole else random_freedom(domain, seed)
    relaxed = np.flatnonzero(domain.interior)
    problem = build_problem(domain.corners, relaxed, domain.points, freedom=freedom)
    directions = np.random.default_rng(seed).normal(size=(len(relaxed), domain.dimension))
    reached = []
    for engine in (NumpyEngine(problem), NumbaEngine(problem, threads)):
        engine.load(domain.points)
        moved = [engine.move_batch(b, how) for how in (STEEPEST, OPTIMAL) for b in range(engine.batches)]
        q1 = engine.q1()
        limit = 1.01 * q1 ** (-1 if domain.dimension == 2 else -3) if q1 > 0 else np.inf
        for batch in range(engine.batches):
            moved.append(engine.polish_batch(batch, limit))
        level, active = float(np.median(engine.qualities())), np.arange(len(relaxed)) % 3 > 0
        for aim in (Aim(max(level, 0.0), relative=True), Aim(max(level, 0.0), by_ring=True)):
            for batch in range(engine.batches):
                moved.append(engine.polish_batch(batch, limit, aim, active))
                moved.append(engine.move_batch(batch, STEEPEST, active, 1.2 * limit))
                moved.append(engine.move_batch(batch, directions, active, 1.2 * limit))
        moved.append(engine.ring_qualities().tobytes())
        reached.append((engine.points.tobytes(), moved))
    assert reached[0] == reached[1]


@pytest.mark.parametrize("kind", ["triangle", "tetra"])
def test_same_bytes_and_report_of_all_phases(kind):
    mesh = random_mesh(kind, 4, n=4)
    options = {"directions": "steepest,random", "polish": True, "sweeps": 6}
    assert result(mesh, "numba", threads=2, **options) == result(mesh, "numpy", **options)


@pytest.mark.parametrize("examples", [4, pytest.param(30, marks=pytest.mark.long)])
def test_same_bytes_for_tangled_meshes(examples):
    @settings(max_examples=examples, deadline=None)
    @given(st.integers(0, 10**6), st.sampled_from([2, 3]), st.floats(0.0, 3.0))
    def check(seed, dimension, mess):
        mesh = delaunay(60, dimension, seed)
        domain = domain_of(mesh)
        rng = np.random.default_rng(seed)
        points = mesh.points.copy()
        points[domain.interior] += 0.1 * mess * rng.normal(size=(int(domain.interior.sum()), dimension))
        tangled = Mesh(points, mesh.cells)
        for directions in ("random", "steepest"):
            one, other = (result(tangled, engine, directions=directions) for engine in ("numba", "numpy"))
            assert one == other

    check()


@pytest.mark.parametrize("meshes", [4, pytest.param(30, marks=pytest.mark.long)])
def test_same_bytes_for_flat_and_degenerate_elements(meshes):
    """Every vertex on few lattice points: ties, zero volumes and corners at their barrier everywhere."""
    for seed in range(meshes):
        mesh = hexagon(4) if seed % 2 else random_mesh("tetra", seed, n=4)
        coarse = Mesh(np.round(mesh.points * 7) / 7, mesh.cells)
        assert result(coarse, "numba", directions="random,axis") == result(
            coarse, "numpy", directions="random,axis"
        )


@pytest.mark.parametrize("kind", KINDS)
def test_compiled_set_up_gives_the_same_domain_and_problem(kind):
    mesh = random_mesh(kind, 5)
    plain, compiled = domain_of(mesh), domain_of(mesh, backend=COMPILED)
    assert compiled.interior.tobytes() == plain.interior.tobytes()
    assert compiled.corners.vertices.tobytes() == plain.corners.vertices.tobytes()
    relaxed = np.flatnonzero(plain.interior)
    for order in ORDERS:
        one = build_problem(plain.corners, relaxed, plain.points, order)
        other = build_problem(plain.corners, relaxed, plain.points, order, backend=COMPILED)
        for name in ("vertices", "start", "others", "shapes"):
            np.testing.assert_array_equal(getattr(one.rings, name), getattr(other.rings, name))
        np.testing.assert_array_equal(one.batch_start, other.batch_start)


def test_mirrored_cells_are_found_by_the_compiled_set_up_too():
    mesh = random_mesh("tetra", 3)
    cells = mesh.cells[0].vertices.copy()
    cells[::2] = cells[::2][:, [0, 2, 1, 3]]
    mixed = Mesh(mesh.points, [type(mesh.cells[0])("tetra", cells)])
    assert domain_of(mixed, backend=COMPILED).mirrored == domain_of(mixed).mirrored == len(cells[::2])


def test_interrupted_between_batches():
    """The mesh reached is that of the NumPy engine stopped after as many batches."""
    mesh = random_mesh("tetra", 8, n=4)
    domain = domain_of(mesh)
    problem = build_problem(domain.corners, np.flatnonzero(domain.interior), domain.points)
    field = direction_field(["random"], domain, {})
    for stop_after in range(1, 12):
        reached = []
        for engine in (NumpyEngine(problem), NumbaEngine(problem, 2)):
            answers = iter([False] * (stop_after - 1) + [True])
            outcome = relax(engine, domain.points, field, Stopping(), interrupted=answers.__next__)
            assert outcome.stopped_because == "interrupted"
            reached.append(outcome.points.tobytes())
        assert reached[0] == reached[1]


PROGRAM = """
import numpy as np, sys
sys.path.insert(0, {tests!r})
from meshes import random_mesh
import dvr_cli
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.relax.stopping import Stopping
with np.errstate(all="ignore"):
    for kind in {kinds!r}:
        points, report = smooth_mesh(
            random_mesh(kind, 1),
            SmoothOptions(
                directions="steepest,random",
                polish=True,
                engine="numba",
                threads=2,
                stopping=Stopping(3, 0.0),
            ),
        )
        assert report.engine == "numba"
        print(points.tobytes().hex())
"""


def in_a_process(kinds, **environment):
    """The coordinates that another process, with these variables set, gets for some meshes."""
    program = PROGRAM.format(tests=str(Path(__file__).parents[2]), kinds=kinds)
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.split()


def test_the_kernel_is_plain_python():
    """With the compiler switched off the same code gives the same bytes."""
    kinds = ["quad", "tetra"]
    options = {"sweeps": 3, "directions": "steepest,random", "polish": True}
    expected = [result(random_mesh(kind, 1), "numpy", **options)[0].hex() for kind in kinds]
    assert in_a_process(kinds, NUMBA_DISABLE_JIT="1") == expected


def test_no_place_for_a_cache_does_no_harm(tmp_path, monkeypatch):
    """Neither beside the package nor in a home: what cannot be cached is compiled anew."""
    from numba.core import caching

    monkeypatch.setattr(caching._CacheLocator, "from_function", classmethod(lambda *_: None), raising=False)
    for locator in caching.CacheImpl._locator_classes:
        monkeypatch.setattr(locator, "from_function", classmethod(lambda *_: None))
    from dvr_cli.jit.kernels import compiled

    @compiled
    def twice(x: float) -> float:
        return x + x

    assert twice(3.0) == 6.0


@pytest.mark.long
def test_a_change_in_another_file_than_the_function_s_own_is_noticed(tmp_path):
    """numba looks at that file alone, though what it keeps has functions of other files in it."""
    package = Path(dvr_cli.__file__).parent
    shutil.copytree(package, tmp_path / "dvr_cli", ignore=shutil.ignore_patterns("__pycache__"))
    program = """
import numpy as np
from dvr_cli.quality.mean_ratio_numba import corner_terms
points, v, s = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.empty(1), np.empty(1)
corner, shape = np.array([[0, 1, 2]], dtype=np.int32), np.zeros((1, 3), dtype=np.uint8)
corner_terms(points, corner, shape, np.ones((1, 3)), v, s)
kernel = corner_terms.of(True, False)
print(v[0], kernel.stats.cache_hits[kernel.signatures[0]])
"""
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def answer():
        command = [sys.executable, "-c", program]
        run = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=True, cwd=tmp_path
        )
        return run.stdout.split()

    assert answer()[0] == "1.0"
    assert answer() == ["1.0", "1"]  # from the cache
    called = tmp_path / "dvr_cli" / "mesh" / "simplex_numba.py"
    text = called.read_text()
    ours = "    return (p[0] - x[0]) * (q[1] - p[1])"
    assert text.count(ours) == 1
    called.write_text(text.replace(ours, "    return 2 * (p[0] - x[0]) * (q[1] - p[1])"))
    assert answer()[0] == "2.0"


@pytest.mark.long
def test_what_a_run_on_a_surface_has_compiled_is_known(tmp_path):
    """Though it has not compiled what runs on volumes need."""
    program = """
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.api.warming import SORTS
from dvr_cli.api.options import SmoothOptions
from dvr_cli.relax.engines.choice import MeshKind, choose_engine

def kinds():
    surface = MeshKind(surface=True)
    return [choose_engine("auto", 10**4, 100, mesh=surface, meanwhile=True).maker[1],
            choose_engine("auto", 10**4, 100, walking=10**4, mesh=surface, meanwhile=True).maker[1],
            choose_engine("auto", 10**6, 100, meanwhile=True).maker[1]]

print(*kinds())
mesh, options = SORTS["surfaces"]()
smooth_mesh(mesh, SmoothOptions(engine="numba", **options))
import sys
del sys.modules["dvr_cli.relax.engines.numba_engine"]
print(*kinds())
"""
    command = [sys.executable, "-c", program]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    before, after = run.stdout.splitlines()
    assert before.split()[1:] == ["HandoverEngine"] * 2
    assert after.split() == ["NumbaEngine", "NumbaEngine", "HandoverEngine"]


@pytest.mark.long
def test_of_processes_that_take_turns_one_compiles(tmp_path):
    program = """
from dvr_cli.jit.turns import compile_in_turn
compile_in_turn()
from dvr_cli.mesh.csr_numba import group
import numpy as np
group(np.array([1, 0, 1]), 2)
print(sum(group.stats.cache_misses.values()))
"""
    command = [sys.executable, "-c", program]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    running = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE) for _ in range(3)]
    assert sorted(process.communicate(timeout=600)[0] for process in running) == [b"0\n", b"0\n", b"1\n"]


@pytest.mark.parametrize(
    ("source", "matters"),
    [
        *(pytest.param(source, True, marks=pytest.mark.long) for source in ("mesh/csr.py", "jit/kinds.py")),
        ("relax/patches/solver.py", True),
        ("cli/app.py", False),
    ],
)
def test_results_older_than_any_source_they_may_come_from_are_forgotten(tmp_path, source, matters):
    """However deep in the package that source lies."""
    package = tmp_path / "dvr_cli"
    shutil.copytree(Path(dvr_cli.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    for path in package.rglob("*.py"):
        os.utime(path, (1e9, 1e9))
    os.utime(package / source, (1e9 + 2, 1e9 + 2))
    index = tmp_path / "function.nbi"
    index.touch()
    os.utime(index, (1e9 + 1, 1e9 + 1))
    program = f"from dvr_cli.jit.on_disk import forget_outdated; forget_outdated({str(tmp_path)!r})"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    subprocess.run([sys.executable, "-c", program], env=environment, check=True, cwd=tmp_path)
    assert index.exists() is not matters


def test_kernels_are_known_to_be_compiled_where_results_are_newer_than_all_sources(monkeypatch, tmp_path):
    kernel = "relax.patches.solver_numba.solve_patch"
    kept = f"solver_numba.solve_patch-1.py3{sys.version_info[1]}.nbi"
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr("dvr_cli.kept._PACKAGE", tmp_path)
    monkeypatch.setattr("dvr_cli.kept.last_change", lambda: 1e9)
    beside, named = tmp_path / "relax/patches/__pycache__", tmp_path / "named"
    for folder in (beside, named / "patches_0123"):
        folder.mkdir(parents=True)
        assert not may_be_kept(kernel)
        (folder / kept.replace("solve_patch", "solve")).touch()
        assert not may_be_kept(kernel)
        (folder / kept).touch()
        assert may_be_kept(kernel)
        os.utime(folder / kept, (1e9 - 1, 1e9 - 1))
        assert not may_be_kept(kernel)
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(named))


@pytest.mark.parametrize("metric", ["", "_metric"])
def test_all_kernels_that_are_looked_for_are_there(metric):
    for kernel in itertools.chain(*choice._KERNELS.values()):
        module, _, name = kernel.format(kind="2d", metric=metric, surface="").rpartition(".")
        compiled = module if module.endswith("_numba") else f"{module}_numba"  # over the module named
        found = getattr(import_module(f"dvr_cli.{compiled}"), kernel.rpartition(".")[2].partition("_{")[0])
        function = found.of(True, name.endswith("metric")) if "{kind}" in kernel else found
        assert function.stats.cache_path, kernel
        assert function.py_func.__qualname__ == name
        assert Path(function.py_func.__code__.co_filename).stem == module.rpartition(".")[2]


def test_auto_takes_numba_where_it_pays(monkeypatch):
    monkeypatch.delitem(sys.modules, numba_engine.__name__)
    assert choice.choose_engine("auto", 100, 100).name == "numpy"
    assert choice.choose_engine("auto", 10**6, 100).name == "numba"
    assert choice.choose_engine("auto", 10**6, 0).name == "numpy"
    monkeypatch.setattr(choice, "_are_compiled", lambda *_: True)
    assert choice.choose_engine("auto", 60, 100, patches=True).name == "numba"  # patches are what takes long
    assert choice.choose_engine("auto", 20, 100, patches=True).name == "numpy"
    monkeypatch.setattr(choice, "_are_compiled", lambda *_: False)
    assert choice.choose_engine("auto", 200, 100, patches=True, meanwhile=True).name == "numpy"
    assert choice.choose_engine("auto", 10_000, 100).name == "numpy"
    assert choice.choose_engine("auto", 10**6, 100).name == "numba"
    meanwhile = choice.choose_engine("auto", 10**6, 100, meanwhile=True)
    assert meanwhile.maker[1] == "HandoverEngine"
    assert choice.choose_engine("auto", 10_000, 100, meanwhile=True) is choice.KINDS["numpy"]
    # a batch of walks on NumPy has to end before another engine can take over
    walks = [choice.choose_engine("auto", n, 100, walking=n, meanwhile=True) for n in (5_000, 50_000)]
    assert [kind.maker[1] for kind in walks] == ["HandoverEngine", "NumbaEngine"]
    for program in ("/opt/cad/bin/cad", "", None):  # what embeds Python is not started in its place
        monkeypatch.setattr(sys, "executable", program)
        assert choice.choose_engine("auto", 10**6, 100, meanwhile=True).name == "numba"
    monkeypatch.setattr(choice, "_are_compiled", lambda *_: True)
    assert choice.choose_engine("auto", 10_000, 100).name == "numba"
    assert choice.choose_engine("auto", 10_000, 100, meanwhile=True).name == "numba"
    monkeypatch.setitem(sys.modules, numba_engine.__name__, numba_engine)
    assert choice.choose_engine("auto", 100, 100).name == "numba"  # what is loaded costs nothing more
    monkeypatch.setattr(choice, "_are_compiled", lambda *_: False)
    assert choice.choose_engine("auto", 10_000, 100).name == "numpy"
    monkeypatch.setattr(choice, "find_spec", lambda package: None)
    assert choice.choose_engine("auto", 10**6, 100).name == "numpy"
    with pytest.raises(UsageError, match=r"dvr-cli\[fast\]"):
        choice.choose_engine("numba", 10, 10)


@pytest.mark.parametrize(("options", "fault"), [({"engine": "gpu"}, "gpu"), ({"threads": 0}, "threads")])
def test_wrong_options_are_named(options, fault):
    with pytest.raises(UsageError, match=fault):
        SmoothOptions(**options)


@pytest.mark.long
def test_scipys_blas_is_loaded_for_those_who_call_it_and_for_no_kernel_here():
    require("scipy")
    program = """
import sys
import numpy as np
from numba import njit
from dvr_cli.jit.kernels import compiled

assert compiled(lambda a: a[0] + a[1])(np.ones(2)) == 2.0
assert "scipy.linalg" not in sys.modules

@njit
def product(a, b):
    return np.dot(a, b)

assert product(np.arange(4.0), np.ones(4)) == 6.0
assert "scipy.linalg" in sys.modules
"""
    subprocess.run(
        [sys.executable, "-c", program], check=True, env={**os.environ, "PYTHONPATH": ":".join(sys.path)}
    )
