"""numba's compiler, set up for this package: results are cached on disk where that is possible.

Importing this module imports numba; only what has decided to compile does so.
"""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import cache, cached_property, partial, reduce, update_wrapper
from importlib.util import find_spec
from operator import attrgetter, getitem, itemgetter, setitem
from pathlib import Path
from threading import Lock
from types import FunctionType, MappingProxyType, ModuleType
from typing import Any, TypeVar, cast
from zlib import crc32

import numpy as np
from llvmlite.binding import add_symbol, parse_bitcode
from numba import config, types
from numba.core import cgutils
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUDispatcher
from numba.core.runtime.nrt import _nrt
from numba.core.serialize import dumps
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
from numba.extending import intrinsic
from numba.np.numpy_support import from_dtype, map_layout

from dvr_cli.kept import last_change


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


_Function = TypeVar("_Function", bound=Callable[..., Any])
_Kind = tuple[bool, bool, bool]  # of a mesh: planar, measured, on a surface
# IEEE arithmetic as written: nothing fused or reassociated, division by zero as in NumPy. No entry point for
# C is made: nothing calls one, and to compile it takes time.
_OPTIONS: dict[str, Any] = {
    "nopython": True,
    "boundscheck": None,
    "nogil": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
}


class _Unsettled:
    """A property of meshes in code that nothing is compiled from as it stands."""

    def __bool__(self) -> bool:
        raise TypeError("only what is compiled by kind knows the kind of mesh")


# In functions that are compiled by kind, and their parts: whether points have two coordinates, shapes are
# measured in a metric, a patch is of triangles in space. The compiler leaves out what does not hold.
PLANAR: Any = _Unsettled()
MEASURED: Any = _Unsettled()
ON_SURFACE: Any = _Unsettled()


def compiled(function: _Function, **options: Any) -> _Function:
    """``function`` compiled when first called; it may be a plain loop over arrays."""
    if vars(config)["DISABLE_JIT"]:
        return function
    made: Any = _Kernel(function, {}, options | _OPTIONS, _KernelCompiler)
    with suppress(RuntimeError):  # no directory to keep the result in: compile it anew in every process
        made._cache = _KernelCache(function)
        forget_outdated(made.stats.cache_path)
    return cast(_Function, made)


def part(function: _Function, **options: Any) -> _Function:
    """``function`` as a part of kernels that call it."""
    if vars(config)["DISABLE_JIT"]:
        _PLAIN.add(function)
        return function
    return cast(_Function, _Part(function, options | {"no_cpython_wrapper": True, **_OPTIONS}))


def inlined(function: _Function) -> _Function:
    """``function`` compiled into those that call it, for short ones called in loops.

    A call proper counts references to each array it is given, which costs more than a few sums do.
    """
    return part(function, forceinline=True)


def compiled_by_kind(function: _Function) -> _Function:
    """``function`` compiled for each kind of mesh by itself, when first called for one.

    Its arguments say which kind: ``points``, and ``factor`` (of a ``ShapeTable``), or what has these; and
    ``corners``, ``patch`` and ``walk`` by how many vertices their corners have.
    """
    return cast(_Function, _ByKind(function))


class _ByKind:
    """A kernel that is another one for each kind of mesh."""

    def __init__(self, function: Callable[..., Any]) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._lock = Lock()
        self._kernels: dict[_Kind, Callable[..., Any]] = {}
        names = function.__code__.co_varnames[: function.__code__.co_argcount]
        self._points, self._factor = _place(names, "points"), _place(names, "factor")
        self._corners, self._others = _place(names, "corners"), _place(names, "others")

    def __call__(self, *args: Any) -> Any:
        planar, corners, others = self._points(args).shape[1] == 2, self._corners(args), self._others(args)
        vertices = corners.shape[1] if len(corners) else others.shape[1] + 1 if len(others) else 0
        on_surface = not planar and vertices == 3
        return self.of(planar, len(self._factor(args)) > 0, on_surface)(*args)

    def of(self, planar: bool, measured: bool, on_surface: bool = False) -> Callable[..., Any]:
        """The kernel for a kind of mesh."""
        kind = planar, measured, on_surface
        if kind not in self._kernels:
            with self._lock:
                if kind not in self._kernels:
                    name = f"{self.py_func.__name__}_{'2d' if planar else '3d'}{'_metric' * measured}"
                    name += "_surface" * on_surface
                    self._kernels[kind] = compiled(_settled(self.py_func, kind, name))
        return self._kernels[kind]


def _place(names: Sequence[str], wanted: str) -> Callable[[Sequence[Any]], Any]:
    """Finds among arguments of these names an array, by its own name or as a member of what has it."""
    for i, name in enumerate(names):
        if name == wanted:
            return itemgetter(i)
    for i, name in enumerate(names):
        if name in _HOLDERS[wanted]:
            return lambda args: attrgetter(_HOLDERS[wanted][name])(args[i])
    return lambda _: ()


# where named tuples have what tells the kind of mesh
_HOLDERS = {
    "points": {"walk": "points"},
    "factor": {"rings": "factor", "patch": "factor", "walk": "rings.factor"},
    "corners": {"patch": "vertices"},
    "others": {"walk": "rings.others"},
}


def _settled(function: Any, kind: _Kind, name: str) -> Any:
    """A copy of a function, of which all it calls is for meshes of a kind."""
    known = function.__globals__
    names = {name: _of_kind(known[name], kind) for name in function.__code__.co_names if name in known} | {
        "PLANAR": kind[0],
        "MEASURED": kind[1],
        "ON_SURFACE": kind[2],
        "__name__": known["__name__"],
    }
    copy = FunctionType(function.__code__, names, name, function.__defaults__)
    copy.__qualname__ = name
    return copy


_PLAIN: set[Any] = set()  # the parts where nothing is compiled
_parts: dict[tuple[Any, _Kind], Any] = {}  # those of a kind, by the functions that they are of


def _of_kind(value: Any, kind: _Kind) -> Any:
    """The thing that a name stands for in functions for meshes of a kind: parts are others for each."""
    if isinstance(value, _ByKind):
        return value.of(*kind)
    plain = isinstance(value, FunctionType) and value in _PLAIN
    if not (plain or isinstance(value, _Part)):
        return value
    function = value if plain else value.py_func
    if (function, kind) not in _parts:
        copy = _settled(function, kind, function.__name__)
        _parts[function, kind] = copy if plain else _Part(copy, value.options)
    return _parts[function, kind]


class _LoadedLibrary(JITCodeLibrary):
    """The code of a kernel that was kept on disk, of which the machine code is loaded at once.

    numba's own reads all of the bitcode, too, which only other kernels need that link it.
    """

    def __init__(self, codegen: Any, name: str, machine_code: bytes, bitcode: bytes) -> None:
        super().__init__(codegen, name)
        self._bitcode = bitcode
        self.enable_object_caching()
        self._set_compiled_object(machine_code)
        self._finalize_final_module()

    def get_pointer_to_function(self, name: str) -> int:
        """The address of the function by which Python calls the kernel."""
        return int(self._codegen._engine.get_function_address(name))

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = parse_bitcode(self._bitcode)
        return self._shared_module


class _KernelCacheImpl(CompileResultCacheImpl):
    """Keeps of a kernel what numba keeps, but for environments of parts that hold nothing.

    Nothing looks into these; to make them, modules of numba would be imported that only compile.
    """

    def reduce(self, result: CompileResult) -> tuple[int, bytes]:
        """The parts of a kernel that are kept, as bytes after their checksum."""
        *fields, environments = super().reduce(result)
        kept = dumps((*fields, tuple(each for each in environments if each.consts)))
        return crc32(kept), kept

    def rebuild(self, target_context: Any, payload: tuple[int, bytes]) -> CompileResult:
        """The kernel, of which no bitcode is read; ValueError if it is not what was kept."""
        checksum, kept = payload
        if crc32(kept) != checksum:
            raise ValueError("damaged machine code")
        code, fndesc, environment, signature, *_, reload_init, environments = pickle.loads(kept)
        name, _, (machine_code, bitcode) = code
        for initialise in reload_init:
            initialise()
        _name_helpers()
        codegen = target_context.codegen()
        library = _LoadedLibrary(codegen, name, machine_code, bitcode)
        entry = target_context.get_executable(library, fndesc, environment)
        for each in environments:
            codegen.set_env(each.env_name, each)
        fields = dict.fromkeys(CompileResult._fields) | {
            "target_context": target_context,
            "typing_context": target_context.typing_context,
            "library": library,
            "environment": environment,
            "entry_point": entry,
            "fndesc": fndesc,
            "signature": signature,
            "objectmode": False,
            "reload_init": reload_init,
            "referenced_envs": environments,
        }
        return CompileResult(**fields)


class _KernelCache(FunctionCache):
    """numba's cache, which loads without a look through all that numba knows: only compiling needs one.

    A run never fails because of it: what cannot be read is compiled anew, what cannot be written is not kept.
    """

    _impl_class = _KernelCacheImpl

    def load_overload(self, signature: Any, target_context: Any) -> CompileResult | None:
        """The kernel for a signature, or None if it has to be compiled."""
        with suppress(Exception):  # a damaged file may raise anything
            return cast("CompileResult | None", self._load_overload(signature, target_context))
        return None

    def save_overload(self, signature: Any, data: CompileResult) -> None:
        """Keep a kernel; an index that cannot be read makes room for a new one."""
        try:
            super().save_overload(signature, data)
        except Exception:
            with suppress(Exception):  # a disk that is full, or may not be written to
                self.flush()
                super().save_overload(signature, data)


@cache
def _name_helpers() -> None:
    """Name to the linker the functions in C that count references, as numba does before it compiles."""
    for name, address in _nrt.c_helpers.items():
        add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


class _Kernel(CPUDispatcher):
    """A function that Python calls."""

    def typeof_pyval(self, value: Any) -> Any:
        """numba's type of an argument.

        To see that an array is not a masked one numba would load those, in a thirtieth of a short run.
        """
        if type(value) is np.ndarray:
            readonly = not value.flags.writeable
            return types.Array(from_dtype(value.dtype), value.ndim, map_layout(value), readonly=readonly)
        if isinstance(value, tuple):
            return types.BaseTuple.from_types([self.typeof_pyval(each) for each in value], type(value))
        return super().typeof_pyval(value)


class _Part:
    """A function that only kernels call; numba hears of it when it compiles one of these."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func, self.options = function, options

    @cached_property
    def _dispatcher(self) -> _PartDispatcher:
        return _PartDispatcher(self.py_func, {}, self.options, _PartCompiler)

    @property
    def _numba_type_(self) -> Any:
        """By this name numba asks things for their type."""
        return types.Dispatcher(self._dispatcher)

    def __call__(self, *args: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} is a part of kernels, which only these can call")


class _PartDispatcher(CPUDispatcher):
    """A part as numba knows it."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """For the types of the arguments, not for their values: these would make it another function each."""
        return super().get_call_template([types.unliteral(kind) for kind in args], kws)


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


class _KernelCompiler(CompilerBase):
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


class _PartCompiler(_KernelCompiler):
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


@intrinsic
def bare(_: Any, arrays: Any) -> Any:
    """The same array, or named tuple of arrays or such tuples, without an owner.

    For use in compiled functions only. Passing it on counts no references, which otherwise costs more than
    most functions do; whoever calls the kernel keeps the arrays alive.
    """

    def without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        if not isinstance(kind, types.Array):
            members = [
                without_owner(context, builder, member, builder.extract_value(value, i))
                for i, member in enumerate(kind.types)
            ]
            return context.make_tuple(builder, kind, members)
        array = context.make_array(kind)(context, builder, value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        return array._getvalue()

    def made(context: Any, builder: Any, _: Any, args: Any) -> Any:
        return without_owner(context, builder, arrays, args[0])

    return arrays(arrays), made


def _allocated(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    """A new array; args: its shape, a number or a tuple, then others."""
    kind, (shape, *_) = signature.return_type, signature.args
    is_tuple = isinstance(shape, types.BaseTuple)
    lengths = cgutils.unpack_tuple(builder, args[0]) if is_tuple else args[:1]
    numbers = shape.types if is_tuple else [shape]
    lengths = [context.cast(builder, *each, types.intp) for each in zip(lengths, numbers, strict=True)]
    item = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    strides = [item]
    for length in reversed(lengths):
        strides.insert(0, builder.mul(strides[0], length))
    size, *strides = strides
    owner = context.nrt.meminfo_alloc_aligned(builder, size, context.get_preferred_array_alignment(kind))
    array = context.make_array(kind)(context, builder)
    array.data = builder.bitcast(context.nrt.meminfo_data(builder, owner), array.data.type)
    array.shape, array.strides = (cgutils.pack_array(builder, each) for each in (lengths, strides))
    array.nitems, array.itemsize, array.meminfo = reduce(builder.mul, lengths), item, owner
    array.parent = cgutils.get_null_value(array.parent.type)
    return array


def _array_of(shape: Any, dtype: Any) -> Any:
    return types.Array(dtype.dtype, getattr(shape, "count", 1), "C")


@intrinsic
def _empty(_: Any, shape: Any, dtype: Any) -> Any:
    def made(*to: Any) -> Any:
        return _allocated(*to)._getvalue()

    return _array_of(shape, dtype)(types.unliteral(shape), dtype), made


@intrinsic
def _zeros(_: Any, shape: Any, dtype: Any) -> Any:
    def made(context: Any, builder: Any, *to: Any) -> Any:
        array = _allocated(context, builder, *to)
        cgutils.memset(builder, array.data, builder.mul(array.nitems, array.itemsize), 0)
        return array._getvalue()

    return _array_of(shape, dtype)(types.unliteral(shape), dtype), made


@intrinsic
def _full(_: Any, shape: Any, value: Any, dtype: Any) -> Any:
    def made(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = _allocated(context, builder, signature, args)
        item = context.cast(builder, args[1], signature.args[1], dtype.dtype)
        with cgutils.for_range(builder, array.nitems) as loop:
            place = builder.gep(array.data, [loop.index])
            context.pack_value(builder, dtype.dtype, item, place)
        return array._getvalue()

    return _array_of(shape, dtype)(types.unliteral(shape), types.unliteral(value), dtype), made


@intrinsic
def _bits(_: Any, values: Any) -> Any:
    def made(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        given = context.make_array(values)(context, builder, args[0])
        array = context.make_array(signature.return_type)(context, builder)
        for name in ("shape", "strides", "itemsize", "nitems"):
            setattr(array, name, getattr(given, name))
        for name in ("meminfo", "parent"):  # as those of ``bare``
            setattr(array, name, cgutils.get_null_value(getattr(array, name).type))
        array.data = builder.bitcast(given.data, array.data.type)
        return array._getvalue()

    return values.copy(dtype=types.int64)(values), made


def _view_of_bits(values: np.ndarray) -> np.ndarray:
    return values.view(np.int64)


# For kernels: ``np.empty``, ``np.zeros`` and ``np.full`` of a shape, a value and a type, and a view of real
# numbers as integers. numba's own are functions that call functions, which it compiles anew for each type and
# kernel: that takes a tenth of all.
_IS_PLAIN = bool(vars(config)["DISABLE_JIT"])
empty: Any = np.empty if _IS_PLAIN else _empty
zeros: Any = np.zeros if _IS_PLAIN else _zeros
full: Any = np.full if _IS_PLAIN else _full
bits_of: Any = _view_of_bits if _IS_PLAIN else _bits


def compiled_over(
    module: ModuleType, entries: Collection[str], names: Mapping[str, Any] = MappingProxyType({})
) -> dict[str, Any]:
    """The functions that a module defines, compiled: kernels that are written once, in plain Python.

    entries: those that are called from Python, too. names: what they take for names that the module imports,
    where it is something else that is compiled. Those with a leading underscore are the module's own,
    whatever another one has by the same name.
    Returns all names of the module, by which its functions know each other.
    """
    imported = {name for name in vars(module) if not name.startswith("_")}
    known = {**vars(module), **{name: value for name, value in names.items() if name in imported}}
    for name, value in vars(module).items():
        if isinstance(value, FunctionType) and value.__module__ == module.__name__:
            twin = FunctionType(value.__code__, known, name, value.__defaults__)
            known[name] = compiled_by_kind(twin) if name in entries else inlined(twin)
    return known


@cache
def compile_in_turn() -> None:
    """From now on wait where another process that called this compiles functions of the same source.

    numba does not lock its cache: of two processes that write to it at once, one may lose what it wrote, or
    find the other's code under its own signature. Those that waited load what was compiled. Where files
    cannot be locked nothing changes.
    """
    compiled_alone = Dispatcher.compile

    def compiled_in_turn(self: Dispatcher, signature: Any) -> Any:
        # one thread at a time, which may compile what the function calls
        with global_compiler_lock, _turn(self.py_func.__code__.co_filename):
            return compiled_alone(self, signature)

    Dispatcher.compile = compiled_in_turn  # type: ignore[assignment, method-assign]


class _Turn:
    """The right to compile functions of one source, which one process has at a time, as often as it likes."""

    def __init__(self, source: str) -> None:
        import fcntl

        self._lock = partial(fcntl.flock, os.open(source, os.O_RDONLY))  # open until the process ends
        self._take, self._give = fcntl.LOCK_EX, fcntl.LOCK_UN
        self._depth = 0

    def __enter__(self) -> None:
        self._depth += 1
        if self._depth == 1:
            self._lock(self._take)

    def __exit__(self, *_: object) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._lock(self._give)


@cache
def _turn(source: str) -> AbstractContextManager[None]:
    """The turn of a source; where that cannot be locked all compile at once."""
    try:
        return _Turn(source)
    except (ImportError, OSError):
        return nullcontext()


@cache
def forget_outdated(directory: str) -> None:
    """Remove from a directory of results those older than the last change of any source they may come from.

    numba notices when the file of a function changes, but not those of the functions and constants it uses.
    """
    with suppress(OSError):
        for index in Path(directory).glob("*.nbi"):
            if index.stat().st_mtime < last_change():
                index.unlink()
