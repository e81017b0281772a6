"""What tests need beside the package itself."""

import importlib
import os

import pytest


def require(module: str) -> None:
    """Skip the tests that need ``module`` where it cannot be imported; in CI that is a failure."""
    try:
        importlib.import_module(module)
    except (ImportError, OSError) as error:
        if os.environ.get("CI") == "true":
            raise
        pytest.skip(f"{module} cannot be imported: {error}", allow_module_level=True)
