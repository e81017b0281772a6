"""Gmsh files (.msh): MSH 1, 2, 3, 4.0 and 4.1, ASCII and binary, read and patched losslessly."""

from dvr_cli.files.gmsh.source import GmshSource, read

__all__ = ["GmshSource", "read"]
