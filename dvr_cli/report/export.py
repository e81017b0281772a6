"""Reports as files and for other programs: JSON and CSV."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import chain, repeat
from typing import Any

import numpy as np

from dvr_cli.mesh.mesh import Mesh
from dvr_cli.quality.measure import Quality


def as_json(record: Mapping[str, Any]) -> str:
    """A report's record as JSON, one line a key: legible, yet not a line for each of a million components."""
    lines = (f"  {json.dumps(key)}: {_as_json(value)}" for key, value in record.items())
    return "{\n" + ",\n".join(lines) + "\n}"


def _as_json(value: Any) -> str:
    """A value as JSON; in quality vectors equal numbers follow each other, which are made text but once."""
    if not isinstance(value, list) or set(map(type, value)) != {float}:
        return json.dumps(value, allow_nan=False)
    numbers = np.array(value)
    bits = numbers.view(np.int64)  # tells -0.0 from 0.0
    begin = np.flatnonzero(np.concatenate([[True], bits[1:] != bits[:-1]]))
    texts = json.dumps(numbers[begin].tolist(), allow_nan=False)[1:-1].split(", ")
    again = np.diff(begin, append=len(value)).tolist()
    return f"[{', '.join(chain.from_iterable(map(repeat, texts, again)))}]"


def as_csv(quality: Quality) -> str:
    """The quality vector as CSV: rank (the component's number, from 1), vertex (from 0) and quality."""
    pairs = zip(quality.vertices.tolist(), quality.vector.tolist(), strict=True)
    rows = (f"{rank},{vertex},{value!r}" for rank, (vertex, value) in enumerate(pairs, start=1))
    return "\n".join(["rank,vertex,quality", *rows])


def cells_as_csv(mesh: Mesh, values: Sequence[np.ndarray]) -> str:
    """Values of cells as CSV: cell (from 0 through all cells of the file), its type and its value.

    values: one array a block of the mesh, see ``measure.cell_field``; cells without a value are left out.
    """
    start = np.cumsum([0, *(len(block.vertices) for block in mesh.cells)]).tolist()
    rows = [
        f"{cell},{block.type},{value!r}"
        for first, block, part in zip(start, mesh.cells, values, strict=False)
        for cell, value in enumerate(part.tolist(), start=first)
        if value == value  # not NaN
    ]
    return "\n".join(["cell,type,value", *rows])
