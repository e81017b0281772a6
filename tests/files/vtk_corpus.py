"""Legacy VTK files written by VTK itself and by meshio, and what VTK reads from a file.

VTK is needed for these tests only. Where it cannot be imported they are skipped, except under CI.
"""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import meshio
import numpy as np

from needs import require


def _load_vtk() -> SimpleNamespace:
    modules = [require(f"vtkmodules.vtk{name}") for name in ("CommonCore", "CommonDataModel", "IOLegacy")]
    names = {name: value for module in modules for name, value in vars(module).items()}
    names["np"] = require("vtkmodules.util.numpy_support")
    return SimpleNamespace(**{name: names[name] for name in names if not name.startswith("_")})


vtk = _load_vtk()

CUBE = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
# Third and later digits make sure that float32 cannot hold the coordinates exactly.
JITTER = np.random.default_rng(3).uniform(-0.1, 0.1, (64, 3))


def _points(coordinates: np.ndarray, double: bool = True) -> object:
    points = vtk.vtkPoints()
    points.SetData(vtk.np.numpy_to_vtk(coordinates.astype(np.float64 if double else np.float32), deep=True))
    return points


def _array(kind: str, name: str, values: np.ndarray) -> object:
    values = np.asarray(values)
    array = getattr(vtk, kind)()
    array.SetName(name)
    array.SetNumberOfComponents(1 if values.ndim == 1 else values.shape[1])
    for row in values.reshape(len(values), -1).tolist():
        array.InsertNextTuple(row)
    return array


def _strings(name: str, values: list[str]) -> object:
    array = vtk.vtkStringArray()
    array.SetName(name)
    for value in values:
        array.InsertNextValue(value)
    return array


def _cell_array(*cells: list[int]) -> object:
    array = vtk.vtkCellArray()
    for cell in cells:
        array.InsertNextCell(len(cell), cell)
    return array


def tetrahedra(double: bool = True) -> object:
    """Six tetrahedra in a cube, coordinates with many digits, no data."""
    grid = vtk.vtkUnstructuredGrid()
    grid.SetPoints(_points(CUBE + JITTER[:8], double))
    for a, b in ((1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1)):
        grid.InsertNextCell(10, 4, [0, a, b, 7])
    return grid


def all_linear(double: bool = True) -> object:
    """One cell of each linear type, polygons and a polyline among them, in runs of different length."""
    grid = vtk.vtkUnstructuredGrid()
    grid.SetPoints(_points(np.concatenate([CUBE, [[0.5, 0.5, 2]], JITTER[:4]]), double))
    for kind, nodes in (
        (10, [0, 1, 2, 4]),
        (10, [1, 3, 2, 7]),
        (12, [0, 1, 3, 2, 4, 5, 7, 6]),
        (11, range(8)),
        (11, range(8)),
        (13, [0, 2, 1, 4, 6, 5]),
        (14, [4, 5, 7, 6, 8]),
        (5, [0, 1, 2]),
        (9, [0, 1, 3, 2]),
        (8, [0, 1, 2, 3]),
        (7, [0, 1, 3]),
        (7, [0, 1, 3, 2]),
        (7, [0, 1, 5, 7, 2]),
        (3, [0, 1]),
        (4, [0, 1, 3, 2]),
        (1, [3]),
        (2, [4, 5]),
    ):
        nodes = list(nodes)
        grid.InsertNextCell(kind, len(nodes), nodes)
    grid.GetCellData().AddArray(_array("vtkIntArray", "cell id", np.arange(grid.GetNumberOfCells())))
    return grid


SECOND_ORDER = {
    "line3": "vtkQuadraticEdge",
    "triangle6": "vtkQuadraticTriangle",
    "triangle7": "vtkBiQuadraticTriangle",
    "quad8": "vtkQuadraticQuad",
    "quad9": "vtkBiQuadraticQuad",
    "quad6": "vtkQuadraticLinearQuad",
    "tetra10": "vtkQuadraticTetra",
    "hexahedron20": "vtkQuadraticHexahedron",
    "hexahedron24": "vtkBiQuadraticQuadraticHexahedron",
    "hexahedron27": "vtkTriQuadraticHexahedron",
    "wedge12": "vtkQuadraticLinearWedge",
    "wedge15": "vtkQuadraticWedge",
    "wedge18": "vtkBiQuadraticQuadraticWedge",
    "pyramid13": "vtkQuadraticPyramid",
    "line4": "vtkCubicLine",
    "penta_prism": "vtkPentagonalPrism",
    "hexa_prism": "vtkHexagonalPrism",
}


def second_order(double: bool = True) -> object:
    """One cell of each type of SECOND_ORDER at its parametric coordinates, with points of its own."""
    grid = vtk.vtkUnstructuredGrid()
    coordinates, cells, first = [], [], 0
    for name in SECOND_ORDER.values():
        cell = getattr(vtk, name)()
        n = cell.GetNumberOfPoints()
        coordinates.append(np.reshape(cell.GetParametricCoords()[: 3 * n], (n, 3)))
        cells.append((cell.GetCellType(), n, list(range(first, first + n))))
        first += n
    grid.SetPoints(_points(np.concatenate(coordinates), double))
    for cell in cells:
        grid.InsertNextCell(*cell)
    return grid


def with_data(double: bool = True) -> object:
    """Two tetrahedra with every attribute and type of array that VTK writes."""
    grid = vtk.vtkUnstructuredGrid()
    points = _points(CUBE[[0, 1, 2, 4, 7]] + JITTER[:5], double)
    points.GetData().SetComponentName(0, "in x")
    points.GetData().GetRange(-1)  # makes VTK write the range as METADATA
    grid.SetPoints(points)
    for cell in ([0, 1, 2, 3], [1, 2, 3, 4]):
        grid.InsertNextCell(10, 4, cell)
    words = ["a b", "50%", "", "x" * 100, "é"]
    on_points, on_cells, free = grid.GetPointData(), grid.GetCellData(), grid.GetFieldData()
    free.AddArray(_array("vtkDoubleArray", "TIME", np.array([3.5])))
    free.AddArray(_strings("history of the run", [*words, "y" * 20000]))
    on_points.AddArray(_strings("some words", words))
    for kind in (
        *("Char", "SignedChar", "UnsignedChar", "Short", "UnsignedShort", "Int", "UnsignedInt", "Long"),
        *("UnsignedLong", "LongLong", "UnsignedLongLong", "IdType", "Bit", "Float", "Double"),
    ):
        on_points.AddArray(_array(f"vtk{kind}Array", f"a {kind}", np.array([0, 1, 0, 1, 1])))
    variants = vtk.vtkVariantArray()
    variants.SetName("variants")
    for value in (1, 2.5, "a b", "", 3):
        variants.InsertNextValue(vtk.vtkVariant(value))
    on_points.AddArray(variants)
    vectors = _array("vtkDoubleArray", "the vectors", np.arange(15).reshape(5, 3) / 7)
    vectors.SetTuple3(2, np.nan, np.inf, -np.inf)
    vectors.SetComponentName(1, "in y")
    on_points.SetVectors(vectors)
    on_points.SetNormals(_array("vtkFloatArray", "n", np.tile([0, 0, 1], (5, 1))))
    on_points.SetTCoords(_array("vtkFloatArray", "t", np.arange(10).reshape(5, 2)))
    on_points.SetTensors(_array("vtkDoubleArray", "tensors", np.arange(45).reshape(5, 9)))
    on_points.SetGlobalIds(_array("vtkIdTypeArray", "g", np.arange(5) * 10))
    on_points.SetPedigreeIds(_array("vtkIdTypeArray", "p", np.arange(5)))
    colors = _array("vtkUnsignedCharArray", "colors", np.array([[1, 2, 3], [255, 0, 128]]))
    table = vtk.vtkLookupTable()
    table.SetNumberOfTableValues(4)
    table.Build()
    colors.SetLookupTable(table)
    on_cells.SetScalars(colors)
    on_cells.AddArray(_array("vtkIntArray", "CellEntityIds", np.array([7, -9])))
    on_cells.AddArray(_array("vtkDoubleArray", "last", np.array([[0.1, 0.2], [0.3, 0.4]])))
    return grid


def scalars(double: bool = True) -> object:
    """Tetrahedra with a scalar field of several components on points and one on cells."""
    grid = tetrahedra(double)
    grid.GetPointData().SetScalars(_array("vtkFloatArray", "s", np.arange(24).reshape(8, 3) / 3))
    grid.GetCellData().SetScalars(_array("vtkIntArray", "material", np.arange(6) // 2))
    return grid


def polydata(double: bool = True) -> object:
    """Vertices, lines and polygons of 3 to 6 nodes, numbered by a cell array."""
    data = vtk.vtkPolyData()
    data.SetPoints(_points(JITTER[:10], double))
    data.SetVerts(_cell_array([0], [1, 2]))
    data.SetLines(_cell_array([0, 1], [1, 2, 3]))
    data.SetPolys(_cell_array([0, 1, 2], [0, 1, 2, 3], [4, 5, 6, 7, 8], [2, 3, 4], [0, 2, 4, 6, 8, 9]))
    data.GetCellData().AddArray(_array("vtkIntArray", "cell id", np.arange(9)))
    data.GetPointData().SetNormals(_array("vtkFloatArray", "n", np.tile([0, 0, 1], (10, 1))))
    return data


def structured(*dimensions: int, double: bool = True) -> object:
    """A structured grid of so many points in each direction."""
    grid = vtk.vtkStructuredGrid()
    grid.SetDimensions(*dimensions)
    x = np.stack(np.meshgrid(*(np.arange(d) for d in dimensions), indexing="ij"), axis=-1)
    x = x.transpose(2, 1, 0, 3).reshape(-1, 3)
    grid.SetPoints(_points(x + JITTER[: len(x)], double))
    grid.GetCellData().AddArray(_array("vtkIntArray", "cell id", np.arange(grid.GetNumberOfCells())))
    return grid


def write(data: object, version: int = 51, binary: bool = False, **settings: bool) -> bytes:
    """The file VTK writes for a data set. version: 42 or 51; settings: of the writer, by name."""
    writer = getattr(vtk, data.GetClassName() + "Writer")()
    writer.SetInputData(data)
    writer.SetFileVersion(version)
    writer.SetFileType(2 if binary else 1)
    for name, value in settings.items():
        getattr(writer, f"Set{name}")(value)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.vtk"
        writer.SetFileName(str(path))
        assert writer.Write()
        return path.read_bytes()


def write_meshio(mesh: meshio.Mesh, file_format: str, binary: bool) -> bytes:
    """The file meshio writes: "vtk42" for version 4.2, "vtk" for 5.1."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.vtk"
        meshio.write(path, mesh, file_format=file_format, binary=binary)
        return path.read_bytes()


def meshio_mesh(dtype: type = np.float64) -> meshio.Mesh:
    """Tetrahedra and wedges with data, as a meshio mesh."""
    return meshio.Mesh(
        (CUBE + JITTER[:8]).astype(dtype),
        [
            ("tetra", np.array([[0, 1, 2, 4], [1, 3, 2, 7]])),
            ("wedge", np.array([[0, 1, 2, 4, 5, 6]])),
            ("triangle", np.array([[0, 1, 2]])),
        ],
        point_data={"u": np.arange(8.0), "v": np.arange(24.0).reshape(8, 3)},
        cell_data={"ref": [np.array([1, 2]), np.array([3]), np.array([4])]},
    )


_HAND = b"""# vtk DataFile Version %s
by hand
ascii
dataset unstructured_grid
points 5 %s
0 0 0
   1 0 0\t0 1 0
0.1 1e-3 +1.50

1 1 1
cells 2 10
4 0 1 2 3 4 1 2
3 4
cell_types 2
10 10
cell_data 2
scalars tag int
lookup_table default
4 5
point_data 5
vectors u float
1 0 0 1 0 0 1 0 0 1 0 0 1 0 0
"""


@cache
def corpus() -> dict[str, bytes]:
    """Files by name."""
    files = {}
    for version in (42, 51):
        for binary in (False, True):
            form = f"{version}{'binary' if binary else 'ascii'}"
            for build in (tetrahedra, all_linear, second_order, with_data, scalars, polydata):
                for double in (False, True):
                    name = f"{build.__name__}-{form}-{'double' if double else 'float'}"
                    files[name] = write(build(double), version, binary)
            for dimensions in ((3, 4, 2), (3, 4, 1), (1, 3, 4), (3, 1, 4), (1, 5, 1), (1, 1, 1)):
                name = f"structured{''.join(map(str, dimensions))}-{form}"
                files[name] = write(structured(*dimensions), version, binary)
            files[f"extent-{form}"] = write(structured(3, 4, 2), version, binary, WriteExtent=True)
    for file_format in ("vtk42", "vtk"):
        for binary in (False, True):
            for dtype in (np.float32, np.float64):
                name = f"meshio-{file_format}-{'binary' if binary else 'ascii'}-{dtype.__name__}"
                files[name] = write_meshio(meshio_mesh(dtype), file_format, binary)
    for version in (b"1.0", b"2.0", b"3.0"):
        for kind in (b"float", b"double"):
            files[f"hand-{version.decode()}-{kind.decode()}"] = _HAND % (version, kind)
    files["hand-crlf"] = (_HAND % (b"3.0", b"double")).replace(b"\n", b"\r\n")
    files["hand-int"] = (_HAND % (b"3.0", b"int")).replace(b"0.1 1e-3 +1.50", b"0 0 1")
    files["hand-no-last-line-end"] = (_HAND % (b"3.0", b"float"))[:-1]
    return files


def read_with_vtk(data: bytes) -> object:
    """The data set VTK reads from a file; fails if VTK complains."""
    kind = next(
        name
        for word, name in (
            (b"unstructured_grid", "vtkUnstructuredGrid"),
            (b"polydata", "vtkPolyData"),
            (b"structured_grid", "vtkStructuredGrid"),
        )
        if word in data[:400].lower()
    )
    reader = getattr(vtk, kind + "Reader")()
    for what in ("Scalars", "Vectors", "Normals", "Tensors", "ColorScalars", "TCoords", "Fields"):
        getattr(reader, f"ReadAll{what}On")()
    return found_by(reader, data)


def found_by(reader: object, data: bytes) -> object:
    """The data set one of VTK's readers finds in a file; fails if it complains."""
    complaints = []
    for event in ("ErrorEvent", "WarningEvent"):
        reader.AddObserver(event, lambda _, name: complaints.append(name))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.vtk"
        path.write_bytes(data)
        reader.SetFileName(str(path))
        reader.Update()
    assert not complaints
    return reader.GetOutput()


def coordinates(data: object) -> np.ndarray:
    """(N, 3) coordinates of a VTK data set in the type VTK keeps them."""
    return vtk.np.vtk_to_numpy(data.GetPoints().GetData())


def cells(data: object) -> list[tuple[int, list[int]]]:
    """Type and point ids of every cell of a VTK data set."""
    result = []
    ids = vtk.vtkIdList()
    for i in range(data.GetNumberOfCells()):
        data.GetCellPoints(i, ids)
        result.append((data.GetCellType(i), [ids.GetId(j) for j in range(ids.GetNumberOfIds())]))
    return result


def arrays(fields: object) -> dict[str, np.ndarray | list[str]]:
    """All arrays of point, cell or field data of a VTK data set."""
    result: dict[str, np.ndarray | list[str]] = {}
    for i in range(fields.GetNumberOfArrays()):
        array = fields.GetAbstractArray(i)
        if array.IsNumeric():
            result[array.GetName()] = vtk.np.vtk_to_numpy(array)
        else:
            values = range(array.GetNumberOfValues())
            result[array.GetName()] = [array.GetVariantValue(j).ToString() for j in values]
    return result


def everything_but_coordinates(data: object) -> list:
    """Cells and all arrays, in a form that compares with ==."""
    parts: list = [cells(data)]
    for fields in (data.GetPointData(), data.GetCellData(), data.GetFieldData()):
        for name, values in arrays(fields).items():
            parts.append((name, values if isinstance(values, list) else values.tobytes()))
    return parts
