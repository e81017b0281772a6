"""The view of a page: a mesh in its browser that turns, is cut, and tells of the element clicked.

The page gets the cells once, points and values of each state, and the faces of the boundary, as compressed
arrays. What is seen of them, also at a cut, is found in the browser (``viewer/viewer.js``). It draws with
three.js, of which ``viewer/three.min.js`` holds what is used; docs/design.md, "The viewer", says how that is
made.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import Domain
from dvr_cli.mesh.facets import facets_of
from dvr_cli.mesh.mesh import Cells
from dvr_cli.report.picture import State
from dvr_cli.report.plot_mesh import INVERTED, KEPT, colour_scale
from dvr_cli.report.scale import Scale

MOST = 2_000_000  # elements that a page holds: two states of a million take 25 megabytes
_WORST = 1000  # elements of a larger mesh that come along with those on its boundary
_COLOURS = 256
_VIEW = """\
<style>
{style}</style>
{note}<div id="view">The view needs JavaScript; the pictures are below.</div>
<script type="application/json" id="mesh">{record}</script>
<script>
/* {licence} */
{library}</script>
<script>
{program}</script>
"""


def view(domain: Domain, states: Sequence[State], scale: Scale) -> str:
    """The view as a piece of HTML: a mesh with the domain in one or more states, coloured by the scale.

    Of a mesh of more than MOST elements those on the boundary and the worst ones are there, and the page says
    so first; if that is still too much, only that is said.
    """
    blocks, numbers, boundary = domain.cells, np.arange(len(domain.cell_ids)), _boundary(domain)
    whole = len(numbers) <= MOST
    note = ""
    if not whole:
        numbers = _essence(boundary, states, scale)
        blocks = _chosen(blocks, numbers)
        if len(numbers) > MOST:
            return f"<p>More than {MOST:,} elements would be seen: there is no view to turn.</p>\n"
        left_out = f"of its {len(domain.cell_ids):,} elements {len(numbers):,} are here"
        note = f"<p>The mesh is too large to be cut: {left_out}, those on the boundary and the worst.</p>\n"
        boundary = np.column_stack([np.searchsorted(numbers, boundary[:, 0]), boundary[:, 1]])
    record = _record(domain, blocks, numbers, boundary, states, scale) | {"inside": whole}
    return _VIEW.format(
        style=_resource("viewer.css"),
        note=note,
        record=json.dumps(record, allow_nan=False).replace("<", "\\u003c"),  # no tag can end it
        licence=_resource("three.LICENSE"),
        library=_resource("three.min.js"),
        program=_resource("viewer.js"),
    )


def _record(
    domain: Domain,
    blocks: Sequence[Cells],
    numbers: np.ndarray,
    boundary: np.ndarray,
    states: Sequence[State],
    scale: Scale,
) -> dict[str, Any]:
    """The record that ``viewer.js`` reads; numbers: (n,) of the cells of ``blocks`` in the domain."""
    used, renumbered = np.unique(np.concatenate([b.vertices.ravel() for b in blocks]), return_inverse=True)
    start = np.cumsum([0, *(block.vertices.size for block in blocks)])
    planar = domain.points.shape[1] == 2
    places = [_in_space(domain.flatten(state.points)[used]) for state in states]
    middle = (places[0].min(axis=0) + places[0].max(axis=0)) / 2  # 32 bits are enough for what is near it
    kept = states[0].kept
    return {
        "dimension": domain.dimension,
        "planar": planar,
        "blocks": [
            {
                "type": block.type,
                "nodes": block.vertices.shape[1],
                "faces": _faces(block.type),
                "edges": CELL_TYPES[block.type].edges,
                "vertices": _packed(renumbered[start[i] : start[i + 1]], np.int32),
            }
            for i, block in enumerate(blocks)
        ],
        "ids": _packed(domain.cell_ids[numbers], np.int32),
        "boundary": _packed(boundary, np.int32),
        "kept": None if kept is None else _packed(kept[numbers], np.uint8),
        "colours": _packed(_colours(), np.uint8),
        "scale": {
            "label": scale.label,
            "unit": scale.unit,
            "good": scale.good,
            "bad": scale.bad,
            "inverted": scale.signed,
        },
        "states": [
            {
                "name": state.name,
                "points": _packed(place - middle, np.float32),
                "values": _packed(state.values[numbers], np.float32),
            }
            for state, place in zip(states, places, strict=True)
        ],
    }


def _faces(name: str) -> Sequence[Sequence[int]]:
    """The vertices of each face of a cell that may be drawn: a planar cell is a face itself."""
    cell_type = CELL_TYPES[name]
    return [cell_type.outline] if cell_type.dimension == 2 else cell_type.facets


def _boundary(domain: Domain) -> np.ndarray:
    """(F, 2) the faces that are seen of the whole mesh: number of the cell, number of the face within it."""
    if domain.dimension == 2:
        n = len(domain.cell_ids)
        return np.column_stack([np.arange(n), np.zeros(n, dtype=np.int64)])
    facets = facets_of(domain.cells, domain.backend)
    number = [
        np.repeat(np.arange(len(CELL_TYPES[block.type].facets)), len(block.vertices))
        for block in domain.cells
    ]
    outside = np.sort(facets.order[facets.start[:-1][facets.shared_by == 1]])
    return np.column_stack([facets.owner[outside], np.concatenate(number)[outside]])


def _essence(boundary: np.ndarray, states: Sequence[State], scale: Scale) -> np.ndarray:
    """The numbers, ascending, of the cells on the boundary and the worst ones of each state."""
    worst = [scale.worst(state.values, _WORST) for state in states]
    return np.unique(np.concatenate([boundary[:, 0], *worst]))


def _chosen(blocks: Sequence[Cells], numbers: np.ndarray) -> list[Cells]:
    """Blocks with those cells alone that have these numbers, ascending."""
    start = np.cumsum([0, *(len(block.vertices) for block in blocks)])
    ends = np.searchsorted(numbers, start)
    return [
        Cells(block.type, block.vertices[numbers[ends[i] : ends[i + 1]] - start[i]])
        for i, block in enumerate(blocks)
    ]


def _in_space(points: np.ndarray) -> np.ndarray:
    """(N, 3) points, planar ones at height 0."""
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def _colours() -> np.ndarray:
    """(_COLOURS + 2, 3) bytes: from the bad end of the scale to the good one, inverted cells, kept cells."""
    scale = colour_scale()(np.linspace(0.0, 1.0, _COLOURS))[:, :3]
    apart = [[int(name[i : i + 2], 16) for i in (1, 3, 5)] for name in (INVERTED, KEPT)]
    return np.concatenate([np.rint(255 * scale), apart])


def _packed(values: np.ndarray, dtype: type) -> str:
    """Numbers as little-endian bytes, compressed, in base64."""
    data = np.ascontiguousarray(values, dtype=np.dtype(dtype).newbyteorder("<"))
    return base64.b64encode(zlib.compress(data.tobytes(), 6)).decode("ascii")


def _resource(name: str) -> str:
    return (files("dvr_cli") / "report" / "viewer" / name).read_text(encoding="utf-8")
