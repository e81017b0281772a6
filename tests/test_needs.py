"""Where something is missing, tests are skipped on a user's machine and fail under CI."""

import sys

import pytest

from needs import require, require_debian, require_program

OUTCOMES = pytest.mark.parametrize(
    ("ci", "outcome"), [("true", pytest.fail.Exception), ("", pytest.skip.Exception)]
)


@OUTCOMES
def test_a_module(monkeypatch, ci, outcome):
    monkeypatch.setitem(sys.modules, "gmsh", None)
    monkeypatch.setenv("CI", ci)
    with pytest.raises(outcome, match="gmsh cannot be imported"):
        require("gmsh")


@OUTCOMES
def test_a_program(monkeypatch, tmp_path, ci, outcome):
    monkeypatch.setenv("CI", ci)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(outcome, match="no program one or other is on the path"):
        require_program("one", "other")
    program = tmp_path / "other"
    program.touch(mode=0o755)
    assert require_program("one", "other") == str(program)


@OUTCOMES
def test_modules_of_debian(monkeypatch, ci, outcome):
    monkeypatch.setenv("CI", ci)
    with pytest.raises(outcome, match="Debian's Python has not all of json, no_such_module"):
        require_debian("json", "no_such_module")
