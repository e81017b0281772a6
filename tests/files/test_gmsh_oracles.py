"""Reading Gmsh files: the mesh against Gmsh's own account of the file, and against meshio's."""

from __future__ import annotations

import contextlib
import re
from collections import Counter
from functools import cache
from pathlib import Path

import meshio
import numpy as np
import pytest

from dvr_cli.errors import InputError
from dvr_cli.files.gmsh import read
from dvr_cli.files.gmsh.cells import CellType, cell_type
from dvr_cli.mesh.cell_types import topological_dimension
from dvr_cli.mesh.groups import group_cells
from dvr_cli.mesh.mesh import Mesh
from gmsh_corpus import NAMES, Account, account, corpus
from gmsh_session import gmsh_session
from pairwise import named_cases


def supported_types() -> dict[int, CellType]:
    types = {}
    for code in range(200):
        with contextlib.suppress(InputError):
            types[code] = cell_type(code)
    return types


CODE = {kind.name: code for code, kind in supported_types().items()}

# Of the nodes that are not corners, the corners they lie between, as VTK numbers them.
MIDSIDES = {
    "line3": [(0, 1)],
    "triangle6": [(0, 1), (1, 2), (2, 0)],
    "quad8": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "quad9": [(0, 1), (1, 2), (2, 3), (3, 0), (0, 1, 2, 3)],
    "tetra10": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "pyramid13": [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)],
    "wedge15": [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    "hexahedron20": [
        *[(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)],
        *[(0, 4), (1, 5), (2, 6), (3, 7)],
    ],
}
MIDSIDES["pyramid14"] = [*MIDSIDES["pyramid13"], (0, 1, 2, 3)]
MIDSIDES["wedge18"] = [*MIDSIDES["wedge15"], (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)]
MIDSIDES["hexahedron27"] = [
    *MIDSIDES["hexahedron20"],
    *[(0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7)],
    tuple(range(8)),
]


@cache
def both(name: str) -> tuple[Mesh, Account, np.ndarray]:
    """The mesh as we read it, Gmsh's account of it, and the node tag of each of our points."""
    mesh, gmsh = read(corpus(name)).mesh, account(corpus(name))
    tag_at = {xyz: tag for tag, xyz in gmsh.nodes.items()}
    assert len(tag_at) == len(gmsh.nodes)  # no two nodes in one place
    return mesh, gmsh, np.array([tag_at[xyz] for xyz in map(tuple, mesh.points.tolist())])


def cell_keys(mesh: Mesh, tags: np.ndarray) -> list[list[tuple[int, ...]]]:
    """For each block, each cell as Gmsh's number of its type and its sorted node tags."""
    return [[(CODE[c.type], *sorted(row)) for row in tags[c.vertices].tolist()] for c in mesh.cells]


def tags_of(mesh: Mesh, block: int) -> np.ndarray:
    """(n, g) all physical tags of the cells of a block."""
    columns = [values[block] for key, values in mesh.cell_data.items() if key.startswith("gmsh:physical")]
    return np.stack(columns, axis=1)


# --------------------------------------------------------------------------------------- against Gmsh


@pytest.mark.parametrize("name", named_cases(NAMES))
def test_same_nodes_and_cells_as_gmsh(name):
    mesh, gmsh, tags = both(name)
    assert sorted(tags) == sorted(gmsh.nodes)
    cells = Counter(key for keys in cell_keys(mesh, tags) for key in keys)
    assert set(cells) == {(code, *sorted(nodes)) for (code, _), nodes in gmsh.elements.items()}
    assert max(cells.values()) == 1
    assert all(c.vertices.dtype == np.int32 for c in mesh.cells)


@pytest.mark.parametrize("name", named_cases(NAMES))
def test_same_groups_as_gmsh(name):
    mesh, gmsh, tags = both(name)
    keys = cell_keys(mesh, tags)
    grouped = set()
    for dimension, tag in gmsh.groups:
        inside = {
            key
            for i, block in enumerate(mesh.cells)
            if topological_dimension(block.type) == dimension
            for key, groups in zip(keys[i], tags_of(mesh, i), strict=True)
            if tag in groups
        }
        assert inside == gmsh.members(dimension, tag)
        grouped |= inside
    in_none = {
        key
        for i in range(len(mesh.cells))
        for key, groups in zip(keys[i], tags_of(mesh, i), strict=True)
        if not groups.any()
    }
    assert in_none == {key for block in keys for key in block} - grouped


@pytest.mark.parametrize("name", named_cases(NAMES))
def test_groups_are_found_by_name(name):
    mesh, gmsh, tags = both(name)
    keys = cell_keys(mesh, tags)
    for title, entities in gmsh.groups.values():
        alike = [group for group, (other, _) in gmsh.groups.items() if other == title]
        if title and entities:
            inside = {
                key
                for block, mask in zip(keys, group_cells(mesh, title), strict=True)
                for key, is_in in zip(block, mask, strict=True)
                if is_in
            }
            assert inside == set().union(*(gmsh.members(*group) for group in alike))


@pytest.mark.parametrize(
    "name", named_cases([name for name in NAMES if not re.match("partitioned.*-22", name)])
)
def test_same_entities_as_gmsh(name):
    """But for partitions in MSH 2, for which Gmsh makes up entities that are not in the file."""
    mesh, gmsh, tags = both(name)
    entity_of = {
        (code, *sorted(gmsh.elements[code, number])): gmsh.parents.get(entity, entity[1])
        for entity, elements in gmsh.elements_of.items()
        for code, number in elements
        if not gmsh.entities[entity].startswith("Ghost")
    }
    for keys, entities in zip(cell_keys(mesh, tags), mesh.cell_data["gmsh:geometrical"], strict=True):
        assert [entity_of[key] for key in keys] == entities.tolist()


@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith("periodic")])
def test_same_periodic_links_as_gmsh(name):
    mesh, _, tags = both(name)
    _, gmsh, _ = both(name.replace("-22-", "-41-"))  # Gmsh does not give the links of MSH 2
    if name.startswith("periodic_rectangle-22"):
        assert len(mesh.periodic) == 0  # nor does it save them with groups
    else:
        assert set(map(tuple, tags[mesh.periodic].tolist())) == gmsh.periodic
        assert len(gmsh.periodic) > 5


@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith("with_data")])
def test_same_fields_as_gmsh(name):
    mesh, gmsh, tags = both(name)
    assert set(mesh.point_data) == {"height", "direction"}
    assert "ignored" not in mesh.cell_data
    for field, step in (("height", 1), ("direction", 0)):
        expected = gmsh.views[field, step]
        width = len(next(iter(expected.values())))
        rows = [expected.get(tag, (np.nan,) * width) for tag in tags.tolist()]
        assert np.array_equal(mesh.point_data[field].reshape(-1, width), np.array(rows), equal_nan=True)
    assert mesh.point_data["height"].shape == (len(tags),)
    assert np.isnan(mesh.point_data["direction"]).any()
    values = {
        (code, *sorted(nodes)): gmsh.views["stress of it", 0].get(number, (np.nan,) * 9)
        for (code, number), nodes in gmsh.elements.items()
    }
    for keys, stress in zip(cell_keys(mesh, tags), mesh.cell_data["stress of it"], strict=True):
        assert np.array_equal(stress, np.array([values[key] for key in keys]), equal_nan=True)


def test_element_types_are_those_of_gmsh():
    families = {"Point": "vertex", "Triangle": "triangle", "Quadrilateral": "quad", "Line": "line"}
    families |= {"Tetrahedron": "tetra", "Hexahedron": "hexahedron", "Prism": "wedge", "Pyramid": "pyramid"}
    with gmsh_session() as gmsh:
        for code, kind in supported_types().items():
            if kind.name.startswith("wedge") and kind.nodes > 18:
                continue  # Gmsh does not describe these
            title, dimension, _, nodes, _, corners = gmsh.model.mesh.getElementProperties(code)
            family = families[title.split()[0]]
            assert kind == (family if nodes == corners else f"{family}{nodes}", dimension, nodes)


@pytest.mark.parametrize("kind", MIDSIDES)
def test_second_order_nodes_are_in_the_order_of_vtk(kind):
    model = "incomplete_second_order" if kind in ("quad8", "wedge15", "hexahedron20", "pyramid13") else None
    model = model or ("second_order" if kind == "tetra10" else "full_second_order")
    for variant in ("22-ascii", "41-binary"):
        mesh = read(corpus(f"{model}-{variant}")).mesh
        cells = np.concatenate([c.vertices for c in mesh.cells if c.type == kind])
        corners = cells.shape[1] - len(MIDSIDES[kind])
        for place, between in enumerate(MIDSIDES[kind], start=corners):
            expected = mesh.points[cells[:, list(between)]].mean(axis=1)
            assert np.allclose(mesh.points[cells[:, place]], expected, rtol=0, atol=1e-12)


# -------------------------------------------------------------------------------------- against meshio

# Models that meshio cannot read in every variant, or reads with a cell for each of its groups.
NOT_FOR_MESHIO = {
    "with_data",
    "parametric_box",
    "parametric_sphere",
    "partitioned",
    "partitioned_topology",
    "incomplete_second_order",
    "several_groups",
    "reversed_group",
    "triangles_and_quads",
    "second_order",
    "save_all",
    "sparse_tags",
}
FOR_MESHIO = [name for name in NAMES if name.partition("-")[0] not in NOT_FOR_MESHIO]


@pytest.mark.parametrize("name", FOR_MESHIO)
def test_same_mesh_as_meshio(name, tmp_path):
    path = Path(tmp_path, "mesh.msh")
    path.write_bytes(corpus(name))
    theirs = meshio.read(path, file_format="gmsh")
    mesh = read(corpus(name)).mesh
    assert np.array_equal(mesh.points, theirs.points)
    assert {c.type for c in mesh.cells} == set(theirs.cells_dict)
    for kind, expected in theirs.cells_dict.items():
        if kind not in ("wedge18", "pyramid14"):  # which meshio leaves in the order of Gmsh
            cells = [c.vertices for c in mesh.cells if c.type == kind]
            assert np.array_equal(np.concatenate(cells), expected)
        for data in ("gmsh:physical", "gmsh:geometrical"):
            if data in theirs.cell_data:
                tags = [mesh.cell_data[data][i] for i, c in enumerate(mesh.cells) if c.type == kind]
                assert np.array_equal(np.concatenate(tags), theirs.get_cell_data(data, kind))
    titles = {title for title in mesh.field_data if "(dim" not in title}
    assert titles == set(theirs.field_data)
    if not name.startswith("equal_names"):
        assert all(np.array_equal(mesh.field_data[title], theirs.field_data[title]) for title in titles)
