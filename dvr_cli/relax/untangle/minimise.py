"""Minimising a smooth function of many variables: L-BFGS with a weak-Wolfe line search.

Nocedal & Wright, Numerical Optimization (2006), algorithm 7.5; the line search brackets and bisects
as in Lewis & Overton, Nonsmooth optimization via quasi-Newton methods (2013), algorithm 2.6. SciPy's L-BFGS-B
adds up through BLAS, whose last bits depend on the number of threads; these sums do not.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from dvr_cli.relax.lbfgs import Pair, descent

Function = Callable[[np.ndarray], tuple[float, np.ndarray]]

_MEMORY = 10  # pairs of steps and changes of the gradient that stand for the Hessian
_DECREASE, _CURVATURE = 1e-4, 0.9  # of the Wolfe conditions
_TRIALS = 30  # points looked at along a line
_FIRST = 0.1  # largest component of the first step
_LOOK_BACK = 10  # steps over which progress is judged


def minimise(
    function: Function,
    x: np.ndarray,
    evaluations: int,
    progress: float,
    stop: Callable[[], bool] = lambda: False,
) -> np.ndarray:
    """The point (n,) reached from ``x`` within so many evaluations; no step raises the function.

    function: gives value and gradient (n,); a value that is not finite is taken for a step too long.
    progress: end when the value fell by less than this part of itself in the last ten steps.
    stop: asked after each step, ends when true.
    """
    value, gradient = function(x)
    values = [value]
    pairs: deque[Pair] = deque(maxlen=_MEMORY)
    used = 1
    while used < evaluations:
        direction = descent(gradient, pairs, _dot)
        largest = float(np.abs(gradient).max())
        if largest == 0:
            break
        length = 1.0 if pairs else min(1.0, _FIRST / largest)
        found, trials = _line_search(function, x, value, gradient, direction, length)
        used += trials
        if found is None:
            if not pairs:
                break
            pairs.clear()  # the model misled: start again along the gradient
            continue
        step, value, new_gradient = found
        x, change, gradient = x + step, new_gradient - gradient, new_gradient
        if (curvature := _dot(step, change)) > 0:
            pairs.append((step, change, curvature))
        values.append(value)
        if len(values) > _LOOK_BACK and values[-_LOOK_BACK - 1] - value < progress * abs(value):
            break
        if stop():
            break
    return x


def _line_search(
    function: Function,
    x: np.ndarray,
    value: float,
    gradient: np.ndarray,
    direction: np.ndarray,
    length: float,
) -> tuple[tuple[np.ndarray, float, np.ndarray] | None, int]:
    """A step along ``direction`` that meets the weak Wolfe conditions, the value and gradient there.

    None if no step within the trials lowers the value enough. Also returned: how many trials it took.
    """
    slope = _dot(gradient, direction)
    low, high = 0.0, np.inf
    best, trials = None, 0
    while trials < _TRIALS and slope < 0:
        trials += 1
        step = length * direction
        new_value, new_gradient = function(x + step)
        if not new_value <= value + _DECREASE * length * slope:
            high = length
        else:
            best = step, new_value, new_gradient
            if _dot(new_gradient, direction) >= _CURVATURE * slope:
                break
            low = length
        length = (low + high) / 2 if high < np.inf else 2 * low
    return best, trials


def _dot(a: np.ndarray, b: np.ndarray) -> float:
    return float((a * b).sum())
