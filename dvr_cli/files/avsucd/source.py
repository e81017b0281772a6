"""UCD files, read and written back with other coordinates in the bytes they were read from.

# a comment
4 1 1 0 0               numbers of nodes, cells, and of data for each node, cell and for the whole
1 0.0 0.0 0.0           nodes: id and coordinates
...
1 7 tet 1 2 3 4         cells: id, material, type and nodes by their ids
1 1                     node data: how many there are, and the size of each
temperature, K          their labels and units
1 20.0
...
"""

from __future__ import annotations

import re

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.losses import number_not_kept
from dvr_cli.files.numbers_in_text import shown
from dvr_cli.files.patched_text import PatchedText, TextLines
from dvr_cli.files.tags import TagIndex, first_repeated
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells, Mesh

MATERIAL = "avsucd:material"
# The words for cell types, with meshio's names, and the place of each node in a file. A pyramid begins with
# its apex.
TYPES = {
    "pt": "vertex",
    "line": "line",
    "tri": "triangle",
    "quad": "quad",
    "tet": "tetra",
    "pyr": "pyramid",
    "prism": "wedge",
    "hex": "hexahedron",
}
NODE_ORDER = {"pyramid": [1, 2, 3, 4, 0]}
_WIDTH = max(map(len, TYPES)) + 1  # letters of a type that are looked at
_COMMENT = re.compile(rb"(?:(?<=[\r\n])|\A)[ \t]*#[^\r\n]*")
_BINARY = b"\x07"  # what binary files begin with


def read(data: bytes) -> PatchedText:
    """Read a UCD file.

    Cells come in one block for each type, with their materials as the cell data "avsucd:material"; the data
    of nodes and cells go by their labels. Coordinates are (N, 3).

    Raises InputError for binary files, for cell types that the format has not, and for what is damaged.
    """
    if data.startswith(_BINARY):
        raise InputError("binary UCD files are not supported; text is")
    lines = TextLines(data, _COMMENT)
    n, n_cells, on_nodes, on_cells, on_model = _counts(lines)
    rows = lines.rows(1, n, 4, "node")
    if (rows.counts != 4).any():
        raise lines.refusal(1 + int((rows.counts != 4).argmax()), "a node has an id and three coordinates")
    values = lines.numbers(rows, 1, np.float64).reshape(n, 4)
    index = _index(_ids(values[:, 0], "node"), "node")
    spans = rows.source_spans(np.arange(n), np.arange(1, 4))
    blocks, materials, order, ids = _read_cells(lines, 1 + n, n_cells, index)
    at = 1 + n + n_cells
    point_data, at = _read_data(lines, at, on_nodes, index, n, "node")
    numbered = _index(ids, "cell") if on_cells else TagIndex(ids[:0])  # other programs mind them no more
    by_cell, at = _read_data(lines, at, on_cells, numbered, n_cells, "cell")
    unread = number_not_kept(on_model, "value of the whole model")
    if len(lines) > at and not on_model:
        raise lines.refusal(at, "there is more than the first line says")
    cell_data = {MATERIAL: materials}
    for name, array in by_cell.items():
        cell_data[f"{name} (data)" if name == MATERIAL else name] = [array[members] for members in order]
    mesh = Mesh(values[:, 1:].copy(), blocks, cell_data, point_data)
    source = PatchedText("avsucd", data, mesh, *spans)
    source.unread = unread
    return source


def _counts(lines: TextLines) -> list[int]:
    """The five numbers in the first line."""
    words = lines.words(0) if len(lines) else []
    if len(words) != 5 or not all(word.isdigit() and len(word) < 16 for word in words):
        raise InputError("not a UCD file: it does not begin with five counts (nodes, cells, data)")
    counts = [int(word) for word in words]
    if not counts[0]:
        raise InputError("it has no nodes")
    return counts


def _ids(numbers: np.ndarray, what: str) -> np.ndarray:
    """(n,) ids of nodes or cells; InputError if they are no whole numbers."""
    if not (np.abs(numbers) < 2**53).all() or (numbers % 1 != 0).any():
        raise InputError(f"the ids of {what}s are whole numbers")
    return numbers.astype(np.int64)


def _index(ids: np.ndarray, what: str) -> TagIndex:
    """The positions of nodes or cells by their ids; InputError if one is repeated."""
    repeated = first_repeated(ids)
    if repeated is not None:
        raise InputError(f"there are two {what}s {repeated}")
    return TagIndex(ids)


def _read_cells(
    lines: TextLines, first: int, count: int, index: TagIndex
) -> tuple[list[Cells], list[np.ndarray], list[np.ndarray], np.ndarray]:
    """Blocks of cells, materials, the numbers in the file of the cells of each, and the ids of all cells."""
    rows = lines.rows(first, count, 4, "cell")
    if not count:
        return [], [], [], np.empty(0, np.int64)
    words = rows.first + 2
    starts = rows.starts[words]
    ends = np.minimum(rows.ends[words], starts + _WIDTH)
    letters = np.zeros((count, _WIDTH), dtype=np.uint8)
    for i in range(_WIDTH):
        there = starts + i < ends
        letters[there, i] = rows.text[starts[there] + i] | 32  # in lower case
    names, kind = np.unique(letters.view(f"S{_WIDTH}")[:, 0], return_inverse=True)
    rows.blank_out(rows.starts[words], rows.ends[words])
    cells_of_type: list[tuple[str, np.ndarray]] = []
    for number, name in enumerate(names.tolist()):
        members = np.flatnonzero(kind == number)
        cell_type = TYPES.get(name.decode("latin-1"))
        if cell_type is None:
            raise lines.refusal(
                first + int(members[0]), f"{shown(name)} is no cell type ({', '.join(TYPES)} are)"
            )
        nodes = CELL_TYPES[cell_type].nodes
        wrong = rows.counts[members] != 3 + nodes
        if wrong.any():
            row = int(members[wrong.argmax()])
            raise lines.refusal(first + row, f"a cell {name.decode()} has {nodes} nodes")
        cells_of_type.append((cell_type, members))
    numbers = np.empty(len(rows.starts), dtype=np.int64)  # one a token, those of types unused
    numeric = np.ones(len(numbers), dtype=bool)
    numeric[words] = False
    numbers[numeric] = lines.numbers(rows, first, np.int64, blanked=1)
    known = list(TYPES.values())
    blocks, materials, order = [], [], []
    for cell_type, members in sorted(cells_of_type, key=lambda pair: known.index(pair[0])):
        size = CELL_TYPES[cell_type].nodes
        given = numbers[rows.first[members, None] + 3 + np.arange(size)]
        vertices = index.find(given)
        if (vertices < 0).any():
            row, column = np.argwhere(vertices < 0)[0]
            raise lines.refusal(first + int(members[row]), f"there is no node {given[row, column]}")
        blocks.append(Cells(cell_type, vertices[:, NODE_ORDER.get(cell_type, range(size))].astype(np.int64)))
        materials.append(numbers[rows.first[members] + 1])
        order.append(members)
    return blocks, materials, order, _ids(numbers[rows.first].astype(np.float64), "cell")


def _read_data(
    lines: TextLines, at: int, total: int, index: TagIndex, n: int, what: str
) -> tuple[dict[str, np.ndarray], int]:
    """The data of nodes or cells by their labels, in the order of these, and the line behind."""
    if not total or not n:
        return {}, at
    words = lines.words(at) if at < len(lines) else []
    sizes = [int(word) for word in words if word.isdigit() and len(word) < 7]
    if len(sizes) != len(words) or sizes[:1] != [len(sizes) - 1] or sum(sizes[1:]) != total:
        raise InputError(f"the sizes of the data of {what}s should follow, {total} numbers in all")
    if at + len(sizes) > len(lines):
        raise InputError(f"the labels of the data of {what}s are missing")
    labels = [_label(lines, at + 1 + i) for i in range(len(sizes) - 1)]
    first = at + len(sizes)
    rows = lines.rows(first, n, 1 + total, what)
    values = lines.numbers(rows, first, np.float64)
    table = values[rows.first[:, None] + np.arange(1 + total)]
    ids = _ids(table[:, 0], what)
    _index(ids, what)
    place = index.find(ids)
    if (place < 0).any():
        raise lines.refusal(first + int((place < 0).argmax()), f"there is no such {what}")
    found: dict[str, np.ndarray] = {}
    column = 1
    for label, size in zip(labels, sizes[1:], strict=True):
        array = np.empty((n, size))
        array[place] = table[:, column : column + size]
        column += size
        if size:
            found[label] = array[:, 0] if size == 1 else array
    return found, first + n


def _label(lines: TextLines, line: int) -> str:
    """The name of data, in front of a comma and their unit."""
    text = lines.text[lines.starts[line] : lines.ends[line]].tobytes()
    return text.split(b",")[0].strip().decode("utf-8", "replace")
