"""Netgen's .vol files: meshio reads those of older versions, those of newer ones are refused by name."""

from __future__ import annotations

import re

from dvr_cli.errors import InputError
from dvr_cli.files import meshio_source
from dvr_cli.files.source import InputFile, Source

_NEWER = re.compile(rb"^[ \t]*(facedescriptors|edgedescriptors|edgesegmentsgi3)\s*$", re.MULTILINE)


def read(file: InputFile) -> Source:
    """Read a .vol file; raises InputError for one with sections that meshio does not know."""
    newer = _NEWER.search(file.data)
    if newer is not None:
        line = file.data.count(b"\n", 0, newer.start(1)) + 1
        raise InputError(
            f"line {line}: the section {newer[1].decode()}, which newer versions of Netgen write, is not "
            "supported; export the mesh from Netgen in its Gmsh2 format"
        )
    return meshio_source.read(file, "netgen")
