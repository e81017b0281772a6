"""Exodus II files (netCDF): read, and written back with their coordinates replaced in place."""

from dvr_cli.files.exodus.source import ExodusSource, read

__all__ = ["ExodusSource", "read"]
