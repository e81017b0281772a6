"""A MED file as a mesh: one of the meshes in it, its cells, families and groups."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files import hdf5
from dvr_cli.files.container import ContainerSource, CoordinateArray
from dvr_cli.files.losses import number_not_kept
from dvr_cli.files.med.elements import TYPES, UNSUPPORTED, node_order
from dvr_cli.files.med.families import groups_of, members
from dvr_cli.files.source import InputFile
from dvr_cli.mesh.cell_types import CELL_TYPES
from dvr_cli.mesh.mesh import Cells, Mesh

if TYPE_CHECKING:
    import h5py

_SYSTEMS = {1: "cylindrical", 2: "spherical"}
_NO_PROFILE = ("", "MED_NO_PROFILE_INTERNAL")


class MedSource(ContainerSource):
    """A MED file; its mesh is one of those in it."""

    format = "med"


def read(file: InputFile) -> MedSource:
    """Read the mesh ``file.mesh`` of a MED file, or the only one.

    Cells come in a block for each type, their families as the cell data "med:family"; groups are cell sets
    and point sets. Points have 2 or 3 coordinates, as the file says. Of several time steps all must have the
    same coordinates and cells, and all are written.

    Raises InputError for damage and for what is not supported, by name.
    """
    with hdf5.opened(file.data) as content:
        meshes = hdf5.members(content, "ENS_MAA")
        if not meshes:
            raise InputError(
                "it is a MED file without a mesh" if "INFOS_GENERALES" in content else "no MED file"
            )
        name = _chosen(list(meshes), file.mesh)
        mesh_group = meshes[name]
        _check_kind(mesh_group)
        steps = _steps(mesh_group)
        step = steps[-1]
        points, arrays = _read_points(steps, mesh_group)
        cells, families = _read_cells(step, len(points))
        mesh = Mesh(points, cells, {"med:family": families})
        for group, chosen in groups_of(content, name, "ELEME").items():
            mesh.cell_sets[group] = [members(family, chosen) for family in families]
        of_nodes = _families(hdf5.dataset_at(step, "NOE/FAM"), len(points))
        for group, chosen in groups_of(content, name, "NOEUD").items():
            mesh.point_sets[group] = members(of_nodes, chosen)
        return MedSource(file.data, mesh, arrays, _beyond_mesh(content, name, step))


def _chosen(names: list[str], wanted: str | None) -> str:
    listed = ", ".join(names)
    if wanted is not None and wanted not in names:
        raise InputError(f"it has no mesh {wanted!r}; there are: {listed}")
    if wanted is None and len(names) > 1:
        raise InputError(f"it holds {len(names)} meshes, one of which has to be named (--mesh): {listed}")
    return wanted or names[0]


def _check_kind(mesh_group: h5py.Group) -> None:
    if hdf5.attribute(mesh_group, "TYP"):
        raise InputError(f"{mesh_group.name} is a structured mesh, which is not supported")
    system = hdf5.attribute(mesh_group, "REP")
    if system:
        kind = _SYSTEMS.get(int(system), "unknown")
        raise InputError(f"{mesh_group.name} has {kind} coordinates, which are not supported")


def _steps(mesh_group: h5py.Group) -> list[h5py.Group]:
    """The time steps that have nodes, in time; in files before version 3 the mesh itself."""
    if hdf5.members(mesh_group, "JNT"):
        raise InputError("it is a part of a distributed mesh; join the parts first")
    found = [
        item for item in hdf5.members(mesh_group).values() if hdf5.dataset_at(item, "NOE/COO") is not None
    ]
    if hdf5.dataset_at(mesh_group, "NOE/COO") is not None:
        found = [mesh_group]
    if not found:
        raise InputError(f"{mesh_group.name} has no nodes")
    for step in found[:-1]:
        for path in {*_arrays(step), *_arrays(found[-1])}:
            first, last = hdf5.dataset_at(step, path), hdf5.dataset_at(found[-1], path)
            if first is None or last is None or not np.array_equal(hdf5.values(first), hdf5.values(last)):
                raise InputError(f"its {len(found)} time steps have different meshes, which is not supported")
    return found


def _arrays(step: h5py.Group) -> list[str]:
    """The datasets in a time step that hold coordinates and cells."""
    types = hdf5.members(step, "MAI")
    return ["NOE/COO", *(f"MAI/{kind}/NOD" for kind in types)]


def _read_points(steps: list[h5py.Group], mesh_group: h5py.Group) -> tuple[np.ndarray, list[CoordinateArray]]:
    """The points of the last step, and where those of all steps are."""
    given = hdf5.attribute(mesh_group, "ESP")
    dimension = int(hdf5.attribute(mesh_group, "DIM") or 0) if given is None else int(given)
    if dimension not in (2, 3):
        raise InputError(f"its nodes have {dimension} coordinates; 2 or 3 are possible")
    _check_profile(steps[-1]["NOE"])
    values = hdf5.values(steps[-1]["NOE/COO"])
    if values.dtype.kind != "f" or values.ndim != 1 or values.size % dimension or not values.size:
        raise InputError(f"{steps[-1].name}/NOE/COO does not hold {dimension} coordinates for each node")
    points = values.reshape(dimension, -1).T.astype(np.float64, order="C")
    axes = tuple(range(dimension))
    paths = [f"{step.name}/NOE/COO" for step in steps]
    return points, [CoordinateArray(path, slice(None), axes, values.shape, values.dtype) for path in paths]


def _read_cells(step: h5py.Group, n_points: int) -> tuple[list[Cells], list[np.ndarray]]:
    """The cells of each type, and their families."""
    blocks, families = [], []
    types = hdf5.members(step, "MAI")
    for kind in types:
        stored = hdf5.dataset_at(types[kind], "NOD")
        if stored is None:
            raise InputError(f"{types[kind].name} has no nodes of cells")
        cell_type = TYPES.get(kind)
        if cell_type is None and stored.size:
            raise InputError(f"{UNSUPPORTED.get(kind, 'cells')} ({kind}) are not supported")
        if cell_type is None or not stored.size:
            continue
        _check_profile(types[kind])
        nodes = hdf5.values(stored)
        count = CELL_TYPES[cell_type].nodes
        if nodes.dtype.kind not in "iu" or nodes.ndim != 1 or nodes.size % count:
            raise InputError(f"{stored.name} does not hold {count} nodes for each cell")
        vertices = nodes.reshape(count, -1).T.astype(np.int64) - 1
        if vertices.min() < 0 or vertices.max() >= n_points:
            wrong = vertices[(vertices < 0) | (vertices >= n_points)][0] + 1
            raise InputError(f"{stored.name} names node {wrong}, but there are {n_points}, counted from 1")
        order = node_order(cell_type)
        blocks.append(
            Cells(cell_type, np.ascontiguousarray(vertices if order is None else vertices[:, order]))
        )
        families.append(_families(hdf5.dataset_at(types[kind], "FAM"), len(vertices)))
    if not blocks:
        raise InputError(f"{step.name} has no cells")
    return blocks, families


def _families(dataset: h5py.Dataset | None, count: int) -> np.ndarray:
    """(count,) the family of each node or cell, 0 where the file does not say."""
    if dataset is None:
        return np.zeros(count, dtype=np.int64)
    families = hdf5.values(dataset)
    if families.shape != (count,) or families.dtype.kind not in "iu":
        raise InputError(f"{dataset.name} does not hold {count} families")
    return families.astype(np.int64)


def _check_profile(group: h5py.Group) -> None:
    profile = hdf5.text(hdf5.attribute(group, "PFL"))
    if profile not in _NO_PROFILE:
        raise InputError(f"{group.name} is given on a profile ({profile}), which is not supported")


def _beyond_mesh(file: h5py.File, name: str, step: h5py.Group) -> list[str]:
    """One line for each kind of thing in the file that is not in the mesh."""
    counted = {"CHA": "field", "PROFILS": "profile", "GAUSS": "localisation", "PARAMETRES": "parameter"}
    counts = {what: len(hdf5.members(file, path)) for path, what in counted.items()}
    counts["other mesh"] = len(file["ENS_MAA"]) - 1
    counts["equivalence"] = len(hdf5.members(step, "EQS") or hdf5.members(file, f"ENS_MAA/{name}/EQS") or ())
    lines = [line for what, count in counts.items() for line in number_not_kept(count, what)]
    if hdf5.dataset_at(step, "NOE/NUM") is not None:
        lines.append("not kept: numbers of nodes")
    types = hdf5.members(step, "MAI")
    if any(hdf5.dataset_at(types[kind], "NUM") is not None for kind in types):
        lines.append("not kept: numbers of cells")
    return lines
