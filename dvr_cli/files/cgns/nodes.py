"""The nodes of a CGNS file: HDF5 groups with a label that says what they are, and data."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files import hdf5

if TYPE_CHECKING:
    import h5py

DATA = " data"  # the dataset in a node that holds its data


class Node:
    """A node of the file.

    name: its path. label: what it is. data: the dataset that holds its data, None for none.
    """

    def __init__(self, group: h5py.Group) -> None:
        self.name: str = group.name
        self.label = hdf5.text(hdf5.attribute(group, "label"))
        self.is_link = hdf5.text(hdf5.attribute(group, "type")) == "LK"
        self._group = group

    @cached_property
    def _members(self) -> dict[str, Any]:
        return hdf5.members(self._group)

    @cached_property
    def nodes(self) -> dict[str, Node]:
        """The nodes below, by name; raises InputError where one is a link to a node elsewhere."""
        found = {name: Node(item) for name, item in self._members.items() if hasattr(item, "keys")}
        for node in found.values():
            if node.is_link:
                raise InputError(f"{node.name} is a link to another place or file, which is not supported")
        return found

    @property
    def data(self) -> h5py.Dataset | None:
        item = self._members.get(DATA)
        return item if hasattr(item, "dtype") else None


def children(node: Node, *labels: str) -> dict[str, Node]:
    """The children of a node with one of these labels, by name."""
    return {name: child for name, child in node.nodes.items() if child.label in labels}


def text_of(node: Node) -> str:
    """The characters a node holds."""
    return "" if node.data is None else hdf5.text(hdf5.values(node.data))


def text_below(node: Node, label: str) -> str:
    """The characters in the first child with this label, "" for none."""
    return next((text_of(child) for child in children(node, label).values()), "")


def integers_of(node: Node, least: int = 0) -> np.ndarray:
    """The whole numbers a node holds, in a row; raises InputError where there are fewer than ``least``."""
    numbers = np.empty(0, dtype=np.int64) if node.data is None else hdf5.values(node.data)
    if numbers.dtype.kind not in "iu" or numbers.size < least:
        raise InputError(f"{node.name} does not hold the whole numbers it should")
    return numbers.ravel().astype(np.int64)


def refuse_rind(node: Node) -> None:
    """Raise InputError where a node has values of a rind, beyond those of its zone."""
    for rind in children(node, "Rind_t").values():
        if integers_of(rind).any():
            raise InputError(f"{node.name} has a rind, which is not supported")
