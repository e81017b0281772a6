"""Reading Gmsh files: groups and regions, and what is easier to see in files made by hand."""

from __future__ import annotations

import io
import struct

import numpy as np
import pytest

from dvr_cli.errors import InputError, UsageError
from dvr_cli.files.gmsh import read
from dvr_cli.mesh.cell_types import topological_dimension
from dvr_cli.mesh.domain import domain_of
from dvr_cli.mesh.groups import group_cells, group_vertices
from dvr_cli.mesh.mesh import Mesh
from gmsh_corpus import NAMES, account, corpus


def tags_of(mesh: Mesh, block: int) -> np.ndarray:
    """(n, g) all physical tags of the cells of a block."""
    columns = [values[block] for key, values in mesh.cell_data.items() if key.startswith("gmsh:physical")]
    return np.stack(columns, axis=1)


# ------------------------------------------------------------------------------------ groups and regions


@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith("partitioned_topology")])
def test_parts_of_a_partition_are_no_regions_and_hold_nothing(name):
    source = read(corpus(name))
    domain = domain_of(source.mesh)
    inside = ((source.mesh.points[:, :2] > 0) & (source.mesh.points[:, :2] < 1)).all(axis=1)
    assert domain.divided_by == ()
    assert np.array_equal(domain.interior, inside)
    assert inside.sum() > 5
    between = [line for line in source.unread if "between partitions" in line]
    assert len(between) == ("-41-" in name)


def test_further_groups_of_a_cell_have_columns_of_their_own():
    for variant in ("22-ascii", "22-binary", "41-ascii", "41-binary"):
        mesh = read(corpus(f"several_groups-{variant}")).mesh
        assert [key for key in mesh.cell_data if key.startswith("gmsh:physical")] == [
            "gmsh:physical",
            "gmsh:physical:2",
            "gmsh:physical:3",
        ]
        triangles = next(i for i, c in enumerate(mesh.cells) if c.type == "triangle")
        first_surface = mesh.cell_data["gmsh:geometrical"][triangles] == 1
        assert (tags_of(mesh, triangles)[first_surface] == [3, 5, 6]).all()
        assert first_surface.sum() == 14


@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith(("several", "triangles_and"))])
def test_regions_number_the_combinations_of_entity_and_groups(name):
    mesh = read(corpus(name)).mesh
    numbers: dict[tuple, set[int]] = {}
    for i, cells in enumerate(mesh.cells):
        entities, regions = mesh.cell_data["gmsh:geometrical"][i], mesh.cell_data["dvr:region"][i]
        for entity, groups, region in zip(entities, tags_of(mesh, i), regions, strict=True):
            key = (topological_dimension(cells.type), int(entity), frozenset(groups.tolist()))
            numbers.setdefault(key, set()).add(int(region))
    assert all(len(regions) == 1 for regions in numbers.values())
    assert sorted(region for (region,) in numbers.values()) == list(range(1, len(numbers) + 1))


def test_no_regions_where_no_cell_is_in_two_groups():
    assert "dvr:region" not in read(corpus("one_group_each-41-ascii")).mesh.cell_data


def test_one_name_for_groups_of_several_dimensions():
    mesh = read(corpus("equal_names-41-binary")).mesh
    assert {key: value.tolist() for key, value in mesh.field_data.items()} == {
        "part": [1, 2],
        "part (dim 3, tag 1)": [1, 3],
    }
    assert [mask.sum() for mask in group_cells(mesh, "part")] == [14, 100]
    assert [mask.sum() for mask in group_cells(mesh, "part (dim 3, tag 1)")] == [0, 100]


def test_group_without_a_name_is_found_by_its_number():
    mesh = read(corpus("one_group_each-22-binary")).mesh
    assert [(c.type, mask.sum()) for c, mask in zip(mesh.cells, group_cells(mesh, "9"), strict=True)] == [
        ("vertex", 0),
        ("line", 2),
        ("triangle", 0),
        ("tetra", 0),
    ]


def test_unknown_group_is_named_with_those_there_are():
    with pytest.raises(UsageError, match=r"'wals'.*walls, solid"):
        group_vertices(read(corpus("one_group_each-22-binary")).mesh, "wals")


# --------------------------------------------------------------------------------------------- by hand


def msh2(nodes: str, elements: str, extra: str = "", version: str = "2.2") -> bytes:
    return (
        f"$MeshFormat\n{version} 0 8\n$EndMeshFormat\n$Nodes\n{nodes}\n$EndNodes\n"
        f"$Elements\n{elements}\n$EndElements\n{extra}"
    ).encode()


SQUARE = "4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0"


@pytest.mark.parametrize("version", ["2", "2.0", "2.1", "2.2"])
def test_versions_before_2_2(version):
    mesh = read(msh2(SQUARE, "2\n1 2 2 5 6 1 2 3\n2 2 2 5 6 1 3 4", version=version)).mesh
    assert mesh.cells[0].vertices.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.cell_data["gmsh:physical"][0].tolist() == [5, 5]


def test_elements_without_tags():
    mesh = read(msh2(SQUARE, "3\n1 2 0 1 2 3\n2 2 1 7 1 3 4\n3 1 3 8 9 1 1 2")).mesh
    assert [c.type for c in mesh.cells] == ["triangle", "line"]
    assert [tags.tolist() for tags in mesh.cell_data["gmsh:physical"]] == [[0, 7], [8]]
    assert [tags.tolist() for tags in mesh.cell_data["gmsh:geometrical"]] == [[0, 0], [9]]


def test_repeated_cells_are_merged_wherever_they_stand():
    triangles = [
        "1 2 2 1 9 1 2 3",
        "3 2 2 2 9 3 1 2",
        "4 2 2 1 9 2 1 3",
        "5 2 2 0 9 1 2 3",
        "6 2 2 2 9 1 3 4",
    ]
    lines = ["6", triangles[0], "2 1 2 0 4 1 2", *triangles[1:]]
    mesh = read(msh2(SQUARE, "\n".join(lines))).mesh
    assert [(c.type, c.vertices.tolist()) for c in mesh.cells] == [
        ("triangle", [[0, 1, 2]]),
        ("line", [[0, 1]]),
        ("triangle", [[0, 2, 3]]),
    ]
    assert [tags.tolist() for tags in mesh.cell_data["gmsh:physical"]] == [[1], [0], [2]]
    assert [tags.tolist() for tags in mesh.cell_data["gmsh:physical:2"]] == [[2], [0], [0]]


def test_values_on_a_repeated_element_belong_to_the_merged_cell():
    data = '$ElementData\n1\n"q"\n0\n3\n0\n1\n2\n2 0.5\n3 0.25\n$EndElementData\n'
    mesh = read(msh2(SQUARE, "3\n1 2 2 1 9 1 2 3\n2 2 2 2 9 1 2 3\n3 2 2 1 9 1 3 4", data)).mesh
    assert mesh.cell_data["q"][0].tolist() == [0.5, 0.25]


def test_cells_that_change_type_all_the_time_are_grouped_by_type():
    quads = [f"{i} 3 0 {i} {i + 1} {i + 2} {i + 3}" for i in range(1, 3001, 2)]
    triangles = [f"{i} 2 0 {i} {i + 1} {i + 2}" for i in range(2, 3001, 2)]
    rows = [row for pair in zip(quads, triangles, strict=True) for row in pair]
    nodes = "\n".join(f"{i + 1} {i} 0 0" for i in range(3010))
    mesh = read(msh2(f"3010\n{nodes}", "\n".join(["3000", *rows]))).mesh
    assert [(c.type, len(c.vertices)) for c in mesh.cells] == [("triangle", 1500), ("quad", 1500)]
    assert mesh.cells[0].vertices[0].tolist() == [1, 2, 3]
    assert mesh.cells[1].vertices[-1].tolist() == [2998, 2999, 3000, 3001]


def test_comments_and_unknown_sections_are_passed_over():
    mesh = msh2(SQUARE, "1\n1 3 2 0 1 1 2 3 4", "\n$Mine\n$EndMine\n")
    assert read(b"$Comments\nany $Nodes text\n$EndComments\n" + mesh).mesh.cells[0].type == "quad"


def test_sections_in_another_order():
    for name in ("several_groups-41-ascii", "several_groups-41-binary", "with_data-22-binary"):
        data = corpus(name)
        head = data[: data.index(b"$EndMeshFormat\n") + len(b"$EndMeshFormat\n")]
        nodes = data[data.index(b"$Nodes") : data.index(b"$Elements")]
        swapped = head + data[len(head) :].replace(nodes, b"") + nodes
        ours, theirs = read(swapped).mesh, read(data).mesh
        np.testing.assert_array_equal(ours.points, theirs.points)
        assert ours.cell_data.keys() == theirs.cell_data.keys()
        for i, cells in enumerate(theirs.cells):
            np.testing.assert_array_equal(ours.cells[i].vertices, cells.vertices)
            for key, values in theirs.cell_data.items():
                np.testing.assert_array_equal(ours.cell_data[key][i], values[i])


def test_msh4_without_entities_has_no_groups():
    data = corpus("several_groups-41-binary")
    mesh = read(data[: data.index(b"$Entities")] + data[data.index(b"$Nodes") :]).mesh
    assert not any(tags.any() for tags in mesh.cell_data["gmsh:physical"])
    assert set(mesh.cell_data) == {"gmsh:physical", "gmsh:geometrical"}


@pytest.mark.parametrize("order", ["<", ">"])
def test_either_byte_order(order):
    def pack(kinds: str, *values: float) -> bytes:
        return struct.pack(order + kinds, *values)

    xyz = [0.0, 0.0, 0.1], [1.0, 0.0, 0.2], [0.0, 1.0, 0.3]
    nodes2 = b"3\n" + b"".join(pack("i3d", tag, *x) for tag, x in zip((7, 5, 9), xyz, strict=True))
    elements2 = b"1\n" + pack("9i", 2, 1, 2, 1, 4, 6, 9, 7, 5)
    nodes4 = pack("4q3iq3q9d", 1, 3, 5, 9, 2, 6, 0, 3, 7, 5, 9, *xyz[0], *xyz[1], *xyz[2])
    elements4 = pack("4q3iq4q", 1, 1, 1, 1, 2, 6, 2, 1, 1, 9, 7, 5)
    for version, nodes, elements in ((b"2.2", nodes2, elements2), (b"4.1", nodes4, elements4)):
        data = b"$MeshFormat\n" + version + b" 1 8\n" + pack("i", 1) + b"\n$EndMeshFormat\n"
        data += b"$Nodes\n" + nodes + b"\n$EndNodes\n$Elements\n" + elements + b"\n$EndElements\n"
        source = read(data)
        assert source.mesh.points.tolist() == list(xyz)
        assert source.mesh.points.dtype.isnative
        assert source.mesh.cells[0].vertices.tolist() == [[2, 0, 1]]
        assert source.mesh.cells[0].vertices.dtype == np.int32
        assert source.mesh.cell_data["gmsh:geometrical"][0].tolist() == [6]
        file = io.BytesIO()
        source.write(source.mesh.points * 2, file)
        assert account(file.getvalue()).nodes == {7: (0, 0, 0.2), 5: (2, 0, 0.4), 9: (0, 2, 0.6)}


def test_batches_of_binary_elements():
    """MSH 2 allows several elements behind one header; Gmsh writes one."""
    data = b"$MeshFormat\n2.2 1 8\n\x01\0\0\0\n$EndMeshFormat\n$Nodes\n4\n"
    data += b"".join(struct.pack("<i3d", i + 1, i, i * i, 0) for i in range(4))
    data += b"\n$EndNodes\n$Elements\n5\n"
    data += struct.pack("<3i12i", 2, 2, 2, 1, 8, 9, 1, 2, 3, 2, 8, 9, 2, 3, 4)
    data += struct.pack("<3i", 3, 0, 2) + struct.pack("<3i9i", 1, 3, 0, 3, 1, 2, 4, 2, 3, 5, 3, 4)
    mesh = read(data + b"\n$EndElements\n").mesh
    assert [(c.type, c.vertices.tolist()) for c in mesh.cells] == [
        ("triangle", [[0, 1, 2], [1, 2, 3]]),
        ("line", [[0, 1], [1, 2], [2, 3]]),
    ]
    assert [tags.tolist() for tags in mesh.cell_data["gmsh:physical"]] == [[8, 8], [0, 0, 0]]


def test_names_repeated_in_other_encodings_and_without_quotes():
    names = '$PhysicalNames\n4\n2 1 "Wände"\n2 2 bare\n2 3 "a \\"b\\" "\n2 4 "bare"\n$EndPhysicalNames\n'
    elements = "1\n1 3 2 0 1 1 2 3 4"
    keys = ["Wände", "bare", 'a \\"b\\" ', "bare (dim 2, tag 4)"]
    assert list(read(msh2(SQUARE, elements, names)).mesh.field_data) == keys
    latin = msh2(SQUARE, elements, names).decode().encode("latin-1")
    assert "Wände" in read(latin).mesh.field_data


def test_links_and_values_of_nodes_that_are_not_saved_are_left_out():
    extra = "$Periodic\n1\n1 2 4\n2\n2 1\n30 40\n$EndPeriodic\n"
    extra += '$NodeData\n1\n"h"\n0\n3\n0\n1\n2\n3 0.5\n99 0.25\n$EndNodeData\n'
    mesh = read(msh2(SQUARE, "1\n1 3 2 0 1 1 2 3 4", extra)).mesh
    assert mesh.periodic.tolist() == [[1, 0]]
    assert np.array_equal(mesh.point_data["h"], [np.nan, np.nan, 0.5, np.nan], equal_nan=True)


def test_views_in_parts_are_put_together_and_later_steps_win():
    view = '$NodeData\n1\n"h"\n1\n0.5\n4\n{}\n1\n1\n0\n{} {}\n$EndNodeData\n'
    parts = view.format(0, 1, 10) + view.format(1, 1, 11) + view.format(1, 2, 12)
    odd = '$NodeData\n1\n"two"\n0\n3\n0\n2\n1\n1 5 6\n$EndNodeData\n'
    mesh = read(msh2(SQUARE, "1\n1 3 2 0 1 1 2 3 4", parts + odd)).mesh
    assert list(mesh.point_data) == ["h"]
    assert np.array_equal(mesh.point_data["h"], [11, 12, np.nan, np.nan], equal_nan=True)


def test_mesh_without_elements():
    mesh = read(msh2(SQUARE, "0")).mesh
    assert (len(mesh.points), mesh.cells) == (4, [])
    assert all(values == [] for values in mesh.cell_data.values())


def test_exponents_of_fortran(tmp_path):
    """Some generators write 1.5D-3; what does not move keeps that spelling."""
    text = b"""$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
5
1 0D0 0.0D+00 0
2 1.0D0 0 0
3 10.0d-1 1 0
4 0 1 0
5 .7D0 .6D+0 0
$EndNodes
$Elements
4
1 2 2 0 1 1 2 5
2 2 2 0 1 2 3 5
3 2 2 0 1 3 4 5
4 2 2 0 1 4 1 5
$EndElements
"""
    source = read(text)
    assert source.mesh.points[4].tolist() == [0.7, 0.6, 0.0]
    assert source.mesh.points[2].tolist() == [1.0, 1.0, 0.0]
    points = source.mesh.points.copy()
    points[4] = [0.5, 0.25, 0.0]
    output = io.BytesIO()
    source.write(points, output)
    assert output.getvalue() == text.replace(b".7D0 .6D+0", b"0.5 0.25")
    with pytest.raises(InputError, match="not a number"):
        read(text.replace(b".7D0", b".7X0"))
