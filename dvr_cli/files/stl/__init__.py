"""STL surfaces, text and binary: patched, vertices and the normals of their facets."""

from dvr_cli.files.stl.convert import convert
from dvr_cli.files.stl.source import StlSource, read

__all__ = ["StlSource", "convert", "read"]
