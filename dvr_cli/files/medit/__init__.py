"""MEDIT meshes, .mesh (text) and .meshb (binary): patched, so that every keyword survives."""

from dvr_cli.files.medit.convert import convert
from dvr_cli.files.medit.source import MeditSource, read

__all__ = ["MeditSource", "convert", "read"]
