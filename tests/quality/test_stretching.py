"""Coherent stretching: layers are found, random slivers and gradings are not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import logm

from dvr_cli.backend import COMPILED, NUMPY
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.orientation import connected_parts
from dvr_cli.quality import sheets, stretching
from dvr_cli.quality.sheets import orderly
from dvr_cli.quality.stretching import coherent, inside_sheets_of, seeds_among
from dvr_cli.quality.targets import FORMED
from meshes import KINDS, delaunay, random_mesh
from needs import require


def grid(kind: str, levels: np.ndarray) -> Mesh:
    """Cells of a kind on a grid that is even but in its last direction, where it has these levels."""
    n = len(levels)
    flat = kind in ("triangle", "quad")
    axes = [np.linspace(0, 1, n), levels] if flat else [np.linspace(0, 1, n), np.linspace(0, 1, n), levels]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    place = np.arange(n ** len(axes)).reshape([n] * len(axes))
    if flat:
        a, b, c, d = (
            place[i : n - 1 + i, j : n - 1 + j].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
        )
        cells = [[a, b, c, d]] if kind == "quad" else [[a, b, c], [a, c, d]]
    else:
        corner = [
            place[i : n - 1 + i, j : n - 1 + j, k : n - 1 + k].ravel()
            for k in (0, 1)
            for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
        ]
        a, b, c, d, e, f, g, h = corner
        cells = {
            "hexahedron": [corner],
            "wedge": [[a, b, c, e, f, g], [a, c, d, e, g, h]],
            "tetra": [[a, b, c, g], [a, c, d, g], [a, d, h, g], [a, h, e, g], [a, e, f, g], [a, f, b, g]],
        }[kind]
    return Mesh(points, [Cells(kind, np.concatenate([np.stack(cell, axis=1) for cell in cells]))])


def layered(kind: str, height: float, n: int = 13) -> Mesh:
    """A unit square or cube, its lowest layers ``height`` high and growing by half up to the even size."""
    even = 1.0 / (n - 1)
    heights = np.minimum(height * 1.5 ** np.arange(n - 1), even)
    return grid(kind, np.concatenate([[0.0], np.cumsum(heights)]))


@pytest.mark.parametrize("kind", ["triangle", "tetra"])
def test_stretching_is_that_of_its_definition(kind):
    """L = -dev ln(A Aᵀ) by SciPy's matrix logarithm, A the map from a regular simplex."""
    mesh = random_mesh(kind, 4)
    domain = domain_of(mesh)
    d = domain.dimension
    regular = np.array([[1, 0, 0], [0.5, 0.75**0.5, 0], [0.5, 0.75**0.5 / 3, (2 / 3) ** 0.5]])[:d, :d]
    rows = stretching._stretching(domain.points, domain.corners, np.ones(len(domain.corners.vertices), bool))
    upper = np.triu_indices(d, 1)
    for vertices, row in zip(domain.corners.vertices, rows, strict=True):
        a = np.linalg.solve(regular, domain.points[vertices[1:]] - domain.points[vertices[0]]).T
        full = -logm(a @ a.T)
        full -= np.trace(full) / d * np.eye(d)
        np.testing.assert_allclose(row, [*np.diag(full), *full[upper]], atol=1e-9)
        aspect = np.ptp(np.linalg.eigvalsh(full)) / 2
        assert stretching._log_aspect(row[None])[0] == pytest.approx(aspect, abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_random_cells_are_not_kept(kind):
    for seed in range(3):
        assert coherent(domain_of(random_mesh(kind, seed))) is None


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("kind", ["triangle", "quad", "tetra", "hexahedron", "wedge"])
def test_layers_are_kept_and_the_rest_is_not(kind, scale):
    mesh = layered(kind, 1 / 12 / 60)
    points = mesh.points * scale
    found = coherent(domain_of(Mesh(points, mesh.cells)))
    assert found is not None
    cells = np.concatenate([points[block.vertices].mean(axis=1)[:, -1] for block in mesh.cells]) / scale
    low = np.sort(np.unique(points[:, -1]))[1] / scale
    assert found.kept[cells < low].all()
    if kind != "tetra":  # the six tetrahedra of a cube are all drawn out along one diagonal: coherent, too
        assert not found.kept[cells > cells.max() - 0.12].any()
    assert found.max_aspect > 20


def test_the_direction_of_layers_does_not_matter():
    mesh = layered("triangle", 1 / 800)
    straight = coherent(domain_of(mesh))
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    turned = coherent(domain_of(Mesh(mesh.points @ turn.T, mesh.cells)))
    assert straight is not None
    assert turned is not None
    assert (turned.kept == straight.kept).all()
    assert (turned.held == straight.held).all()


def test_inverted_cells_are_never_kept():
    mesh = layered("quad", 1 / 800)
    points = mesh.points.copy()
    inner = int(np.flatnonzero(domain_of(mesh).interior)[60])
    points[inner, 1] -= 0.3
    domain = domain_of(Mesh(points, mesh.cells))
    found = coherent(domain)
    assert found is not None
    broken = (mesh.cells[0].vertices == inner).any(axis=1)
    negative = domain.corners.by_cell(np.minimum, _qualities(domain)) <= 0
    assert negative.any()
    assert (broken | ~negative).all()
    assert not found.kept[negative].any()
    rows = mesh.cells[0].vertices
    assert not found.held[rows[negative]].any()
    others = rows[~np.isin(rows, rows[negative]).any(axis=1) & found.kept]
    assert len(others)
    assert found.held[others].all()
    assert found.held.sum() == np.isin(np.unique(rows[found.kept]), rows[negative], invert=True).sum()


def _qualities(domain):
    from dvr_cli.quality.mean_ratio import corner_qualities

    return corner_qualities(domain.points, domain.corners)


@pytest.mark.parametrize("kind", ["triangle", "hexahedron", "pyramid"])
def test_averages_compiled_are_the_same_to_the_bit(kind):
    require("numba")
    domain = domain_of(random_mesh(kind, 0))
    corners = domain.corners
    for shape in ((), (6,)):
        values = np.random.default_rng(0).normal(size=(len(corners.start) - 1, *(shape or (1,))))
        arguments = values, corners.vertices, corners.start, len(domain.points)
        plain = stretching.averaged(*arguments)
        assert COMPILED.twin(stretching.averaged)(*arguments).tobytes() == plain.tobytes()


def squeezed(kind: str, seed: int, power: float, share: float) -> Mesh:
    """A random mesh whose cells get flatter towards the floor, below a part of its height."""
    mesh = random_mesh(kind, seed, n=4)
    height = mesh.points[:, -1] / share
    points = mesh.points.copy()
    points[:, -1] = np.where(height < 1, share * np.abs(height) ** power, points[:, -1])
    return Mesh(points, mesh.cells)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(KINDS), st.integers(0, 10**6), st.floats(1.0, 8.0), st.sampled_from([0.3, 0.6, 1.0]))
def test_the_compiled_search_keeps_the_same_cells_to_the_bit(kind, seed, power, share):
    require("numba")
    mesh = squeezed(kind, seed, power, share)
    plain, compiled = coherent(domain_of(mesh)), coherent(domain_of(mesh, backend=COMPILED))
    assert (plain is None) == (compiled is None)
    if plain is not None and compiled is not None:
        assert compiled.kept.tobytes() == plain.kept.tobytes()
        assert compiled.held.tobytes() == plain.held.tobytes()
        assert compiled.max_aspect == plain.max_aspect


def _squeezed_ever_more(kind):
    """Seed, domain, qualities of corners, which cells are positive, and the cells with their stretching."""
    for seed, power in ((0, 2.0), (1, 3.0), (2, 5.0), (3, 8.0)):
        domain = domain_of(squeezed(kind, seed, power, 0.6))
        corners, quality = domain.corners, _qualities(domain)
        positive = corners.by_cell(np.minimum, quality) > FORMED[domain.dimension]
        cells = stretching._Cells(domain)
        tensor = cells.from_corners(stretching._stretching(domain.points, corners, positive))
        yield seed, domain, quality, positive, cells, tensor


@pytest.mark.parametrize("kind", KINDS)
def test_the_compiled_search_leaves_out_no_seed(kind):
    """Against the third averages of all cells, and with the estimate a hundredth away at most."""
    require("numba")
    found = 0
    for _, domain, quality, positive, cells, tensor in _squeezed_ever_more(kind):
        corners = domain.corners
        aspect = stretching._log_aspect(cells.thrice(tensor))
        parts = corners.vertices, corners.shapes, corners.start, stretching.roots(corners.table)
        likely = COMPILED.twin(stretching.candidates)(domain.points, *parts, quality, positive)
        assert likely[aspect >= np.log(stretching.SEED)].all()
        assert (likely == (aspect >= np.log(stretching.LIKELY)))[
            np.abs(aspect - np.log(stretching.LIKELY)) > 0.01
        ].all()
        found += likely.sum()
    assert found > 0


def test_an_average_never_has_a_larger_aspect_than_its_parts():
    """The search skips meshes by this: the averaged bound is not below the averaged aspect."""
    domain = domain_of(random_mesh("tetra", 4))
    corners = domain.corners
    cells = stretching._Cells(domain)
    every = np.ones(len(corners.start) - 1, dtype=bool)
    tensor = cells.from_corners(stretching._stretching(domain.points, corners, every))
    bound = cells.thrice(cells.from_corners(stretching.largest_log_aspect(_qualities(domain), 3)))
    assert (stretching._log_aspect(cells.thrice(tensor)) <= bound * (1 + 1e-9) + 1e-12).all()


def test_a_mesh_without_inner_cells_is_no_layer():
    assert (
        coherent(domain_of(Mesh(np.eye(3)[:, :2] + 0.0, [Cells("triangle", np.array([[2, 0, 1]]))]))) is None
    )


def one_row(kind: str, aspect: float, place: int, n: int) -> tuple[Mesh, np.ndarray]:
    """An even grid but for one flat row, its vertices shaken along it, others anywhere; (N,) the row's."""
    even = 1.0 / (n - 1)
    heights = np.full(n - 1, even)
    heights[place] = even / aspect
    levels = np.concatenate([[0.0], np.cumsum(heights)])
    mesh = grid(kind, levels)
    of_row = np.isin(mesh.points[:, -1], levels[[place, place + 1]])
    shift = 0.15 * even * np.random.default_rng(place).uniform(-1, 1, mesh.points.shape)
    shift[of_row, -1] = 0.0
    inner = domain_of(mesh).interior
    return Mesh(np.where(inner[:, None], mesh.points + shift, mesh.points), mesh.cells), of_row


@pytest.mark.parametrize("place", [0, 4])
@pytest.mark.parametrize("aspect", [7.0, 10.0, 100.0])
@pytest.mark.parametrize(("kind", "n"), [("triangle", 13), ("quad", 12), ("wedge", 9), ("hexahedron", 9)])
def test_a_single_row_is_found(kind, n, aspect, place):
    mesh, of_row = one_row(kind, aspect, place, n)
    found = coherent(domain_of(mesh))
    assert found is not None
    inside = np.concatenate([of_row[block.vertices].all(axis=1) for block in mesh.cells])
    assert found.kept[inside].all()
    assert found.held[of_row].all()
    assert found.kept[~inside].mean() < 0.1
    if kind in ("quad", "hexahedron"):  # simplices and wedges beside it may be flat by themselves
        assert not found.kept[~inside].any()


def test_a_single_row_round_a_circle_is_found():
    turns, radii = np.linspace(0, 2 * np.pi, 25)[:-1], np.array([0.6, 0.8, 1.0, 1.02, 1.25, 1.5])
    points = np.array([[r * np.cos(t), r * np.sin(t)] for t in turns for r in radii])
    place = np.arange(len(points)).reshape(24, 6)
    following = np.roll(place, -1, axis=0)
    quads = np.stack([place[:, :-1], place[:, 1:], following[:, 1:], following[:, :-1]], axis=-1)
    found = coherent(domain_of(Mesh(points, [Cells("quad", quads.reshape(-1, 4))])))
    assert found is not None
    assert (found.kept.reshape(24, 5) == [False, False, True, False, False]).all()


@pytest.mark.parametrize(("kind", "n", "seed"), [("triangle", 13, 0), ("quad", 12, 1), ("hexahedron", 9, 2)])
def test_cells_that_cannot_be_joined_to_a_sheet_make_no_difference(kind, n, seed):
    """Sheets of cells that may be flat, and of those alone that neighbours could join to one."""
    mesh, _ = one_row(kind, 8.0, 3, n)
    domain = domain_of(mesh)
    corners, rng = domain.corners, np.random.default_rng(seed)
    every = np.ones(len(corners.start) - 1, dtype=bool)
    stretching_ = stretching._Cells(domain).from_corners(
        stretching._stretching(domain.points, corners, every)
    )
    possible = (stretching._log_aspect(stretching_) > np.log(5.0)) | (rng.random(len(every)) < 0.3)
    near = sheets.joined(domain.cells, possible, domain.backend)
    expected = sheets.in_sheets(domain.cells, possible, stretching_)
    assert expected.any()
    assert near.sum() < possible.sum()
    assert (sheets.in_sheets(domain.cells, near, stretching_) == expected).all()


def test_few_flat_cells_and_flat_tetrahedra_make_no_sheet():
    mesh, _ = one_row("quad", 10.0, 3, 9)
    assert coherent(domain_of(mesh)) is None
    mesh, _ = one_row("tetra", 10.0, 4, 9)
    assert coherent(domain_of(mesh)) is None


@pytest.mark.parametrize(("kind", "n"), [("quad", 40), ("hexahedron", 9), ("wedge", 9), ("mixed2d", 40)])
def test_shaken_cells_make_no_sheet(kind, n):
    for noise in (0.3, 0.45):
        assert coherent(domain_of(random_mesh(kind, 1, n, noise))) is None


@pytest.mark.parametrize(
    ("n", "dimension", "seed", "height"),
    [
        (1000, 2, 0, 1.0),
        (1000, 2, 2, 1.0),
        (3000, 2, 1, 1.0),
        (500, 3, 0, 0.05),
        (500, 3, 1, 0.05),
        pytest.param(20000, 3, 0, 1.0, marks=pytest.mark.long),
        pytest.param(100000, 2, 0, 1.0, marks=pytest.mark.long),
    ],
)
def test_the_flat_hull_of_random_points_is_no_layer(n, dimension, seed, height, monkeypatch):
    """Its cells are flat alike along a straight side, and only the order of their sizes tells them apart."""
    domain = domain_of(delaunay(n, dimension, seed, height))
    assert coherent(domain) is None
    monkeypatch.setattr(stretching, "ORDERLY", 0.0)
    found = coherent(domain)
    assert found is not None
    assert found.kept.sum() > 100


def test_parts_of_a_mesh_have_its_seeds():
    """Each part with all cells within REACH steps is asked about its own; and a mesh of random points."""
    whole = domain_of(grid("tetra", np.concatenate([[0.0, 0.002, 0.004], np.linspace(0.1, 1.0, 8)])))
    rows = whole.cells[0].vertices
    quality = _qualities(whole)
    possible = quality > FORMED[3]
    seeds = stretching._seeds(whole, stretching._Cells(whole), quality, possible, possible)
    found = []
    heights = whole.points[rows].mean(axis=1)[:, -1]
    for part in np.array_split(np.argsort(heights), 12):
        near = stretching._Cells(whole).around(part, stretching.REACH)
        among = np.isin(np.flatnonzero(near), part)
        of_part = domain_of(Mesh(whole.points, [Cells("tetra", rows[near])]))
        of_this = seeds_among(of_part, among, _qualities(of_part))
        found.append(len(of_this) > 0)
        assert set(np.flatnonzero(near)[of_this]) == set(part) & set(seeds)
    assert 0 < sum(found) < len(found)
    flat = domain_of(delaunay(500, 3, 0, 0.05))
    assert not len(seeds_among(flat, np.ones(len(flat.cell_ids), dtype=bool), _qualities(flat)))


@pytest.mark.parametrize("backend", [NUMPY, COMPILED], ids=["numpy", "numba"])
@pytest.mark.parametrize("kind", KINDS)
def test_each_vertex_in_whose_cells_stretching_is_large_on_average_is_found(kind, backend):
    """Against the averages themselves, of those asked about only; compiled no others but for digits."""
    if backend is COMPILED:
        require("numba")
    found = 0
    for seed, domain, quality, positive, _, tensor in _squeezed_ever_more(kind):
        corners = domain.corners
        average = np.zeros((len(domain.points), tensor.shape[1]))
        rows, cell = corners.vertices, np.repeat(np.arange(len(tensor)), np.diff(corners.start))
        np.add.at(average, rows, tensor[cell][:, None])
        average /= np.maximum(np.bincount(rows.ravel(), minlength=len(average)), 1)[:, None]
        aspect = stretching._log_aspect(average)
        asked = np.random.default_rng(seed).random(len(average)) < 0.7
        parts = rows, corners.shapes, corners.start, stretching.roots(corners.table), quality, positive
        stretched = backend.twin(stretching.stretched_vertices)(domain.points, *parts, asked)
        assert stretched[asked & (aspect >= np.log(stretching.SEED))].all()
        assert not stretched[~asked].any()
        if backend is COMPILED:
            assert not stretched[aspect < np.log(stretching.LIKELY) - 0.01].any()
        found += stretched.sum()
    assert found > 0


@pytest.mark.parametrize("kind", ["triangle", "quad", "hexahedron", "wedge"])
@pytest.mark.parametrize("sheet", [True, False])
def test_parts_of_a_mesh_add_up_to_its_sheets(kind, sheet):
    """Each part with the cells around it; a thin layer makes a sheet, though no part has enough of it."""
    heights = np.linspace(0.0, 1.0, 12 if kind in ("triangle", "quad") else 8)
    heights[1] = 0.01 if sheet else heights[1]
    whole = domain_of(grid(kind, heights))
    n, cells = len(whole.cell_ids), stretching._Cells(whole)
    weight, pairs = np.zeros(n), []
    for part in np.array_split(np.random.default_rng(1).permutation(n), 5):
        near = cells.around(part, 2)
        ids = np.flatnonzero(near)
        beside = domain_of(Mesh(whole.points, [Cells(kind, whole.cells[0].vertices[near])]))
        found = inside_sheets_of(beside, _qualities(beside))
        if found is not None:
            own = np.isin(ids[found.cells], part)
            weight[ids[found.cells[own]]] = found.weight[own]
            alike = ids[found.alike]
            pairs.append(alike[np.isin(alike, part).any(axis=1)])
    one, other = np.concatenate([np.empty((0, 2), dtype=int), *pairs]).T
    both = (weight[one] > 0) & (weight[other] > 0)
    label = connected_parts(n, one[both], other[both])
    assert (np.bincount(label, weight).max() >= 1.0) == sheet
    assert (coherent(whole) is not None) == sheet


@pytest.mark.parametrize(("kind", "n"), [("triangle", 14), ("tetra", 7)])
def test_cells_of_even_size_drawn_out_as_a_whole_are_kept(kind, n):
    mesh = grid(kind, np.linspace(0, 1, n))
    inner = domain_of(mesh).interior
    shift = 0.15 / n * np.random.default_rng(0).uniform(-1, 1, mesh.points.shape)
    points = np.where(inner[:, None], mesh.points + shift, mesh.points)
    points[:, -1] /= 20.0
    found = coherent(domain_of(Mesh(points, mesh.cells)))
    assert found is not None
    assert found.kept.mean() > 0.95


def test_a_flat_cell_is_orderly_beside_two_of_its_size():
    """A strip of triangles

    1---3---5---7
     \\ / \\ / \\ /
      0---2---4---6   of which the cell 2 4 3 is five times as large as all others.
    """
    rows = np.array([[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5], [4, 6, 5], [5, 6, 7]])
    blocks = [Cells("triangle", rows)]
    every, size = np.ones(6, dtype=bool), np.log([1.0, 1.0, 5.0, 1.0, 1.0, 1.0])
    assert orderly(blocks, every, np.zeros(6)).tolist() == [False, True, True, True, True, False]
    assert orderly(blocks, every, size).tolist() == [False, False, False, False, True, False]
    assert orderly(blocks, size == 0, np.zeros(6)).tolist() == [False, False, False, False, True, False]
    assert not orderly(blocks, ~every, size).any()


def test_random_triangles_make_no_sheet():
    domain = domain_of(delaunay(3000, 2, 0))
    cells = stretching._Cells(domain)
    positive = domain.corners.by_cell(np.minimum, _qualities(domain)) > FORMED[2]
    assert not stretching._in_sheets(domain, cells, positive).any()
