"""What pages of the documentation tell the reader to do is done here, a page in a folder of its own.

Blocks of sh and python run in their order, python with the names that earlier blocks of the page have left;
blocks with a title are files.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from needs import require, require_program

ROOT = Path(__file__).parents[1]
_BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
_DONE = re.compile(r"^```(?:sh|python)$", re.MULTILINE)
_IMPORT = re.compile(r"^(?:import|from) (\w+)", re.MULTILINE)
PAGES = sorted(page for page in ROOT.glob("docs/**/*.md") if _DONE.search(page.read_text("utf-8")))


def shell(text: str, environment: Mapping[str, str]) -> str:
    """Run commands; what they print."""
    run = subprocess.run(
        ["bash", "-e", "-o", "pipefail", "-c", text],
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout


def environment(folder: Path) -> dict[str, str]:
    """Where pages are tried: programs are those of the folder, of this environment, and of the system."""
    path = [str(folder), str(Path(sys.executable).parent), os.environ["PATH"]]
    return os.environ | {"PATH": os.pathsep.join(path), "PYTHONPATH": str(ROOT)}


def blocks(page: Path) -> list[tuple[str, str, str]]:
    """The blocks of code of a page: language, title, text."""
    return _BLOCK.findall(page.read_text(encoding="utf-8"))


@pytest.mark.long
@pytest.mark.parametrize("page", [pytest.param(page, id=page.stem) for page in PAGES])
def test_what_a_page_says_works(page, tmp_path, monkeypatch):
    (tmp_path / "sample_meshes").symlink_to(ROOT / "sample_meshes")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for language, title, text in blocks(page):
        if title:
            Path(title).write_text(text, encoding="utf-8")
        elif language == "python":
            for module in _IMPORT.findall(text):
                require(module)
            exec(compile(text, f"{page.name}", "exec"), names)
        else:
            assert language == "sh", language
            if "gmsh " in text:
                require_program("gmsh")
            if "--plot" in text:
                require("matplotlib")
            if "mpiexec" in text:
                require("mpi4py")
                require_program("mpiexec")
            shell(text, environment(tmp_path))


def test_all_tutorials_are_among_them():
    assert {*ROOT.glob("docs/tutorials/*.md"), ROOT / "docs" / "index.md"} <= {*PAGES}
    assert len(PAGES) > 6
