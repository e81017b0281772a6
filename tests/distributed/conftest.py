"""How tests start jobs of several ranks."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from needs import require, require_debian, require_program

ENVIRONMENT = {
    **os.environ,
    "CI": "",
    # MPICH: a rank that waits sleeps, and does not take a core from those that work
    "MPIR_CVAR_ENABLE_HEAVY_YIELD": "1",
    "MPIR_CVAR_POLLS_BEFORE_YIELD": "10",
    # Open MPI: more ranks than cores, and as root, as in containers
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
}


@pytest.fixture(scope="session")
def on_ranks():
    """on_ranks(ranks, script, *words, cwd=None): the ended process of a Python script beside the tests."""
    require("mpi4py.MPI")
    beside = Path(sys.executable).with_name("mpiexec")  # where the wheels of MPIs put it
    mpiexec = str(beside) if beside.exists() else require_program("mpiexec")

    def run(ranks, script, *words, cwd=None):
        command = [mpiexec, "-n", ranks, sys.executable, "-m", "mpi4py", Path(__file__).with_name(script)]
        return subprocess.run(
            [str(word) for word in (*command, *words)],
            capture_output=True,
            text=True,
            check=False,
            timeout=600,
            env={**ENVIRONMENT, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            cwd=cwd,
        )

    return run


@pytest.fixture(scope="session")
def on_debian():
    """on_debian(ranks, script, *words, cwd=None): the same with Debian's Python, libraries and Open MPI."""
    python = require_debian("dolfinx", "petsc4py")
    mpiexec = require_program("mpiexec.openmpi")
    own = {name: value for name, value in ENVIRONMENT.items() if not name.startswith(("PYTHON", "VIRTUAL"))}

    def run(ranks, script, *words, cwd=None):
        command = [mpiexec, "-n", str(ranks), python, str(Path(__file__).with_name(script)), *words]
        return subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=600, env=own, cwd=cwd
        )

    return run
