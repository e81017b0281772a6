"""VTK XML files (.vtu, .vtp) written by VTK itself in every coding, and what VTK reads from a file."""

from __future__ import annotations

import re
import tempfile
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np

import vtk_corpus
from needs import require
from vtk_corpus import _array, _points, vtk

_xml = require("vtkmodules.vtkIOXML")
_graphs = require("vtkmodules.vtkFiltersParallel")

_FORMS = {"ascii": ("Ascii", False), "binary": ("Binary", False)}
_FORMS |= {"raw": ("Appended", False), "base64": ("Appended", True)}
COMPRESSORS = {"none": None, "zlib": "vtkZLibDataCompressor", "lz4": "vtkLZ4DataCompressor"}
COMPRESSORS |= {"lzma": "vtkLZMADataCompressor"}


def write(
    data: object, form: str, compressor: str = "none", bits: int = 32, big: bool = False, pieces: int = 1
) -> bytes:
    """The file VTK writes for a data set. form: "ascii", "binary", "raw", "base64"; bits: of its headers."""
    is_grid = data.GetClassName() == "vtkUnstructuredGrid"
    writer = _xml.vtkXMLUnstructuredGridWriter() if is_grid else _xml.vtkXMLPolyDataWriter()
    mode, encode = _FORMS[form]
    getattr(writer, f"SetDataModeTo{mode}")()
    writer.SetEncodeAppendedData(encode)
    if COMPRESSORS[compressor]:
        writer.SetCompressor(getattr(vtk_io(), COMPRESSORS[compressor])())
    else:
        writer.SetCompressorTypeToNone()
    writer.SetBlockSize(72)  # several blocks even in a small file
    getattr(writer, f"SetHeaderTypeToUInt{bits}")()
    getattr(writer, f"SetByteOrderTo{'Big' if big else 'Little'}Endian")()
    if pieces == 1:
        writer.SetInputData(data)
    else:
        cut = _graphs.vtkExtractUnstructuredGridPiece() if is_grid else _graphs.vtkExtractPolyDataPiece()
        cut.SetInputData(data)
        cut.SetCreateGhostCells(False)
        writer.SetInputConnection(cut.GetOutputPort())
        writer.SetNumberOfPieces(pieces)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.vtu"
        writer.SetFileName(str(path))
        assert writer.Write()
        return path.read_bytes()


@cache
def vtk_io() -> object:
    return require("vtkmodules.vtkIOCore")


def grid(double: bool = True) -> object:
    """27 points, 48 tetrahedra of two materials, vectors on points."""
    result = vtk.vtkUnstructuredGrid()
    x = np.stack(np.meshgrid(*[np.arange(3.0)] * 3, indexing="ij"), axis=-1).transpose(2, 1, 0, 3)
    result.SetPoints(_points(x.reshape(-1, 3) + vtk_corpus.JITTER[:27] / 2, double))
    for k, j, i in product(range(2), repeat=3):
        at = np.array([0, 1, 3, 4, 9, 10, 12, 13]) + i + 3 * j + 9 * k
        for a, b in ((1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1)):
            result.InsertNextCell(10, 4, at[[0, a, b, 7]].tolist())
    result.GetPointData().SetVectors(_array("vtkFloatArray", "the u", np.arange(81).reshape(27, 3) / 7))
    result.GetCellData().SetScalars(_array("vtkIntArray", "material", np.arange(48) // 24))
    return result


def surface(double: bool = True) -> object:
    """Triangles, quadrilaterals, lines and vertices, numbered by a cell array."""
    return vtk_corpus.polydata(double)


def with_data(double: bool = True) -> object:
    """All arrays that VTK can write as XML."""
    result = vtk_corpus.with_data(double)
    result.GetPointData().RemoveArray("variants")
    return result


def _recipes() -> dict[str, tuple]:
    """By name of a file: the builder of its data set, whether that has double, and what ``write`` takes."""
    recipes: dict[str, tuple] = {}
    for double in (False, True):
        word = "double" if double else "float"
        for build in (grid, vtk_corpus.all_linear, vtk_corpus.second_order, with_data, surface):
            for form, compressor in _SOME:
                recipes[f"{build.__name__}-{form}-{compressor}-{word}"] = (build, double, form, compressor)
        for build, form in ((grid, "ascii"), (grid, "raw"), (surface, "binary"), (grid, "base64")):
            recipes[f"{build.__name__}_pieces-{form}-zlib-{word}"] = (
                build,
                double,
                form,
                "zlib",
                32,
                False,
                3,
            )
            recipes[f"{build.__name__}_pieces-{form}-none-{word}"] = (
                build,
                double,
                form,
                "none",
                64,
                True,
                2,
            )
    for form, compressor, bits, big in product(
        ("binary", "raw", "base64"), COMPRESSORS, (32, 64), (False, True)
    ):
        name = f"grid-{form}-{compressor}-{bits}-{'big' if big else 'little'}"
        recipes[name] = (grid, bits == 32, form, compressor, bits, big)
    return recipes


_SOME = (("ascii", "none"), ("binary", "zlib"), ("raw", "none"), ("base64", "lzma"))
_RECIPES = _recipes()
NAMES = sorted(_RECIPES)


@cache
def file(name: str) -> bytes:
    """The file of this name."""
    build, double, *coding = _RECIPES[name]
    return write(build(double), *coding)


def module_of(data: bytes) -> str:
    """The reader that a file is for: "vtu" or "vtp"."""
    return "vtp" if b'type="PolyData"' in data[:200] else "vtu"


def read_with_vtk(data: bytes) -> object:
    """The data set VTK reads from a file; fails if VTK complains."""
    grids = module_of(data) == "vtu"
    return vtk_corpus.found_by(
        _xml.vtkXMLUnstructuredGridReader() if grids else _xml.vtkXMLPolyDataReader(), data
    )


_POINTS = re.compile(
    rb'<Piece NumberOfPoints="(\d+)"[^>]*>(?:(?!<Points).)*<Points>\s*<DataArray([^>]*?)/?>(.*?)</(?:Da'
    rb"taArray|Points)>",
    re.DOTALL,
)


def points_blanked(data: bytes) -> bytes:
    """An uncompressed file without the numbers of its points: what has to stay the same in all of them.

    Found without the package: those in its Points elements, or behind the offset there.
    """
    places = []
    start = data.find(b"<AppendedData")
    base = data.find(b"_", start) + 1
    width = 8 if b'header_type="UInt64"' in data[:300] else 4
    for match in _POINTS.finditer(data):
        count, tag = int(match[1]), match[2]
        if b'format="appended"' not in tag:
            end = match[3].find(b"<InformationKey")
            places.append((match.start(3), match.start(3) + end if end >= 0 else match.end(3)))
            continue
        offset = base + int(re.search(rb'offset="(\d+)"', tag)[1])
        size = width + 3 * count * (8 if b"Float64" in tag else 4)
        places.append((offset, offset + (-(-size // 3) * 4 if b'encoding="base64"' in data else size)))
    assert places
    for begin, end in reversed(places):
        data = data[:begin] + data[end:]
    return data
