"""SU2 meshes: zones, their elements and points, and markers of the boundary."""

from dvr_cli.files.su2.source import read

__all__ = ["read"]
