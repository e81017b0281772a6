"""Numbers written into columns of fixed width."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvr_cli.files.numbers_in_text import fitted

NUMBERS = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e30, max_value=1e30)


def value_of(text: bytes, exponent: str) -> float:
    """As a reader of the format takes it."""
    plain = text.decode()
    return float(plain.replace(exponent, "e") if exponent else re.sub(r"(?<=[\d.])([+-])", r"e\1", plain))


@pytest.mark.parametrize(
    ("value", "width", "text"),
    [
        (0.0, 8, b"0."),
        (0.5, 8, b".5"),
        (-0.25, 8, b"-.25"),
        (1e-7, 8, b"1.-7"),
        (1 / 3, 8, b".3333333"),
        (-1 / 3, 8, b"-.333333"),
        (123456789.0, 8, b"1.2346+8"),
        (1.0, 8, b"1."),
        (99999999.6, 8, b"1.+8"),
    ],
)
def test_eight_columns_of_nastran(value, width, text):
    assert fitted(value, width, "") == text


@given(NUMBERS)
def test_a_wide_column_keeps_every_bit(value):
    for exponent in ("e", "D", ""):
        text = fitted(value, 25, exponent)
        assert len(text) <= 25
        assert value_of(text, exponent) == value
        assert b"." in text


@given(NUMBERS)
def test_a_narrow_column_is_as_near_as_it_can_be(value):
    """No number of ten significant digits, which always fit, is nearer."""
    text = fitted(value, 16, "")
    assert len(text) <= 16
    near = float(f"{value:.9e}")
    assert abs(value_of(text, "") - value) <= abs(near - value)
