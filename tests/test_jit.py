"""The compiler as this package sets it up: what it keeps, and numba as it is for others in the process."""

from itertools import count
from types import FunctionType, ModuleType
from typing import NamedTuple

import numpy as np
import pytest

from needs import require

numba = require("numba")

from numba.core import caching  # noqa: E402
from numba.core.bytecode import FunctionIdentity  # noqa: E402
from numba.core.caching import FunctionCache  # noqa: E402
from numba.core.codegen import JITCodeLibrary  # noqa: E402
from numba.core.types.functions import BaseFunction  # noqa: E402

from dvr_cli.jit import compiling, kernels, kinds  # noqa: E402


def compiled(function):
    """The function compiled as kernels are, and not kept on disk."""
    return numba.njit(pipeline_class=compiling.KernelCompiler)(function)


def summed(values):
    """A kernel with operators on numbers and on elements of arrays."""
    total = 0.0
    for i in range(len(values)):
        if values[i, 0] > 0.5 and i != 3:
            total += values[i, 0] * values[i, 1] - i / 2
    return total


def joined(values):
    """What no compiler takes: a number added to a text."""
    return values[0, 0] + "1"


def test_operators_are_remembered_while_kernels_are_compiled_and_no_longer(monkeypatch):
    asked = []
    resolved = BaseFunction.get_call_type

    def counted(self, context, args, kws):
        asked.append((self, tuple(args)))
        return resolved(self, context, args, kws)

    monkeypatch.setattr(BaseFunction, "get_call_type", counted)
    values = np.random.default_rng(1).random((9, 2))
    compiling._SIGNATURES.clear()
    assert compiled(summed)(values) == summed(values)
    assert "get_call_type" not in vars(numba.types.Function)
    operators = [(function, args) for function, args in asked if compiling._is_known(function, args)]
    assert len(operators) == len(set(operators)) == len(compiling._SIGNATURES) > 5
    compiled(summed)(values)
    assert len([one for one in asked if compiling._is_known(*one)]) == len(operators)  # they were known


def test_an_error_of_the_compiler_leaves_nothing_behind():
    with pytest.raises(numba.TypingError):
        compiled(joined)(np.ones((2, 2)))
    assert "get_call_type" not in vars(numba.types.Function)


def doubled(values):
    """A kernel that makes an array."""
    return 2.0 * values


def doubled_and_one(values):
    """A kernel that calls another."""
    return doubled(values) + 1.0


def increased(values):
    """A kernel that compiles soon."""
    return values[1] + 2.0


def hits(kernel):
    """How often a kernel was found on disk."""
    return sum(kernel.stats.cache_hits.values())


def test_kernels_from_disk_run_and_are_linked_into_others(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    values = np.arange(3.0)
    for found in (0, 1):
        kernel = kernels.compiled(doubled)
        assert kernel(values).tolist() == [0.0, 2.0, 4.0]
        assert hits(kernel) == found
    for found in (0, 1):
        names = {**globals(), "doubled": kernel}  # the one from disk
        calling = kernels.compiled(FunctionType(doubled_and_one.__code__, names, "doubled_and_one"))
        assert calling(values).tolist() == [1.0, 3.0, 5.0]
        assert hits(calling) == found


@kernels.part
def tripled(values):
    """A part of a kernel."""
    return 3.0 * values


def tripled_and_one(values):
    """A kernel that calls a part."""
    return tripled(values) + 1.0


def test_numba_hears_of_parts_when_it_compiles_what_calls_them(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    values = np.arange(3.0)
    for found in (0, 1):
        names = {**globals(), "tripled": kernels.part(tripled.py_func)}
        kernel = kernels.compiled(FunctionType(tripled_and_one.__code__, names, "tripled_and_one"))
        assert kernel(values).tolist() == [1.0, 4.0, 7.0]
        assert hits(kernel) == found
        assert ("_dispatcher" in vars(names["tripled"])) == (not found)


MEASURED = kinds.MEASURED


@kernels.part
def weighed(values):
    """A part that is another one in a metric."""
    return 2.0 * values if MEASURED else values


def weighed_and_one(points, factor):
    """A kernel that calls it."""
    return weighed(points) + 1.0


def test_parts_of_two_kinds_never_have_one_name(tmp_path, monkeypatch):
    """Processes number functions alike, and each loads what others have kept: one name is to be one part."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    kernel, points, names = kinds.compiled_by_kind(weighed_and_one), np.ones((3, 2)), set()
    for factor in (np.empty(0), np.ones(3)):
        monkeypatch.setattr(FunctionIdentity, "_unique_ids", count(10**6))
        assert kernel(points, factor).tolist() == np.full((3, 2), 2.0 + (len(factor) > 0)).tolist()
        part = kernel.of(True, len(factor) > 0).py_func.__globals__["weighed"]
        names |= {code.fndesc.mangled_name for code in part._dispatcher.overloads.values()}
    assert len(names) == 2


class Pair(NamedTuple):
    """Arguments as kernels take them."""

    one: np.ndarray
    other: tuple


def test_arguments_have_the_types_that_numba_finds():
    frozen = np.arange(4)
    frozen.flags.writeable = False
    flat, table = np.ones(3, dtype=np.float32), np.ones((3, 4), dtype=bool)
    arrays = flat, table, table.T, table[:, 1:], np.ones((2, 0)), frozen, np.array(1.0)
    found = kernels.compiled(doubled).typeof_pyval
    for value in (*arrays, arrays, Pair(flat, (table.T, 1)), (flat, flat), 1, 2.0, True, np.int32(3)):
        assert found(value) == theirs(value)


def theirs(value):
    """The type of an argument as numba finds it."""
    return numba.njit(doubled).typeof_pyval(value)


def kept(folder, ending):
    """The one file of a folder's cache that has an ending."""
    (path,) = folder.rglob(f"*{ending}")
    return path


def cut_off(path):
    """Keep the first half of a file."""
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip(path):
    """Change one bit in the midst of a file, where the machine code is."""
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 1
    path.write_bytes(data)


def fill(path):
    """Put other bytes in place of all of a file."""
    path.write_bytes(b"\xff" * path.stat().st_size)


def block(path):
    """Put a folder where a file was."""
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
@pytest.mark.parametrize("damage", [cut_off, flip, fill, block])
def test_a_damaged_file_is_compiled_anew_and_replaced(damage, ending, tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    values = np.arange(3.0)
    kernels.compiled(increased)(values)
    damage(kept(tmp_path, ending))
    for found in (0, 1):
        kernel = kernels.compiled(increased)
        assert kernel(values) == 3.0
        assert hits(kernel) == (0 if damage is block else found)


def test_what_cannot_be_written_is_compiled_all_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))

    def full(self, name):
        raise OSError(28, "no space left on device")

    monkeypatch.setattr(caching.IndexDataCacheFile, "_open_for_write", full)
    kernel = kernels.compiled(increased)
    assert kernel(np.arange(3.0)) == 3.0
    assert not list(tmp_path.rglob("*.nb*"))


def test_functions_of_others_are_compiled_and_kept_by_numba_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    for _ in range(2):
        kernels.compiled(doubled)(np.arange(3.0))
    for found in (0, 1):
        theirs = numba.njit(cache=True)(summed)
        assert type(theirs._cache) is FunctionCache
        assert theirs(np.ones((9, 2))) == summed(np.ones((9, 2)))
        assert hits(theirs) == found
        assert type(theirs.overloads[theirs.signatures[0]].library) is JITCodeLibrary


@pytest.mark.parametrize(("name", "of_the_other"), [("MOST", True), ("_MOST", False)])
def test_kernels_written_once_take_imports_from_others_and_keep_what_is_their_own(name, of_the_other):
    """Two modules of kernels may have private constants by one name."""
    module = ModuleType("kernels")
    vars(module)[name] = 6
    assert kinds.compiled_over(module, (), {name: 4})[name] == (4 if of_the_other else 6)
