"""The elements of a Gmsh file by type, and the merging of those repeated for each of their groups.

MSH 2 writes an element once for each physical group it is in (its nodes in reverse if the group runs
against it). For a mesh it is one cell, in several groups.
"""

from __future__ import annotations

from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np

from dvr_cli.errors import InputError

MAX_GROUPS = 64  # that one element may be in; bounds the memory a damaged file can ask for
MAX_BLOCKS = 1000


class Elements(NamedTuple):
    """n elements of one type.

    code: Gmsh's number of the type.
    numbers: (n,) element numbers.
    nodes: (n, k) nodes, as tags or as indices, in Gmsh's order.
    geometrical: (n,) tags of the entities the elements belong to.
    physical: (n, g) tags of the physical groups they are in, the first one first, 0 for none.
    """

    code: int
    numbers: np.ndarray
    nodes: np.ndarray
    geometrical: np.ndarray
    physical: np.ndarray


def join_consecutive(blocks: list[Elements]) -> list[Elements]:
    """Join neighbouring blocks of one type.

    Should a file change type so often that too many blocks were left, all blocks of a type are joined.
    """
    changes = sum(a.code != b.code for a, b in pairwise(blocks))
    if changes > MAX_BLOCKS:
        blocks = sorted(blocks, key=lambda block: block.code)
    joined = [_join(list(group)) for _, group in groupby(blocks, key=lambda block: block.code)]
    return [block for block in joined if len(block.numbers)]


def _join(blocks: list[Elements]) -> Elements:
    """Join blocks of one type; a single one is not copied where it can be helped."""
    if len(blocks) == 1:
        (block,) = blocks
        tags = (part.astype(np.int32, copy=False) for part in (block.geometrical, block.physical))
        return Elements(block.code, block.numbers.astype(np.int64, copy=False), block.nodes, *tags)
    groups = max(block.physical.shape[1] for block in blocks)
    return Elements(
        blocks[0].code,
        np.concatenate([block.numbers for block in blocks], dtype=np.int64),
        np.concatenate([block.nodes for block in blocks]),
        np.concatenate([block.geometrical for block in blocks], dtype=np.int32, casting="unsafe"),
        np.concatenate(
            [_widened(block.physical, groups) for block in blocks], dtype=np.int32, casting="unsafe"
        ),
    )


def _widened(physical: np.ndarray, groups: int) -> np.ndarray:
    missing = groups - physical.shape[1]
    return np.pad(physical, ((0, 0), (0, missing))) if missing else physical


def merge_repeated(blocks: list[Elements]) -> tuple[list[Elements], np.ndarray]:
    """Make one element of those of equal type and nodes, keeping the first, and the groups of all.

    Takes blocks whose elements have one physical tag each. Returns the blocks that remain, and for each of
    the n elements given the position, counted through those blocks, of the one that stands for it: (n,).
    """
    sizes = [len(block.numbers) for block in blocks]
    ids = np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])
    first = np.arange(sum(sizes))
    for code in {block.code for block in blocks}:
        members = [i for i, block in enumerate(blocks) if block.code == code]
        ids_of_type = np.concatenate([ids[i] for i in members])
        first[ids_of_type] = ids_of_type[_first_equal(np.concatenate([blocks[i].nodes for i in members]))]
    kept = first == np.arange(len(first))
    position = (np.cumsum(kept) - 1)[first]
    if kept.all():
        return blocks, position
    physical = _collect_groups(position, np.concatenate([block.physical[:, 0] for block in blocks]))
    remaining = []
    for block, own in zip(blocks, ids, strict=True):
        keep = kept[own]
        remaining.append(
            Elements(
                block.code,
                block.numbers[keep],
                block.nodes[keep],
                block.geometrical[keep],
                physical[position[own[keep]]],
            )
        )
    return [block for block in remaining if len(block.numbers)], position


def _first_equal(nodes: np.ndarray) -> np.ndarray:
    """For each row of nodes the index of the first row that has the same nodes, in any order."""
    rows = np.sort(nodes, axis=1)
    begins = _differs(rows)  # Gmsh repeats an element at once; that is quickly found out
    leaders = np.flatnonzero(begins)
    return leaders[_first_equal_apart(rows[leaders])][np.cumsum(begins) - 1]


def _first_equal_apart(rows: np.ndarray) -> np.ndarray:
    """For each row the index of the first equal row.

    Rows are sorted by a hash and compared with their neighbour. Should two different rows ever share their
    64-bit hash, an equal one between them may be missed, and its cell stays repeated.
    """
    hashes = np.zeros(len(rows), np.uint64)
    for column in rows.T:
        hashes = (hashes ^ column.astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        hashes ^= hashes >> np.uint64(29)
    if _differs(np.sort(hashes)[:, np.newaxis]).all():  # the usual case, at a fraction of the cost
        return np.arange(len(rows))
    order = np.argsort(hashes, kind="stable")
    begins = _differs(rows[order])
    first = np.empty(len(rows), np.intp)
    first[order] = order[begins][np.cumsum(begins) - 1]
    return first


def _differs(rows: np.ndarray) -> np.ndarray:
    """For each row whether it differs from the one before it; the first does."""
    differs = np.ones(len(rows), bool)
    differs[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    return differs


def _collect_groups(position: np.ndarray, physical: np.ndarray) -> np.ndarray:
    """(m, g) distinct tags of each of m elements from (n,) positions in 0 .. m-1 and (n,) tags."""
    order = np.lexsort((physical, position))
    distinct = _differs(np.column_stack([position, physical])[order])
    chosen = np.sort(order[distinct & (physical[order] != 0)])  # back in file order
    chosen = chosen[np.argsort(position[chosen], kind="stable")]
    owner = position[chosen]
    begins = np.searchsorted(owner, owner)
    rank = np.arange(len(owner)) - begins
    groups = int(rank.max(initial=0)) + 1
    if groups > MAX_GROUPS:
        raise InputError(f"an element is in {groups} physical groups; dvr takes {MAX_GROUPS}")
    collected = np.zeros((int(position.max()) + 1, groups), physical.dtype)
    collected[owner, rank] = physical[chosen]
    return collected
