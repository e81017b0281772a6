"""Nastran bulk data: decks of cards in columns of 8 or 16, or with commas."""

from dvr_cli.files.nastran.source import read

__all__ = ["read"]
