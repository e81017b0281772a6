"""Any mesh as an XDMF file: its arrays in an HDF5 file beside it, or as text where that cannot be."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from dvr_cli.errors import OutputError
from dvr_cli.files.hdf5 import is_there
from dvr_cli.files.losses import links_not_kept, names_not_kept, not_kept
from dvr_cli.files.source import Source
from dvr_cli.files.vtk.cells import VTK_ORDER, VTK_TYPE
from dvr_cli.files.xdmf.files import owned
from dvr_cli.files.xdmf.topology import TYPES
from dvr_cli.mesh.mesh import Cells, Mesh

_NUMBER_OF = {kind: number for number, (kind, nodes, _) in TYPES.items() if nodes}
_LINEAR = range(4, 10)  # numbers whose names all readers know
_COUNTED = {"vertex": 1, "line": 2, "polygon": 3}  # types whose cells say how many nodes they have
_KINDS = {"f": "Float", "i": "Int", "u": "UInt", "b": "UInt"}


class ConvertedXdmf(Source):
    """A mesh read from another format, to be written as XDMF.

    The arrays go to an HDF5 file with the name of the output. A pipe, or an installation without h5py, gets
    them as text within the XML.
    """

    format = "xdmf"

    def __init__(self, mesh: Mesh, unread: Sequence[str]) -> None:
        """unread: what the file the mesh was read from holds beyond it, one line each."""
        super().__init__()
        self.mesh = mesh
        self._unread = list(unread)
        self._topology, self._cells = _topology(mesh.cells)
        data = [(name, "Node", np.asarray(values)) for name, values in mesh.point_data.items()]
        data += [(name, "Cell", np.concatenate(v)) for name, v in mesh.cell_data.items() if v]
        fits = {name: values.dtype.kind in _KINDS and values.ndim < 4 for name, _, values in data}
        self._attributes = [item for item in data if fits[item[0]]]
        lost = [name for name, fit in fits.items() if not fit]
        self.notes = [*unread, *not_kept(lost, "field"), *names_not_kept(mesh), *links_not_kept(mesh)]

    def write(self, points: np.ndarray, file: BinaryIO) -> None:
        """Write the XML, with the arrays as text where there is no file beside it."""
        heavy = self._heavy
        if heavy is None:
            xml = self._xml(points, "XML", lambda _, values: _text(values))
        else:
            name = heavy.name
            xml = self._xml(points, "HDF", lambda i, _: f"{name}:/data{i}")
        file.write(xml.encode())

    def companions(self, points: np.ndarray) -> dict[Path, bytes]:
        """The HDF5 file, if there is one."""
        heavy = self._heavy
        if heavy is None:
            return {}
        import h5py

        buffer = io.BytesIO()
        with h5py.File(buffer, "w") as file:
            for i, values in enumerate(self._arrays(points)):
                file.create_dataset(f"data{i}", data=values)
        return {heavy: buffer.getvalue()}

    def stored(self, points: np.ndarray) -> np.ndarray:
        """``points``; raises OutputError where a file that does not belong to the output is in the way."""
        heavy = self._heavy
        if heavy is not None and heavy.exists():
            assert self.target is not None
            if Path(os.path.realpath(heavy)) not in owned(self.target):
                raise OutputError(
                    f"{heavy} is in the way and does not belong to the output; choose another name"
                )
        return points

    def with_cell_field(self, name: str, values: list[np.ndarray], points: np.ndarray) -> ConvertedXdmf:
        """The same mesh with one Attribute more."""
        mesh = replace(self.mesh, cell_data={**self.mesh.cell_data, name: values})
        result = ConvertedXdmf(mesh, self._unread)
        result.target = self.target
        return result

    @property
    def _heavy(self) -> Path | None:
        """The HDF5 file, None if the arrays are text: a colon would end its name in the XML."""
        if self.target is None or ":" in self.target.name or not is_there():
            return None
        return self.target.with_suffix(".h5")

    def _arrays(self, points: np.ndarray) -> list[np.ndarray]:
        """The arrays of the file: coordinates, cells, attributes."""
        return [points, self._cells, *(_storable(values) for _, _, values in self._attributes)]

    def _xml(self, points: np.ndarray, form: str, place: Callable[[int, np.ndarray], str]) -> str:
        """The file; place: what stands in the DataItem of an array, by its number and values."""
        items = [
            f'<DataItem Format="{form}" NumberType="{_KINDS[values.dtype.kind]}" '
            f'Precision="{values.dtype.itemsize}" Dimensions="{" ".join(map(str, values.shape))}">'
            f"{escape(place(i, values))}</DataItem>"
            for i, values in enumerate(self._arrays(points))
        ]
        n = sum(len(block.vertices) for block in self.mesh.cells)
        lines = [
            '<Xdmf Version="3.0"><Domain><Grid Name="mesh">',
            f'<Geometry GeometryType="{"XYZ"[: points.shape[1]]}">{items[0]}</Geometry>',
            f'<Topology TopologyType="{self._topology}" NumberOfElements="{n}">{items[1]}</Topology>',
        ]
        for (name, center, values), item in zip(self._attributes, items[2:], strict=True):
            lines.append(
                f'<Attribute Name={quoteattr(name)} AttributeType="{_attribute_type(values)}" '
                f'Center="{center}">{item}</Attribute>'
            )
        return "\n".join([*lines, "</Grid></Domain></Xdmf>\n"])


def convert(mesh: Mesh, unread: Sequence[str]) -> ConvertedXdmf:
    """A Source that writes ``mesh`` in XDMF; raises OutputError for cells that XDMF has not."""
    return ConvertedXdmf(mesh, unread)


def _topology(blocks: list[Cells]) -> tuple[str, np.ndarray]:
    """The type of the Topology and its array: rows of nodes for linear cells of one type, or a mixed list."""
    numbers = {_NUMBER_OF.get(VTK_TYPE.get(block.type, 0), 0) for block in blocks}
    if len(numbers) == 1 and numbers <= set(_LINEAR):
        name = TYPES[numbers.pop()][2][0].capitalize()
        return name, np.concatenate([_in_order(block) for block in blocks])
    return "Mixed", np.concatenate([_entries(block) for block in blocks] or [np.empty(0, np.int64)])


def _entries(block: Cells) -> np.ndarray:
    """A block in a mixed Topology."""
    n, nodes = block.vertices.shape
    if block.type in _COUNTED:
        head = [_COUNTED[block.type], nodes]
    elif VTK_TYPE.get(block.type, 0) in _NUMBER_OF:
        head = [_NUMBER_OF[VTK_TYPE[block.type]]]
    else:
        raise OutputError(f"xdmf cannot hold cells of the type {block.type}")
    return np.concatenate([np.tile(head, (n, 1)), _in_order(block)], axis=1).astype(np.int64).ravel()


def _in_order(block: Cells) -> np.ndarray:
    """The cells of a block with VTK's order of nodes."""
    return block.vertices[:, VTK_ORDER.get(block.type, range(block.vertices.shape[1]))].astype(np.int64)


def _storable(values: np.ndarray) -> np.ndarray:
    """Data in a type that XDMF has."""
    if values.dtype.kind == "b":
        return values.astype(np.uint8)
    return values.astype(np.float32) if values.dtype == np.float16 else values


def _text(values: np.ndarray) -> str:
    return " ".join(map(repr, values.astype(f"{values.dtype.kind}8").ravel().tolist()))


def _attribute_type(values: np.ndarray) -> str:
    width = int(np.prod(values.shape[1:]))
    return {1: "Scalar", 2: "Vector", 3: "Vector", 6: "Tensor6", 9: "Tensor"}.get(width, "Matrix")
