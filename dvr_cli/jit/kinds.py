"""Functions that are compiled for each kind of mesh by itself."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import update_wrapper
from operator import attrgetter, itemgetter
from threading import Lock
from types import FunctionType, MappingProxyType, ModuleType
from typing import Any, cast

from dvr_cli.jit.kernels import (
    PLAIN,
    Function,
    Part,
    compiled,
    inlined,
)

_Kind = tuple[bool, bool, bool]  # of a mesh: planar, measured, on a surface


class _Unsettled:
    """A property of meshes in code that nothing is compiled from as it stands."""

    def __bool__(self) -> bool:
        raise TypeError("only what is compiled by kind knows the kind of mesh")


# In functions that are compiled by kind, and their parts: whether points have two coordinates, shapes are
# measured in a metric, a patch is of triangles in space. The compiler leaves out what does not hold.
PLANAR: Any = _Unsettled()
MEASURED: Any = _Unsettled()
ON_SURFACE: Any = _Unsettled()


def compiled_by_kind(function: Function) -> Function:
    """``function`` compiled for each kind of mesh by itself, when first called for one.

    Its arguments say which kind: ``points``, and ``factor`` (of a ``ShapeTable``), or what has these; and
    ``corners``, ``patch`` and ``walk`` by how many vertices their corners have.
    """
    return cast(Function, ByKind(function))


class ByKind:
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
                    self._kernels[kind] = compiled(_settled(self.py_func, kind))
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


def _settled(function: Any, kind: _Kind) -> Any:
    """A copy of a function, of which all it calls is for meshes of a kind.

    It is named after the kind: where processes number functions alike, code that one has kept would else
    call that of another kind in the next.
    """
    planar, measured, on_surface = kind
    name = f"{function.__name__}_{'2d' if planar else '3d'}{'_metric' * measured}{'_surface' * on_surface}"
    known = function.__globals__
    names = {each: _of_kind(known[each], kind) for each in function.__code__.co_names if each in known} | {
        "PLANAR": planar,
        "MEASURED": measured,
        "ON_SURFACE": on_surface,
        "__name__": known["__name__"],
    }
    copy = FunctionType(function.__code__, names, name, function.__defaults__)
    copy.__qualname__ = name
    return copy


_parts: dict[tuple[Any, _Kind], Any] = {}  # those of a kind, by the functions that they are of


def _of_kind(value: Any, kind: _Kind) -> Any:
    """The thing that a name stands for in functions for meshes of a kind: parts are others for each."""
    if isinstance(value, ByKind):
        return value.of(*kind)
    plain = isinstance(value, FunctionType) and value in PLAIN
    if not (plain or isinstance(value, Part)):
        return value
    function = value if plain else value.py_func
    if (function, kind) not in _parts:
        copy = _settled(function, kind)
        _parts[function, kind] = copy if plain else Part(copy, value.options)
    return _parts[function, kind]


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
