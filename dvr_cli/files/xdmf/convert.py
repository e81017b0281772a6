"""Any mesh as an XDMF file with its arrays as text, which needs no second file."""

from __future__ import annotations

from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from dvr_cli.errors import OutputError
from dvr_cli.files.losses import links_not_kept, names_not_kept, not_kept
from dvr_cli.files.source import InputFile
from dvr_cli.files.vtk.cells import VTK_ORDER, VTK_TYPE
from dvr_cli.files.xdmf.source import XdmfSource, read
from dvr_cli.files.xdmf.topology import TYPES
from dvr_cli.mesh.mesh import Cells, Mesh

_NUMBER_OF = {kind: number for number, (kind, _, _) in TYPES.items()}
_KINDS = {"f": "Float", "i": "Int", "u": "UInt", "b": "UInt"}


def convert(mesh: Mesh, unread: Sequence[str]) -> XdmfSource:
    """A Source that writes ``mesh`` in XDMF; raises OutputError for cells that XDMF has not."""
    lines = ['<Xdmf Version="3.0"><Domain><Grid Name="mesh">']
    kind = "XYZ"[: mesh.points.shape[1]]
    lines.append(f'<Geometry GeometryType="{kind}">{_item(mesh.points)}</Geometry>')
    entries = np.concatenate([_entries(block) for block in mesh.cells] or [np.empty(0, np.int64)])
    n = sum(len(block.vertices) for block in mesh.cells)
    lines.append(f'<Topology TopologyType="Mixed" NumberOfElements="{n}">{_item(entries)}</Topology>')
    lost = []
    data = [(name, "Node", np.asarray(values)) for name, values in mesh.point_data.items()]
    data += [(name, "Cell", np.concatenate(values)) for name, values in mesh.cell_data.items() if values]
    for name, center, values in data:
        if values.dtype.kind in _KINDS and values.ndim < 4:
            lines.append(
                f'<Attribute Name={quoteattr(name)} AttributeType="{_attribute_type(values)}" '
                f'Center="{center}">{_item(values)}</Attribute>'
            )
        else:
            lost.append(name)
    lines.append("</Grid></Domain></Xdmf>\n")
    source = read(InputFile("\n".join(lines).encode(), None))
    source.notes = [*unread, *not_kept(lost, "field"), *names_not_kept(mesh), *links_not_kept(mesh)]
    return source


def _entries(block: Cells) -> np.ndarray:
    """A block in a mixed Topology."""
    n, nodes = block.vertices.shape
    number = _NUMBER_OF.get(VTK_TYPE.get(block.type, 0))
    counted = {"vertex": [1, 1], "line": [2, 2], "polygon": [3, nodes]}
    head = counted.get(block.type, [] if number is None else [number])
    if not head:
        raise OutputError(f"xdmf cannot hold cells of the type {block.type}")
    cells = block.vertices[:, VTK_ORDER.get(block.type, range(nodes))]
    return np.concatenate([np.tile(head, (n, 1)), cells], axis=1).astype(np.int64).ravel()


def _item(values: np.ndarray) -> str:
    values = values.astype(np.uint8) if values.dtype.kind == "b" else values
    values = values.astype(np.float32) if values.dtype == np.float16 else values
    shape = " ".join(map(str, values.shape))
    text = " ".join(map(repr, values.astype(f"{values.dtype.kind}8").ravel().tolist()))
    return (
        f'<DataItem Format="XML" NumberType="{_KINDS[values.dtype.kind]}" '
        f'Precision="{values.dtype.itemsize}" Dimensions="{shape}">{text}</DataItem>'
    )


def _attribute_type(values: np.ndarray) -> str:
    width = int(np.prod(values.shape[1:]))
    return {1: "Scalar", 2: "Vector", 3: "Vector", 6: "Tensor6", 9: "Tensor"}.get(width, "Matrix")
