"""Sums that do not depend on the order of their terms, nor on how these are spread over machines.

Terms are taken as multiples of one small unit, and integers are added.
"""

from __future__ import annotations

import math

import numpy as np

from dvr_cli.mesh.simplex import chunks

_BITS = 62  # of an integer below 2**63, for terms on either side of zero
_HALF = 31  # bits added up at a time: four thousand million such halves fit 63 bits
_LEAST = -900  # exponent of two to which terms are scaled at least, so that the scale is a number


def exponent_of(values: np.ndarray) -> int:
    """An exponent e with |x| < 2**e for all of (n,) finite values."""
    return max(math.frexp(float(np.abs(values).max(initial=0.0)))[1], _LEAST)


def total(values: np.ndarray, exponent: int) -> int:
    """The sum of (n,) values in units of 2**(exponent - 62); each is less than 2**exponent in size.

    What a value has below one unit is cut off. Totals of parts add up to that of the whole.
    """
    scale = 2.0 ** (_BITS - exponent)
    high = low = 0
    for chunk in chunks(len(values)):
        terms = (values[chunk] * scale).astype(np.int64)
        high += int((terms >> _HALF).sum())
        low += int((terms & (1 << _HALF) - 1).sum())
    return (high << _HALF) + low


def mean_of_total(total: int, count: int, exponent: int) -> float:
    """The mean of so many values with this ``total``, rounded once."""
    return math.ldexp(total / count, exponent - _BITS)


def mean(values: np.ndarray, exponent: int | None = None) -> float:
    """The mean of (n,) values, n > 0; exponent: see ``total``, by default that of the largest value."""
    exponent = exponent_of(values) if exponent is None else exponent
    return mean_of_total(total(values, exponent), len(values), exponent)
