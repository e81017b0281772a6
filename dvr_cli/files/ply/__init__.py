"""PLY files: polygons, strips and edges with any properties, text or binary."""

from dvr_cli.files.ply.convert import convert
from dvr_cli.files.ply.source import read

__all__ = ["convert", "read"]
