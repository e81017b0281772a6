"""Byte ranges of files: where they are found, each process reads what a process reads that has the whole."""

from __future__ import annotations

import io
import re
from pathlib import Path

import meshio
import numpy as np
import pytest

from dvr_cli.distributed.share_reading import Read, read_share, with_indices
from dvr_cli.errors import InputError
from dvr_cli.files.formats import formats_by_suffix
from dvr_cli.files.ranges import Rows
from dvr_cli.files.reading import open_mesh
from dvr_cli.mesh.cell_types import CELL_TYPES
from fuzz import COUNTS, mutated
from meshes import delaunay
from ranged_files import (
    DATA,
    FILES,
    METRIC,
    MIXED,
    NUMBERED,
    PARAMETRIC,
    PLANAR,
    gmsh_22,
    gmsh_41,
    write_ranged,
)
from threads import on_threads

GMSH = [name for name in FILES if name.endswith("msh")]


def ranges_of(path: Path):
    return formats_by_suffix(path)[0].ranges_of(path)


def read_by(ranks: int, path: Path, ranges, field: str | None = None) -> list[Read | None]:
    """What each of some ranks reads, vertices by index."""

    def of_rank(comm):
        found = with_indices(comm, ranges, read_share(comm, path, ranges, field))
        return found and found[0]

    return on_threads(ranks, of_rank)


def tags_of(read: Read, of_type: int) -> list[tuple[int, ...]]:
    known, which = read.kinds[of_type]
    return [known[kind] for kind in which]


def agree(path: Path, ranges, ranks: int = 3) -> None:
    """The ranks together have the mesh that one process reads."""
    parts, mesh = read_by(ranks, path, ranges), open_mesh(path).mesh
    np.testing.assert_array_equal(np.concatenate([part.points for part in parts]), mesh.points)
    blocks = [block for block in mesh.cells if len(block.vertices)]
    assert [name for name, _ in ranges.cells] == [block.type for block in blocks]
    for t, block in enumerate(blocks):
        np.testing.assert_array_equal(np.concatenate([part.cells[t] for part in parts]), block.vertices)
        tags = [tag for part in parts for tag in tags_of(part, t)]
        data = [mesh.cell_data[name][t] for name in ranges.names]
        assert tags == [tuple(int(column[i]) for column in data) for i in range(len(block.vertices))]
    dimension = ranges.dimension
    moving = [block for block in blocks if CELL_TYPES[block.type].dimension == dimension]
    assert ranges.count == sum(len(block.vertices) for block in moving)


@pytest.mark.parametrize("name", [*FILES, *MIXED, *PLANAR, *DATA, *NUMBERED, *PARAMETRIC])
def test_processes_together_read_the_mesh(tmp_path, name):
    path = write_ranged(tmp_path, name)
    ranges = ranges_of(path)
    assert ranges is not None
    for ranks in (1, 3, 7):
        agree(path, ranges, ranks)


@pytest.mark.parametrize("name", [*DATA, *METRIC])
def test_processes_together_read_the_fields_of_vertices(tmp_path, name):
    path = write_ranged(tmp_path, name)
    ranges, fields = ranges_of(path), open_mesh(path).mesh.point_data
    assert set(ranges.fields) <= set(fields)
    assert ranges.fields
    for field in ranges.fields:
        for ranks in 1, 3:
            found = np.concatenate([part.field for part in read_by(ranks, path, ranges, field)])
            np.testing.assert_array_equal(found.reshape(fields[field].shape), fields[field])


@pytest.mark.parametrize("name", [*FILES, *DATA])
def test_rows_that_move_are_patched_and_no_other_byte(tmp_path, name):
    """Whoever reads the patched file has the new coordinates, and everything else as before."""
    path = write_ranged(tmp_path, name)
    before, points, data = open_mesh(path).mesh, ranges_of(path).points, bytearray(path.read_bytes())
    moved = before.points.copy()
    moved[3:11] += 0.125
    for first, last in (0, 5), (5, len(moved)):
        done = first
        for part, lo, hi in points.stretches(first, last):
            new = part.rows.patched(path, lo, moved[done : done + hi - lo]).tobytes()
            data[part.rows.offset(lo) : part.rows.offset(lo) + len(new)] = new
            done += hi - lo
        assert done == last
    path.write_bytes(data)
    after = open_mesh(path).mesh
    np.testing.assert_array_equal(after.points, moved)
    for old, new in zip(before.cells, after.cells, strict=True):
        np.testing.assert_array_equal(old.vertices, new.vertices)


@pytest.mark.parametrize("step", [0.0, 0.125])
@pytest.mark.parametrize("name", [*PARAMETRIC, *DATA])
def test_parts_are_written_as_one_process_writes_the_whole(tmp_path, name, step):
    """Parameters of nodes go with those of their block where one of these moves, and no others."""
    path, copy, whole = write_ranged(tmp_path, name), tmp_path / "copy", io.BytesIO()
    source, table = open_mesh(path), ranges_of(path).points
    moved = source.mesh.points.copy()
    moved[3:11] += step
    source.write(moved, whole)
    parts = (0, 5), (5, 9), (9, len(moved))
    stale = set().union(*(table.stale(path, first, moved[first:last]) for first, last in parts))
    table.copy_without(path, copy, stale)
    data = bytearray(copy.read_bytes())
    for first, last in parts:
        done = first
        for part, lo, hi in table.without(stale).stretches(first, last):
            new = part.rows.patched(copy, lo, moved[done : done + hi - lo]).tobytes()
            data[part.rows.offset(lo) : part.rows.offset(lo) + len(new)] = new
            done += hi - lo
    assert bytes(data) == whole.getvalue()
    assert bool(stale) == (name in PARAMETRIC and step > 0)


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("name", [*FILES, *MIXED, *PLANAR, *DATA, *NUMBERED, *PARAMETRIC, *METRIC])
def test_of_damaged_files_processes_read_nothing_that_one_would_not(tmp_path, name, count):
    path = write_ranged(tmp_path, name)
    good = path.read_bytes()
    read = 0
    for data in mutated([good], count // 5, seed=7):
        path.write_bytes(data)
        ranges = ranges_of(path)
        if ranges is None or None in read_by(2, path, ranges):
            continue
        try:
            mesh = open_mesh(path).mesh
        except InputError as error:
            raise AssertionError(f"only ranks read it: {error}") from error
        if ranges.once and sum(map(len, (b.vertices for b in mesh.cells))) < sum(
            table.count for _, table in ranges.cells
        ):
            continue  # cells that are there twice are found when ranks have their cells
        agree(path, ranges, 2)
        read += 1
    assert read > 0


def test_files_with_more_than_that_are_read_by_one_process(tmp_path):
    """Text, 32 bits, curved cells, fields that may tell regions apart, nodes with one tag."""
    mesh, path = delaunay(30, 3, 2), tmp_path / "mesh.vtk"
    cells = [("tetra", mesh.cells[0].vertices)]
    curved = np.arange(10)[None]
    others = (
        (meshio.Mesh(mesh.points, cells), {"binary": False}),
        (meshio.Mesh(mesh.points.astype(np.float32), cells), {}),
        (meshio.Mesh(mesh.points, [("tetra10", curved)]), {}),
        (meshio.Mesh(mesh.points, [*cells, ("tetra10", curved)]), {}),
    )
    for other, how in others:
        other.write(path, **how)
        assert ranges_of(path) is None
    path = tmp_path / "mesh.msh"
    path.write_bytes(gmsh_41(mesh, more=b'$ElementData\n1\n"material"\n0\n3\n0\n1\n0\n$EndElementData\n'))
    assert open_mesh(path).mesh.cells
    assert ranges_of(path) is None
    for tags in np.arange(30) // 2 + 1, np.arange(30):  # some have the same, one is not positive
        path.write_bytes(gmsh_41(mesh, tags=tags))
        assert read_by(2, path, ranges_of(path)) == [None, None]
    for other in (
        tmp_path / "empty.vtk",
        tmp_path / "empty.msh",
        tmp_path / "empty.vtu",
        tmp_path / "text.stl",
    ):
        other.write_bytes(b"")
        assert ranges_of(other) is None


@pytest.mark.parametrize("count", [10**17, 10**18 - 1])
def test_counts_beyond_all_files_are_left_to_one_process(tmp_path, count):
    """Offsets of what they declare to be there are too large for any search."""
    path, good = tmp_path / "mesh.msh", gmsh_22(delaunay(30, 3, 2))
    nodes = re.sub(rb"(?<=\$Nodes\n)\d+", b"%d" % count, good)
    view = b"$NodeData\n0\n0\n3\n0\n%d\n%d\n$EndNodeData\n" % (count, count)
    for data in nodes, good + view:
        path.write_bytes(data)
        assert ranges_of(path) is None


def test_links_may_name_nodes_with_larger_tags_than_nodes_can_have(tmp_path):
    """They are text where the tags of nodes have 32 bits."""
    mesh, path = delaunay(30, 3, 2), tmp_path / "mesh.msh"
    tags = np.arange(len(mesh.points))[::-1] * 3 + 1
    links = b"$Periodic\n1\n2 2 1\n2\n1 3000000000\n4 7\n$EndPeriodic\n"
    path.write_bytes(gmsh_22(mesh, tags=tags, more=links))
    ranges = ranges_of(path)
    found = on_threads(2, lambda comm: with_indices(comm, ranges, read_share(comm, path, ranges)))
    last = len(tags) - 1
    assert [linked.tolist() for _, linked in found] == 2 * [[last - 2, last - 1]]


def test_rows_beyond_the_end_are_not_there(tmp_path):
    path = tmp_path / "rows"
    path.write_bytes(b"head" + np.arange(6, dtype=">i4").tobytes())
    rows = Rows(4, ">i4", 2, 3)
    assert rows.read(path, 1, 3).tolist() == [[2, 3], [4, 5]]
    assert rows.read(path, 2, 5).tolist() == [[4, 5]]
    spread = Rows(4, ">i4", 1, 3, stride=8)
    assert spread.read(path, 0, 3).tolist() == [[0], [2], [4]]
    assert spread.read(path, 2, 5).tolist() == [[4]]
