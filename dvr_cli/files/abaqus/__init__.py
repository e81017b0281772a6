"""Abaqus input decks (.inp), which CalculiX reads, too: a mesh among materials, loads and steps."""

from dvr_cli.files.abaqus.convert import convert
from dvr_cli.files.abaqus.source import read

__all__ = ["convert", "read"]
