"""Replacing coordinates in the bytes of a Gmsh file, and nothing else.

A node that moves loses its parametric coordinates, which say where on its curve or surface it was, unless new
ones are given. MSH 4 marks blocks of nodes as parametric, so blocks with a node that loses its own are
rewritten as non-parametric; in MSH 1 and 2 a whole section is parametric or not, and $ParametricNodes becomes
$Nodes. In MSH 3 each node names its entity, and then 0.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.files.gmsh.nodes import NodeBlocks
from dvr_cli.files.gmsh.sections import Header, Section


def patch_nodes(
    data: bytes,
    section: Section,
    header: Header,
    blocks: NodeBlocks,
    values: np.ndarray,
    changed: np.ndarray,
) -> tuple[bytes, int]:
    """The bytes of the section of nodes, markers included, with new coordinates.

    values: (N, 3) coordinates, or (N, 5) with parameters, which may be given in MSH 4 only; changed: bool of
    that shape, which of them to write.
    Also returns how many nodes have lost their parametric coordinates.
    """
    moved = np.concatenate([[0], np.cumsum(changed[:, :3].any(axis=1) & ~changed[:, 3:].any(axis=1))])
    ends = np.cumsum(blocks.size)
    stale = (blocks.parametric == 1) & (moved[ends] > moved[ends - blocks.size])
    opening, closing = data[section.opening : section.start], data[section.stop : section.end]
    dropped = stale
    if section.name in ("ParametricNodes", "NOD") and stale.any():
        dropped = np.ones_like(stale)
        opening, closing = (marker.replace(b"ParametricNodes", b"Nodes") for marker in (opening, closing))
    body = data[section.start : section.stop]
    changed = changed.copy()
    changed[:, 3:] &= np.repeat((blocks.parametric == 1) & ~dropped, blocks.size)[:, None]
    if header.byte_order:
        none = "\0" * 4 if header.version.startswith("3") else ""
        body = _patch_binary(body, header.byte_order, blocks, values, changed, dropped, none)
    else:
        none = " 0" if header.version.startswith("3") else ""
        body = _patch_text(body, blocks, values, changed, dropped, none)
    return b"".join([opening, body, closing]), int(blocks.size[dropped & (blocks.parametric == 1)].sum())


def _patch_text(
    body: bytes, blocks: NodeBlocks, values: np.ndarray, changed: np.ndarray, dropped: np.ndarray, none: str
) -> bytes:
    """The body with the changed numbers; blocks that are ``dropped`` lose flag and tails.

    none: what stands for a tail that is dropped.
    """
    start, stop = _tokens(body)
    first = blocks.positions()
    node, axis = np.nonzero(changed)
    token = first[node] + axis
    digits = list(map(repr, values[changed].tolist()))
    flag = blocks.flag[dropped & (blocks.flag >= 0)]
    tail = np.repeat(np.where(dropped, blocks.tail, 0), blocks.size)
    last = first[tail > 0] + 2
    return _splice(
        body,
        np.concatenate([start[token], start[flag], stop[last]]),
        np.concatenate([stop[token], stop[flag], stop[last + tail[tail > 0]]]),
        digits + ["0"] * len(flag) + [none] * len(last),
    )


def _patch_binary(
    body: bytes,
    byte_order: str,
    blocks: NodeBlocks,
    values: np.ndarray,
    changed: np.ndarray,
    dropped: np.ndarray,
    none: str,
) -> bytes:
    """The body with the changed numbers; blocks that are ``dropped`` lose flag and tails.

    none: what stands for a tail that is dropped.
    """
    buffer = bytearray(body)
    end = 0
    for first, size, stride in zip(*(column.tolist() for column in blocks[:3]), strict=True):
        begin, end = end, end + size
        mask = changed[begin:end]
        if mask.any():
            mask = mask[:, : 1 + int(np.flatnonzero(mask.any(axis=0))[-1])]  # a node may have no more numbers
            stored = np.ndarray(mask.shape, byte_order + "f8", buffer, first, (stride, 8))
            stored[mask] = values[begin:end, : mask.shape[1]][mask]
    for flag in blocks.flag[dropped & (blocks.flag >= 0)].tolist():
        buffer[flag : flag + 4] = bytes(4)
    tail = np.repeat(np.where(dropped, blocks.tail, 0), blocks.size)
    last = blocks.positions()[tail > 0] + 24
    return _splice(bytes(buffer), last, last + tail[tail > 0], [none] * len(last))


def _tokens(text: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Start and stop of each token of ``text``; tokens are separated by white space."""
    solid = np.zeros(len(text) + 2, np.int8)
    solid[1:-1] = np.frombuffer(text, np.uint8) > ord(" ")  # what lies below was found to be white space
    edges = np.diff(solid)
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)


def _splice(text: bytes, start: np.ndarray, stop: np.ndarray, replacements: list[str]) -> bytes:
    """``text`` with each stretch start[i]:stop[i] replaced; the stretches are not empty nor overlap."""
    if len(start) == 0:
        return text
    order = np.argsort(start, kind="stable")
    start, stop = start[order], stop[order]
    replacements = [replacements[i] for i in order.tolist()]
    length = np.fromiter(map(len, replacements), np.int64, len(replacements))
    growth = length - (stop - start)
    moved = start + np.cumsum(growth) - growth  # where each replacement comes to stand
    kept = ~_covered(start, stop, len(text))
    written = _covered(moved[length > 0], (moved + length)[length > 0], len(text) + int(growth.sum()))
    result = np.empty(len(written), np.uint8)
    result[written] = np.frombuffer("".join(replacements).encode(), np.uint8)
    result[~written] = np.frombuffer(text, np.uint8)[kept]
    return result.tobytes()


def _covered(start: np.ndarray, stop: np.ndarray, size: int) -> np.ndarray:
    """(size,) bool: which positions lie in one of the stretches start[i]:stop[i], none of which overlap."""
    change = np.zeros(size + 1, np.int8)
    change[start] += 1
    change[stop] -= 1
    return np.cumsum(change[:-1], dtype=np.int8).astype(bool)
