"""Warming up: the kernels of the compiled engine are compiled, and kept where later runs find them."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from threading import Thread
from typing import Any

import numpy as np

from dvr_cli.api.options import SmoothOptions
from dvr_cli.api.smoothing import smooth_mesh
from dvr_cli.backend import COMPILED, NUMPY, Backend
from dvr_cli.errors import UsageError
from dvr_cli.mesh.corners import Simplices
from dvr_cli.mesh.mesh import Cells, Mesh
from dvr_cli.mesh.rings import incidence_of
from dvr_cli.relax.engines.choice import KINDS, EngineKind
from dvr_cli.relax.engines.engine import Engine
from dvr_cli.relax.problem import Problem, touched_corners
from dvr_cli.relax.stopping import Stopping

_NICE = 10  # the priority of a process that compiles for another
_GARBAGE = 100_000  # objects after which it looks for garbage: it lives shortly, and makes many that stay
_BOXES = 3  # along each edge of the cube
_TETRAHEDRA = ((0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7))
_CURVED: dict[str, Any] = {"boundary": "project", "feature_angle": 90.0}

# A small mesh and options for each sort of meshes whose kernels differ, by what they are for.
SORTS: dict[str, Callable[[], tuple[Mesh, dict[str, Any]]]] = {
    "tetrahedra": lambda: (_cube("tetra"), {"order": "natural"}),
    "metrics": lambda: (_cube("tetra"), {"metric": _metric(3)}),
    "stretched cells": lambda: (_stretched(_cube("tetra")), {}),
    "planar meshes": lambda: (_square(), {}),
    "metrics in a plane": lambda: (_square(), {"metric": _metric(2)}),
    "stretched cells in a plane": lambda: (_stretched(_square()), {}),
    "curved boundaries in a plane": lambda: (_ball(_square()), _CURVED),
    "cells of other types": lambda: (_cube("hexahedron"), {}),
    "curved boundaries": lambda: (_ball(_cube("tetra")), _CURVED),
    "curved boundaries in a plane that are tangled": lambda: (_turned(_ball(_square())), _CURVED),
    "curved boundaries that are tangled": lambda: (_turned(_ball(_cube("tetra"))), _CURVED),
    "surfaces": lambda: (_lifted(_square()), {"feature_angle": 90.0}),
}
_OPTIONS = SmoothOptions(threads=1, stopping=Stopping(max_iterations=2))


def warm_up(say: Callable[[str], None]) -> str:
    """Relax small meshes of all sorts; returns the folder that keeps what was compiled.

    say: gets what is compiled next. Raises UsageError if numba is missing, or finds no folder to write to.
    """
    options = replace(_OPTIONS, engine="numba")
    folder = _folder()
    for sort, made in SORTS.items():
        say(sort)
        mesh, more = made()
        smooth_mesh(mesh, replace(options, **more))
    say("meshes that ranks share")
    for mesh in (_cube("tetra"), _square()):
        _share(mesh)
    return folder


def compile_for(sort: str, *halves: str) -> None:
    """Compile for meshes of a sort in a process of its own, which ends when its stdin is closed.

    halves: of the kernels that a run uses, by name, which is said on stdout when they are compiled. Then
    those follow by which later runs are set up.
    """
    os.environ["NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING"] = "1"  # thousands of errors are caught, none shown
    from dvr_cli.jit.turns import compile_in_turn
    from dvr_cli.relax.engines.handover import MOVES, TWINS

    Thread(target=_end_with_stdin, daemon=True).start()
    if hasattr(os, "nice"):
        os.nice(_NICE)
    gc.set_threshold(_GARBAGE)
    compile_in_turn()
    mesh, more = SORTS[sort]()
    more = {name: value for name, value in more.items() if name != "order"}

    compiled = {MOVES: ("numba", NUMPY), TWINS: ("numpy", COMPILED)}  # engine, backend
    for half in halves:
        smooth_mesh(mesh, replace(_OPTIONS, engine="numpy", **more), make=partial(_made, *compiled[half]))
        print(half, flush=True)
    smooth_mesh(mesh, replace(_OPTIONS, engine="numba", **more))


def _made(name: str, backend: Backend, _: EngineKind, problem: Problem, threads: int | None) -> Engine:
    """The engine of a name, with twins of any backend."""
    engine = KINDS[name].make(problem, threads)
    engine.backend = backend
    return engine


def _end_with_stdin() -> None:
    while os.read(sys.stdin.fileno(), 1):
        pass
    os._exit(0)


class _Alone:
    """The communicator of a rank without others."""

    rank, size = 0, 1

    def Alltoall(self, given: np.ndarray, taken: np.ndarray) -> None:
        """Take what each rank gives, which is this one alone."""
        taken[:] = given

    def allgather(self, given: Any) -> list[Any]:
        """The things given to all ranks, one of each."""
        return [given]


def _share(mesh: Mesh) -> None:
    """Look for layers in a mesh, and colour its inner vertices, as ranks do that share it."""
    from dvr_cli.distributed.colouring import colours, turns
    from dvr_cli.quality.mean_ratio import corner_qualities
    from dvr_cli.quality.stretching import stretched_among

    domain = _OPTIONS.domain(mesh, COMPILED)
    everywhere = np.ones(len(mesh.points), dtype=bool)
    stretched_among(domain, everywhere, corner_qualities(domain.points, domain.corners, COMPILED))
    corners, number = domain.corners, np.arange(len(mesh.points), dtype=np.int32)
    touch = COMPILED.twin(touched_corners)
    vertices, shapes, _ = touch(corners.vertices, corners.shapes, domain.interior, number)
    touched = Simplices(vertices, shapes, corners.table)
    own, turn = np.flatnonzero(domain.interior), turns(np.where(domain.interior, number, -1).astype(np.int64))
    incidence, ghosts = incidence_of(touched, own, len(number), COMPILED), ([own[:0]], [own[:0]])
    colours(_Alone(), own, incidence, turn, ghosts, touched.vertices, COMPILED)


def _folder() -> str:
    """The folder that keeps what numba compiles; UsageError if none does."""
    from dvr_cli.mesh.rings_numba import rings

    kernel: Any = rings
    folder = kernel.stats.cache_path
    if folder is None:
        raise UsageError("warm-up: no folder can be written for what is compiled; NUMBA_CACHE_DIR names one")
    return str(folder)


def _metric(dimension: int) -> np.ndarray:
    """(N, d, d): one that sees lengths along the last axis doubled, at the corners of all boxes."""
    return np.tile(np.diag([1.0] * (dimension - 1) + [4.0]), ((_BOXES + 1) ** dimension, 1, 1))


def _cube(kind: str) -> Mesh:
    """A cube around 0 of 3 × 3 × 3 boxes, their inner vertices a little astray."""
    side = range(_BOXES + 1)
    places = np.array(list(product(side, side, side)), dtype=np.float64)
    inner = ((places > 0) & (places < _BOXES)).all(axis=1)
    places[inner] += 0.3 * np.sin(np.arange(3.0 * inner.sum())).reshape(-1, 3)
    boxes = []
    for x, y, z in product(range(_BOXES), repeat=3):
        boxes.append([((x + a) * 4 + y + b) * 4 + z + c for c, b, a in product((0, 1), repeat=3)])
    at = np.array(boxes)
    order = _TETRAHEDRA if kind == "tetra" else ((0, 1, 3, 2, 4, 5, 7, 6),)
    return Mesh(places - _BOXES / 2, [Cells(kind, np.concatenate([at[:, list(one)] for one in order]))])


def _square() -> Mesh:
    """The bottom of the cube, around 0, in triangles, its inner vertices a little astray."""
    side = range(_BOXES + 1)
    places = np.array(list(product(side, side)), dtype=np.float64)
    inner = ((places > 0) & (places < _BOXES)).all(axis=1)
    places[inner] += 0.3 * np.sin(np.arange(2.0 * inner.sum())).reshape(-1, 2)
    at = np.array([4 * x + y for x, y in product(range(_BOXES), repeat=2)])[:, None]
    return Mesh(
        places - _BOXES / 2,
        [Cells("triangle", np.concatenate([at + np.array(three) for three in ((0, 4, 5), (0, 5, 1))]))],
    )


def _stretched(cube: Mesh) -> Mesh:
    """The cube or square flattened, so that its cells are as those of layers."""
    flat = cube.points.copy()
    flat[:, -1] *= 0.02
    return Mesh(flat, cube.cells)


def _lifted(square: Mesh) -> Mesh:
    """The square bent to a surface in space."""
    height = 0.1 * (square.points**2).sum(axis=1)
    return Mesh(np.column_stack([square.points, height]), square.cells)


def _ball(cube: Mesh) -> Mesh:
    """The cube or square blown up to a ball or disk."""
    distance = np.abs(cube.points).max(axis=1)
    radius = np.linalg.norm(cube.points, axis=1)
    return Mesh(cube.points * (distance / radius)[:, None], cube.cells)


def _turned(ball: Mesh) -> Mesh:
    """The ball or disk, half of its boundary turned against the rest by more than the mesh can follow."""
    (x, y), last = ball.points.T[:2], ball.points[:, -1]
    outside = np.isclose(np.linalg.norm(ball.points, axis=1), _BOXES / 2)
    angle = np.where(outside & (last > 0.0), 1.2, 0.0)
    cos, sin = np.cos(angle), np.sin(angle)
    turned = ball.points.copy()
    turned[:, 0], turned[:, 1] = cos * x - sin * y, sin * x + cos * y
    return Mesh(turned, ball.cells)
