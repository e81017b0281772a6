"""Pictures: what their artists hold is what the report says, and what is drawn is the mesh."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import StepPatch

from dvr_cli.api.measuring import mesh_quality
from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.relax.stopping import Stopping
from dvr_cli.report.picture import State, picture
from dvr_cli.report.plot import plot_histogram, plot_sweeps, plot_vectors, styles
from dvr_cli.report.plot_mesh import INVERTED, KEPT, colour_scale, plot_boundary, plot_cut, plot_surface
from dvr_cli.report.render import render
from meshes import KINDS, delaunay, grid, random_mesh


@cache
def smoothed(kind, **options):
    """A mesh, its new points and the report with means, as a command that draws makes them."""
    mesh = random_mesh(kind, 2, n=4)
    return mesh, *smooth_mesh(mesh, SmoothOptions(stopping=Stopping(6), **options), means=True)


def drawn(mesh, points, report):
    states = [State("before", mesh.points, report.before), State("after", points, report.after)]
    return picture(domain_of(mesh), states, report.sweeps)


def axes_titled(figure, title):
    (axes,) = [axes for axes in figure.axes if axes.get_title().startswith(title)]
    return axes


def polygons(axes):
    """Corners and value of each polygon in a picture of a mesh, by their place in it."""
    (collection, *_) = [artist for artist in axes.collections if isinstance(artist, PolyCollection)]
    return [path.vertices[:-1] for path in collection.get_paths()], collection.get_array()


def test_kept_cells_are_drawn_apart():
    """Layers of flat quadrilaterals under squares: the flat ones have a colour of their own."""
    points, boxes = grid(8, 2)
    height = np.array([0.0, 0.01, 0.02, 0.03, 0.04, 0.2, 0.4, 0.6, 0.8])
    points[:, 1] = height[np.rint(8 * points[:, 1]).astype(int)]
    mesh = Mesh(points, [Cells("quad", boxes)])
    moved, report = smooth_mesh(mesh, SmoothOptions(boundary="slide", stopping=Stopping(6)), means=True)
    flat = points[boxes][:, :, 1].max(axis=1) < 0.05
    assert report.kept is not None
    assert report.kept[flat].all()
    assert not report.kept[points[boxes][:, :, 1].min(axis=1) > 0.3].any()
    assert (mesh_quality(mesh).kept == report.kept).all()
    states = [
        State(name, where, quality, report.kept)
        for name, where, quality in (("before", points, report.before), ("after", moved, report.after))
    ]
    figure = picture(domain_of(mesh), states, report.sweeps)
    for name, quality in (("before", report.before), ("after", report.after)):
        axes = axes_titled(figure, name)
        _, values = polygons(axes)
        assert (np.ma.getmaskarray(values) == report.kept).all()
        assert (values.data == quality.elements).all()
        FigureCanvasAgg(figure).draw()
        (collection, *_) = [artist for artist in axes.collections if isinstance(artist, PolyCollection)]
        colours = collection.get_facecolors()[:, :3]
        assert np.allclose(colours[report.kept], to_rgb(KEPT))
        assert not np.isclose(colours[~report.kept], to_rgb(KEPT)).all(axis=1).any()
    assert any("kept" in axes.get_ylabel() + axes.get_xlabel() for axes in figure.axes)


# --------------------------------------------------------------------------------------------- the numbers


@pytest.mark.parametrize("kind", KINDS)
def test_diagrams_show_the_numbers_of_the_report(kind):
    mesh, points, report = smoothed(kind, patches=kind == "tetra")
    figure = drawn(mesh, points, report)
    record = report.record()
    vectors = axes_titled(figure, "quality vector")
    assert vectors.get_xscale() == "log"
    for line, key in zip(vectors.lines, ("quality_vector_before", "quality_vector"), strict=True):
        assert line.get_ydata().tolist() == record[key]
        assert line.get_xdata().tolist() == list(range(1, report.relaxed + 1))
    bars = [patch for patch in axes_titled(figure, "elements by").patches if isinstance(patch, StepPatch)]
    assert [bar.get_data().values.tolist() for bar in bars] == [
        record[key]["histogram"] for key in ("before", "after")
    ]
    lines = {line.get_label(): line for line in axes_titled(figure, "over the sweeps").lines}
    number = [0, *(sweep["sweep"] for sweep in record["sweeps"])]
    for name, start, key in (("Q1", "q1", "q1"), ("mean", "mean", "elements_mean")):
        assert list(lines[name].get_xdata()) == number
        assert list(lines[name].get_ydata()) == [
            record["before"][start],
            *(sweep[key] for sweep in record["sweeps"]),
        ]


@pytest.mark.parametrize(
    "kind", ["triangle", *(pytest.param(k, marks=pytest.mark.long) for k in ("tetra", "mixed3d"))]
)
def test_the_mean_over_the_sweeps_ends_at_that_of_the_result(kind):
    _, _, report = smoothed(kind)
    assert report.sweeps[-1]["elements_mean"] == report.after.mean
    assert (
        "elements_mean"
        not in smooth_mesh(random_mesh(kind, 2), SmoothOptions(stopping=Stopping(1)))[1].sweeps[0]
    )


@pytest.mark.parametrize("kind", ["triangle", "quad", "mixed2d"])
def test_a_planar_mesh_is_drawn_as_it_is(kind):
    mesh, points, report = smoothed(kind)
    figure = drawn(mesh, points, report)
    cells = [vertices for block in mesh.cells for vertices in block.vertices]
    for name, at, quality in (("before", mesh.points, report.before), ("after", points, report.after)):
        axes = axes_titled(figure, f"{name}: worst mean ratio")
        corners, values = polygons(axes)
        assert values.tolist() == quality.elements.tolist()
        assert axes.get_aspect() == 1
        assert len(corners) == len(cells)
        for polygon, vertices in zip(corners, cells, strict=True):
            assert {tuple(corner) for corner in polygon} == {tuple(corner) for corner in at[vertices]}


@pytest.mark.parametrize("kind", ["tetra", "hexahedron", "wedge", "pyramid", "mixed3d"])
@pytest.mark.parametrize("plot", [plot_boundary, plot_cut])
def test_faces_of_a_volume_mesh_have_the_quality_of_their_cells(kind, plot):
    """Each polygon is a face of a cell: found again among all faces by its corners in the picture."""
    mesh = random_mesh(kind, 2, n=4)
    domain = domain_of(mesh)
    qualities = mesh_quality(mesh).quality.elements
    axes = Figure().subplots()
    plot(axes, mesh.points, domain.cells, qualities)
    corners, values = polygons(axes)
    assert len(corners) > 10
    right = np.array([0.74, 0.52, 0.0]) / np.hypot(0.74, 0.52)
    viewer = np.array([0.52, -0.74, 0.43]) / np.sqrt(0.52**2 + 0.74**2 + 0.43**2)
    flat = mesh.points @ np.column_stack([right, np.cross(viewer, right)])
    cells = [set(map(int, vertices)) for block in mesh.cells for vertices in block.vertices]
    for polygon, value in zip(corners, values, strict=True):
        distance = np.linalg.norm(flat[None] - polygon[:, None], axis=2)
        vertices = set(map(int, distance.argmin(axis=1)))
        assert distance.min(axis=1).max() < 1e-12
        assert value in {qualities[i] for i, cell in enumerate(cells) if vertices <= cell}


def test_the_boundary_of_a_cube_is_seen_from_three_sides_and_the_cut_is_its_farther_half():
    points, boxes = grid(4, 3)
    cells, qualities = [Cells("hexahedron", boxes)], np.arange(64.0)
    figure = Figure()
    axes = figure.subplots(1, 2)
    plot_boundary(axes[0], points, cells, qualities)
    plot_cut(axes[1], points, cells, qualities)
    centre = points[boxes].mean(axis=1)
    near = (centre[:, 0] > 0.75) | (centre[:, 1] < 0.25) | (centre[:, 2] > 0.75)
    assert set(polygons(axes[0])[1]) == set(np.flatnonzero(near))
    assert len(polygons(axes[0])[0]) == 3 * 16
    behind = centre[:, 1] > 0.5
    near = behind & ((centre[:, 0] > 0.75) | (centre[:, 1] < 0.75) | (centre[:, 2] > 0.75))
    assert set(polygons(axes[1])[1]) == set(np.flatnonzero(near))


def test_faces_are_drawn_from_back_to_front():
    """Two cubes, one behind the other: the faces of the nearer one come last."""
    points, boxes = grid(1, 3)
    both = np.concatenate([points - np.array([0, 3, 0]), points])
    axes = Figure().subplots()
    plot_boundary(axes, both, [Cells("hexahedron", np.concatenate([boxes, boxes + 8]))], np.array([1.0, 0.5]))
    assert polygons(axes)[1].tolist() == [0.5] * 3 + [1.0] * 3


def test_a_surface_in_space_is_drawn_from_both_sides():
    points, boxes = grid(2, 2)
    dome = np.column_stack([points, np.sin(3 * points[:, 0])])
    for order in ([0, 1, 2, 3], [3, 2, 1, 0]):
        axes = Figure().subplots()
        plot_surface(axes, dome, [Cells("quad", boxes[:, order])], np.arange(4.0))
        assert sorted(polygons(axes)[1]) == [0.0, 1.0, 2.0, 3.0]


def test_the_worst_elements_are_ringed_where_they_are():
    mesh = delaunay(200, 2, 1)
    report = mesh_quality(mesh)
    figure = picture(domain_of(mesh), [State("mesh", mesh.points, report.quality)])
    rings = [c for c in axes_titled(figure, "mesh").collections if isinstance(c, PathCollection)]
    assert len(report.quality.worst) == 10
    for ring in rings:
        np.testing.assert_allclose(ring.get_offsets(), [worst.centroid for worst in report.quality.worst])
    assert rings


# --------------------------------------------------------------------------------------------- the looks


def test_inverted_elements_have_a_colour_of_their_own():
    mesh = random_mesh("quad", 1, n=5, noise=0.9)
    quality = mesh_quality(mesh).quality
    assert quality.inverted
    figure = picture(domain_of(mesh), [State("mesh", mesh.points, quality)])
    (collection, *_) = axes_titled(figure, "mesh").collections
    assert (collection.get_clim(), collection.get_cmap().name) == ((0.0, 1.0), "cividis")
    scale = colour_scale()
    assert scale(-0.01) not in {scale(i) for i in range(256)}
    assert tuple(int(INVERTED[i : i + 2], 16) / 255 for i in (1, 3, 5)) == pytest.approx(scale(-0.01)[:3])


def test_lines_differ_in_more_than_colour():
    for number in range(1, 7):
        assert len({str(style["ls"]) for style in styles(number)}) == number
    assert len({str(sorted(map(str, style.items()))) for style in styles(12)}) == 12


@pytest.mark.parametrize("kind", [pytest.param("triangle", marks=pytest.mark.long), "mixed3d"])
def test_labels_do_not_overlap(kind):
    mesh, points, report = smoothed(kind, patches=True, polish=True)
    figure = drawn(mesh, points, report)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    texts = []
    for axes in figure.axes:
        low, high = axes.get_xlim()
        ticks = [label for label in axes.get_xticklabels() if low <= label.get_position()[0] <= high]
        labels = [axes.title, axes.xaxis.label, axes.yaxis.label, *ticks] if axes.axison else [axes.title]
        texts += [text.get_window_extent(canvas.get_renderer()) for text in labels if text.get_text()]
    assert len(texts) > 15
    for i, box in enumerate(texts):
        assert not any(box.overlaps(other) for other in texts[:i])
        assert figure.bbox.x0 <= box.x0
        assert box.x1 <= figure.bbox.x1


def test_phases_are_marked_off():
    axes = Figure().subplots()
    names = ["relax", "relax", "patches", "polish"]
    plot_sweeps(axes, [{"sweep": i, "phase": name, "q1": 0.5} for i, name in enumerate(names, start=1)])
    assert [text.get_text() for text in axes.texts] == ["relax", "patches", "polish"]
    assert [line.get_xdata()[0] for line in axes.lines[1:]] == [2.5, 3.5, 4.5]


def test_few_elements_in_large_bins_are_seen():
    axes = Figure().subplots()
    plot_histogram(axes, {"mesh": np.array([1, 0, 100_000])})
    assert axes.get_yscale() == "log"
    assert axes.get_ylim()[0] < 1


def test_what_is_missing_is_said():
    figure = Figure()
    axes = figure.subplots(1, 2)
    plot_vectors(axes[0], {"mesh": np.empty(0)})
    plot_sweeps(axes[1], [])
    assert [one.texts[0].get_text() for one in axes] == ["no relaxed vertex", "no sweeps"]
    single = Mesh(np.array([[0.0, 0], [1, 0], [0, 1]]), [Cells("triangle", np.array([[0, 1, 2]]))])
    state = State("one", single.points, mesh_quality(single).quality)
    assert render(picture(domain_of(single), [state], []), ".png")


def test_of_many_meshes_only_diagrams_are_drawn():
    mesh = random_mesh("triangle", 1)
    state = mesh_quality(mesh).quality
    for number, pictures in ((6, 6), (7, 0)):
        states = [State(str(i), mesh.points, state) for i in range(number)]
        figure = picture(domain_of(mesh), states)
        assert sum("worst mean ratio" in axes.get_title() for axes in figure.axes) == pictures
        assert len(axes_titled(figure, "quality vector").lines) == number


# --------------------------------------------------------------------------------------------- the files


def test_large_meshes_make_small_files():
    mesh = delaunay(12_000, 2, 1)
    quality = mesh_quality(mesh).quality
    figure = picture(domain_of(mesh), [State("mesh", mesh.points, quality)])
    svg = render(figure, ".svg")
    assert b"data:image/png;base64," in svg
    assert len(svg) < 2e6
    few = delaunay(100, 2, 1)
    figure = picture(domain_of(few), [State("mesh", few.points, mesh_quality(few).quality)])
    assert axes_titled(figure, "mesh").collections[0].get_rasterized() is False


@pytest.mark.parametrize(
    ("suffix", "magic"),
    [(".png", b"\x89PNG"), (".svg", b"<?xml"), pytest.param(".pdf", b"%PDF", marks=pytest.mark.long)],
)
def test_the_same_picture_is_the_same_bytes(suffix, magic):
    mesh = random_mesh("mixed2d", 1)
    state = State("mesh", mesh.points, mesh_quality(mesh).quality)
    one, other = (render(picture(domain_of(mesh), [state]), suffix) for _ in range(2))
    assert one.startswith(magic)
    assert one == other
