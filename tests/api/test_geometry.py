"""Vertices on a CAD model: those that would spoil an element there are put back, and counted."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from dvr_cli.api.geometry import OnModel
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.report.text.phases import put_back


def sheet() -> Mesh:
    """A plane sheet of 4 by 4 squares cut in two, one corner pushed in; inner vertices are on surface 1."""
    side = np.arange(5.0)
    x, y = (part.ravel() for part in np.meshgrid(side, side, indexing="ij"))
    number = np.arange(25).reshape(5, 5)
    a, b, c, d = (
        part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    )
    cells = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    points = np.column_stack([x, y, np.zeros(25)])
    points[20, :2] = 3.6, 0.3
    return Mesh(points, [Cells("triangle", cells)], entities={(2, 1): number[1:-1, 1:-1].ravel()})


@pytest.mark.parametrize(("height", "kept"), [(0.88, False), (0.0, True)])
def test_who_would_spoil_an_element_goes_back_and_is_counted(height, kept):
    """The model has vertex 6 nearly on the edge opposite, beyond which its triangles lie flat, or not."""
    mesh = sheet()
    moved, spoilt, other = mesh.points.copy(), 6, 18
    moved[spoilt, 0] += 0.1
    moved[other, 1] += 0.1

    def closest(dimension, tag, flat):
        found = flat.reshape(-1, 3).copy()
        found[found[:, 0] == moved[spoilt, 0], :2] += height
        found[found[:, 1] == moved[other, 1], 0] += 0.05
        return found.ravel(), None

    model = SimpleNamespace(
        getType=lambda *entity: "Plane",
        getClosestPoint=closest,
        getParametrization=lambda dimension, tag, flat: flat.reshape(-1, 3)[:, :2].ravel(),
    )
    place = OnModel(SimpleNamespace(model=model), mesh, domain_of(mesh), False)
    stored = place.stored(moved)
    assert place.put_back == (0 if kept else 1)
    assert np.array_equal(stored[spoilt], moved[spoilt] if kept else mesh.points[spoilt])
    assert set(place.parameters) == ({spoilt, other} if kept else {other})
    assert np.allclose(stored[other], moved[other] + [0.05, 0.0, 0.0])
    place.stored(mesh.points)
    assert place.put_back == 0


def test_the_text_says_how_many():
    assert put_back(None) == put_back(0) == []
    assert put_back(1)[0].startswith("geometry: 1 point put back")
    assert put_back(12)[0].startswith("geometry: 12 points put back")
