"""The house's order: a folder imports only from folders below it, and nothing heavy before it is needed."""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import dvr_cli
from needs import require

ROOT = Path(dvr_cli.__file__).parent
MODULES = sorted(path.relative_to(ROOT) for path in ROOT.rglob("*.py"))

# The layers from top to bottom; the first part of a module's path names its layer.
LAYERS = [
    "__main__",
    "cli",
    "gmsh",
    "api",
    "distributed",
    "files",
    "report",
    "relax",
    "boundary",
    "quality",
    "mesh",
    "jit",
    "kept",
    "backend",
    "beside",
    "options",
    "errors",
]
PACKAGE = "dvr_cli"  # the package itself: holds the version, and loads api on first use


def name_of(path):
    """The dotted name of a module, given by its path below the package."""
    return ".".join([PACKAGE, *path.with_suffix("").parts]).removesuffix(".__init__")


def layer_of(name):
    """The layer of a dotted name; the package itself is one of its own."""
    parts = name.split(".")
    return parts[1] if len(parts) > 1 and parts[1] in LAYERS else PACKAGE


# These load what they list when it is asked for, and what they list may know their records.
REGISTRIES = {"dvr_cli.files.formats"}

NAMES = {name_of(path): path for path in MODULES}


@cache
def parsed(path):
    """The syntax tree of a module."""
    return ast.parse((ROOT / path).read_text(encoding="utf-8"))


def at_once(module):
    """The statements that run when a module is imported, but for those in blocks."""
    return module.body


def statements(node):
    """All statements below a node but those for type checkers only."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            continue
        yield child
        yield from statements(child)


def imports(path, nodes=ast.walk):
    """The dotted names that a module imports from the package, anywhere among ``nodes``."""
    found = set()
    for node in nodes(parsed(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in found if name.split(".")[0] == PACKAGE}


def module_of(name):
    """The module that a dotted name is, or is in."""
    return name if name in NAMES else name.rpartition(".")[0]


def test_modules_import_only_from_below():
    wrong = {}
    for name, path in NAMES.items():
        layer = layer_of(name)
        if layer == PACKAGE:
            assert name == PACKAGE, f"{name} belongs to no layer"
            allowed = {PACKAGE, "gmsh", "api"}
        else:
            allowed = {PACKAGE, *LAYERS[LAYERS.index(layer) :]}
        wrong[name] = {one for one in imports(path) if layer_of(one) not in allowed}
    assert {name: found for name, found in wrong.items() if found} == {}


MOST_ARGUMENTS = 8


def test_functions_take_few_arguments():
    functions = (
        (name, node)
        for name, path in NAMES.items()
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    )
    taken = {
        (name, one.name, one.lineno): [
            arg.arg
            for arg in (*one.args.posonlyargs, *one.args.args, *one.args.kwonlyargs)
            if arg.arg not in ("self", "cls")
        ]
        for name, one in functions
    }
    long = {where: len(arguments) for where, arguments in taken.items() if len(arguments) > MOST_ARGUMENTS}
    assert long == {}


def test_no_module_imports_itself_by_way_of_others():
    """Inside folders, too, and counting what functions import when they are called, but for registries."""
    below = {
        name: {module_of(one) for one in imports(path, at_once if name in REGISTRIES else statements)}
        - {PACKAGE, name}
        for name, path in NAMES.items()
        if name != PACKAGE
    }
    while free := {name for name, others in below.items() if not others & below.keys()}:
        below = {name: others for name, others in below.items() if name not in free}
    circle = sorted(below)  # and what imports from one
    assert circle == []


def test_compiled_modules_stand_beside_their_twins():
    compiled = [path for path in MODULES if path.stem.endswith("_numba")]
    assert compiled
    for path in compiled:
        assert path.with_name(path.name.replace("_numba", "")) in MODULES


def test_only_compiled_modules_import_the_compiler_at_once():
    """All others leave that to the functions that have decided to compile."""
    compiling = {
        path
        for path in MODULES
        for one in imports(path, at_once)
        if layer_of(one) == "jit" or module_of(one).endswith("_numba")
    }
    assert {
        path
        for path in compiling
        if not (path.parts[0] == "jit" or path.stem.endswith(("_numba", "numba_engine")))
    } == set()


def test_compiled_modules_import_from_folders_of_compiled_modules():
    """Results of the compiler are forgotten when a source in one of these changes."""
    compiled = [path for path in MODULES if path.stem.endswith("_numba")]
    folders = {path.parts[0] for path in compiled} | {"jit"}
    assert {layer_of(one) for path in compiled for one in imports(path)} <= folders


def loaded_by(statement):
    """The modules in sys.modules of a fresh interpreter after a statement."""
    program = f"{statement}\nimport sys\nprint(*sys.modules)"
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=600
    ).stdout.split()


@pytest.mark.parametrize(
    "statement", ["import dvr_cli", "import dvr_cli; dvr_cli.__version__", "import dvr_cli.errors"]
)
def test_importing_the_package_costs_nothing(statement):
    modules = loaded_by(statement)
    assert "dvr_cli" in modules
    assert not {"numpy", "meshio", "rich", "trimesh", "typer", "numba", "dvr_cli.api"} & set(modules)


HEADER = "# vtk DataFile Version 4.2\none\nASCII\nDATASET UNSTRUCTURED_GRID\n"
TRIANGLE = {
    "vtk": HEADER + "POINTS 3 double\n0 0 0 1 0 0 0 1 0\nCELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n5\n",
    "inp": "*NODE\n1, 0, 0\n2, 1, 0\n3, 0, 1\n*ELEMENT, TYPE=CPS3, ELSET=all\n1, 1, 2, 3\n",
}


@pytest.mark.parametrize(("ending", "package"), [("vtk", "vtk"), ("inp", "abaqus")])
def test_a_run_loads_no_reader_of_other_formats(tmp_path, ending, package):
    """Of those that have a package of their own: each costs every short run some milliseconds."""
    source, output = tmp_path / f"in.{ending}", tmp_path / f"out.{ending}"
    source.write_text(TRIANGLE[ending])
    command = ["smooth", str(source), str(output), "-q"]
    modules = loaded_by(f"from dvr_cli.cli.main import main; assert main({command!r}) == 0")
    packages = {f"dvr_cli.files.{path.parent.name}" for path in (ROOT / "files").glob("*/__init__.py")}
    assert packages & set(modules) == {f"dvr_cli.files.{package}"}
    assert MASKED not in modules


# NumPy loads it for np.unique and masked arrays, in a thirtieth of a short run.
MASKED = "numpy.ma"

# What a run without curved cells, walks, untangling, patches and named sets has no use for.
UNUSED = {
    "dvr_cli.api.adapters.registry",
    "dvr_cli.boundary.smooth_parts",
    "dvr_cli.boundary.unfolding",
    "dvr_cli.cli.morph",
    "dvr_cli.cli.report",
    "dvr_cli.cli.untangle",
    "dvr_cli.cli.warm_up",
    "dvr_cli.files.losses",
    "dvr_cli.mesh.groups",
    "dvr_cli.quality.cell_measures",
    "dvr_cli.quality.curved",
    "dvr_cli.quality.verdict",
    "dvr_cli.relax.descent",
    "dvr_cli.relax.lbfgs",
    "dvr_cli.relax.surface.carriers",
    "dvr_cli.relax.surface.walk",
    "dvr_cli.relax.untangle.phase",
    "dvr_cli.relax.patches.phase",
    "dvr_cli.report.compare",
    "dvr_cli.report.text",
}


def test_a_run_loads_nothing_that_it_does_not_use(tmp_path):
    """Each module costs every short run up to a millisecond."""
    assert NAMES.keys() >= UNUSED
    points = "POINTS 5 double\n0 0 0 1 0 0 1 1 0 0 1 0 .8 .9 0\n"
    cells = "CELLS 4 16\n3 0 1 4\n3 1 2 4\n3 2 3 4\n3 3 0 4\nCELL_TYPES 4\n5 5 5 5\n"
    (tmp_path / "in.vtk").write_text(HEADER + points + cells)
    options = ["-q", "-d", "random", "--no-patches", "--engine", "numpy"]
    command = ["smooth", str(tmp_path / "in.vtk"), str(tmp_path / "out.vtk"), *options]
    before, after = (
        "import gc; looks = gc.get_stats()[1:]",
        "assert gc.get_stats()[1:] == looks",
    )  # for garbage
    program = f"from dvr_cli.cli.main import main; assert main({command!r}) == 0"
    modules = loaded_by("\n".join([before, program, after]))
    assert {*UNUSED, MASKED} & set(modules) == set()
    assert "dvr_cli.relax.sweeps" in modules  # it has relaxed


def test_a_report_loads_nothing_that_relaxes():
    """Of relax/ only the records and reasons that a report of a run has."""
    mesh = ROOT.parent / "sample_meshes" / "two_materials.msh"
    command = ["report", "quality", str(mesh), "--csv"]
    modules = loaded_by(f"from dvr_cli.cli.main import main; assert main({command!r}) == 0")
    versions = {name for name in modules if name.startswith("dvr_cli.files.gmsh.msh")}
    assert versions == {"dvr_cli.files.gmsh.msh4"}  # that of this file
    relaxing = {name for name in modules if name.startswith("dvr_cli.relax.")}
    assert relaxing == {"dvr_cli.relax.phases", "dvr_cli.relax.stopping"}
    assert not {"dvr_cli.api.smoothing", "dvr_cli.cli.smooth", MASKED} & set(modules)


def test_types_of_arguments_are_found_without_masked_arrays():
    require("numba")
    found = "compiled(lambda x: x).typeof_pyval((np.ones(3), (1, np.ones((2, 2), bool).T)))"
    modules = loaded_by(f"import numpy as np; from dvr_cli.jit.kernels import compiled; {found}")
    assert "numba" in modules
    assert MASKED not in modules


def test_the_mathematics_needs_numpy_only():
    modules = loaded_by("import dvr_cli.mesh.domain, dvr_cli.relax.sweeps, dvr_cli.report.records")
    assert "numpy" in modules
    assert not {"meshio", "rich", "trimesh", "typer", "numba"} & set(modules)


def test_names_of_the_package_are_loaded_when_first_used():
    assert {"numpy", "dvr_cli.api.public"} <= set(loaded_by("import dvr_cli; dvr_cli.smooth"))


def test_no_two_modules_of_tests_have_one_name():
    """pytest could not tell them apart, and would run neither."""
    names = sorted(path.name for path in Path(__file__).parent.rglob("*.py") if path.name != "conftest.py")
    assert len(names) == len(set(names))
