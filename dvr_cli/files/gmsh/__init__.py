"""Gmsh files (.msh): MSH 2.2 and 4.1, ASCII and binary, read and patched losslessly."""

from dvr_cli.files.gmsh.source import GmshSource, read

__all__ = ["GmshSource", "read"]
