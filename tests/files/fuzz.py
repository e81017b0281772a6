"""Damaged copies of files: what a disk, a network or a bad exporter may do to them, repeatable by seed."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from dvr_cli.errors import InputError
from dvr_cli.files.source import Source
from dvr_cli.mesh.mesh import Mesh
from sources import cells_of, written

# how many copies a test takes: some in every run, thousands in a long one
COUNTS = (500, pytest.param(4000, marks=pytest.mark.long))

_NUMBER = re.compile(rb"(?<![\w.])\d+(?![\w.])")
_STRANGE = b"-1 0 999999999 4294967296 9223372036854775807 1e400 nan -0 0x10".split()


def mutated(files: list[bytes], count: int, seed: int) -> Iterator[bytes]:
    """``count`` copies of the files, each with one to three kinds of damage."""
    rng = np.random.default_rng(seed)
    kinds = (_cut, _flip, _renumber, _drop, _repeat, _swap, _insert)
    for i in range(count):
        data = files[i % len(files)]
        for _ in range(rng.integers(1, 4)):
            if data:
                data = kinds[rng.integers(len(kinds))](data, rng)
        yield data


def check_damaged(
    files: list[bytes],
    count: int,
    seed: int,
    read: Callable[[bytes], Source],
    least: float,
    exact: bool = False,
) -> None:
    """Damaged copies of the files are refused in one line, or read, and then come back whole and moved.

    least: the part of the copies of which more have to be readable. exact: the format keeps every digit.
    """
    messages, read_well = [], 0
    for data in mutated(files, count, seed):
        try:
            source = read(data)
        except InputError as error:
            messages.append(str(error))
            continue
        read_well += 1
        mesh = source.mesh
        _check_whole(mesh)
        assert written(source, mesh.points.copy()) == data
        with np.errstate(all="ignore"):
            points = mesh.points + 0.25
        again = read(written(source, points)).mesh
        assert np.array_equal(again.points, points if exact else source.stored(points), equal_nan=True)
        assert cells_of(again) == cells_of(mesh)
        assert again.cell_data.keys() == mesh.cell_data.keys()
        for name, blocks in mesh.cell_data.items():
            for old, new in zip(blocks, again.cell_data[name], strict=True):
                assert np.array_equal(new, old, equal_nan=np.asarray(old).dtype.kind == "f")
    assert read_well > least * count
    assert len(messages) > count // 4
    assert all(len(message) < 300 and message.isprintable() for message in messages)


def _check_whole(mesh: Mesh) -> None:
    """Cells name vertices that are there, and data have a row for each point or cell."""
    for block in mesh.cells:
        assert block.vertices.min(initial=0) >= 0
        assert block.vertices.max(initial=-1) < len(mesh.points)
    assert all(len(values) == len(mesh.points) for values in mesh.point_data.values())
    for blocks in mesh.cell_data.values():
        assert [len(values) for values in blocks] == [len(block.vertices) for block in mesh.cells]


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: rng.integers(len(data))]


def _flip(data: bytes, rng: np.random.Generator) -> bytes:
    damaged = bytearray(data)
    for at in rng.integers(len(data), size=rng.integers(1, 5)):
        damaged[at] = rng.integers(256) if rng.random() < 0.5 else damaged[at] ^ (1 << rng.integers(8))
    return bytes(damaged)


def _renumber(data: bytes, rng: np.random.Generator) -> bytes:
    """Replace a whole number, of a count or of content."""
    numbers = list(_NUMBER.finditer(data))
    if not numbers:
        return data
    match = numbers[rng.integers(len(numbers))]
    choices = [*_STRANGE, b"%d" % (min(int(match.group()), 1 << 62) + rng.integers(-2, 3))]
    return data[: match.start()] + choices[rng.integers(len(choices))] + data[match.end() :]


def _piece(data: bytes, rng: np.random.Generator) -> tuple[int, int]:
    """A stretch of bytes, or of whole lines."""
    begin = int(rng.integers(len(data)))
    end = min(len(data), begin + int(rng.integers(1, 1 + len(data) // 4 + 1)))
    if rng.random() < 0.5:
        begin, end = data.rfind(b"\n", 0, begin) + 1, data.find(b"\n", end) + 1 or len(data)
    return begin, end


def _drop(data: bytes, rng: np.random.Generator) -> bytes:
    begin, end = _piece(data, rng)
    return data[:begin] + data[end:]


def _repeat(data: bytes, rng: np.random.Generator) -> bytes:
    begin, end = _piece(data, rng)
    return data[:end] + data[begin:end] + data[end:]


def _swap(data: bytes, rng: np.random.Generator) -> bytes:
    (a, b), (c, d) = sorted([_piece(data, rng), _piece(data, rng)])
    return data if c < b else data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]


def _insert(data: bytes, rng: np.random.Generator) -> bytes:
    at = rng.integers(len(data))
    return data[:at] + rng.bytes(rng.integers(1, 9)) + data[at:]
