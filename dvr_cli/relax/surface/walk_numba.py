"""The kernels of ``walk`` compiled, over those of ``ring_numba`` and ``overlay_numba``."""

from __future__ import annotations

from dvr_cli.jit import compiled_over
from dvr_cli.relax.surface import overlay_numba, ring_numba, walk

_NAMES = vars(ring_numba) | {"look": overlay_numba.look, "take_over": overlay_numba.take_over}
_COMPILED = compiled_over(walk, ("walk_rings", "walk_directions"), _NAMES)
walk_rings, walk_directions = _COMPILED["walk_rings"], _COMPILED["walk_directions"]
