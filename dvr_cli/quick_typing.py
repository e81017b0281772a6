"""numba's choice among the implementations of a call, made once for the types of its arguments.

numba tries all that a name stands for, from the first on, each time a function calls it: sums and indices are
most of what kernels are made of, so this is a fourth of the time that it takes to compile one.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from numba.core.targetconfig import ConfigStack, TargetConfig
from numba.core.types import Type
from numba.core.types.functions import BaseFunction


@cache
def remember_choices() -> None:
    """From now on remember what was chosen, by name, types of arguments and options of the compiler."""
    choose = BaseFunction.get_call_type
    chosen: dict[Any, tuple[Any, Any]] = {}

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws or not all(isinstance(kind, Type) and kind.is_precise() for kind in args):
            return choose(self, context, args, kws)
        question = self, context, tuple(args), ConfigStack.top_or_none()
        if question not in chosen:
            signature = choose(self, context, args, kws)
            chosen[question] = signature, self.get_impl_key(signature)
            return signature
        signature, implementation = chosen[question]
        self._impl_keys[signature.args] = implementation
        return signature

    BaseFunction.get_call_type = get_call_type  # type: ignore[method-assign]
    _compare_quickly()


def _compare_quickly() -> None:
    """Let options of the compiler that were set alike be equal without a look at all there are."""
    equal = TargetConfig.__eq__

    def __eq__(self: TargetConfig, other: object) -> Any:
        return (type(self) is type(other) and self._values == other._values) or equal(self, other)

    TargetConfig.__eq__ = __eq__  # type: ignore[method-assign]
    TargetConfig.__hash__ = lambda self: hash(type(self))  # type: ignore[method-assign]
