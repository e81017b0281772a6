"""Node orders that formats have in common."""

from __future__ import annotations

# The upright edges of wedges and hexahedra come before the upper ones, as in CGNS, Exodus and Nastran; in
# meshio's order they come last. meshio's type: the place in the file of each node in meshio's order.
UPRIGHT_BEFORE_UPPER: dict[str, tuple[int, ...]] = {
    "hexahedron20": (*range(12), 16, 17, 18, 19, 12, 13, 14, 15),
    "wedge15": (*range(9), 12, 13, 14, 9, 10, 11),
}
