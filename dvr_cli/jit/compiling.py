"""numba's compiler, without what no kernel needs."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from operator import getitem, setitem
from typing import Any

from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult
from numba.core.compiler_machinery import PassManager
from numba.core.typed_passes import (
    IRLegalization,
    NativeLowering,
    NoPythonBackend,
    NopythonRewrites,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.untyped_passes import (
    DeadBranchPrune,
    FixupArgs,
    GenericRewrites,
    IRProcessing,
    ReconstructSSA,
    RewriteSemanticConstants,
    TranslateByteCode,
)


def _load_without_blas() -> None:
    """Load what numba compiles with, and not SciPy's BLAS, which numba would look for at once.

    That takes as long as half a short run, and 16 MB. Nothing here calls it; for functions of others that
    do, numba loads it then.
    """
    if find_spec("scipy") is None or "numba.np.arraymath" in sys.modules:
        return
    from numba.np import linalg

    find = linalg.ensure_blas
    linalg.ensure_blas = lambda: None
    try:
        from numba.np import arraymath
    finally:
        linalg.ensure_blas = find
    arraymath.ensure_blas = find


class _KernelLibrary(JITCodeLibrary):
    """The code of a kernel, which is optimised once.

    numba does so twice, to remove counts of references that show after the first time: kernels have few, as
    their arrays are ``bare``.
    """

    def _optimize_final_module(self) -> None:
        passes, builder = self._codegen._module_pass_manager(slp_vectorize=False, cost="cheap")
        passes.run(self._final_module, builder)


class _PartLibrary(JITCodeLibrary):
    """The code of a part of kernels, which is optimised and made machine code in each of them, not here."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


@contextmanager
def _remembering() -> Iterator[None]:
    """Let numba remember, while kernels are compiled, what operators make of numbers and arrays.

    It tries all that an operator may mean anew for each sum and each element of an array, for its type and
    for its code, which takes a third of the time. Nobody else compiles meanwhile, as the compiler is locked.
    """
    kind: Any = types.Function
    if "get_call_type" in vars(kind):  # for a kernel that calls this one
        yield
        return
    resolved = kind.get_call_type

    def get_call_type(function: Any, context: Any, args: Any, kws: Any) -> Any:
        key = function, tuple(args)
        if kws or not _is_known(*key):
            return resolved(function, context, args, kws)
        if key not in _SIGNATURES:
            _SIGNATURES[key] = resolved(function, context, args, kws)
        return _SIGNATURES[key]

    kind.get_call_type = get_call_type
    try:
        yield
    finally:
        del kind.get_call_type


_SIGNATURES: dict[tuple[Any, Sequence[Any]], Any] = {}  # by operator and types of arguments


def _is_known(function: Any, args: Sequence[Any]) -> bool:
    """True for operators on numbers, and on parts of arrays, which numba knows without compiling."""
    operator: Any = function.typing_key
    if operator in (getitem, setitem) and args and isinstance(args[0], types.Array | types.BaseTuple):
        args = *getattr(args[1], "types", args[1:2]), *args[2:]  # a tuple has one type a place
    elif operator is not bool and getattr(operator, "__module__", None) != getitem.__module__:
        return False
    return all(isinstance(arg, _SIMPLE) for arg in args)


_SIMPLE = types.Number, types.Literal, types.Boolean, types.SliceType


# What numba does to functions, but for closures, contexts, literals and its own inlining: kernels have none.
_PASSES = (
    TranslateByteCode,
    FixupArgs,
    IRProcessing,
    RewriteSemanticConstants,
    DeadBranchPrune,
    GenericRewrites,
    ReconstructSSA,
    NopythonTypeInference,
    PreLowerStripPhis,
    NopythonRewrites,
    IRLegalization,
    NativeLowering,
    NoPythonBackend,
)


class KernelCompiler(CompilerBase):
    """numba's compiler, with a memory, and without what no kernel needs."""

    _library: type[JITCodeLibrary] = _KernelLibrary

    def __init__(self, *args: Any) -> None:
        _load_without_blas()
        super().__init__(*args)

    def define_pipelines(self) -> list[PassManager]:
        """The one way to compile a kernel."""
        passes = PassManager("kernel")
        for each in _PASSES:
            passes.add_pass(each, each.name())
        passes.finalize()
        state = self.state
        state.library = self._library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return [passes]

    def _compile_core(self) -> Any:
        with _remembering():
            return super()._compile_core()


class PartCompiler(KernelCompiler):
    """The compiler, which ends where there is code for others to link; the rest takes as long again."""

    _library = _PartLibrary

    def define_pipelines(self) -> list[PassManager]:
        """The way to compile a part, which makes no machine code."""
        self.state.flags.no_compile = True
        return super().define_pipelines()

    def _compile_core(self) -> CompileResult:
        result = super()._compile_core()
        entry: Any = [].append  # functions are known by their entry points: any will do that is no other's
        self.state.targetctx.insert_user_function(entry, result.fndesc, [result.library])
        return result._replace(entry_point=entry)
