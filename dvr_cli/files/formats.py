"""File formats: one record each, which everything that depends on a format reads.

A format is added by a record here and a module with a function ``read``. Formats that meshio alone reads or
writes have records, too.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvr_cli.errors import OutputError, UsageError

if TYPE_CHECKING:
    from dvr_cli.files.ranges import Ranges
    from dvr_cli.files.source import InputFile, Source
    from dvr_cli.mesh.mesh import Mesh

_MESHIO = "meshio_source"


@dataclass(frozen=True)
class Format:
    """A file format.

    name: as ``--input-format`` and ``--output-format`` take it.
    suffixes: those its files go by, in lower case, the dot included. Several formats may share one.
    signature: the regular expression that the first bytes of its files match, compiled when a file needs it;
        None if they do not give it away.
    reader: the module in this package whose ``read`` makes a Source of a file.
    ranges: the module in this package whose ``ranges_of`` finds where in a file each of several processes can
        read its part; None where one has to read it.
    several: its meshes may be spread over several files. ``read`` then takes an InputFile, else bytes.
    named_meshes: a file may hold several meshes, of which one is chosen by name.
    converter: the module whose ``convert(mesh, unread)`` makes a Source of any mesh, to be written in this
        format; None where files of other formats cannot be written in it, also because meshio writes what
        no other program here can check.
    meshio: meshio's name for the format and the options its writer gets, where meshio converts.
    versions, regions, refused: what of it is read, what in it counts as regions, and what is refused by name,
        as the page about formats has it.
    checked_by: the packages that read its files in tests.
    """

    name: str
    suffixes: tuple[str, ...]
    signature: bytes | None = None
    reader: str = _MESHIO
    ranges: str | None = None
    several: bool = False
    named_meshes: bool = False
    converter: str | None = _MESHIO
    meshio: tuple[str, Mapping[str, Any]] = field(default=("", {}))
    versions: str = ""
    regions: str = ""
    refused: str = ""
    checked_by: tuple[str, ...] = ()

    @property
    def patched(self) -> bool:
        """True if only coordinates change in its files."""
        return self.reader != _MESHIO

    def read(self, file: InputFile) -> Source:
        """Read a file of this format; raises InputError."""
        if self.reader == _MESHIO:
            from dvr_cli.files import meshio_source

            return meshio_source.read(file, self.name)
        read = import_module(f"dvr_cli.files.{self.reader}").read
        return read(file if self.several else file.data)

    def ranges_of(self, path: Path) -> Ranges | None:
        """The byte ranges of a file, None where a process has to read it whole; raises OSError."""
        if self.ranges is None or not path.stat().st_size:
            return None
        ranges: Ranges | None = import_module(f"dvr_cli.files.{self.ranges}").ranges_of(path)
        return ranges

    def convert(self, mesh: Mesh, unread: Sequence[str]) -> Source:
        """A Source that writes ``mesh``, read from another format, in this one.

        unread: what the file it was read from holds beyond the mesh, one line each.
        Raises OutputError where that cannot be done.
        """
        if self.converter is None:
            raise OutputError(f"{self.name} can only be written where the input is {self.name}, too")
        if self.converter == _MESHIO:
            from dvr_cli.files.meshio_source import MeshioSource

            return MeshioSource(mesh, self.name, unread)
        return import_module(f"dvr_cli.files.{self.converter}").convert(mesh, unread)


# A deck of Nastran begins with a statement of its executive or case control sections, or with a card.
_DECK = (
    rb"(?i)(\s*\$[^\n]*\n)*\s*"
    rb"(SOL\s+\w+|ID\s+\w+\s*,|CEND\b|BEGIN\s+BULK|NASTRAN\b|ASSIGN\b|INCLUDE\s*['\"]|SUBCASE\s+\d"
    rb"|(GRID|GRDSET|PARAM|CORD\d[RCS]|MAT\d+|PSHELL|PSOLID|C(TRIA|QUAD|TETRA|HEXA|PENTA)\w*)[ \t]*[*,\s])"
)
_BOM = rb"(\xef\xbb\xbf)?"  # a byte order mark
_XML = _BOM + rb"\s*(<\?xml[^>]*>\s*)?(<!--.*?-->\s*)*"
_COMMENTS = rb"\s*(#[^\n]*\n\s*)*"

REGISTRY = (
    Format(
        "gmsh",
        (".msh", ".msh2", ".msh4"),
        rb"\s*\$(MeshFormat|Comments|NOD)\b",
        reader="gmsh",
        ranges="gmsh.ranges",
        meshio=("gmsh22", {"binary": True}),  # its 4.1 needs tags that other formats do not have
        versions="MSH 1, 2.0 to 2.2, 3, 4.0, 4.1; text and binary",
        regions="physical groups, entities",
        refused="periodic links in binary 4.0",
        checked_by=("gmsh",),
    ),
    Format(
        "vtk",
        (".vtk",),
        _BOM + rb"\s*# vtk DataFile",
        reader="vtk",
        ranges="vtk.ranges",
        meshio=("vtk42", {}),  # its default, 5.1, is one Gmsh cannot open
        versions="1.0 to 5.1; text and binary",
        regions="cell fields",
        refused="polyhedra, strips, Lagrange and Bezier cells",
        checked_by=("gmsh",),
    ),
    Format(
        "vtp",
        (".vtp",),
        rb"(?s)" + _XML + rb"<VTKFile[^>]*\stype=[\"']PolyData",
        reader="vtkxml.vtp",
        converter=None,
        versions="text, base64, raw, compressed",
        regions="cell fields",
    ),
    Format(
        "vtu",
        (".vtu",),
        rb"(?s)" + _XML + rb"<VTKFile",
        reader="vtkxml.vtu",
        ranges="vtkxml.ranges",
        versions="text, base64, raw, compressed, several pieces",
        regions="cell fields",
    ),
    Format(
        "medit",
        (".mesh", ".meshb"),
        (
            _BOM + _COMMENTS + rb"MeshVersionFormatted"
            rb"|\x01\0\0\0[\1-\4]\0\0\0\x03\0\0\0|\0\0\0\x01\0\0\0[\1-\4]\0\0\0\x03"  # binary
        ),
        reader="medit",
        converter="medit",
        versions="1 to 4; text and binary",
        refused="second-order hexahedra, prisms and pyramids without a list of the order of their nodes",
        regions="references",
        checked_by=("gmsh", "mmgpy"),
    ),
    Format(
        "off",
        (".off",),
        _BOM + _COMMENTS + rb"(ST)?C?N?4?n?OFF\b",
        reader="off",
        converter="off",
        versions="OFF, COFF, NOFF, STOFF; text and binary",
        refused="4OFF, nOFF",
        checked_by=("gmsh", "trimesh"),
    ),
    Format(
        "ply",
        (".ply",),
        rb"ply[ \t]*[\r\n]",
        reader="ply",
        converter="ply",
        versions="1.0; text and binary of either byte order",
        regions="face properties of few values, but for colours",
        checked_by=("trimesh", "vtk"),
    ),
    Format(
        "obj",
        (".obj",),
        rb"(\s*#[^\n]*\n|\s*(mtllib|usemtl|o|g|s)\s[^\n]*\n|\s*\n)*\s*v[tn]?\s+[-+.\d]",
        reader="obj",
        versions="polygons, lines and points",
        regions="objects, groups, materials",
        refused="free-form geometry",
    ),
    Format(
        "tetgen",
        (".node", ".ele"),
        reader="tetgen",
        several=True,
        converter=None,
        versions="TetGen and Triangle, with .face and .edge",
        regions="attributes",
    ),
    Format(
        "abaqus",
        (".inp",),
        rb"(?i)" + _BOM + rb"(\s*\*\*[^\n]*\n)*\s*\*(?!KEYWORD\b)[A-Za-z]",
        reader="abaqus",
        several=True,
        converter="abaqus",
        versions="decks with parts, instances, included files",
        regions="sections, element sets, parts",
        checked_by=("gmsh",),
    ),
    Format("tecplot", (".dat", ".tec"), rb"(?i)\s*(#[^\n]*\n\s*)*(TITLE|VARIABLES|ZONE)\b"),
    Format(
        "nastran",
        (".bdf", ".nas", ".fem", ".dat"),
        _DECK,
        reader="nastran",
        several=True,
        converter="nastran.convert",
        versions="columns of 8 and 16, commas",
        regions="properties",
        refused="local coordinate systems",
        checked_by=("gmsh", "meshio"),
    ),
    Format(
        "su2",
        (".su2",),
        rb"(?i)(\s*%[^\n]*\n)*\s*(NDIME|NZONE|NELEM|NPOIN)[ \t]*=",
        reader="su2",
        converter="su2.convert",
        versions="one zone or several",
        regions="zones, markers",
        checked_by=("gmsh", "meshio"),
    ),
    Format(
        "stl",
        (".stl",),
        rb"(?i)\s*solid\b[^\n]*\n\s*(facet|endsolid)\b",
        reader="stl",
        converter="stl",
        versions="text and binary",
        regions="solids",
    ),
    Format(
        "xdmf",
        (".xdmf", ".xmf"),
        rb"(?s)" + _XML + rb"(<!DOCTYPE[^>]*>\s*)?(<!--.*?-->\s*)*<Xdmf\b",
        reader="xdmf",
        several=True,
        converter="xdmf.convert",
        versions="2 and 3, with HDF5 or raw data",
        regions="cell attributes",
        checked_by=("h5py",),
    ),
    Format(
        "med",
        (".med", ".mmed", ".rmed"),
        rb"(?s)\x89HDF.*(ENS_MAA|INFOS_GENERALES|MED file)",
        reader="med",
        several=True,
        named_meshes=True,
        converter=None,
        versions="HDF5",
        regions="families",
        refused="profiles, polyhedra, structured or cylindrical coordinates",
        checked_by=("h5py", "meshio"),
    ),
    Format(
        "cgns",
        (".cgns",),
        rb"(?s)\x89HDF.*CGNS|.{,16}ADF Database",
        reader="cgns",
        converter=None,
        versions="HDF5, unstructured",
        regions="zones, families",
        refused="ADF files, structured zones, NGON, NFACE, links",
        checked_by=("h5py", "vtk"),
    ),
    Format(
        "exodus",
        (".e", ".exo", ".ex2", ".exii", ".g", ".gen"),
        rb"(?s)CDF[\x01\x02\x05].*(num_nod|coord)|\x89HDF.*api_version",
        reader="exodus",
        converter="exodus.convert",
        versions="every netCDF variant",
        regions="element blocks",
        checked_by=("h5py", "meshio", "netCDF4"),
    ),
    Format("h5m", (".h5m",), converter=None),
    Format(
        "avsucd",
        (".avs", ".inp"),
        _COMMENTS + rb"(\d+[ \t]+){4}\d+[ \t]*[\r\n]|\x07",
        reader="avsucd",
        converter="avsucd",
        versions="text",
        regions="materials",
        refused="binary files",
        checked_by=("vtk",),
    ),
    Format("dolfin-xml", (".xml",), converter=None),
    Format("flac3d", (".f3grid",), converter=None),
    Format("hmf", (".hmf",), converter=None),
    Format("mdpa", (".mdpa",), converter=None),
    Format(
        "netgen",
        (".vol",),
        _COMMENTS + rb"mesh3d\b",
        reader="netgen",
        versions="older and newer",
        regions="materials, boundary conditions",
    ),
    Format("permas", (".post",), converter=None),
    Format(
        "unv",
        (".unv", ".uff"),
        rb"\s*-1[ \t]*\r?\n\s*\d{2,4}[ \t]*\r?\n",
        reader="unv",
        converter=None,
        versions="datasets 15, 781, 2411, 2412, groups",
        regions="properties, materials, groups",
        refused="local coordinate systems, elements in 71 and 780",
        checked_by=("gmsh",),
    ),
    Format("ugrid", (".ugrid",), converter=None),
)
FORMATS = tuple(sorted(record.name for record in REGISTRY))


def format_named(name: str) -> Format:
    """The format called ``name``; raises UsageError that lists those there are."""
    for record in REGISTRY:
        if record.name == name:
            return record
    raise UsageError(f"unknown format {name!r}; known: {', '.join(FORMATS)}")


def formats_by_suffix(path: Path) -> list[Format]:
    """The formats that the suffix of ``path`` may stand for, the likeliest first."""
    return [record for record in REGISTRY if path.suffix.lower() in record.suffixes]


def format_of(path: Path, data: bytes) -> Format | None:
    """The format of a file: that of its suffix, where several share it the one its first bytes give away.

    A suffix that tells nothing leaves it to the first bytes. None where they do not tell, either.
    """
    known = formats_by_suffix(path)
    if len(known) == 1:
        return known[0]
    head = bytes(data[:4096])
    told = (r for r in known or REGISTRY if r.signature is not None and re.match(r.signature, head))
    return next(told, known[0] if known else None)
