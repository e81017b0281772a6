"""The direction of L-BFGS: the two-loop recursion (Nocedal & Wright, Numerical Optimization, algorithm 7.4).

Recent pairs of steps and changes of the gradient stand for the Hessian. How scalar products are added up is
the caller's business, as the last bits depend on it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

# A step, the change of the gradient over it, and their scalar product, which is positive.
Pair = tuple[np.ndarray, np.ndarray, float]


def descent(
    gradient: np.ndarray, pairs: Collection[Pair], dot: Callable[[np.ndarray, np.ndarray], float]
) -> np.ndarray:
    """Minus the gradient times the inverse Hessian that the ``pairs``, oldest first, stand for.

    gradient: an array of any shape, which those of the pairs have, too.
    """
    direction = -gradient
    factors = []
    for step, change, curvature in reversed(list(pairs)):
        factors.append(dot(step, direction) / curvature)
        direction = direction - factors[-1] * change
    if pairs:
        _, change, curvature = list(pairs)[-1]
        direction = direction * (curvature / dot(change, change))
    for (step, change, curvature), factor in zip(pairs, reversed(factors), strict=True):
        direction = direction + (factor - dot(change, direction) / curvature) * step
    return direction
