"""MED files (HDF5), as Salome and code_aster use them: read, and written back with coordinates in place."""

from dvr_cli.files.med.source import MedSource, read

__all__ = ["MedSource", "read"]
