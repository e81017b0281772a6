"""Nodes, elements and groups of a universal file."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import Rows
from dvr_cli.files.unv.datasets import FORTRAN, Dataset, UniversalFile
from dvr_cli.files.unv.elements import BEAMS, HOLDING, LINES, TYPES
from dvr_cli.mesh.cell_types import CELL_TYPES

NODES = ("15", "781", "2411")
_WIDE_GROUPS = ("2435", "2452", "2467", "2477")  # four numbers an entity
GROUPS = (*_WIDE_GROUPS, "2417", "2429", "2430", "2432")  # two
_KINDS = {0: "Cartesian", 1: "cylindrical", 2: "spherical"}
_MOST_NODES = 1000  # of a rigid element


class Nodes(NamedTuple):
    """labels: (N,). points: (N, 3). starts, ends: (N, 3) where each coordinate is in the file. widths: (N,)
    columns that each has, 0 where they do not end in the columns they should."""

    labels: np.ndarray
    points: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    widths: np.ndarray


class Elements(NamedTuple):
    """n elements of one type. nodes: (n, k) labels. properties, materials: (n,)."""

    cell_type: str
    labels: np.ndarray
    nodes: np.ndarray
    properties: np.ndarray
    materials: np.ndarray


class Group(NamedTuple):
    """A group of nodes and elements, by their labels."""

    name: str
    nodes: np.ndarray
    elements: np.ndarray


def read_nodes(file: UniversalFile) -> Nodes:
    """The nodes of all datasets that have some; InputError where they are in local coordinates."""
    systems = _systems(file)
    found = [_nodes_of(file, dataset, systems) for dataset in file.of(*NODES)]
    if not found or not sum(len(nodes.labels) for nodes in found):
        raise InputError("it has no nodes (dataset 2411, 781 or 15)")
    return Nodes(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _nodes_of(file: UniversalFile, dataset: Dataset, systems: dict[int, str]) -> Nodes:
    starts, ends = file.lines(dataset)
    rows = file.rows(starts, ends)
    one_line = dataset.number == "15"
    shape = [7] if one_line else [4, 3]
    n, rest = divmod(len(rows.counts), len(shape))
    wrong = rows.counts[: n * len(shape)] != np.tile(shape, n)
    if rest or wrong.any():
        at = int(starts[int(wrong.argmax()) if wrong.any() else -1])
        what = "a node has four whole numbers and three coordinates"
        raise InputError(f"{file.line_at(at)}: {what}")
    values = file.numbers(dataset, rows, np.float64).reshape(n, 7)
    if (values[:, :4] != np.rint(values[:, :4])).any() or not (np.abs(values[:, :4]) < 2**53).all():
        raise InputError(f"dataset {dataset.number} has nodes whose labels are no whole numbers")
    whole = values[:, :4].astype(np.int64)
    for column, what in ((1, "coordinates"), (2, "displacements")):
        for system in np.unique(whole[:, column]).tolist():
            kind = systems.get(system, "" if system in (0, 1) else "undefined")
            if kind:
                label = whole[np.argmax(whole[:, column] == system), 0]
                raise InputError(
                    f"node {label} has its {what} in coordinate system {system}, which is {kind}: "
                    "only the global one is supported"
                )
    coordinate_lines = np.arange(n) if one_line else 2 * np.arange(n) + 1
    spans = rows.source_spans(coordinate_lines, np.arange(4, 7) if one_line else np.arange(3))
    width, before = (13, 40) if one_line else (25, 0)
    columns = spans[1] - starts[coordinate_lines, None]
    aligned = (columns == before + width * np.arange(1, 4)).all(axis=1)
    return Nodes(whole[:, 0], values[:, 4:].copy(), *spans, np.where(aligned, width, 0))


def _systems(file: UniversalFile) -> dict[int, str]:
    """The fault of each coordinate system the file defines, "" if it is the global one."""
    systems: dict[int, str] = {}
    for dataset in file.of("2420"):
        starts, ends = file.lines(dataset)
        words = [bytes(file.data[a:b]).split() for a, b in zip(starts.tolist(), ends.tolist(), strict=True)]
        at = 2 if len(words) % 6 == 2 else 1  # the name of the part may be blank
        while at < len(words):
            record = words[at : at + 6]
            head = [int(w) for w in record[0][:2] if w.isdigit() and len(w) < 16]
            matrix = [row for row in record if len(row) == 3][-4:]
            if len(head) != 2 or len(matrix) != 4:
                raise InputError(f"{file.line_at(int(starts[at]))}: dataset 2420 is damaged")
            try:
                values = np.array([[float(word.translate(FORTRAN)) for word in row] for row in matrix])
            except ValueError:
                raise InputError(f"{file.line_at(int(starts[at]))}: dataset 2420 is damaged") from None
            globally = np.array_equal(values, np.eye(4, 3))
            kind = _KINDS.get(head[1], "unknown")
            systems[head[0]] = kind if head[1] else "" if globally else "Cartesian, but turned or shifted"
            at += 6
    for dataset in file.of("18"):
        starts, ends = file.lines(dataset)
        if len(starts):
            first = file.numbers(dataset, file.rows(starts[:1], ends[:1]), np.int64)
            systems.setdefault(int(first[0]), "defined in dataset 18")
    return systems


def read_elements(file: UniversalFile) -> list[Elements]:
    """The elements of each type, in the order of the types' first ones; InputError names what is unknown."""
    older = file.of("71", "780", "2431")
    if older:
        raise InputError(f"elements in dataset {older[0].number} are not supported, only those in 2412")
    parts: dict[str, list[Elements]] = {}
    for dataset in file.of("2412"):
        numbers = file.numbers(dataset, file.rows(*file.lines(dataset)), np.int64)
        records = _records(dataset, numbers)
        for fe, count in dict.fromkeys(map(tuple, records[:, 1:].tolist())):
            members = np.flatnonzero((records[:, 1] == fe) & (records[:, 2] == count))
            begin = records[members, 0]
            cell_type, width = _cell_type(fe, count, int(numbers[begin[0]]))
            first = begin + 6 + (3 if fe in BEAMS else 0)
            nodes = numbers[first[:, None] + np.arange(count)]
            own = Elements(
                cell_type,
                numbers[begin],
                nodes,
                numbers[begin + 2],
                numbers[begin + 3],
            )
            if width != count:  # it has no cell type: its nodes are taken one by one
                labels, *tags = (np.repeat(a, count) for a in (own.labels, own.properties, own.materials))
                own = Elements(cell_type, labels, nodes.reshape(-1, 1), *tags)
            parts.setdefault(cell_type, []).append(own)
    return [
        Elements(name, *(np.concatenate(arrays) for arrays in zip(*[e[1:] for e in found], strict=True)))
        for name, found in parts.items()
    ]


def _records(dataset: Dataset, numbers: np.ndarray) -> np.ndarray:
    """For each element where its record begins among the numbers, its FE descriptor and number of nodes."""
    values = numbers.tolist()
    found = []
    at = 0
    while at < len(values):
        if at + 6 > len(values):
            raise InputError(f"dataset {dataset.number} ends within an element: truncated or damaged")
        fe, count = values[at + 1], values[at + 5]
        width = 6 + count + (3 if fe in BEAMS else 0)
        if not 0 < count <= _MOST_NODES or at + width > len(values):
            raise InputError(
                f"dataset {dataset.number}, element {values[at]}: {count} nodes do not follow, or damage"
            )
        found.append((at, fe, count))
        at += width
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def _cell_type(fe: int, count: int, label: int) -> tuple[str, int]:
    """meshio's name and number of nodes of an element."""
    if fe in HOLDING:
        return "vertex", 1
    cell_type = LINES.get(count) if fe in BEAMS else TYPES.get(fe)
    if cell_type is None:
        raise InputError(f"element {label} has the FE descriptor {fe}, which is not supported")
    if CELL_TYPES[cell_type].nodes != count:
        raise InputError(f"element {label} (FE descriptor {fe}) is a {cell_type}, but has {count} nodes")
    return cell_type, count


def read_groups(file: UniversalFile) -> list[Group]:
    """The groups that have nodes or elements."""
    return [group for dataset in file.of(*GROUPS) for group in _groups_of(file, dataset)]


def _groups_of(file: UniversalFile, dataset: Dataset) -> list[Group]:
    starts, ends = file.lines(dataset)
    width = 4 if dataset.number in _WIDE_GROUPS else 2
    found = []
    at = 0
    while at < len(starts):
        head = file.numbers(dataset, file.rows(starts[at : at + 1], ends[at : at + 1]), np.int64)
        count = int(head[7]) if len(head) > 7 else -1
        lines = -(-count * width // 8)
        if not 0 <= lines <= len(starts) - at - 2:
            raise InputError(
                f"{file.line_at(int(starts[at]))}: a group whose {count} entities do not follow, or damage"
            )
        name = file.data[int(starts[at + 1]) : int(ends[at + 1])].strip().decode("utf-8", "replace")
        chosen = slice(at + 2, at + 2 + lines)
        rows: Rows = file.rows(starts[chosen], ends[chosen])
        table = file.numbers(dataset, rows, np.int64)
        if len(table) != count * width:
            raise InputError(f"{file.line_at(int(starts[at]))}: group {name} should have {count} entities")
        table = table.reshape(count, width)
        found.append(Group(name, table[table[:, 0] == 7, 1], table[table[:, 0] == 8, 1]))
        at += 2 + lines
    return found
