"""Two materials in one mesh: their interface keeps every bit under ``fixed``, unless regions are declined.

Each file is written down here, none by the package.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dvr_cli.cli.main import main
from dvr_cli.files.reading import open_mesh

SIDE = 5  # vertices along an edge of the square, of the cube
TETRAHEDRA = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]


def square() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (N, 3) of a square, its triangles and their materials, 1 left and 2 right of the middle."""
    y, x = (a.ravel() for a in np.mgrid[0:SIDE, 0:SIDE].astype(float))
    first = (np.arange(SIDE - 1) + SIDE * np.arange(SIDE - 1)[:, None]).ravel()
    halves = [(0, 1, SIDE + 1), (0, SIDE + 1, SIDE)]
    triangles = (first[:, None, None] + np.array(halves)).reshape(-1, 3)
    return _shaken(np.column_stack([x, y, 0 * x]), 2), triangles, _materials(x, triangles)


def cube() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of a cube, with tetrahedra."""
    z, y, x = (a.ravel() for a in np.mgrid[0:SIDE, 0:SIDE, 0:SIDE].astype(float))
    steps = np.arange(SIDE - 1)
    first = (steps + SIDE * steps[:, None] + SIDE**2 * steps[:, None, None]).ravel()
    corners = np.array([i + SIDE * j + SIDE**2 * k for k in (0, 1) for j in (0, 1) for i in (0, 1)])
    tets = (first[:, None, None] + corners[np.array(TETRAHEDRA)]).reshape(-1, 4)
    return _shaken(np.column_stack([x, y, z]), 3), tets, _materials(x, tets)


def _shaken(points: np.ndarray, dimension: int) -> np.ndarray:
    inner = ((points[:, :dimension] > 0) & (points[:, :dimension] < SIDE - 1)).all(axis=1)
    shift = 0.2 * np.random.default_rng(3).uniform(-1, 1, (inner.sum(), dimension))
    points[inner, :dimension] += shift
    return points


def _materials(x: np.ndarray, cells: np.ndarray) -> np.ndarray:
    return np.where(x[cells].mean(axis=1) < (SIDE - 1) / 2, 1, 2)


def _rows(array: np.ndarray) -> str:
    return "".join(" ".join(map(repr, row)) + "\n" for row in array.tolist())


def medit(path: Path, points: np.ndarray, cells: np.ndarray, materials: np.ndarray) -> None:
    keyword = {3: "Triangles", 4: "Tetrahedra"}[cells.shape[1]]
    vertices = _rows(points).replace("\n", " 0\n")
    path.write_text(
        f"MeshVersionFormatted 2\nDimension 3\nVertices {len(points)}\n{vertices}{keyword} {len(cells)}\n"
        f"{_rows(np.column_stack([cells + 1, materials]))}End\n"
    )


def meshb(path: Path, points: np.ndarray, cells: np.ndarray, materials: np.ndarray) -> None:
    record = np.zeros(len(points), dtype=[("place", "<f8", (3,)), ("reference", "<i4")])
    record["place"] = points
    code = {3: 6, 4: 8}[cells.shape[1]]
    rows = np.column_stack([cells + 1, materials]).astype("<i4")
    data = np.array([1, 2], "<i4").tobytes() + np.array([3, 20, 3], "<i4").tobytes()
    for keyword, count, body in ((4, len(points), record.tobytes()), (code, len(rows), rows.tobytes())):
        data += np.array([keyword, len(data) + 12 + len(body), count], "<i4").tobytes() + body
    path.write_bytes(data + np.array([54, 0], "<i4").tobytes())


def vtu(path: Path, points: np.ndarray, cells: np.ndarray, materials: np.ndarray) -> None:
    kind = {3: 5, 4: 10}[cells.shape[1]]
    ends = np.arange(1, len(cells) + 1) * cells.shape[1]

    def array(kind: str, words: str, values: np.ndarray) -> str:
        text = " ".join(map(repr, values.ravel().tolist()))
        return f'<DataArray type="{kind}" {words} format="ascii">{text}</DataArray>'

    path.write_text(
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian"><UnstructuredGrid>'
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(cells)}">'
        "<Points>"
        + array("Float64", 'NumberOfComponents="3"', points)
        + "</Points><Cells>"
        + array("Int64", 'Name="connectivity"', cells)
        + array("Int64", 'Name="offsets"', ends)
        + array("UInt8", 'Name="types"', np.full(len(cells), kind))
        + "</Cells><CellData>"
        + array("Int32", 'Name="material"', materials)
        + "</CellData></Piece></UnstructuredGrid></VTKFile>\n"
    )


def xdmf(path: Path, points: np.ndarray, cells: np.ndarray, materials: np.ndarray) -> None:
    kind = {3: "Triangle", 4: "Tetrahedron"}[cells.shape[1]]

    def item(values: np.ndarray) -> str:
        number = 'NumberType="Float" Precision="8"' if values.dtype.kind == "f" else 'NumberType="Int"'
        shape = " ".join(map(str, values.shape))
        text = " ".join(map(repr, values.ravel().tolist()))
        return f'<DataItem Dimensions="{shape}" Format="XML" {number}>{text}</DataItem>'

    path.write_text(
        '<Xdmf Version="3.0"><Domain><Grid Name="mesh">'
        f'<Topology TopologyType="{kind}" NumberOfElements="{len(cells)}">{item(cells)}</Topology>'
        f'<Geometry GeometryType="XYZ">{item(points)}</Geometry>'
        f'<Attribute Name="material" AttributeType="Scalar" Center="Cell">{item(materials)}</Attribute>'
        "</Grid></Domain></Xdmf>\n"
    )


def abaqus(path: Path, points: np.ndarray, cells: np.ndarray, materials: np.ndarray) -> None:
    kind = {3: "CPS3", 4: "C3D4"}[cells.shape[1]]
    nodes = "".join(f"{i}, {x!r}, {y!r}, {z!r}\n" for i, (x, y, z) in enumerate(points.tolist(), 1))
    parts = [f"*NODE\n{nodes}"]
    for material in (1, 2):
        parts.append(f"*ELEMENT, TYPE={kind}, ELSET=M{material}\n")
        for i in np.flatnonzero(materials == material).tolist():
            parts.append(f"{i + 1}, {', '.join(map(str, (cells[i] + 1).tolist()))}\n")
    path.write_text("".join(parts))


def nastran(path: Path, points: np.ndarray, cells: np.ndarray, materials: np.ndarray) -> None:
    card = {3: "CTRIA3", 4: "CTETRA"}[cells.shape[1]]
    grids = [f"GRID*,{i},,{x!r},{y!r},\n*,{z!r}\n" for i, (x, y, z) in enumerate(points.tolist(), 1)]
    elements = [
        f"{card},{i},{material},{','.join(map(str, row))}\n"
        for i, (material, row) in enumerate(zip(materials.tolist(), (cells + 1).tolist(), strict=True), 1)
    ]
    path.write_text("".join(["BEGIN BULK\n", *grids, *elements, "ENDDATA\n"]))


Write = Callable[[Path, np.ndarray, np.ndarray, np.ndarray], None]
FORMATS: dict[str, Write] = {
    ".mesh": medit,
    ".meshb": meshb,
    ".vtu": vtu,
    ".xdmf": xdmf,
    ".inp": abaqus,
    ".bdf": nastran,
}


def smoothed(source: Path, *options: str) -> np.ndarray:
    target = source.with_name(f"out{source.suffix}")
    fixed = ["--no-report", "--quiet", "-n", "3"]
    assert main(["smooth", str(source), str(target), *fixed, *options]) == 0
    return open_mesh(target).mesh.points


@pytest.mark.parametrize("body", [square, cube])
@pytest.mark.parametrize("suffix", FORMATS)
def test_the_interface_of_two_materials_stays(tmp_path, suffix, body):
    points, cells, materials = body()
    source = tmp_path / f"in{suffix}"
    FORMATS[suffix](source, points, cells, materials)
    before = open_mesh(source).mesh.points
    assert np.array_equal(before[:, : points.shape[1]], points[:, : before.shape[1]])
    interface = np.intersect1d(cells[materials == 1], cells[materials == 2])
    assert len(interface) == SIDE ** (cells.shape[1] - 2)
    apart = np.setdiff1d(np.arange(len(points)), interface)
    after = smoothed(source)
    assert np.array_equal(after[interface].view(np.int64), before[interface].view(np.int64))
    assert (after[apart] != before[apart]).any()
    free = smoothed(source, "--regions", "none")
    assert (free[interface] != before[interface]).any()


@pytest.mark.parametrize("suffix", [".mesh", ".meshb", ".vtu", ".xdmf"])
def test_a_region_named_binds_the_others_do_not(tmp_path, suffix):
    points, cells, materials = square()
    source = tmp_path / f"in{suffix}"
    FORMATS[suffix](source, points, cells, materials)
    name = "medit:ref" if "mesh" in suffix else "material"
    assert np.array_equal(smoothed(source, "--regions", name), smoothed(source))


SU2_MARKER = "MARKER_TAG= inner\nMARKER_ELEMS= {}\n{}"


@pytest.mark.parametrize("body", [square, cube])
def test_a_marker_between_two_materials_of_su2_stays(tmp_path, body):
    """SU2 has no materials: its interface is a marker on facets between cells, and without it they move."""
    points, cells, materials = body()
    dimension = cells.shape[1] - 1
    interface = np.intersect1d(cells[materials == 1], cells[materials == 2])
    left = cells[materials == 1]
    on = np.isin(left, interface)
    facets = left[on.sum(axis=1) == dimension]
    facets = facets[on[on.sum(axis=1) == dimension]].reshape(-1, dimension)
    assert len(facets) == {2: SIDE - 1, 3: 2 * (SIDE - 1) ** 2}[dimension]
    elements = _rows(np.column_stack([np.full(len(cells), {2: 5, 3: 10}[dimension]), cells]))
    head = (
        f"NDIME= {dimension}\nNELEM= {len(cells)}\n{elements}"
        f"NPOIN= {len(points)}\n{_rows(points[:, :dimension])}"
    )
    rows = _rows(np.column_stack([np.full(len(facets), {2: 3, 3: 5}[dimension]), facets]))
    marked, plain = tmp_path / "in.su2", tmp_path / "plain.su2"
    marked.write_text(f"{head}NMARK= 1\n{SU2_MARKER.format(len(facets), rows)}")
    plain.write_text(f"{head}NMARK= 0\n")
    before, after = open_mesh(marked).mesh.points, smoothed(marked)
    assert np.array_equal(after[interface].view(np.int64), before[interface].view(np.int64))
    assert (after != before).any()
    assert (smoothed(plain)[interface] != before[interface]).any()


def test_zones_of_su2_that_touch_keep_their_interface(tmp_path):
    points, cells, materials = square()
    parts = ["NZONE= 2\n"]
    kept = []
    for material in (1, 2):
        own = np.unique(cells[materials == material])
        local = np.searchsorted(own, cells[materials == material])
        elements = _rows(np.column_stack([np.full(len(local), 5), local]))
        parts += [
            f"IZONE= {material}\nNDIME= 2\nNELEM= {len(local)}\n{elements}",
            f"NPOIN= {len(own)}\n{_rows(points[own, :2])}NMARK= 0\n",
        ]
        kept.append(own)
    source = tmp_path / "in.su2"
    source.write_text("".join(parts))
    both = np.concatenate(kept)
    interface = np.isin(both, np.intersect1d(*kept))
    before, after = open_mesh(source).mesh.points, smoothed(source)
    assert interface.sum() == 2 * SIDE
    assert np.array_equal(after[interface].view(np.int64), before[interface].view(np.int64))
    assert (after[~interface] != before[~interface]).any()
