"""STL in binary: 80 bytes of anything, a count, and 50 bytes a facet, the last two an attribute."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from dvr_cli.errors import InputError

HEADER = 84
FACET = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


class BinaryStl:
    """A binary file; see ``TextStl`` for what it has."""

    single = True

    def __init__(self, data: bytes) -> None:
        """Raises InputError for a file whose length is not what its count says."""
        count = declared(data)
        if len(data) != HEADER + FACET.itemsize * count:
            raise InputError(
                f"a binary STL file of {count} facets has {HEADER + FACET.itemsize * count} bytes, "
                f"this one {len(data)}: truncated or damaged, or not an STL file"
            )
        self._data = data
        self._facets = np.frombuffer(data, FACET, count, HEADER)
        self.corners = self._facets["corners"].astype(np.float64)
        self.normals = self._facets["normal"].astype(np.float64)
        attribute = self._facets["attribute"].astype(np.int64)
        self.tags: np.ndarray | None = attribute if attribute.any() else None
        self.solid = np.zeros(count, dtype=np.int64)
        self.names = [""]

    def write(
        self, corners: np.ndarray, moved: np.ndarray, normals: np.ndarray, turned: np.ndarray, file: BinaryIO
    ) -> None:
        """Write the file with other numbers; see ``TextStl.write``."""
        facets = self._facets.copy()
        facets["corners"][moved] = corners[moved]
        facets["normal"][turned] = normals[turned]
        file.write(self._data[:HEADER])
        file.write(facets.tobytes())


def declared(data: bytes) -> int:
    """The number of facets in a binary file as its header says; InputError if there is no header."""
    if len(data) < HEADER:
        raise InputError("not an STL file: it neither begins with solid nor has the header of a binary one")
    return int(np.frombuffer(data, "<u4", 1, HEADER - 4)[0])
