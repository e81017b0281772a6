"""The sweep loop: the paper's Algorithm 1 over batches, until a criterion is met or it is interrupted."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dvr_cli.relax.directions import DirectionField
from dvr_cli.relax.engine import Engine
from dvr_cli.relax.stopping import Stopping


@dataclass(frozen=True)
class Sweep:
    """What one sweep did: its number from 1, Q1 after it, how many vertices moved, seconds it took."""

    sweep: int
    q1: float
    moved: int
    seconds: float


@dataclass(frozen=True)
class Relaxation:
    """The result of relaxing: coordinates (N, d), the sweeps done, why they stopped."""

    points: np.ndarray
    sweeps: list[Sweep]
    stopped_because: str


def relax(
    engine: Engine,
    points: np.ndarray,
    field: DirectionField,
    stopping: Stopping,
    on_sweep: Callable[[Sweep], None] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
) -> Relaxation:
    """Relax the vertices of the engine's problem from the coordinates ``points`` (N, d).

    on_sweep: called after each sweep. interrupted: asked after each batch; when true the mesh reached is the
    result. Every intermediate mesh is valid and no worse (Theorem 4.10).
    """
    vertices = engine.problem.relaxed
    if not len(vertices):
        return Relaxation(points, [], "nothing-to-relax")
    begin = time.perf_counter()
    engine.load(points)
    history = [engine.q1()]
    sweeps: list[Sweep] = []
    while (reason := stopping.reason(history, time.perf_counter() - begin)) is None:
        start = time.perf_counter()
        directions = field(len(sweeps), engine.relaxed_points, vertices)
        moved = 0
        for batch in range(engine.batches):
            moved += engine.relax_batch(batch, directions)
            if interrupted():
                return Relaxation(engine.points, sweeps, "interrupted")
            if stopping.time_limit is not None and time.perf_counter() - begin >= stopping.time_limit:
                return Relaxation(engine.points, sweeps, "time-limit")
        history.append(engine.q1())
        sweeps.append(Sweep(len(sweeps) + 1, history[-1], moved, time.perf_counter() - start))
        if on_sweep is not None:
            on_sweep(sweeps[-1])
    return Relaxation(engine.points, sweeps, reason)
