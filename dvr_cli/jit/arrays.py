"""Arrays in kernels: new ones, and those that are passed on."""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic


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
