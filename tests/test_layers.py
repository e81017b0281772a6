"""The house's order: a folder imports only from folders below it, and nothing heavy before it is needed."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import dvr_cli

ROOT = Path(dvr_cli.__file__).parent
MODULES = sorted(path.relative_to(ROOT) for path in ROOT.rglob("*.py"))

# What a layer may import besides itself; the first part of a module's path names its layer.
EVERYWHERE = {"dvr_cli", "errors"}
BELOW = {
    "jit": set(),
    "mesh": {"jit"},
    "quality": {"mesh", "jit"},
    "relax": {"mesh", "quality", "jit"},
    "report": {"mesh", "quality"},
    "files": {"mesh", "quality"},
    "api": {"mesh", "quality", "relax", "report", "files"},
    "cli": {"mesh", "quality", "relax", "report", "files", "api"},
    "__main__": {"cli"},
    "dvr_cli": {"api"},  # on first use
    "errors": set(),
}


def layer_of(module):
    """The layer of a dotted name below dvr_cli; the package itself holds the version."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 and parts[1] in BELOW else "dvr_cli"


def imports(path):
    """The dotted names that a module imports from the package, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in found if name.split(".")[0] == "dvr_cli"}


@pytest.mark.parametrize("path", MODULES, ids=str)
def test_modules_import_only_from_below(path):
    name = ".".join(["dvr_cli", *path.with_suffix("").parts]).removesuffix(".__init__")
    layer = layer_of(name)
    assert layer != "dvr_cli" or name == "dvr_cli", f"{name} belongs to no layer"
    allowed = EVERYWHERE | BELOW[layer] | {layer}
    assert {one for one in imports(path) if layer_of(one) not in allowed} == set()


def test_layers_are_free_of_cycles():
    """Each is allowed to import from layers alone that come before it in some order."""
    done = set()
    for layer, below in BELOW.items():
        if layer not in EVERYWHERE:
            assert below <= done
            done.add(layer)
    assert done >= {path.parts[0] for path in MODULES if len(path.parts) > 1}


def loaded_by(statement):
    """The modules in sys.modules of a fresh interpreter after a statement."""
    program = f"{statement}\nimport sys\nprint(*sys.modules)"
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60
    ).stdout.split()


@pytest.mark.parametrize(
    "statement", ["import dvr_cli", "import dvr_cli; dvr_cli.__version__", "import dvr_cli.errors"]
)
def test_importing_the_package_costs_nothing(statement):
    modules = loaded_by(statement)
    assert "dvr_cli" in modules
    assert not {"numpy", "meshio", "rich", "trimesh", "typer", "numba", "dvr_cli.api"} & set(modules)


def test_the_mathematics_needs_numpy_only():
    modules = loaded_by("import dvr_cli.mesh.domain, dvr_cli.relax.sweeps, dvr_cli.report.records")
    assert "numpy" in modules
    assert not {"meshio", "rich", "trimesh", "typer", "numba"} & set(modules)


def test_names_of_the_package_are_loaded_when_first_used():
    assert {"numpy", "dvr_cli.api"} <= set(loaded_by("import dvr_cli; dvr_cli.smooth"))
