"""CGNS files by hand, through h5py alone, as the library lays them out in HDF5."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from needs import require

TYPES = {"BAR_2": 3, "TRI_3": 5, "QUAD_4": 7, "TETRA_4": 10, "HEXA_8": 17, "MIXED": 20, "PYRA_13": 21}
KINDS = {"i4": "I4", "i8": "I8", "f4": "R4", "f8": "R8", "i1": "C1"}


def node(parent: Any, name: str, label: str, data: Any = None) -> Any:
    """Add a node; data: an array, in the order of HDF5, or text."""
    made = parent.create_group(name)
    if isinstance(data, str):
        data = np.frombuffer(data.encode(), dtype=np.int8)
    kind = "MT" if data is None else KINDS[np.asarray(data).dtype.str[1:]]
    for key, value, size in (("name", name, 33), ("label", label, 33), ("type", kind, 3)):
        made.attrs.create(key, np.array(value.encode(), dtype=f"S{size}"))
    made.attrs.create("flags", np.array([1], dtype=np.int32))
    if data is not None:
        made.create_dataset(" data", data=data)
    return made


def section(
    zone: Any, name: str, kind: str, first: int, count: int, entries: Any, offsets: Any = None
) -> Any:
    """Add a section of so many elements, numbered from ``first``; entries: of its connectivity."""
    made = node(zone, name, "Elements_t", np.array([TYPES[kind], 0], np.int32))
    node(made, "ElementRange", "IndexRange_t", np.array([first, first + count - 1], np.int32))
    node(made, "ElementConnectivity", "DataArray_t", np.ravel(entries).astype(np.int32))
    if offsets is not None:
        node(made, "ElementStartOffset", "DataArray_t", np.asarray(offsets, np.int32))
    return made


def zone(base: Any, name: str, points: np.ndarray, cells: int, real: str = "f8") -> Any:
    """Add an unstructured zone with its coordinates."""
    made = node(base, name, "Zone_t", np.array([[len(points)], [cells], [0]], np.int32))
    node(made, "ZoneType", "ZoneType_t", "Unstructured")
    grid = node(made, "GridCoordinates", "GridCoordinates_t")
    for letter, column in zip("XYZ", points.T, strict=False):
        node(grid, f"Coordinate{letter}", "DataArray_t", column.astype(real))
    return made


def condition(
    zone: Any, name: str, location: str = "", family: str = "", **lists: Sequence[int] | np.ndarray
) -> None:
    """Add a boundary condition; lists: PointList, PointRange, ElementList or ElementRange."""
    parent = zone["ZoneBC"] if "ZoneBC" in zone else node(zone, "ZoneBC", "ZoneBC_t")
    made = node(parent, name, "BC_t", "FamilySpecified" if family else "BCWall")
    for kind, members in lists.items():
        label = "IndexRange_t" if kind.endswith("Range") else "IndexArray_t"
        shape = (-1, 1) if kind.startswith("Point") else (-1,)
        node(made, kind, label, np.asarray(members, np.int32).reshape(shape))
    if location:
        node(made, "GridLocation", "GridLocation_t", location)
    if family:
        node(made, "FamilyName", "FamilyName_t", family)


def cgns(build: Any, dimensions: tuple[int, int] = (3, 3), bases: Mapping[str, Any] | None = None) -> bytes:
    """A CGNS file; build: called with the base, to fill it; bases: others by name, and what fills them."""
    buffer = io.BytesIO()
    with require("h5py").File(buffer, "w", track_order=True, libver="v108") as file:
        for key, value, size in (("name", "HDF5 MotherNode", 33), ("label", "Root Node of HDF5 File", 33)):
            file.attrs.create(key, np.array(value.encode(), dtype=f"S{size}"))
        file.attrs.create("type", np.array(b"MT", dtype="S3"))
        file.create_dataset(" format", data=np.frombuffer(b"IEEE_LITTLE_32\0", np.int8))
        file.create_dataset(
            " hdf5version", data=np.frombuffer(b"HDF5 Version 1.10.5".ljust(33, b"\0"), np.int8)
        )
        node(file, "CGNSLibraryVersion", "CGNSLibraryVersion_t", np.array([3.4], np.float32))
        build(node(file, "Base", "CGNSBase_t", np.array(dimensions, np.int32)))
        for name, fill in (bases or {}).items():
            fill(node(file, name, "CGNSBase_t", np.array(dimensions, np.int32)))
    return buffer.getvalue()
