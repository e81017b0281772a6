"""MEDIT solutions (.sol, .solb): the tensor of each vertex that a metric is given as.

The section SolAtVertices has the number of its rows, how many solutions a row holds, the kind of each (1 a
scalar, 2 a vector, 3 a symmetric tensor), and the rows. A tensor stands as its lower triangle, row after row:
m11, m21, m22 in the plane, and m31, m32, m33 after these in space.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.medit.binary import BINARY, BinaryFile
from dvr_cli.files.medit.keywords import SOLUTION
from dvr_cli.files.medit.text import readable, sections_of, with_e
from dvr_cli.files.numbers_in_text import parse_numbers

_SECTION = "SolAtVertices"
_HEAD = re.compile(rb"\s*(\d{1,15})\s+(\d{1,3})(?!\S)")
_DIMENSION = re.compile(rb"\s*([23])(?!\S)")
_TENSOR = 3
_KINDS = {1: "a scalar", 2: "a vector", _TENSOR: "a tensor"}


def read_tensors(path: Path) -> np.ndarray:
    """(N, 2, 2) or (N, 3, 3) the tensors at the vertices in a .sol or .solb file.

    Raises InputError, which does not name the file, for one that cannot be read, is damaged, or does not have
    one tensor a vertex.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError((error.strerror or str(error)).lower()) from error
    dimension, kinds, rows = _from_binary(data) if data[:4] in BINARY else _from_text(data)
    if kinds.count(_TENSOR) != 1:
        has = ", ".join(_KINDS[kind] for kind in kinds)
        why = "; scalars are sizes and say nothing about shape" if set(kinds) == {1} else ""
        raise InputError(f"it has {has} a vertex{why}; one tensor a vertex is needed")
    first = _width(kinds[: kinds.index(_TENSOR)], dimension)
    j, k = np.tril_indices(dimension)
    tensors = np.empty((len(rows), dimension, dimension))
    tensors[:, j, k] = tensors[:, k, j] = rows[:, first : first + len(j)]
    return tensors


def _from_text(data: bytes) -> tuple[int, list[int], np.ndarray]:
    """Dimension, the kind of each solution, and the rows of numbers."""
    text = readable(data)
    spans = sections_of(text)
    found = _DIMENSION.match(text, *spans.get("Dimension", (0, 0)))
    if found is None:
        raise InputError("the keyword Dimension and its number, 2 or 3, are missing")
    if _SECTION not in spans:
        raise InputError(f"it has no section {_SECTION}")
    dimension, head = int(found[1]), _HEAD.match(text, *spans[_SECTION])
    if head is None:
        raise InputError(f"section {_SECTION} should begin with the numbers of its rows and solutions")
    solutions = int(head[2])
    words = text[head.end() : spans[_SECTION][1]].split(None, solutions)
    kinds = _kinds([int(word) if word.isdigit() else 0 for word in words[:solutions]], solutions)
    rest = with_e(words[solutions]) if len(words) > solutions else b""
    count, width = int(head[1]), _width(kinds, dimension)
    if 2 * count * width > len(rest) + 1:  # a digit and a blank each
        raise InputError(_too_short(count))
    try:
        values = parse_numbers(rest, count * width, np.float64)
    except ValueError as error:
        raise InputError(f"section {_SECTION} should have {count} rows of {width} numbers: {error}") from None
    return dimension, kinds, values.reshape(count, width)


def _from_binary(data: bytes) -> tuple[int, list[int], np.ndarray]:
    """As ``_from_text``, of a binary file."""
    file = BinaryFile(data, SOLUTION)
    count, kinds, numbers = file.solutions()
    width = _width(_kinds(kinds, len(kinds)), file.dimension)
    if not 0 <= count * width <= len(numbers):
        raise InputError(_too_short(count))
    return file.dimension, kinds, numbers[: count * width].reshape(count, width)


def _too_short(count: int) -> str:
    return f"section {_SECTION} should have {count} rows, which it is too short for"


def _kinds(kinds: list[int], count: int) -> list[int]:
    """The kinds of ``count`` solutions; InputError unless all are there and known."""
    if not count or len(kinds) != count or not set(kinds) <= set(_KINDS):
        raise InputError(f"section {_SECTION} should have solutions of kind 1, 2 or 3")
    return kinds


def _width(kinds: list[int], dimension: int) -> int:
    """The number of numbers that solutions of these kinds have."""
    return sum({1: 1, 2: dimension, _TENSOR: dimension * (dimension + 1) // 2}[kind] for kind in kinds)
