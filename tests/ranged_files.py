"""Files of which processes can read ranges: binary VTK, Gmsh 2.2 and 4.1, raw VTU, written by hand.

Two halves of a box of tetrahedra, as two entities; in Gmsh's files with triangles, lines and points on its
boundary and between them, in physical groups.
"""

from __future__ import annotations

import struct
from pathlib import Path

import meshio
import numpy as np

from dvr_cli.files.vtk.cells import VTK_ORDER, VTK_TYPE
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Mesh
from meshes import random_mesh

FILES = ("5.1.vtk", "4.2.vtk", "41.msh", "41-big.msh", "22.msh", "22-batches.msh", "raw.vtu", "raw-big.vtu")
MIXED = ("5.1-mixed.vtk", "4.2-mixed.vtk", "41-mixed.msh", "22-mixed.msh", "raw-mixed.vtu")
DATA = ("5.1-data.vtk", "4.2-data.vtk", "41-data.msh", "22-data.msh", "raw-data.vtu")
LINKS = ("41-links.msh", "22-links.msh")
NUMBERED = ("41-order.msh", "41-gaps.msh", "41-big-gaps.msh", "22-order.msh", "22-batches-gaps.msh")
PARAMETRIC = ("41-parametric.msh", "41-big-order-parametric.msh")
METRIC = ("41-metric.msh", "41-big-order-metric.msh", "22-batches-gaps-metric.msh")
PLANAR = ("5.1-planar.vtk", "41-planar.msh", "22-planar.msh", "raw-planar.vtu")
_CODES = {"vertex": 15, "line": 1, "triangle": 2, "quad": 3, "tetra": 4}
_CODES |= {"hexahedron": 5, "wedge": 6, "pyramid": 7}


def write_ranged(folder: Path, name: str) -> Path:
    """The file of this name, one of FILES, of MIXED with several types of cells, or of PLANAR in a plane.

    Those of LINKS have periodic links, of vertices inside too; those of NUMBERED such links, and nodes
    numbered in any order, maybe with gaps; those of PARAMETRIC a block of nodes with a parameter each. Those
    of DATA have fields on cells and points, one of which tells regions apart; of Gmsh's fields, and of 4.1 a
    volume in two groups and a node with a parameter. Those of METRIC have a field of tensors.
    """
    kind = {"mixed": "mixed3d", "planar": "mixed2d"}.get(Path(name).stem.split("-")[-1], "tetra")
    mesh, path = random_mesh(kind, 1, n=4, noise=0.2), folder / name
    mesh = Mesh(np.pad(mesh.points, ((0, 0), (0, 3 - mesh.points.shape[1]))), mesh.cells)
    order = ">" if "big" in name else "<"
    if path.suffix == ".vtk":
        blocks = [(block.type, block.vertices) for block in mesh.cells]
        data = {"point_data": {"u": mesh.points}, "cell_data": cell_data(mesh)} if "data" in name else {}
        meshio.Mesh(mesh.points, blocks, **data).write(path, file_format={"5": "vtk", "4": "vtk42"}[name[0]])
    elif path.suffix == ".vtu":
        raw_vtu(path, mesh, order, "data" in name)
    elif name.startswith("41"):
        tags = tags_of(name, len(mesh.points), 2**40)
        how = {"groups": 2, "parametric": 1, "more": views(order)} if "data" in name else {}
        how |= {"parametric": 60} if name in PARAMETRIC else {}
        how |= {"more": metric(order, mesh, tags)} if name in METRIC else {}
        how |= {"more": links(order, False, tags)} if name in (*LINKS, *NUMBERED) else {}
        path.write_bytes(gmsh_41(mesh, order, tags, **how))
    else:
        tags = tags_of(name, len(mesh.points), 10**9)
        linked = links(order, True, tags) if name in (*LINKS, *NUMBERED) else b""
        more = views(order) if "data" in name else metric(order, mesh, tags) if name in METRIC else linked
        path.write_bytes(gmsh_22(mesh, order, "batches" in name, more=more, tags=tags))
    return path


def tags_of(name: str, n: int, most: int) -> np.ndarray:
    """(n,) the tags of nodes: in the order of the file, in any order or, up to ``most``, with gaps, too."""
    if "order" in name:
        return np.random.default_rng(3).permutation(n) + 1
    return np.random.default_rng(3).integers(1, most, n) if "gaps" in name else np.arange(1, n + 1)


def cell_data(mesh: Mesh) -> dict[str, list[np.ndarray]]:
    """Fields on cells: two parts, a number for each, and what are no numbers to tell parts by."""
    middle = [mesh.points[block.vertices].mean(axis=1) for block in mesh.cells]
    some = [np.arange(len(block.vertices)) for block in mesh.cells]
    data = {"part": [(rows[:, 1] > 0.5).astype(np.int32) for rows in middle], "id": some, "each": some}
    return data | {"at": middle, "load": [rows[:, 0] for rows in middle]}


def links(order: str, older: bool, tags: np.ndarray) -> bytes:
    """Periodic links of a Gmsh file, from every seventh node to the one behind it; one has no such node."""
    pairs = [(int(tags[node]), int(tags[node + 1])) for node in range(9, 99, 7)] + [(int(tags[4]), 10**9)]
    if older:
        rows = "\n".join(f"{one} {other}" for one, other in pairs)
        return f"$Periodic\n1\n2 2 1\n{len(pairs)}\n{rows}\n$EndPeriodic\n".encode()
    body = struct.pack(f"{order}q3iqq", 1, 2, 2, 1, 0, len(pairs))
    return b"$Periodic\n" + body + np.array(pairs, f"{order}i8").tobytes() + b"\n$EndPeriodic\n"


def tensors_at(points: np.ndarray) -> np.ndarray:
    """(N, 6) the tensors of a metric: drawn out along x, and the more the farther from the origin."""
    tensors = np.zeros((len(points), 6))
    tensors[:, :3] = 1.0 + points.sum(axis=1, keepdims=True) * [2.0, 0.0, 0.5]
    tensors[:, 3] = 0.3
    return tensors


def metric(order: str, mesh: Mesh, tags: np.ndarray) -> bytes:
    """A metric as a field of a Gmsh file in two steps, the last in two views, as for partitions.

    A node has two rows, and the first of these is not the metric; another row is of no node.
    """
    tensors = tensors_at(mesh.points)[:, [0, 3, 5, 3, 1, 4, 5, 4, 2]]
    n, cut, one = len(tags), len(tags) // 3, np.ones((1, 9))
    steps = (
        (0, tags, np.tile(np.eye(3).reshape(1, 9), (n, 1))),
        (1, np.append(tags[:1], tags[cut:]), np.concatenate([one, tensors[cut:]])),
        (1, np.append(tags[:cut], 10**9 + 1), np.concatenate([tensors[:cut], one])),
    )
    found = b""
    for step, numbers, values in steps:
        rows = np.zeros(len(numbers), [("tag", f"{order}i4"), ("value", f"{order}f8", 9)])
        rows["tag"], rows["value"] = numbers, values
        found += b'$NodeData\n1\n"metric"\n1\n0.0\n3\n%d\n9\n%d\n' % (step, len(rows))
        found += rows.tobytes() + b"\n$EndNodeData\n"
    return found


def views(order: str) -> bytes:
    """Fields of a Gmsh file, of some nodes and some elements."""
    found = b"$Comments\nsome words\n$EndComments\n"
    for name in b"NodeData", b"ElementData":
        found += b'$%b\n1\n"load"\n1\n0.0\n3\n0\n1\n2\n' % name
        found += struct.pack(f"{order}idid", 1, 0.5, 2, 1.5) + b"\n$End%b\n" % name
    return found


def blocks_of(mesh: Mesh) -> list[tuple[str, int, int, np.ndarray]]:
    """The type, physical group, entity and cells of each block, from the points to the two halves.

    Of a mesh with several types a facet of the first, and then all its blocks.
    """
    if len(mesh.cells) > 1:
        first = CELL_TYPES[mesh.cells[0].type]
        facet = np.take(mesh.cells[0].vertices[:1], first.facets[0], axis=1)
        name = {2: "line", 4: "quad"}[facet.shape[1]]
        blocks = [(block.type, 5 + i, 1 + i, block.vertices) for i, block in enumerate(mesh.cells)]
        return [(name, 1, 1, facet), *blocks]
    cells = mesh.cells[0].vertices
    left = mesh.points[cells].mean(axis=1)[:, 0] < 0.5
    halves = cells[left], cells[~left]
    facets = [_facets(half) for half in halves]
    between = np.array([row for row in facets[0].tolist() if row in facets[1].tolist()]).reshape(-1, 3)
    sides = [np.array([row for row in some.tolist() if row not in between.tolist()]) for some in facets]
    return [
        ("vertex", 9, 1, sides[0][:1, :1]),
        ("line", 3, 1, np.unique(sides[0][:9, :2], axis=0)),
        ("triangle", 1, 1, sides[0]),
        ("triangle", 2, 2, sides[1]),
        ("triangle", 0, 3, between),
        ("tetra", 5, 1, halves[0]),
        ("tetra", 4, 2, halves[1]),
    ]


def _facets(cells: np.ndarray) -> np.ndarray:
    """The facets that one cell has."""
    rows = np.sort(np.concatenate([np.delete(cells, k, axis=1) for k in range(4)]), axis=1)
    rows, counts = np.unique(rows, axis=0, return_counts=True)
    return rows[counts == 1]


def gmsh_22(
    mesh: Mesh,
    order: str = "<",
    batches: bool = False,
    again: str = "",
    more: bytes = b"",
    tags: np.ndarray | None = None,
) -> bytes:
    """An MSH 2.2 file; each element has a header, as Gmsh writes them, or each block.

    again: the type of an element that is there twice, for two groups. more: sections at the end. tags: (n,)
    of the nodes.
    """
    n = len(mesh.points)
    number = np.arange(1, n + 1) if tags is None else tags
    nodes = np.zeros(n, [("tag", f"{order}i4"), ("xyz", f"{order}f8", 3)])
    nodes["tag"], nodes["xyz"] = number, mesh.points
    body, done = b"", 0
    blocks = [block for block in blocks_of(mesh) for _ in range(1 + (block[0] == again and block[2] == 1))]
    for name, physical, entity, cells in blocks:
        numbers = np.arange(done + 1, done + len(cells) + 1)
        done += len(cells)
        groups = np.broadcast_to([physical, entity], (len(cells), 2))
        rows = np.hstack([numbers[:, None], groups, number[cells]]).astype(f"{order}i4")
        if batches:
            body += struct.pack(f"{order}3i", _CODES[name], len(cells), 2) + rows.tobytes()
        else:
            head = np.broadcast_to([_CODES[name], 1, 2], (len(cells), 3))
            body += np.hstack([head, rows]).astype(f"{order}i4").tobytes()
    head = b"$MeshFormat\n2.2 1 8\n" + struct.pack(f"{order}i", 1) + b"\n$EndMeshFormat\n"
    head += b'$PhysicalNames\n1\n3 5 "left"\n$EndPhysicalNames\n'
    head += b"$Nodes\n%d\n" % n + nodes.tobytes() + b"\n$EndNodes\n"
    return head + b"$Elements\n%d\n" % done + body + b"\n$EndElements\n" + more


def gmsh_41(
    mesh: Mesh,
    order: str = "<",
    tags: np.ndarray | None = None,
    groups: int = 1,
    parametric: int = 0,
    more: bytes = b"",
) -> bytes:
    """An MSH 4.1 file; its nodes in two blocks.

    tags: (n,) of the nodes. groups: that the first volume is in. parametric: how many
    nodes have a parameter, the first ones. more: sections at the end.
    """
    n, pack = len(mesh.points), lambda kinds, *values: struct.pack(order + kinds, *values)
    tags = np.arange(1, n + 1) if tags is None else tags
    number = np.zeros(n + 1, dtype=np.int64)
    number[:n] = tags
    blocks = blocks_of(mesh)
    dimension = {name: CELL_TYPES[name].dimension for name, *_ in blocks}
    entities = pack("4q", *(sum(dimension[name] == d for name, *_ in blocks) for d in range(4)))
    for name, physical, entity, _ in blocks:
        of_entity = [physical, 7][:groups] if (name, entity) == ("tetra", 1) else [physical] * (physical > 0)
        entities += pack("i", entity) + bytes(8 * (3 if name == "vertex" else 6)) + pack("q", len(of_entity))
        entities += b"".join(pack("i", group) for group in of_entity)
        entities += b"" if name == "vertex" else pack("q", 0)
    cut = parametric or n // 3
    nodes = pack("4q", 2, n, 1, n)
    for entity, some in (1, slice(0, cut)), (2, slice(cut, n)):
        flag = int(parametric > 0) if entity == 1 else 0
        points = np.pad(mesh.points[some], ((0, 0), (0, flag)))
        nodes += pack("3iq", 1 if flag else 3, entity, flag, len(points))
        nodes += tags[some].astype(f"{order}i8").tobytes() + points.astype(f"{order}f8").tobytes()
    elements, done = b"", 0
    for name, _, entity, cells in blocks:
        rows = np.hstack([done + 1 + np.arange(len(cells))[:, None], number[cells]]).astype(f"{order}i8")
        elements += pack("3iq", dimension[name], entity, _CODES[name], len(cells)) + rows.tobytes()
        done += len(cells)
    elements = pack("4q", len(blocks), done, 1, done) + elements
    bodies = {"MeshFormat": b"4.1 1 8\n" + pack("i", 1), "Entities": entities}
    bodies |= {"Nodes": nodes, "Elements": elements}
    sections = [b"$%b\n%b\n$End%b\n" % (name.encode(), body, name.encode()) for name, body in bodies.items()]
    return b"".join(sections) + more


def raw_vtu(path: Path, mesh: Mesh, order: str = "<", on_cells: bool = False) -> None:
    """Write a VTU file with raw appended arrays, a field on its points, and some on its cells if wanted."""
    cells = [block.vertices[:, VTK_ORDER.get(block.type, slice(None))] for block in mesh.cells]
    sizes = np.concatenate([np.full(len(rows), rows.shape[1]) for rows in cells])
    types = np.concatenate([np.full(len(b.vertices), VTK_TYPE[b.type], np.uint8) for b in mesh.cells])
    header = np.dtype(f"{order}u8" if order == "<" else f"{order}u4")
    arrays = {
        "Points": ("Float64", 3, mesh.points.astype(f"{order}f8")),
        "u": ("Float32", 1, mesh.points[:, 0].astype(f"{order}f4")),
        "connectivity": ("Int64", 1, np.concatenate([rows.ravel() for rows in cells]).astype(f"{order}i8")),
        "offsets": ("Int32", 1, np.cumsum(sizes).astype(f"{order}i4")),
        "types": ("UInt8", 1, types),
    }
    if on_cells:
        arrays["metric"] = "Float64", 6, tensors_at(mesh.points).astype(f"{order}f8")
    fields = {name: np.concatenate(values) for name, values in cell_data(mesh).items()} if on_cells else {}
    for name, values in fields.items():
        kind = {"i4": "Int32", "i8": "Int64", "f8": "Float64"}[values.dtype.str[1:]]
        arrays[name] = kind, values[0].size, values.astype(values.dtype.newbyteorder(order))
    tags, data = {}, b""
    for name, (kind, components, values) in arrays.items():
        tags[name] = (
            f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" '
            f'format="appended" offset="{len(data)}"/>'
        )
        data += np.array([values.nbytes], header).tobytes() + values.tobytes()
    words = "LittleEndian" if order == "<" else "BigEndian"
    text = (
        f'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="{words}" '
        f'header_type="UInt{8 * header.itemsize}">\n<UnstructuredGrid>'
        f'<Piece NumberOfPoints="{len(mesh.points)}" NumberOfCells="{len(types)}">\n'
        f"<PointData>{tags['u']}{tags.get('metric', '')}</PointData>\n"
        f"<CellData>{''.join(tags[name] for name in fields)}</CellData>\n"
        f"<Points>{tags['Points']}</Points>\n"
        f"<Cells>{tags['connectivity']}{tags['offsets']}{tags['types']}</Cells>\n"
        '</Piece></UnstructuredGrid>\n<AppendedData encoding="raw">\n_'
    )
    path.write_bytes(text.encode() + data + b"\n</AppendedData>\n</VTKFile>\n")
