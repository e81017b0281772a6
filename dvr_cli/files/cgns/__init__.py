"""CGNS files (HDF5) with unstructured zones: read, and written back with their coordinates in place."""

from dvr_cli.files.cgns.source import CgnsSource, read

__all__ = ["CgnsSource", "read"]
