"""The kernels of ``walk`` compiled, over those of ``ring_numba``, ``overlay_numba`` and ``strides_numba``."""

from __future__ import annotations

from dvr_cli.jit.kinds import compiled_over
from dvr_cli.relax.surface import overlay_numba, ring_numba, strides_numba, walk

COMPILED = compiled_over(
    walk,
    ("walk_rings", "walk_directions"),
    vars(ring_numba) | strides_numba.COMPILED | overlay_numba.COMPILED,
)
walk_rings, walk_directions = COMPILED["walk_rings"], COMPILED["walk_directions"]
