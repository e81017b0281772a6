"""Reports as files and for other programs: JSON and CSV."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from dvr_cli.quality.measure import Quality


def as_json(record: Mapping[str, Any]) -> str:
    """A report's record as JSON, one line a key: legible, yet not a line for each of a million components."""
    lines = (f"  {json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in record.items())
    return "{\n" + ",\n".join(lines) + "\n}"


def as_csv(quality: Quality) -> str:
    """The quality vector as CSV: rank (the component's number, from 1), vertex (from 0) and quality."""
    pairs = zip(quality.vertices.tolist(), quality.vector.tolist(), strict=True)
    rows = (f"{rank},{vertex},{value!r}" for rank, (vertex, value) in enumerate(pairs, start=1))
    return "\n".join(["rank,vertex,quality", *rows])
