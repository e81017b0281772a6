"""What tests need beside the package itself.

Where it is missing they are skipped, and say why; under CI, which installs all of it, they fail.
"""

import importlib
import os
import shutil
import subprocess
from pathlib import Path
from types import ModuleType
from typing import NoReturn

import pytest


def require(module: str) -> ModuleType:
    """The module of this name."""
    try:
        return importlib.import_module(module)
    except (ImportError, OSError) as error:  # OSError: a system library it needs is missing
        _miss(f"{module} cannot be imported: {error}")


def require_program(*names: str) -> str:
    """The path of a program that goes by any of these names, the first one found."""
    path = next(filter(None, map(shutil.which, names)), None)
    if path is None:
        _miss(f"no program {' or '.join(names)} is on the path")
    return path


def require_debian(*modules: str) -> str:
    """The path of Debian's own Python, which has these modules by packages of Debian."""
    python = "/usr/bin/python3"
    own = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL"))}
    command = [python, "-c", f"import {', '.join(modules)}"]
    if not Path(python).exists() or subprocess.run(command, capture_output=True, env=own).returncode != 0:
        _miss(f"Debian's Python has not all of {', '.join(modules)}")
    return python


def _miss(reason: str) -> NoReturn:
    """Skip the test, or at its top level the module."""
    if os.environ.get("CI") == "true":
        pytest.fail(f"{reason}; CI must install it")
    pytest.skip(reason, allow_module_level=True)
