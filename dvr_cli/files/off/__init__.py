"""OFF files of Geomview: polygons, as text or binary, that may have colours and normals."""

from dvr_cli.files.off.convert import convert
from dvr_cli.files.off.source import read

__all__ = ["convert", "read"]
