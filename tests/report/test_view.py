"""The record that a page's view reads, taken apart again; and the scales of colours of measures."""

from __future__ import annotations

import base64
import json
import zlib
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from dvr_cli.api.measuring import mesh_quality
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.domain import domain_of
from dvr_cli.quality.cell_measures import CELL_MEASURES
from dvr_cli.report import view as module
from dvr_cli.report.picture import State, picture
from dvr_cli.report.scale import MEAN_RATIO, scale_of
from dvr_cli.report.view import view
from meshes import random_mesh

TYPES = {"vertices": "<i4", "ids": "<i4", "boundary": "<i4", "points": "<f4", "values": "<f4", "kept": "u1"}


def record_of(page):
    """The record of a view, its arrays unpacked."""
    text = page.split('<script type="application/json" id="mesh">')[1].split("</script>")[0]

    def unpacked(pairs):
        return {
            key: np.frombuffer(zlib.decompress(base64.b64decode(value)), TYPES[key])
            if key in TYPES and value is not None
            else value
            for key, value in pairs
        }

    return json.loads(text, object_pairs_hook=unpacked)


def viewed(mesh, name="mesh", kept=None):
    quality = mesh_quality(mesh).quality
    return view(domain_of(mesh), [State(name, mesh.points, quality, kept)], MEAN_RATIO), quality


def cells_of(record):
    """The vertices of each cell and its type, through the blocks."""
    return [
        (block["type"], cell)
        for block in record["blocks"]
        for cell in block["vertices"].reshape(-1, block["nodes"])
    ]


@pytest.mark.parametrize("kind", ["mixed2d", "mixed3d"])
def test_the_record_is_the_mesh(kind):
    mesh = random_mesh(kind, 4)
    page, quality = viewed(mesh)
    record = record_of(page)
    assert record["inside"]
    assert record["planar"] == (kind == "mixed2d")
    (state,) = record["states"]
    points = state["points"].reshape(-1, 3)
    expected = [(b.type, mesh.points[cell]) for b in mesh.cells for cell in b.vertices]
    shift = expected[0][1][0] - points[cells_of(record)[0][1][0]][: mesh.points.shape[1]]
    for (name, vertices), (known, places) in zip(cells_of(record), expected, strict=True):
        assert name == known
        found = points[vertices][:, : places.shape[1]] + shift
        assert np.abs(found - places).max() < 1e-6
    assert np.abs(state["values"] - quality.elements).max() < 1e-7
    assert record["ids"].tolist() == list(range(len(expected)))
    # the boundary: faces that one cell alone has, found by their vertices
    boundary = record["boundary"].reshape(-1, 2)
    if kind == "mixed2d":
        assert boundary.tolist() == [[cell, 0] for cell in range(len(expected))]
        return
    faces = {
        (c, f): frozenset(vertices[list(face)].tolist())
        for c, (name, vertices) in enumerate(cells_of(record))
        for f, face in enumerate(CELL_TYPES[name].facets)
    }
    shared = Counter(faces.values())
    assert {tuple(pair) for pair in boundary.tolist()} == {
        at for at, face in faces.items() if shared[face] == 1
    }


def test_of_a_large_mesh_the_boundary_and_the_worst_are_there(monkeypatch):
    mesh = random_mesh("mixed3d", 4, n=5)
    whole, quality = viewed(mesh)
    everything = record_of(whole)
    monkeypatch.setattr(module, "_WORST", 3)
    monkeypatch.setattr(module, "MOST", len(quality.elements) - 1)
    page, _ = viewed(mesh)
    assert page.index("too large to be cut") < page.index('<div id="view">')
    record = record_of(page)
    worst = np.argsort(quality.elements, kind="stable")[:3].tolist()
    outside = everything["boundary"].reshape(-1, 2)[:, 0].tolist()
    expected = sorted({*worst, *outside})
    assert record["ids"].tolist() == expected
    assert len(expected) < len(quality.elements)
    assert not record["inside"]
    assert [name for name, _ in cells_of(record)] == [cells_of(everything)[c][0] for c in expected]
    kept = record["boundary"].reshape(-1, 2)
    assert record["ids"][kept[:, 0]].tolist() == outside
    assert (record["states"][0]["values"] == everything["states"][0]["values"][expected]).all()
    monkeypatch.setattr(module, "MOST", 10)
    assert "there is no view" in viewed(mesh)[0]
    assert "<script" not in viewed(mesh)[0]


def test_names_and_kept_cells():
    mesh = random_mesh("quad", 1)
    kept = np.arange(len(mesh.cells[0].vertices)) % 2 == 0
    page, _ = viewed(mesh, "<!--<script>&", kept)
    text = page.split('id="mesh">')[1].split("</script>")[0]
    assert "<" not in text
    assert json.loads(text)["states"][0]["name"] == "<!--<script>&"
    assert record_of(page)["kept"].tolist() == kept.tolist()


@pytest.mark.parametrize("name", CELL_MEASURES)
def test_scales_of_measures(name):
    """1 is the best value of all states, 0 the one that a hundredth of a state at most is beyond."""
    measure = CELL_MEASURES[name]
    rng = np.random.default_rng(5)
    states = [rng.random(300), 1.0 + rng.random(300)]
    scale = scale_of(measure, states)
    shares = np.concatenate([scale.shares(values) for values in states])
    values = np.concatenate(states)
    order = np.argsort(values if measure.high_is_good else -values)
    assert (np.diff(shares[order]) >= 0).all()
    assert (shares >= 0).all()
    if name == "scaled-jacobian":
        assert (scale.good, scale.bad) == (1.0, 0.0)
        assert scale.shares(np.array([-0.5, 0.25, 2.0])).tolist() == [-0.5, 0.25, 1.0]
        return
    assert shares[order][-1] == 1.0
    beyond = shares[order] == 0.0
    assert 1 <= beyond.sum() <= 3  # a hundredth of the worse state
    assert scale.worst(values, 5) == order[:5].tolist()
    alike = scale_of(measure, [np.full(4, 2.0)])
    assert alike.shares(np.full(4, 2.0)).tolist() == [1.0] * 4


def test_a_picture_by_measure():
    mesh = random_mesh("mixed3d", 4)
    quality = mesh_quality(mesh).quality
    values = np.arange(len(quality.elements)) % 7 + 1.0
    scale = replace(MEAN_RATIO, label="smallest angle", unit="°", bad=1.0, good=7.0, signed=False)
    figure = picture(domain_of(mesh), [State("mesh", mesh.points, quality, None, values)], None, scale)
    (axes,) = [axes for axes in figure.axes if axes.get_title() == "mesh: worst smallest angle 1°"]
    drawn = axes.collections[0].get_array()
    assert set(np.rint(6 * drawn).astype(int).tolist()) <= set(range(7))
    figure.canvas.draw()
    (bar,) = [axes for axes in figure.axes if axes.get_ylabel() == "smallest angle"]
    labels = [label.get_text() for label in bar.get_yticklabels()]
    places = bar.get_yticks()
    assert labels
    for label, place in zip(labels, places, strict=True):
        assert float(label.rstrip("°")) == pytest.approx(1.0 + 6.0 * place)
