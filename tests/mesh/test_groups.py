"""Groups found by name and by tag, wherever a format keeps them."""

import meshio
import numpy as np
import pytest

from dvr_cli.errors import UsageError
from dvr_cli.files.obj import read as read_obj
from dvr_cli.mesh.cell_types import topological_dimension
from dvr_cli.mesh.convert import from_meshio
from dvr_cli.mesh.groups import group_cells, group_vertices
from dvr_cli.mesh.mesh import Cells, Mesh

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]])
FAN = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
EDGES = np.array([[0, 1], [1, 2]])


def square(cell_data=None, field_data=None, **more):
    """Four triangles around vertex 4 and two boundary edges."""
    return Mesh(
        SQUARE,
        [Cells("triangle", FAN), Cells("line", EDGES)],
        {name: [np.array(block) for block in blocks] for name, blocks in (cell_data or {}).items()},
        field_data={name: np.array(pair) for name, pair in (field_data or {}).items()},
        **more,
    )


def vertices(mesh, name):
    return np.flatnonzero(group_vertices(mesh, name)).tolist()


def test_a_name_has_a_tag_and_a_dimension():
    mesh = square({"gmsh:physical": [[1, 1, 2, 2], [1, 2]]}, {"left": [2, 2], "low": [1, 1]})
    assert vertices(mesh, "left") == [0, 2, 3, 4]
    assert vertices(mesh, "low") == [0, 1]


def test_a_tag_is_of_any_dimension():
    mesh = square({"gmsh:physical": [[1, 1, 2, 2], [1, 1]]})
    assert vertices(mesh, "1") == [0, 1, 2, 4]
    assert [mask.sum() for mask in group_cells(mesh, "1")] == [2, 2]


def test_a_name_that_looks_like_a_tag_is_a_name():
    mesh = square({"gmsh:physical": [[7, 7, 8, 8], [0, 0]]}, {"7": [8, 2]})
    assert vertices(mesh, "7") == [0, 2, 3, 4]


def test_a_cell_in_no_physical_group_is_not_in_group_0():
    mesh = square({"gmsh:physical": [[1, 1, 0, 0], [0, 0]]})
    with pytest.raises(UsageError, match=r"'0'.*gmsh:physical 1"):
        group_vertices(mesh, "0")
    assert vertices(square({"medit:ref": [[0, 1, 1, 1], [5, 5]]}), "0") == [0, 1, 4]


def test_further_physical_groups_of_a_cell_count():
    mesh = square({"gmsh:physical": [[1, 1, 1, 1], [0, 0]], "gmsh:physical:2": [[0, 3, 0, 0], [0, 0]]})
    assert vertices(mesh, "3") == [1, 2, 4]


def test_entities_count_only_where_there_are_no_physical_groups():
    entities = [[4, 4, 5, 5], [6, 6]]
    assert vertices(square({"gmsh:geometrical": entities, "gmsh:physical": [[0] * 4, [0] * 2]}), "6") == [
        0,
        1,
        2,
    ]
    with pytest.raises(UsageError, match="'6'"):
        group_vertices(square({"gmsh:geometrical": entities, "gmsh:physical": [[1] * 4, [0] * 2]}), "6")


def test_sets_of_cells_and_of_points():
    mesh = square(cell_sets={"a": [np.array([0]), np.array([1])]}, point_sets={"p": np.array([3])})
    assert vertices(mesh, "a") == [0, 1, 2, 4]
    assert vertices(mesh, "p") == [3]


def test_unknown_names_list_names_and_tags():
    mesh = square(
        {"gmsh:physical": [[1, 1, 2, 2], [9, 9]]},
        {"left": [2, 2], "empty": [3, 2]},
        cell_sets={"set": [np.array([0]), np.array([], dtype=int)]},
        point_sets={"p": np.array([3])},
    )
    with pytest.raises(UsageError) as caught:
        group_vertices(mesh, "lfet")
    expected = "nothing is in a group 'lfet'; the groups are: left, set, p; gmsh:physical 1, 2, 9"
    assert str(caught.value) == expected
    with pytest.raises(UsageError, match="'empty'"):
        group_vertices(mesh, "empty")


def test_many_tags_are_not_all_listed():
    mesh = Mesh(SQUARE, [Cells("vertex", np.arange(5).repeat(8)[:, None])], {"region": [np.arange(40)]})
    with pytest.raises(UsageError, match=r"region 0, 1, .*, 19, 20 more$"):
        group_vertices(mesh, "x")
    with pytest.raises(UsageError, match=r"the groups are: none$"):
        group_vertices(Mesh(SQUARE, [Cells("triangle", FAN)]), "x")


def test_field_data_that_are_no_groups():
    mesh = square(field_data={"time": [0.5], "bounds": [0.0, 1.0], "left": [2, 2]})
    for name in ("time", "bounds", "left"):
        with pytest.raises(UsageError, match=r"none$"):
            group_vertices(mesh, name)


def test_names_in_an_obj_file():
    text = "".join(f"v {x} {y} 0\n" for x, y in SQUARE)
    faces = [f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in FAN]
    text += f"{faces[0]}o door\ng panel frame\n{faces[1]}usemtl oak wood\ng panel\n{faces[2]}g\n{faces[3]}"
    mesh = read_obj(text.encode()).mesh
    assert {name: [part.tolist() for part in parts] for name, parts in mesh.cell_sets.items()} == {
        "door": [[1, 2, 3]],
        "panel": [[1, 2]],
        "frame": [[1]],
        "oak wood": [[2, 3]],
    }
    assert vertices(mesh, "frame") == [1, 2, 4]
    assert vertices(mesh, "0") == [0, 1, 4]  # by the number of its combination


def test_sets_of_a_meshio_mesh(tmp_path):
    lines = ["*NODE", *(f"{i + 1}, {x}, {y}, 0." for i, (x, y) in enumerate(SQUARE))]
    lines += [
        "*ELEMENT, TYPE=S3",
        *(f"{i + 1}, {a + 1}, {b + 1}, {c + 1}" for i, (a, b, c) in enumerate(FAN)),
    ]
    lines += ["*ELSET, ELSET=west", "4", "*NSET, NSET=corner", "1, 3", "*ELSET, ELSET=nested", "west"]
    path = tmp_path / "in.inp"
    path.write_text("\n".join(lines) + "\n")
    mesh = from_meshio(meshio.read(path))
    assert vertices(mesh, "west") == [0, 3, 4]
    assert vertices(mesh, "corner") == [0, 2]


def test_sets_that_are_none_are_left_out():
    """meshio files the entities around Gmsh's among the sets, and nests sets of sets of Abaqus."""
    mesh = meshio.Mesh(SQUARE, [("triangle", FAN)], point_sets={"far": np.array([9])})
    mesh.cell_sets = {
        "gmsh:bounding_entities": [np.array([1, 2])],
        "nested": [[np.array([0])]],
        "short": [],
        "beyond": [np.array([4])],
        "good": [np.array([3])],
    }
    converted = from_meshio(mesh)
    assert list(converted.cell_sets) == ["good"]
    assert converted.point_sets == {}


def test_families_of_a_med_file():
    mesh = meshio.Mesh(SQUARE, [("triangle", FAN)], cell_data={"cell_tags": [np.array([-6, -7, 0, -6])]})
    mesh.cell_tags = {-6: ["steel"], -7: ["steel", "hot"]}  # as meshio leaves them
    converted = from_meshio(mesh)
    assert vertices(converted, "hot") == [1, 2, 4]
    assert vertices(converted, "steel") == [0, 1, 2, 3, 4]
    assert group_cells(converted, "steel")[0].tolist() == [True, True, False, True]


@pytest.mark.parametrize(
    ("name", "dimension"),
    [("vertex", 0), ("line3", 1), ("triangle6", 2), ("quad9", 2), ("tetra10", 3), ("wedge", 3), ("x", None)],
)
def test_dimensions(name, dimension):
    assert topological_dimension(name) == dimension


def test_second_order_cells_bring_all_their_nodes():
    points = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]], dtype=float)
    mesh = Mesh(points, [Cells("triangle6", np.arange(6)[None])], {"region": [np.array([3])]})
    assert vertices(mesh, "3") == [0, 1, 2, 3, 4, 5]


def test_periodic_vertices_are_not_free():
    mesh = square(periodic=np.array([[0, 2]]))
    assert mesh.unlinked.tolist() == [False, True, False, True, True]
    outside = meshio.Mesh(SQUARE, [("triangle", FAN)])
    outside.gmsh_periodic = [(0, (1, 2), None, np.array([[0, 1], [0, 99]]))]
    assert from_meshio(outside).periodic.tolist() == [[0, 1]]
