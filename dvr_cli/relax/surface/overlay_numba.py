"""The kernels of ``overlay`` compiled."""

from __future__ import annotations

from dvr_cli.jit.arrays import bare
from dvr_cli.jit.kinds import compiled_over
from dvr_cli.relax.surface import overlay

COMPILED = compiled_over(overlay, ("renew",), {"bare": bare})
look, take_over, renew = COMPILED["look"], COMPILED["take_over"], COMPILED["renew"]
