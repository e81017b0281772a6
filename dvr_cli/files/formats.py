"""File formats: their names, the suffixes they go by, and how their first bytes give them away."""

from __future__ import annotations

import re
from pathlib import Path

from dvr_cli.errors import UsageError

_SUFFIXES = {
    ".msh": "gmsh",
    ".msh2": "gmsh",
    ".msh4": "gmsh",
    ".vtk": "vtk",
    ".obj": "obj",
    ".node": "tetgen",
    ".ele": "tetgen",
    ".vtu": "vtu",
    ".mesh": "medit",
    ".meshb": "medit",
    ".inp": "abaqus",
    ".bdf": "nastran",
    ".fem": "nastran",
    ".nas": "nastran",
    ".su2": "su2",
    ".off": "off",
    ".ply": "ply",
    ".stl": "stl",
    ".xdmf": "xdmf",
    ".xmf": "xdmf",
    ".med": "med",
    ".cgns": "cgns",
    ".e": "exodus",
    ".exo": "exodus",
    ".ex2": "exodus",
    ".h5m": "h5m",
    ".avs": "avsucd",
    ".xml": "dolfin-xml",
    ".f3grid": "flac3d",
    ".hmf": "hmf",
    ".mdpa": "mdpa",
    ".vol": "netgen",
    ".post": "permas",
    ".dat": "tecplot",
    ".tec": "tecplot",
    ".ugrid": "ugrid",
}
FORMATS = tuple(sorted(set(_SUFFIXES.values())))

_SIGNATURES = (
    (re.compile(rb"\s*\$(MeshFormat|Comments|NOD)\b"), "gmsh"),
    (re.compile(rb"\s*# vtk DataFile"), "vtk"),
    (re.compile(rb"\s*(<\?xml[^>]*>\s*)?(<!--.*?-->\s*)*<VTKFile", re.DOTALL), "vtu"),
    (re.compile(rb"\s*(#[^\n]*\n\s*)*MeshVersionFormatted"), "medit"),
    (re.compile(rb"\s*(#[^\n]*\n\s*)*(C?O?FF)\b"), "off"),
    (re.compile(rb"ply\r?\n"), "ply"),
    (re.compile(rb"(\s*#[^\n]*\n|\s*(mtllib|usemtl|o|g|s)\s[^\n]*\n|\s*\n)*\s*v[tn]?\s+[-+.\d]"), "obj"),
)


def format_named(name: str) -> str:
    """``name`` if it is a format; raises UsageError that lists those there are."""
    if name not in FORMATS:
        raise UsageError(f"unknown format {name!r}; known: {', '.join(FORMATS)}")
    return name


def format_by_suffix(path: Path) -> str | None:
    """The format the suffix of ``path`` stands for, or None."""
    return _SUFFIXES.get(path.suffix.lower())


def sniff(data: bytes) -> str | None:
    """The format that the first bytes of a file give away, or None."""
    head = bytes(data[:4096])
    return next((name for pattern, name in _SIGNATURES if pattern.match(head)), None)
