"""Exodus files as netCDF4 writes them, in all its variants, and what VTK's reader makes of a file."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from needs import require

VARIANTS = ("NETCDF3_CLASSIC", "NETCDF3_64BIT_OFFSET", "NETCDF3_64BIT_DATA", "NETCDF4", "NETCDF4_CLASSIC")


def exodus(
    points: np.ndarray,
    blocks: Sequence[tuple[str, Any]],
    variant: str = "NETCDF3_64BIT_OFFSET",
    *,
    joint: bool = False,
    real: str = "f8",
    names: Sequence[str] = (),
    ids: Sequence[int] = (),
    node_sets: Mapping[str, Sequence[int]] | None = None,
    side_sets: Mapping[str, Sequence[tuple[int, int]]] | None = None,
    steps: int = 0,
    compressed: bool = False,
    extra: Any = None,
) -> bytes:
    """An Exodus file as netCDF4 writes it.

    blocks: element type and 0-based nodes of each, in Exodus's order. joint: one variable for all
    coordinates. real: their type. side_sets: pairs of element and side, both from 1. steps: time steps of
    nodal and element variables. extra: called with the open file, to add to it.
    """
    netcdf = require("netCDF4")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.e"
        with netcdf.Dataset(path, "w", format=variant) as file:
            _write(
                file, points, blocks, joint, real, names, ids, node_sets or {}, side_sets or {}, compressed
            )
            if steps:
                _write_results(file, len(points), blocks, steps)
            if extra:
                extra(file)
        return path.read_bytes()


def _write(
    file: Any,
    points: np.ndarray,
    blocks: Sequence[tuple[str, Any]],
    joint: bool,
    real: str,
    names: Sequence[str],
    ids: Sequence[int],
    node_sets: Mapping[str, Sequence[int]],
    side_sets: Mapping[str, Sequence[tuple[int, int]]],
    compressed: bool,
) -> None:
    n, dimension = points.shape
    file.setncattr("title", "by hand")
    file.setncattr("api_version", np.float32(8.11))
    file.setncattr("version", np.float32(8.11))
    file.setncattr("floating_point_word_size", np.int32(8 if real.endswith("8") else 4))
    file.setncattr("file_size", np.int32(not joint))
    sizes = {
        "len_string": 33,
        "len_name": 33,
        "num_dim": dimension,
        "num_nodes": n,
        "num_elem": sum(len(c) for _, c in blocks),
    }
    for name, size in {**sizes, "num_el_blk": len(blocks), "time_step": None}.items():
        file.createDimension(name, size)
    file.createVariable("time_whole", "f8", ("time_step",))
    packed = {"zlib": True, "shuffle": True} if compressed else {}
    if joint:
        file.createVariable("coord", real, ("num_dim", "num_nodes"), **packed)[:] = points.T
    else:
        for axis, column in zip("xyz", points.T, strict=False):
            file.createVariable(f"coord{axis}", real, ("num_nodes",), **packed)[:] = column
    ids = ids or range(10, 10 + 10 * len(blocks), 10)
    file.createVariable("eb_status", "i4", ("num_el_blk",))[:] = 1
    file.createVariable("eb_prop1", "i4", ("num_el_blk",))[:] = ids
    file.variables["eb_prop1"].setncattr("name", "ID")
    if names:
        _write_names(file, "eb_names", "num_el_blk", names)
    for b, (kind, cells) in enumerate(blocks, 1):
        cells = np.asarray(cells)
        file.createDimension(f"num_el_in_blk{b}", len(cells))
        file.createDimension(f"num_nod_per_el{b}", cells.shape[1])
        connect = file.createVariable(f"connect{b}", "i4", (f"num_el_in_blk{b}", f"num_nod_per_el{b}"))
        connect.setncattr("elem_type", kind)
        connect[:] = cells + 1
    if node_sets:
        file.createDimension("num_node_sets", len(node_sets))
        file.createVariable("ns_prop1", "i4", ("num_node_sets",))[:] = range(1, 1 + len(node_sets))
        _write_names(file, "ns_names", "num_node_sets", list(node_sets))
        for i, nodes in enumerate(node_sets.values(), 1):
            file.createDimension(f"num_nod_ns{i}", len(nodes))
            file.createVariable(f"node_ns{i}", "i4", (f"num_nod_ns{i}",))[:] = np.asarray(nodes) + 1
    if side_sets:
        file.createDimension("num_side_sets", len(side_sets))
        file.createVariable("ss_prop1", "i4", ("num_side_sets",))[:] = range(1, 1 + len(side_sets))
        _write_names(file, "ss_names", "num_side_sets", list(side_sets))
        for i, sides in enumerate(side_sets.values(), 1):
            file.createDimension(f"num_side_ss{i}", len(sides))
            pairs = np.asarray(sides)
            file.createVariable(f"elem_ss{i}", "i4", (f"num_side_ss{i}",))[:] = pairs[:, 0]
            file.createVariable(f"side_ss{i}", "i4", (f"num_side_ss{i}",))[:] = pairs[:, 1]


def _write_names(file: Any, variable: str, dimension: str, names: Sequence[str]) -> None:
    rows = np.array([list(name.ljust(33, "\0")) for name in names], dtype="S1")
    file.createVariable(variable, "S1", (dimension, "len_name"))[:] = rows


def _write_results(file: Any, n: int, blocks: Sequence[tuple[str, Any]], steps: int) -> None:
    file.variables["time_whole"][:] = np.arange(steps)
    names = ["temp", "disp_x", "disp_y", "disp_z"]
    file.createDimension("num_nod_var", len(names))
    _write_names(file, "name_nod_var", "num_nod_var", names)
    for i in range(len(names)):
        values = file.createVariable(f"vals_nod_var{i + 1}", "f8", ("time_step", "num_nodes"))
        values[:] = 100.0 * np.arange(steps)[:, None] + i + np.arange(n) / n
    file.createDimension("num_elem_var", 1)
    _write_names(file, "name_elem_var", "num_elem_var", ["stress"])
    for b, (_, cells) in enumerate(blocks[:1], 1):  # the first block alone has values
        values = file.createVariable(f"vals_elem_var1eb{b}", "f8", ("time_step", f"num_el_in_blk{b}"))
        values[:] = 7.0 * np.arange(steps)[:, None] + np.arange(len(cells))
    file.createDimension("num_qa_rec", 2)
    file.createDimension("four", 4)
    file.createVariable("qa_records", "S1", ("num_qa_rec", "four", "len_string"))[:] = b"q"
    file.createVariable("node_num_map", "i4", ("num_nodes",))[:] = np.arange(n) * 3 + 5


def vtk_blocks(data: bytes, kind: str) -> dict[str, tuple[np.ndarray, list[tuple[int, list[int]]]]]:
    """What VTK reads: for each block or set by its name the points, and VTK's type and points of each cell.

    kind: ELEM_BLOCK, SIDE_SET or NODE_SET.
    """
    vtk = require("vtk")
    from vtk.util.numpy_support import vtk_to_numpy

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.e"
        path.write_bytes(data)
        reader = vtk.vtkExodusIIReader()
        reader.SetFileName(str(path))
        reader.UpdateInformation()
        reader.ApplyDisplacementsOff()
        for other in ("ELEM_BLOCK", "SIDE_SET", "NODE_SET"):
            number = getattr(reader, other)
            for i in range(reader.GetNumberOfObjects(number)):
                reader.SetObjectStatus(number, i, int(other == kind))
        reader.Update()
        found = {}
        parts = reader.GetOutput().GetBlock({"ELEM_BLOCK": 0, "SIDE_SET": 4, "NODE_SET": 7}[kind])
        for i in range(parts.GetNumberOfBlocks()):
            part = parts.GetBlock(i)
            if part is not None:
                name = parts.GetMetaData(i).Get(vtk.vtkCompositeDataSet.NAME())
                listed = []
                for c in range(part.GetNumberOfCells()):
                    cell = part.GetCell(c)  # the next one goes by the same object
                    nodes = [cell.GetPointId(k) for k in range(cell.GetNumberOfPoints())]
                    listed.append((cell.GetCellType(), nodes))
                found[name] = (vtk_to_numpy(part.GetPoints().GetData()).copy(), listed)
        return found
