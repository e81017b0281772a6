"""Regions: which cell data count as tags, and which cells they tell apart."""

import numpy as np
import pytest

from dvr_cli.errors import UsageError
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.region_choice import regions_of
from dvr_cli.mesh.regions import names_of_regions, region_names


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
    assert regions_of(mesh, [0, 2])[0].tolist() == [0, 0, 1, 2, 2]


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
    assert regions_of(mesh, [0, 2])[0].tolist() == [0] * 5


@pytest.mark.parametrize("name", ["temperature", "quality", "medit", "my_material"])
def test_other_names_are_not(name):
    assert region_names(tagged(**{name: [1, 2, 3, 4, 5, 6]})) == []


def test_regions_differ_where_any_tag_does():
    rng = np.random.default_rng(0)
    for _ in range(20):
        tags = {name: rng.integers(-2, 3, 6) for name in ("material", "region", "gmsh__physical")}
        mesh = tagged(**tags)
        regions = regions_of(mesh, [0, 2])[0]
        cells = [tuple(values[i] for values in tags.values()) for i in (0, 1, 2, 4, 5)]
        for i, one in enumerate(cells):
            for j, other in enumerate(cells):
                assert (regions[i] == regions[j]) == (one == other)


def test_tags_of_lower_cells_do_not_matter():
    mesh = tagged(material=[5, 5, 5, 9, 5, 5])
    assert regions_of(mesh, [0, 2])[0].tolist() == [0] * 5


def test_untagged_mesh_is_one_region():
    assert regions_of(tagged(), [0, 2])[0].tolist() == [0] * 5


# ---------------------------------------------------------------------- fields of any name, sets, choice


def strip(n=40, **more):
    """n triangles in a row, without a field; more: as for Mesh."""
    rows = np.arange(n)
    points = np.column_stack([np.arange(n + 2) // 2, np.arange(n + 2) % 2]).astype(float)
    return Mesh(points, [Cells("triangle", np.column_stack([rows, rows + 1, rows + 2]))], **more)


HALVES = np.repeat([3, 8], 20)


@pytest.mark.parametrize("name", ["PartId", "attribute", "my_material", "zone id", "grain", "id", "flag"])
@pytest.mark.parametrize("dtype", [np.int64, np.int32, np.uint8, bool])
def test_integers_with_few_values_are_tags_whatever_their_name(name, dtype):
    mesh = strip(cell_data={name: [(HALVES == 8).astype(dtype)]})
    assert region_names(mesh) == [name]
    assert regions_of(mesh, [0])[0].tolist() == [0] * 20 + [1] * 20


@pytest.mark.parametrize(
    "name",
    [
        *("partition", "Partition_ID", "gmsh:partition", "rank", "mpi_rank", "RankId", "proc", "ProcessId"),
        *("procs", "processor", "GlobalId", "GlobalIds", "cell_id", "CellID", "ElementNumber", "elem_ids"),
        *("vtkGhostType", "vtkGhostLevels", "vtkOriginalCellIds", "vtkGlobalIds", "PedigreeIds", "owner"),
    ],
)
def test_partitions_ranks_and_numberings_are_not(name):
    mesh = strip(cell_data={name: [HALVES]}, cell_sets={name: [np.arange(20)]})
    assert region_names(mesh) == []
    assert regions_of(mesh, [0]) == (pytest.approx(np.zeros(40)), ())


def test_numbers_of_many_values_and_fractions_are_not():
    rng = np.random.default_rng(0)
    data = {
        "every": [np.arange(40)],
        "many": [rng.permutation(np.arange(40) // 2)],
        "one": [np.full(40, 7)],
        "real": [HALVES.astype(float)],
        "two": [np.stack([HALVES, HALVES], axis=1)],
        "text": [np.array(["a", "b"])[(HALVES == 8).astype(int)]],
    }
    assert region_names(strip(cell_data=data)) == []


def test_tags_of_formats_count_however_many_there_are():
    data = {
        name: [np.arange(40)] for name in ("nastran:property", "abaqus:part", "unv:group", "stl:attribute")
    }
    assert region_names(strip(cell_data=data)) == ["nastran:property", "abaqus:part", "unv:group"]


def test_sets_divide_as_their_members_say():
    rng = np.random.default_rng(1)
    for _ in range(20):
        members = {f"set {i}": rng.integers(0, 40, rng.integers(0, 90)) for i in range(4)}  # some twice
        mesh = strip(cell_data={"PartId": [HALVES]}, cell_sets={name: [one] for name, one in members.items()})
        region, dividers = regions_of(mesh, [0])
        key = [(HALVES[c], *(c in one for one in members.values())) for c in range(40)]
        for a in range(40):
            assert (region == region[a]).tolist() == [key[a] == other for other in key]
        counts = {name: len(set(one.tolist())) for name, one in members.items()}
        expected = {name: n for name, n in counts.items() if 0 < n < 40}
        assert {d.name: d.count for d in dividers if d.kind == "set"} == expected


def test_sets_of_all_cells_or_of_a_programs_own_divide_nothing():
    sets = {"all": [np.arange(40)], "none": [np.empty(0, int)], "_Surf-1_S3": [np.arange(5)]}
    assert regions_of(strip(cell_sets=sets), [0])[1] == ()


def test_what_divides_is_named_and_counted():
    mesh = strip(cell_data={"PartId": [HALVES]}, cell_sets={"steel": [np.arange(13)]})
    assert [d.text for d in regions_of(mesh, [0])[1]] == ["PartId (2 values)", "steel (13 cells)"]


def test_a_choice_of_names_replaces_all_others():
    data = {"PartId": [HALVES], "temperature": [np.arange(40) // 10 / 2]}
    mesh = strip(cell_data=data, cell_sets={"steel": [np.arange(13)]})
    assert regions_of(mesh, [0], ["PartId"])[0].tolist() == [0] * 20 + [1] * 20
    assert regions_of(mesh, [0], ["steel"])[0].tolist() == [1] * 13 + [0] * 27
    assert regions_of(mesh, [0], ["temperature"])[0].tolist() == sorted([0, 1, 2, 3] * 10)
    both = regions_of(mesh, [0], ["steel", "PartId"])
    assert len(np.unique(both[0])) == 3
    assert regions_of(mesh, [0], ["none"]) == (pytest.approx(np.zeros(40)), ())


def test_a_choice_may_be_a_physical_group():
    tags = np.repeat([5, 6, 7, 8], 10)
    mesh = strip(cell_data={"gmsh:physical": [tags]}, field_data={"rotor": np.array([6, 2])})
    assert regions_of(mesh, [0], ["rotor"])[0].tolist() == [0] * 10 + [1] * 10 + [0] * 20


def test_a_choice_may_be_a_number_for_each_cell():
    assert regions_of(strip(), [0], HALVES)[0].tolist() == [0] * 20 + [1] * 20
    for wrong in (HALVES[:-1], HALVES / 2, HALVES.reshape(2, 20)):
        with pytest.raises(UsageError, match="an integer for each of the 40 cells"):
            regions_of(strip(), [0], wrong)


def test_wrong_choices_are_told_what_there_is():
    mesh = strip(
        cell_data={"PartId": [HALVES], "v": [np.zeros((40, 3))]}, cell_sets={"steel": [np.arange(3)]}
    )
    with pytest.raises(UsageError, match="are called 'brass'; known: PartId, v, steel"):
        regions_of(mesh, [0], ["brass"])
    with pytest.raises(UsageError, match="'v' are not one number"):
        regions_of(mesh, [0], ["v"])
    with pytest.raises(UsageError, match="leaves no place"):
        regions_of(mesh, [0], ["none", "steel"])


def test_names_are_those_of_numbers_of_values_alone():
    """Ranks know of integers only how many values there are."""
    rng, names = np.random.default_rng(3), ["part", "su2:tag", "id", "cell_tags", "rank", "x"]
    for n in (1, 3, 9, 60, 700):
        values = {name: rng.integers(0, rng.integers(1, n + 2), n) for name in names}
        counts = {name: len(np.unique(some)) for name, some in values.items()}
        blocks = [Cells("triangle", np.zeros((n, 3), dtype=int))]
        mesh = Mesh(np.zeros((1, 2)), blocks, {name: [some] for name, some in values.items()})
        assert names_of_regions(counts, n) == tuple(region_names(mesh))
