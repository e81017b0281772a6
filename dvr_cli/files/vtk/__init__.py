"""Legacy VTK files (.vtk): versions 1.0 to 5.1, ASCII and binary, read and patched losslessly."""

from dvr_cli.files.vtk.source import VtkSource, read

__all__ = ["VtkSource", "read"]
