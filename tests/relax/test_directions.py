"""Direction fields: the vectors of each kind, how lists and arrays are cycled, and what is refused."""

import math

import meshio
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import dvr_cli
from dvr_cli.api.options import SmoothOptions
from dvr_cli.boundary.freedom import unit
from dvr_cli.cli.main import main
from dvr_cli.errors import DvrError, InputError, UsageError
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.options import OPTIONS
from dvr_cli.relax.directions import DIRECTIONS, Direction, direction_field, radial_field
from meshes import random_mesh

FLAT, VOLUME = random_mesh("triangle", 1), random_mesh("tetra", 1)
CELLS = {"triangle": FLAT.cells[0].vertices}
TILT = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
IN_SPACE = {  # the flat mesh in planes in space, and how vectors in space are seen there
    "z": (np.column_stack([FLAT.points, np.full(len(FLAT.points), 3.0)]), lambda v: v[..., [0, 1]]),
    "x": (np.column_stack([np.full(len(FLAT.points), 3.0), FLAT.points]), lambda v: v[..., [1, 2]]),
    "tilted": (FLAT.points @ TILT[:2] + TILT[2], None),
}


def all_directions(mesh, entries, sweep=0, point_data=None, vertices=None, **options):
    """Directions of all vertices (or some) in one sweep, and the field's domain."""
    domain = domain_of(mesh)
    field = direction_field(entries, domain, point_data or {}, **options)
    vertices = np.arange(len(mesh.points)) if vertices is None else vertices
    return field(sweep, domain.points[vertices], vertices)


def in_space(name):
    return Mesh(IN_SPACE[name][0], FLAT.cells)


def normalised(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


# ------------------------------------------------------------------------------------------- all fields


@given(
    arrays(
        np.float64, st.tuples(st.integers(0, 5), st.sampled_from([2, 3])), elements=st.floats(-1e300, 1e300)
    )
)
def test_unit_scales_rows_to_length_one_and_leaves_zero_rows(vectors):
    result = unit(vectors)
    zero = ~vectors.any(axis=1)
    assert not result[zero].any()
    np.testing.assert_allclose(np.linalg.norm(result[~zero], axis=1), 1, rtol=1e-15)
    assert (np.sign(result) * np.sign(vectors) >= 0).all()


@pytest.mark.parametrize("scale", [5e-324, 1e-300, 1e-160, 1.0, 1e160, 1e308])
def test_unit_takes_vectors_of_any_size(scale):
    np.testing.assert_allclose(
        unit(scale * np.array([[0.0, 1.0, 1.0]])), [[0, 0.5**0.5, 0.5**0.5]], rtol=1e-15
    )


@pytest.mark.parametrize("mesh", [FLAT, VOLUME], ids=["2D", "3D"])
@pytest.mark.parametrize(
    "name", [*sorted(DIRECTIONS.keys() - {"steepest", "narrowing", "optimal"}), "array", "field:f"]
)
def test_directions_have_unit_length(name, mesh):
    d = mesh.points.shape[1]
    if name == "z" and d == 2:
        return
    vectors = np.random.default_rng(0).normal(size=mesh.points.shape)
    for sweep in range(4):
        result = all_directions(mesh, [vectors if name == "array" else name], sweep, {"f": vectors})
        assert result.shape == mesh.points.shape
        np.testing.assert_allclose(np.linalg.norm(result, axis=1), 1, rtol=1e-15)


# ----------------------------------------------------------------------------------------------- random


@pytest.mark.parametrize("mesh", [FLAT, VOLUME], ids=["2D", "3D"])
def test_random_directions_depend_on_seed_and_sweep_only(mesh):
    one = [all_directions(mesh, ["random"], sweep, seed=5) for sweep in range(3)]
    again = [all_directions(mesh, ["random"], sweep, seed=5) for sweep in (2, 0, 1)]
    assert [a.tobytes() for a in one] == [again[i].tobytes() for i in (1, 2, 0)]
    others = [all_directions(mesh, ["random"], sweep, seed=seed) for seed in (0, 6) for sweep in range(3)]
    vectors = {row.tobytes() for field in one + others for row in field}
    assert len(vectors) == 9 * len(mesh.points)  # no vector comes twice


def test_random_directions_of_a_vertex_do_not_depend_on_the_others_or_their_order():
    everywhere = all_directions(VOLUME, ["random"], 3, seed=1)
    some = np.random.default_rng(0).permutation(len(VOLUME.points))[:10]
    assert (
        all_directions(VOLUME, ["random"], 3, vertices=some, seed=1).tobytes() == everywhere[some].tobytes()
    )
    moved = Mesh(VOLUME.points * 3 + 1, VOLUME.cells)
    assert all_directions(moved, ["random"], 3, seed=1).tobytes() == everywhere.tobytes()


def test_seeds_beyond_63_bits_are_seeds_of_their_own():
    seeds = (0, 1, 2**63 - 1, 2**63, 2**63 + 1, 2**64 - 2, 2**64 - 1)
    assert len({all_directions(FLAT, ["random"], seed=seed).tobytes() for seed in seeds}) == len(seeds)


@pytest.mark.parametrize("mesh", [FLAT, VOLUME], ids=["2D", "3D"])
def test_random_directions_are_uniform(mesh):
    """Mean 0 and covariance 1/d, each to five standard deviations."""
    d = mesh.points.shape[1]
    sweeps = np.concatenate([all_directions(mesh, ["random"], sweep) for sweep in range(400)])
    assert np.abs(sweeps.mean(axis=0)).max() < 5 * np.sqrt(1 / d / len(sweeps))
    assert np.abs(sweeps.T @ sweeps / len(sweeps) - np.eye(d) / d).max() < 5 / d / np.sqrt(len(sweeps))


# ---------------------------------------------------------------------------------------------- by name


@pytest.mark.parametrize(("mesh", "names"), [(FLAT, "xy"), (VOLUME, "xyz")], ids=["2D", "3D"])
def test_coordinate_directions(mesh, names):
    for number, name in enumerate(names):
        expected = np.tile(np.eye(len(names))[number], (len(mesh.points), 1))
        assert all_directions(mesh, [name]).tolist() == expected.tolist()
    for sweep in range(7):
        one_by_one = all_directions(mesh, [names[sweep % len(names)]])
        assert all_directions(mesh, ["axis"], sweep).tolist() == one_by_one.tolist()


@pytest.mark.parametrize("center", [None, (0.3, -0.7)])
def test_circumferential_directions_are_those_of_the_paper(center):
    """Section 5.2: (-y, x)/r."""
    x, y = (FLAT.points - (FLAT.points.mean(axis=0) if center is None else center)).T
    expected = np.column_stack([-y, x]) / np.hypot(x, y)[:, None]
    np.testing.assert_allclose(all_directions(FLAT, ["circumferential"], center=center), expected, atol=1e-14)


@pytest.mark.parametrize("center", [None, (0.3, -0.7)])
def test_radial_directions_point_away_from_the_center(center):
    offset = FLAT.points - (FLAT.points.mean(axis=0) if center is None else center)
    np.testing.assert_allclose(
        all_directions(FLAT, ["radial"], center=center), normalised(offset), atol=1e-14
    )


@pytest.mark.parametrize("axis", [None, (0, 0, -2.0), (1.0, 2.0, 3.0)])
@pytest.mark.parametrize("center", [None, (0.3, -0.7, 2.0)])
def test_directions_around_an_axis(center, axis):
    """Radial: off the axis. Circumferential: across both, turning about the axis by the right-hand rule."""
    around = normalised(np.array((0, 0, 1.0) if axis is None else axis))
    offset = VOLUME.points - (VOLUME.points.mean(axis=0) if center is None else center)
    radial = all_directions(VOLUME, ["radial"], center=center, axis=axis)
    circumferential = all_directions(VOLUME, ["circumferential"], center=center, axis=axis)
    np.testing.assert_allclose(radial @ around, 0, atol=1e-14)
    np.testing.assert_allclose(np.cross(radial, offset) @ around, 0, atol=1e-14)
    assert ((radial * offset).sum(axis=1) > 0).all()
    np.testing.assert_allclose(circumferential @ around, 0, atol=1e-14)
    np.testing.assert_allclose((circumferential * radial).sum(axis=1), 0, atol=1e-14)
    assert (np.cross(radial, circumferential) @ around > 0.99).all()


@pytest.mark.parametrize("name", ["circumferential", "radial"])
def test_vertices_on_the_axis_stay(name):
    mesh = Mesh(FLAT.points.copy(), FLAT.cells)
    assert all_directions(mesh, [name], center=mesh.points[4])[4].tolist() == [0, 0]
    on_axis = VOLUME.points[4] - [0, 0, 2.0]
    assert all_directions(VOLUME, [name], center=on_axis)[4].tolist() == [0, 0, 0]


def test_directions_follow_the_vertices():
    """Circumferential and radial directions are those at the place a vertex has reached."""
    domain = domain_of(FLAT)
    field = direction_field(["radial"], domain, {}, center=(0.0, 0.0))
    np.testing.assert_allclose(field(0, np.array([[0.0, 5.0]]), np.array([3])), [[0, 1]])


def test_center_of_a_mesh_in_space_may_have_two_or_three_coordinates():
    expected = all_directions(FLAT, ["radial"], center=(0.2, 0.3))
    for center in ((0.2, 0.3), (0.2, 0.3, 3.0), (0.2, 0.3, -8.0)):
        np.testing.assert_array_equal(all_directions(in_space("z"), ["radial"], center=center), expected)


# --------------------------------------------------------------------------------------- arrays and lists


def test_arrays_are_given_for_every_sweep_or_one_sweep_after_the_other():
    frames = np.random.default_rng(0).normal(size=(3, *FLAT.points.shape))
    frames[:, 5] = 0
    for sweep in range(7):
        np.testing.assert_allclose(all_directions(FLAT, [frames[0]], sweep)[:5], normalised(frames[0, :5]))
        cycled = all_directions(FLAT, [frames], sweep)
        np.testing.assert_allclose(cycled[:5], normalised(frames[sweep % 3, :5]))
        assert cycled[5].tolist() == [0, 0]
    some = np.array([7, 2, 9])
    np.testing.assert_allclose(all_directions(FLAT, [frames], 1, vertices=some), normalised(frames[1, some]))


def test_lists_are_cycled_sweep_by_sweep():
    """An array (K, N, d) in a list goes on to its next entry when its own turn comes again."""
    frames = np.random.default_rng(0).normal(size=(2, *FLAT.points.shape))
    entries = ["axis", frames, "radial"]
    x, y, radial = (all_directions(FLAT, [name]) for name in ("x", "y", "radial"))
    first, second = normalised(frames)
    expected = [x, y, first, radial, x, y, second, radial, x, y, first, radial, x]
    for sweep, directions in enumerate(expected):
        np.testing.assert_allclose(all_directions(FLAT, entries, sweep), directions, atol=1e-15)


def test_random_directions_in_a_list_differ_from_turn_to_turn():
    turns = [all_directions(FLAT, ["random", "x", "random"], sweep) for sweep in (0, 2, 3, 5)]
    assert len({directions.tobytes() for directions in turns}) == 4


@pytest.mark.parametrize("kind", ["f4", "i8", "u1", ">f8"])
def test_numbers_of_any_type(kind):
    vectors = np.tile(np.array([3, 4], dtype=kind), (len(FLAT.points), 1))
    np.testing.assert_allclose(all_directions(FLAT, [vectors]), np.tile([0.6, 0.8], (len(vectors), 1)))


@pytest.mark.parametrize("shape", [(), (4,)])
def test_point_fields_are_arrays_by_name(shape):
    vectors = np.random.default_rng(0).normal(size=(*shape, *FLAT.points.shape))
    data = {"velocity": vectors, "other": -vectors}
    for sweep in range(5):
        by_name = all_directions(FLAT, ["field:velocity"], sweep, data)
        assert by_name.tobytes() == all_directions(FLAT, [vectors], sweep).tobytes()


# ---------------------------------------------------------------------------------- planar meshes in space


@pytest.mark.parametrize("frames", [(), (3,)])
@pytest.mark.parametrize("name", ["z", "x"])
def test_vectors_in_space_are_projected_into_the_plane(name, frames):
    vectors = np.random.default_rng(0).normal(size=(*frames, len(FLAT.points), 3))
    seen = IN_SPACE[name][1](vectors)
    for sweep in range(4):
        expected = normalised(seen[sweep % 3] if frames else seen)
        np.testing.assert_allclose(all_directions(in_space(name), [vectors], sweep), expected, atol=1e-15)


def test_vectors_in_space_are_projected_into_a_tilted_plane():
    mesh = in_space("tilted")
    axes = domain_of(mesh).plane.axes
    vectors = np.random.default_rng(0).normal(size=mesh.points.shape)
    within = normalised(vectors - np.outer(vectors @ TILT[2], TILT[2]))
    np.testing.assert_allclose(all_directions(mesh, [vectors]) @ axes, within, atol=1e-13)
    for number, name in enumerate("xyz"):
        along = np.eye(3)[number] - TILT[2, number] * TILT[2]
        expected = np.tile(normalised(along), (len(mesh.points), 1))
        np.testing.assert_allclose(all_directions(mesh, [name]) @ axes, expected, atol=1e-13)


@pytest.mark.parametrize("name", ["z", "x", "tilted"])
def test_vectors_across_the_plane_leave_the_vertices_where_they_are(name):
    """Also where the projection is zero but for rounding, which is no direction to move along."""
    normal = {"z": np.eye(3)[2], "x": np.eye(3)[0], "tilted": TILT[2]}[name]
    lengths = np.random.default_rng(0).uniform(0.1, 10, len(FLAT.points))
    assert not all_directions(in_space(name), [np.outer(lengths, normal)]).any()


def test_vectors_with_two_components_are_taken_in_x_and_y():
    vectors = np.random.default_rng(0).normal(size=FLAT.points.shape)
    np.testing.assert_allclose(all_directions(in_space("z"), [vectors]), normalised(vectors))
    with_z = np.column_stack([vectors, np.zeros(len(vectors))])
    np.testing.assert_array_equal(
        all_directions(in_space("tilted"), [vectors]), all_directions(in_space("tilted"), [with_z])
    )


def test_third_components_are_dropped_in_a_mesh_without_third_coordinates():
    vectors = np.random.default_rng(0).normal(size=(len(FLAT.points), 3))
    np.testing.assert_allclose(all_directions(FLAT, [vectors]), normalised(vectors[:, :2]))


@pytest.mark.parametrize(("plane", "direction"), [("z", "z"), ("x", "x")])
def test_coordinate_direction_across_the_plane_is_refused(plane, direction):
    with pytest.raises(UsageError, match=rf"directions {direction}: perpendicular"):
        all_directions(in_space(plane), [direction])


# ------------------------------------------------------------------------------------------------- files


def smoothed(directions):
    """The points of the flat mesh after a few sweeps."""
    return dvr_cli.smooth(FLAT.points, CELLS, directions=directions, max_iterations=5, tol=0)[0]


def save(path, vectors):
    if path.suffix == ".npy":
        np.save(path, vectors)
    else:
        np.savetxt(path, vectors, delimiter="," if path.suffix == ".csv" else " ", fmt="%.17g")


@pytest.mark.parametrize("suffix", [".npy", ".csv", ".txt", ".NPY", ".CSV"])
def test_arrays_from_files(tmp_path, suffix):
    vectors = np.random.default_rng(0).normal(size=FLAT.points.shape)
    path = tmp_path / f"directions{suffix}"
    if suffix == ".NPY":
        with path.open("wb") as file:
            np.save(file, vectors)
    else:
        save(path.with_suffix(suffix.lower()), vectors)
        path.with_suffix(suffix.lower()).rename(path)
    from_file, by_hand = (smoothed(directions) for directions in (f"file:{path}", vectors))
    assert from_file.tobytes() == by_hand.tobytes()
    assert (by_hand != FLAT.points).any()


def test_arrays_for_several_sweeps_from_files(tmp_path):
    frames = np.random.default_rng(0).normal(size=(3, *FLAT.points.shape))
    path = tmp_path / "frames.npy"
    np.save(path, frames)
    from_file, by_hand = (smoothed(directions) for directions in (f"x, file:{path}", ["x", frames]))
    assert from_file.tobytes() == by_hand.tobytes()


def refusal(error, call, *arguments, **options):
    """The message, of one line, with which a call is refused."""
    with pytest.raises(error) as caught:
        call(*arguments, **options)
    message = str(caught.value)
    assert message
    assert "\n" not in message
    return message


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("words.csv", b"x,y\n1,2\n"),
        ("ragged.csv", b"1,2\n3\n"),
        ("binary.txt", b"\xff\xfe\x00\x81"),
        ("semicolons.csv", b"1;2\n3;4\n"),
        ("cut.npy", b"\x93NUMPY\x01\x00"),
        ("text.npy", b"1 2\n3 4\n"),
        ("matrix.mat", b""),
        ("nosuffix", b"1 2\n"),
    ],
)
def test_files_that_hold_no_table_of_numbers(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    assert name in refusal(UsageError, SmoothOptions, f"file:{path}")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["empty.npy", "empty.csv", "empty.txt"])
def test_empty_files(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b"")
    assert name in refusal(UsageError, SmoothOptions, f"file:{path}")


def test_archives_are_not_arrays(tmp_path):
    np.savez(tmp_path / "several.npz", a=FLAT.points, b=FLAT.points)
    path = (tmp_path / "several.npz").rename(tmp_path / "several.npy")
    assert "several.npy" in refusal(UsageError, SmoothOptions, f"file:{path}")


def test_arrays_of_objects_are_not_loaded(tmp_path):
    path = tmp_path / "objects.npy"
    np.save(path, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    assert "objects.npy" in refusal(UsageError, SmoothOptions, f"file:{path}")


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / "folder.npy").mkdir()
    for name in ("missing.npy", "missing.csv", "missing.txt", "folder.npy"):
        assert name in refusal(InputError, SmoothOptions, f"file:{tmp_path / name}")


def test_an_array_of_wrong_shape_is_told_by_the_file_it_came_from(tmp_path):
    save(tmp_path / "wrong.csv", FLAT.points[:-1])
    assert "wrong.csv" in refusal(UsageError, smoothed, f"file:{tmp_path / 'wrong.csv'}")


# ----------------------------------------------------------------------------------------- what is refused

N = len(FLAT.points)


@pytest.mark.parametrize(
    ("mesh", "shape"),
    [
        *(
            (FLAT, shape)
            for shape in [(N,), (N, 1), (N, 4), (N - 1, 2), (2, N), (2, N - 1, 2), (1, 1, N, 2), ()]
        ),
        *((VOLUME, (len(VOLUME.points), d)) for d in (1, 2, 4)),
    ],
)
def test_arrays_of_wrong_shape(mesh, shape):
    vectors = np.ones(shape)
    for message in (
        refusal(UsageError, all_directions, mesh, [vectors]),
        refusal(UsageError, all_directions, mesh, ["x", "field:wind"], point_data={"wind": vectors}),
    ):
        assert str(shape) in message
        assert f"N = {len(mesh.points)}" in message
    assert "field:wind" in message


def test_arrays_for_no_sweep():
    assert "no sweeps" in refusal(UsageError, all_directions, FLAT, [np.ones((0, N, 2))])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("frames", [(), (2,)])
def test_vectors_that_are_not_finite(frames, value):
    vectors = np.ones((*frames, N, 2))
    vectors[..., 7, 1] = value
    assert "vertex 7" in refusal(UsageError, all_directions, FLAT, [vectors])


@pytest.mark.parametrize("kind", [complex, "U3", object])
def test_arrays_that_are_not_numbers(kind):
    assert "not numbers" in refusal(UsageError, all_directions, FLAT, [np.ones((N, 2)).astype(kind)])


def test_a_new_record_is_a_direction_of_commands_and_of_the_api(monkeypatch, tmp_path):
    """Inward, and outward in the sweep after, is what it stands for; no other module knows the name."""

    def fields(setting):
        outward = radial_field(setting.center, setting.axis)
        return [lambda *given: -outward(*given), outward]

    monkeypatch.setitem(DIRECTIONS, "in-and-out", Direction("in-and-out", fields))
    directions = [all_directions(VOLUME, ["in-and-out", "x"], sweep) for sweep in range(3)]
    offset = VOLUME.points - VOLUME.points.mean(axis=0)
    offset[:, 2] = 0
    np.testing.assert_allclose(directions[0], -normalised(offset), rtol=1e-12)
    np.testing.assert_allclose(directions[1], normalised(offset), rtol=1e-12)
    assert (directions[2] == [1, 0, 0]).all()
    points, report = dvr_cli.smooth(FLAT.points, CELLS, directions="in-and-out", max_iterations=2)
    assert report.options["directions"] == "in-and-out"
    assert (points != FLAT.points).any()
    meshio.Mesh(np.pad(FLAT.points, ((0, 0), (0, 1))), CELLS).write(tmp_path / "in.vtk")
    command = ["smooth", tmp_path / "in.vtk", tmp_path / "out.vtk", "-d", "in-and-out", "-q"]
    assert main([str(word) for word in command]) == 0


def test_every_name_is_in_the_help():
    assert all(f" {name}" in OPTIONS["directions"].help for name in DIRECTIONS)


def test_unknown_names_are_told_with_those_that_exist():
    for message in (
        refusal(UsageError, all_directions, FLAT, ["x", "sideways"]),
        refusal(UsageError, SmoothOptions, "x,sideways"),
    ):
        assert "'sideways'" in message
        assert all(name in message for name in DIRECTIONS)
    message = refusal(UsageError, all_directions, FLAT, ["field:wind"], point_data={"u": 1, "velocity": 2})
    assert "field:wind" in message
    assert "u, velocity" in message
    assert "none" in refusal(UsageError, all_directions, FLAT, ["field:wind"])


@pytest.mark.parametrize("directions", ["", ",", "x,", "x,,y", "X", "Random"])
def test_names_are_exact(directions):
    assert "unknown name" in refusal(UsageError, SmoothOptions, directions)


def test_no_directions_at_all():
    assert "none given" in refusal(UsageError, all_directions, FLAT, [])


@pytest.mark.parametrize("center", [(1,), (1, 2, 3, 4), (math.nan, 0, 0), (0, math.inf, 0), (0, 0)])
def test_centers_that_are_no_point(center):
    assert refusal(UsageError, all_directions, VOLUME, ["radial"], center=center).startswith(
        "center: 3 finite"
    )


@pytest.mark.parametrize("axis", [(1,), (1, 2), (1, 2, 3, 4), (math.nan, 0, 1), (0, math.inf, 0)])
def test_axes_that_are_no_vector(axis):
    message = refusal(DvrError, all_directions, VOLUME, ["circumferential"], axis=axis)
    assert message.startswith("axis: 3 finite")


def test_axis_without_length():
    message = refusal(UsageError, all_directions, VOLUME, ["circumferential"], axis=(0, 0, 0))
    assert message == "axis: 3 finite numbers are needed that are not all zero"
