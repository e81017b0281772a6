"""Of a product of factors the few cases that show every pair of their values; the rest are long cases."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import pytest


def covering(cases: Sequence[Sequence[object]]) -> list[Sequence[object]]:
    """Few of the cases, each a value per factor, that hold every pair of values which any of them holds."""
    pairs = [set(combinations(enumerate(case), 2)) for case in cases]
    left, chosen = set().union(*pairs), []
    while left:
        best = max(range(len(cases)), key=lambda i: len(pairs[i] & left))
        left -= pairs[best]
        chosen.append(cases[best])
    return chosen


def named_cases(names: Sequence[str]) -> list[Any]:
    """Names, values joined by hyphens, for parametrize: those that the covering leaves out are long."""
    usual = {"-".join(map(str, case)) for case in covering([name.split("-") for name in names])}
    return [name if name in usual else pytest.param(name, marks=pytest.mark.long) for name in names]
