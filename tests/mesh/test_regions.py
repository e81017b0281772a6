"""Regions: which cell data count as tags, and which cells they tell apart."""

import numpy as np
import pytest

from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.regions import region_names, regions_of


def tagged(**tags):
    """Three triangles, one line, two quads, with cell data of the given values in this order."""
    cells = [
        Cells("triangle", np.array([[0, 1, 2]] * 3)),
        Cells("line", np.array([[0, 1]])),
        Cells("quad", np.array([[0, 1, 2, 3]] * 2)),
    ]
    data = {
        name.replace("__", ":"): [np.array(values)[part] for part in (slice(3), slice(3, 4), slice(4, 6))]
        for name, values in tags.items()
    }
    return Mesh(np.zeros((4, 2)), cells, data)


@pytest.mark.parametrize(
    "name",
    [
        *("gmsh__physical", "gmsh__geometrical", "medit__ref", "tetgen__ref", "obj__group", "dvr__region"),
        *("cell_tags", "CellEntityIds", "material", "MaterialID", "mat_id", "Region", "subdomain"),
    ],
)
def test_known_names_with_whole_numbers_are_tags(name):
    mesh = tagged(**{name: [1, 1, 2, 3, 4, 4]})
    assert region_names(mesh) == [name.replace("__", ":")]
    assert regions_of(mesh, [0, 2]).tolist() == [0, 0, 1, 2, 2]


@pytest.mark.parametrize(
    "values", [[1.0, 1.0, 2.0, 2.0, -3.0, 1e9], [True, False] * 3, np.arange(6, dtype="u1")]
)
def test_whole_numbers_of_any_type_are_tags(values):
    assert region_names(tagged(material=values)) == ["material"]


@pytest.mark.parametrize(
    "values",
    [[1, 1, 2, 2, 2, 2.5], [1, 1, 2, 2, 2, np.nan], [1, 1, 2, 2, np.inf, 2], ["a"] * 6, np.ones((6, 3), int)],
    ids=["fractions", "nan", "infinite", "text", "vectors"],
)
def test_other_values_are_not(values):
    mesh = tagged(material=values)
    assert region_names(mesh) == []
    assert regions_of(mesh, [0, 2]).tolist() == [0] * 5


@pytest.mark.parametrize("name", ["temperature", "quality", "medit", "my_material"])
def test_other_names_are_not(name):
    assert region_names(tagged(**{name: [1, 2, 3, 4, 5, 6]})) == []


def test_regions_differ_where_any_tag_does():
    rng = np.random.default_rng(0)
    for _ in range(20):
        tags = {name: rng.integers(-2, 3, 6) for name in ("material", "region", "gmsh__physical")}
        mesh = tagged(**tags)
        regions = regions_of(mesh, [0, 2])
        cells = [tuple(values[i] for values in tags.values()) for i in (0, 1, 2, 4, 5)]
        for i, one in enumerate(cells):
            for j, other in enumerate(cells):
                assert (regions[i] == regions[j]) == (one == other)


def test_tags_of_lower_cells_do_not_matter():
    mesh = tagged(material=[5, 5, 5, 9, 5, 5])
    assert regions_of(mesh, [0, 2]).tolist() == [0] * 5


def test_untagged_mesh_is_one_region():
    assert regions_of(tagged(), [0, 2]).tolist() == [0] * 5
