"""The kernels of ``joint`` compiled, over those of ``walk_numba``."""

from __future__ import annotations

from dvr_cli.jit.kinds import compiled_over
from dvr_cli.relax.surface import joint, overlay_numba, ring_numba, strides_numba, walk_numba

COMPILED = compiled_over(
    joint,
    ("move_jointly", "go_jointly"),
    vars(ring_numba) | strides_numba.COMPILED | overlay_numba.COMPILED | walk_numba.COMPILED,
)
move_jointly, go_jointly = COMPILED["move_jointly"], COMPILED["go_jointly"]
