"""Sums in any order: exact oracles in fractions, and parts that add up."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dvr_cli.mesh import sums
from dvr_cli.mesh.sums import exponent_of, mean, mean_of_total, total

values = arrays(np.float64, st.integers(1, 40), elements=st.floats(-1e50, 1e50))


@given(values)
def test_the_mean_is_the_exact_one_but_for_one_unit_and_one_rounding(given_values):
    exact = sum(map(Fraction, given_values.tolist())) / len(given_values)
    unit = Fraction(2) ** (exponent_of(given_values) - 62)
    assert abs(Fraction(mean(given_values)) - exact) <= unit + abs(exact) * Fraction(2) ** -53


@given(values, st.randoms(use_true_random=False))
def test_neither_order_nor_parts_change_a_bit(given_values, random):
    exponent = exponent_of(given_values)
    shuffled = np.array(random.sample(given_values.tolist(), len(given_values)))
    cut = random.randint(0, len(shuffled))
    parts = total(shuffled[:cut], exponent) + total(shuffled[cut:], exponent)
    assert parts == total(given_values, exponent)
    assert mean_of_total(parts, len(shuffled), exponent) == mean(given_values)


def test_many_values_of_one_sign_do_not_overflow(monkeypatch):
    monkeypatch.setattr("dvr_cli.mesh.simplex._CHUNK", 1000)  # several chunks
    ones = np.full(100_000, math.nextafter(2.0, 0.0))
    assert mean(ones, 1) == ones[0]
    assert mean(-ones, 1) == -ones[0]


@pytest.mark.parametrize("value", [0.0, 5e-324, 1e-300, 1.0, 1.5e300])
def test_values_of_any_size(value):
    expected = value if value == 0.0 or value > 1e-280 else 0.0  # below the least unit: cut off
    assert mean(np.array([value, value])) == expected


def test_the_exponent_is_above_every_value():
    for value in (0.3, 0.5, 1.0, 1.5, 2.0):
        assert value < 2.0 ** exponent_of(np.array([0.1, -value])) <= 4 * value
    assert exponent_of(np.zeros(2)) <= 0
    assert sums.exponent_of(np.array([])) <= 0
