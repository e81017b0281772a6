"""The kernels of ``strides`` compiled."""

from __future__ import annotations

from dvr_cli.jit.kinds import compiled_over
from dvr_cli.relax.surface import strides

COMPILED = compiled_over(strides, ())
