"""Meshes of other formats written as Exodus, by meshio as far as its node orders are right."""

from __future__ import annotations

from collections.abc import Sequence

from dvr_cli.errors import OutputError
from dvr_cli.files.exodus.elements import NODE_ORDER
from dvr_cli.files.meshio_source import MeshioSource
from dvr_cli.mesh.mesh import Mesh


def convert(mesh: Mesh, unread: Sequence[str]) -> MeshioSource:
    """A Source that writes ``mesh``; raises OutputError for cells that meshio writes wrongly."""
    wrong = sorted({block.type for block in mesh.cells} & NODE_ORDER.keys())
    if wrong:
        raise OutputError(f"{', '.join(wrong)} cells can only be written as exodus where the input is exodus")
    return MeshioSource(mesh, "exodus", unread)
