"""The things an output cannot keep, in lines that name them by kind and count."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dvr_cli.mesh.mesh import Mesh

_LISTED = 8  # names in a line
_PLURALS = (("ay", "ays"), ("y", "ies"), ("sh", "shes"))  # of words that do not just get an s


def counted(count: int, what: str) -> str:
    """So many things of a kind, which is given in the singular: "2 sets of names", "1 entry"."""
    if count == 1:
        return f"1 {what}"
    first, of, rest = what.partition(" of ")
    ending = next((pair for pair in _PLURALS if first.endswith(pair[0])), ("", "s"))
    return f"{count} {first.removesuffix(ending[0])}{ending[1]}{of}{rest}"


def not_kept(names: Iterable[str], what: str) -> list[str]:
    """The line about things of a kind that are lost, with their number and names; none if there are none."""
    known = sorted(names)
    listed = known[:_LISTED] + ([f"{len(known) - _LISTED} more"] if len(known) > _LISTED else [])
    return [f"not kept: {counted(len(known), what)} ({', '.join(listed)})"] if known else []


def number_not_kept(count: int, what: str) -> list[str]:
    """The line about so many things of a kind, which have no names; none if there are none."""
    return [f"not kept: {counted(count, what)}"] if count else []


def parameters_dropped(count: int) -> list[str]:
    """The line about nodes that have lost their places on curves or surfaces; none if there are none."""
    if not count:
        return []
    return [f"dropped the parametric coordinates of {counted(count, 'node')}: moving nodes makes them wrong"]


def names_not_kept(mesh: Mesh, names: Iterable[str] | None = None) -> list[str]:
    """A line for each kind of groups and sets of ``mesh`` that has some of ``names``; by default all."""
    kinds = {
        "group name": {*mesh.field_data},
        "cell set": {*mesh.cell_sets},
        "point set": {*mesh.point_sets},
        "facet set": {*mesh.facet_sets},
    }
    gone = set().union(*kinds.values()) if names is None else set(names)
    return [line for what, named in kinds.items() for line in not_kept(gone & named, what)]


def links_not_kept(mesh: Mesh) -> list[str]:
    """The line about the periodic links of ``mesh``, if it has some."""
    return number_not_kept(len(mesh.periodic), "periodic link")


def lost(mesh: Mesh, back: Mesh, points: np.ndarray) -> list[str]:
    """The parts of ``mesh``, written with the coordinates ``points``, that are not in what was read ``back``.

    One line for each kind.
    """
    lines = []
    if not np.array_equal(back.points[:, : points.shape[1]], points):
        difference = np.abs(back.points[:, : points.shape[1]] - points).max()
        lines.append(f"coordinates are rounded, by up to {difference:.2g}")
    in_order = _cells(mesh) == _cells(back)
    if not in_order:
        lines.append("the order of the cells is not kept")
    lines += _lost_data("point field", mesh.point_data, back.point_data)
    if in_order:
        lines += _lost_data("cell field", _joined(mesh.cell_data), _joined(back.cell_data))
    else:
        lines += not_kept(mesh.cell_data.keys() - back.cell_data.keys(), "cell field")
    lines += names_not_kept(mesh, _group_names(mesh) - _group_names(back))
    if len(mesh.periodic) > len(back.periodic):
        lines += links_not_kept(mesh)
    return lines


def _lost_data(what: str, old: dict[str, np.ndarray], new: dict[str, np.ndarray]) -> list[str]:
    """The arrays among ``old`` that are gone, go by another name or have other values in ``new``."""
    lines = []
    missing = old.keys() - new.keys()
    for name in sorted(missing):
        for other in sorted(new.keys() - old.keys()):
            if name in missing and np.array_equal(old[name], new[other]):
                lines.append(f"the {what} {name} is kept as {other}")
                missing.discard(name)
    lines += not_kept(missing, what)
    changed = [name for name in sorted(old.keys() & new.keys()) if not _equal(old[name], new[name])]
    if changed:
        lines.append(f"{counted(len(changed), what)} with other values or shapes: {', '.join(changed)}")
    return lines


def _group_names(mesh: Mesh) -> set[str]:
    return {*mesh.field_data, *mesh.cell_sets, *mesh.point_sets, *mesh.facet_sets}


def _equal(old: np.ndarray, new: np.ndarray) -> bool:
    return old.shape == new.shape and bool(((old == new) | ((old != old) & (new != new))).all())


def _joined(cell_data: dict[str, list[np.ndarray]]) -> dict[str, np.ndarray]:
    """Cell data with one array a name, as blocks may have been joined."""
    return {name: np.concatenate(blocks) for name, blocks in cell_data.items() if blocks}


def _cells(mesh: Mesh) -> list[tuple[str, bytes]]:
    """Cells in comparable form, adjacent blocks of one type joined."""
    joined: list[tuple[str, list[np.ndarray]]] = []
    for block in mesh.cells:
        if joined and joined[-1][0] == block.type:
            joined[-1][1].append(block.vertices)
        elif len(block.vertices):
            joined.append((block.type, [block.vertices]))
    return [(name, np.concatenate(parts).astype(np.int64).tobytes()) for name, parts in joined]
