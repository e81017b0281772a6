"""An XDMF file as a Source: the XML, and the arrays in it or in files beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import BinaryIO
from xml.sax.saxutils import quoteattr

import numpy as np

from dvr_cli.errors import InputError, OutputError
from dvr_cli.files.losses import not_kept, number_not_kept
from dvr_cli.files.numbers_in_text import parse_numbers, token_spans, write_replaced
from dvr_cli.files.source import InputFile, Source, differing
from dvr_cli.files.xdmf.data import mesh_of
from dvr_cli.files.xdmf.files import places, references
from dvr_cli.files.xdmf.grids import Grids, grids_of
from dvr_cli.files.xdmf.hdf5 import with_dataset
from dvr_cli.files.xdmf.items import Item, item_of, read_item, renamed
from dvr_cli.files.xml_places import Edit, Element, attribute_place, edited, parse, write_edited
from dvr_cli.mesh.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Coordinates:
    """An array of coordinates.

    items: the DataItems that refer to it, or as text repeat it.
    values: its numbers.
    axis: the coordinate it holds, None if all.
    """

    items: list[Item]
    values: np.ndarray
    axis: int | None

    def of(self, points: np.ndarray) -> np.ndarray:
        """The values of the array for these points, (count,)."""
        return points.ravel() if self.axis is None else points[:, self.axis]


class XdmfSource(Source):
    """An XDMF file with the files that it names."""

    format = "xdmf"

    def __init__(
        self,
        file: InputFile,
        mesh: Mesh,
        grids: Grids,
        coordinates: list[Coordinates],
        numbers: list[list[np.ndarray]],
        beside: Callable[[str], bytes],
    ) -> None:
        """numbers: see ``data.mesh_of``; beside: the bytes of a file that ``file`` names."""
        super().__init__()
        self.mesh = mesh
        self._file = file
        self._grids = grids
        self._coordinates = coordinates
        self._numbers = numbers
        self._beside = beside
        self._wide = False
        self._names = references(file.data)

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the XML with the coordinates ``points``, where it has them, and the names of the files."""
        write_edited(file, self._file.data, self._edits(self.stored(points)))

    def companions(self, points: np.ndarray) -> dict[Path, bytes]:
        """The files with arrays: those with coordinates with ``points``, others as they are."""
        if self.target is None:
            return {}
        points = self.stored(points)
        return {self.target.parent / new: self._heavy(name, points) for name, new in self._places().items()}

    def stored(self, points: np.ndarray) -> np.ndarray:
        """The coordinates a reader of the output gets: rounded where the file stores 32 bits.

        Raises OutputError where the files cannot be written.
        """
        self._places()
        result = points.copy()
        for part in self._coordinates:
            if self._dtype(part) == np.float32:
                with np.errstate(over="ignore"):
                    rounded = part.of(points).astype(np.float32)
                if part.axis is None:
                    result[...] = rounded.reshape(points.shape)
                else:
                    result[:, part.axis] = rounded
        return result

    def widened(self) -> XdmfSource | None:
        """The same file with coordinates of 64 bits, None if they are, or are in a raw file."""
        narrow = any(self._dtype(part) == np.float32 for part in self._coordinates)
        if not narrow or any(part.items[0].form == "binary" for part in self._coordinates):
            return None
        wide = self._like(self._file, self.mesh)
        wide._wide = True
        return wide

    def with_cell_field(self, name: str, values: list[np.ndarray], points: np.ndarray) -> XdmfSource:
        """The same file with one Attribute more in each grid that has cells of its own, as text."""
        edits = []
        first = 0
        for (_, topology, attributes), numbers in zip(self._grids.grids, self._numbers, strict=True):
            if not numbers:
                continue
            of_cells = np.full(1 + max(int(number.max()) for number in numbers), np.nan)
            for number, block in zip(numbers, values[first : first + len(numbers)], strict=True):
                of_cells[number] = block
            first += len(numbers)
            attribute = _attribute(name, of_cells)
            old = [a for a in attributes if a.attributes.get("Name") == name]
            at = (old[0].begin, old[0].end) if old else (topology.end, topology.end)
            edits.append(Edit(*at, attribute))
        file = InputFile(edited(self._file.data, edits), self._file.path)
        source = _read(file, self._beside)
        result = self._like(file, replace(self.mesh, cell_data={**self.mesh.cell_data, name: values}))
        result._grids, result._coordinates = source._grids, source._coordinates
        return result

    def _like(self, file: InputFile, mesh: Mesh) -> XdmfSource:
        result = XdmfSource(file, mesh, self._grids, self._coordinates, self._numbers, self._beside)
        result.target, result.unread, result.notes = self.target, self.unread, list(self.notes)
        result._wide = self._wide
        return result

    def _dtype(self, part: Coordinates) -> np.dtype:
        """The type that coordinates are written in."""
        return np.dtype(np.float64) if self._wide or part.values.dtype.kind != "f" else part.values.dtype

    def _changed(self, part: Coordinates, points: np.ndarray) -> bool:
        wider = self._wide and part.values.dtype != np.float64
        return wider or bool(differing(part.of(points), part.values.astype(np.float64)).any())

    def _places(self) -> dict[str, str]:
        """By the name of each file to be written with the output, the name it gets."""
        moved = dict.fromkeys(part.items[0].file for part in self._coordinates if part.items[0].file)
        others = sorted(self._names - set(moved))
        if not moved and not others:
            return {}
        if self.target is None or self._file.path is None:
            raise OutputError("an XDMF file with its arrays in other files cannot be piped")
        return places(self._file.path, self.target, list(moved), others)

    def _edits(self, points: np.ndarray) -> list[Edit]:
        data = self._file.data
        edits = []
        for part in self._coordinates:
            if not self._changed(part, points):
                continue
            for item in part.items:
                if item.form == "xml":
                    edits.append(_text(data, item, part.of(points)))
                if self._dtype(part) != part.values.dtype:
                    edits += _as_double(data, item.element)
        names = {name: new for name, new in self._places().items() if name != new}
        for element in parse(data, entities=True).walk() if names else ():
            if element.name == "DataItem" and not element.children and "Reference" not in element.attributes:
                item = item_of(data, element)
                edits += [renamed(data, item, names[item.file])] if item.file in names else []
        return edits

    def _heavy(self, name: str, points: np.ndarray) -> bytes:
        """The bytes of a file that the XML names, with these coordinates."""
        data = self._beside(name)
        for part in self._coordinates:
            item = part.items[0]
            if item.file != name or not self._changed(part, points):
                continue
            values = part.of(points).astype(self._dtype(part))
            if item.form == "hdf":
                data = with_dataset(data, item.inside, values)
            else:
                new = values.astype(item.dtype).tobytes()
                data = data[: item.seek] + new + data[item.seek + len(new) :]
        return data


def read(file: InputFile) -> XdmfSource:
    """Read an XDMF file and the arrays in the files that it names.

    Grids that share one Geometry are one mesh, see ``data.mesh_of``; series in time are carried along.
    Raises InputError, for several meshes and for what is not supported by name.
    """
    return _read(file, cache(file.beside))


def _read(file: InputFile, beside: Callable[[str], bytes]) -> XdmfSource:
    data = file.data

    def values(element: Element) -> tuple[np.ndarray, tuple[int, ...]]:
        item = item_of(data, element)
        return read_item(data, item, beside), item.shape

    grids = grids_of(data)
    coordinates = []
    arrays = [geometry.named("DataItem") for geometry in grids.geometries]
    for i, elements in enumerate(zip(*arrays, strict=True)):
        items = [item_of(data, element) for element in elements]
        read = read_item(data, items[0], beside)
        if items[0].form == "binary" and read.dtype.kind != "f":
            raise InputError("coordinates that are whole numbers in a raw file are not supported")
        coordinates.append(Coordinates(items, read, i if grids.apart else None))
    columns = [part.values.astype(np.float64) for part in coordinates]
    if len({len(column) for column in columns}) > 1 or len(columns[0]) % (
        1 if grids.apart else grids.dimension
    ):
        raise InputError("the numbers of coordinates do not agree")
    points = np.stack(columns, axis=1) if grids.apart else columns[0].reshape(-1, grids.dimension)
    mesh, numbers, left = mesh_of(points, grids, values)
    source = XdmfSource(file, mesh, grids, coordinates, numbers, beside)
    source.unread += [*number_not_kept(grids.steps, "step of a series in time"), *not_kept(left, "attribute")]
    return source


def _attribute(name: str, values: np.ndarray) -> bytes:
    text = " ".join(map(repr, values.tolist()))
    return (
        f'<Attribute Name={quoteattr(name)} AttributeType="Scalar" Center="Cell"><DataItem Format="XML" '
        f'NumberType="Float" Precision="8" Dimensions="{len(values)}">{text}</DataItem></Attribute>'
    ).encode()


def _text(data: bytes, item: Item, values: np.ndarray) -> Edit:
    """The text of an array with the numbers replaced that are not those."""
    begin, end = item.element.text
    text = data[begin:end]
    exact = parse_numbers(text, len(values), np.float64)
    with np.errstate(over="ignore"):
        before = exact.astype(np.float32).astype(np.float64) if item.dtype == np.float32 else exact
    # what was rounded to 32 bits on reading, and has not moved, keeps its digits
    changed = differing(values, before)
    starts, ends = token_spans(np.frombuffer(text, np.uint8))
    file = BytesIO()
    write_replaced(file, text, starts[changed], ends[changed], values[changed])
    return Edit(begin, end, file.getvalue())


def _as_double(data: bytes, element: Element) -> list[Edit]:
    """The edit that declares an array to be of 64 bits."""
    edits = []
    for name, value in (("Precision", b"8"), ("NumberType", b"Float"), ("DataType", b"Float")):
        if name in element.attributes:
            edits.append(Edit(*attribute_place(data, element, name), value))
        elif name == "Precision":
            at = element.begin + len("<DataItem")
            edits.append(Edit(at, at, b' Precision="8"'))
    return edits
