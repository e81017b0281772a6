"""How to smooth: all options of ``dvr smooth`` and ``smooth``, checked as far as that needs no mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from dvr_cli.api.selection import Selection
from dvr_cli.errors import UsageError
from dvr_cli.files.arrays import read_directions, read_vertices, whole_numbers
from dvr_cli.relax.directions import Entry, check_name
from dvr_cli.relax.engines.choice import checked_threads, chosen_engine, has_numba
from dvr_cli.relax.schedule import ORDERS
from dvr_cli.relax.stopping import Stopping

BOUNDARIES = ("fixed", "slide", "project")  # each frees the vertices of those before it, and more

# What a preset fixes; "paper" is the paper's Algorithm 1, which makes a given number of sweeps.
PRESETS: dict[str, dict[str, Any]] = {
    "paper": {"directions": "random", "order": "natural", "patches": False, "polish": False, "tol": 0.0},
}

_DIRECTIONS = "steepest,random"

Directions = str | np.ndarray | Sequence[str | np.ndarray]
Names = str | Sequence[str]
Vertices = str | Path | np.ndarray | Sequence[int]


@dataclass(frozen=True)
class SmoothOptions:
    """How to relax; the fields are those of ``dvr smooth --help``.

    directions: comma-separated names, an array (N, d) or (K, N, d), or a list of these, one a sweep, cycled.
    center, axis: for "circumferential" and "radial"; default the centroid of the points and the z axis.
    order: "coloured", "natural" or "shuffled". seed: for random directions and the shuffled order.
    boundary: "fixed", or "slide": vertices of the boundary, of interfaces and of embedded cells move within
        straight lines and planes; or "project": also along curved ones, brought back to the input's. Surfaces
        in space are always projected.
    feature_angle: degrees, from 0 to 180; where a boundary turns by more it is a feature and keeps its shape.
    max_deviation: how far a projected boundary may come from the input's, None for 1e-3 of the diagonal of
        the bounding box.
    fix, only, below, layers: see Selection; fix and only are one name or several. vertices: numbers from 0,
        or the path of a .npy, .csv or .txt file with them.
    straighten: take curved second-order cells as straight. stopping: when to stop.
    untangle: make inverted elements positive first.
    patches: after the sweeps move the surroundings of the worst elements jointly, worst first; by default
        with the default directions if numba is installed, as it takes long without.
    polish: afterwards raise the mean quality, keeping all qualities above floor times the Q1 reached; by
        default with the default directions, unless the quality vector would fall below that of the input.
    preset: "paper" for the paper's Algorithm 1: random directions, natural order, max_iterations sweeps.
    engine: "auto", "numpy" or "numba"; threads: by default all cores. Neither changes the result.
    """

    directions: Directions = _DIRECTIONS
    center: Sequence[float] | None = None
    axis: Sequence[float] | None = None
    order: str = "coloured"
    seed: int = 0
    boundary: str = "fixed"
    feature_angle: float = 30.0
    max_deviation: float | None = None
    fix: Names = ()
    only: Names = ()
    below: float | None = None
    layers: int = 0
    vertices: Vertices | None = None
    straighten: bool = False
    untangle: bool = False
    patches: bool | None = None
    polish: bool | None = None
    floor: float = 0.999
    preset: str | None = None
    engine: str = "auto"
    threads: int | None = None
    stopping: Stopping = field(default_factory=Stopping)

    def __post_init__(self) -> None:
        """Check what can be checked without a mesh; raises UsageError, InputError for an unreadable array."""
        if self.preset is not None:
            self._take_preset(self.preset)
        if self.order not in ORDERS:
            raise UsageError(f"order: unknown {self.order!r}; known: {', '.join(ORDERS)}")
        if self.boundary not in BOUNDARIES:
            raise UsageError(f"boundary: unknown {self.boundary!r}; known: {', '.join(BOUNDARIES)}")
        if not 0 <= self.feature_angle <= 180:
            raise UsageError("feature-angle: must be between 0 and 180 degrees")
        if self.max_deviation is not None and not 0 <= self.max_deviation < np.inf:
            raise UsageError("max-deviation: must be a length that is not negative")
        if not 0 <= self.seed < 2**64:
            raise UsageError("seed: must be between 0 and 2^64 - 1")
        if not 0 <= self.floor <= 1:
            raise UsageError("floor: must be a fraction of Q1, from 0 to 1")
        chosen_engine(self.engine, 0, 0)
        checked_threads(self.threads)
        for entry in self.entries:
            if isinstance(entry, str):
                check_name(entry)
        _ = self.selection  # which checks itself

    def _take_preset(self, name: str) -> None:
        """Set what the preset fixes; UsageError where something else was asked for."""
        if name not in PRESETS:
            raise UsageError(f"preset: unknown {name!r}; known: {', '.join(PRESETS)}")
        for key, value in PRESETS[name].items():
            owner: SmoothOptions | Stopping = self.stopping if key == "tol" else self
            given = getattr(owner, key)
            default = getattr(type(owner), key)
            if isinstance(given, np.ndarray) or given not in (default, value):
                raise UsageError(f"preset {name}: leave out {key}, which it sets to {value}")
            if owner is self:
                object.__setattr__(self, key, value)
        object.__setattr__(self, "stopping", replace(self.stopping, tol=PRESETS[name]["tol"]))

    @property
    def takes_patches(self) -> bool:
        """Whether patches are to be relaxed."""
        return self._is_free and has_numba() if self.patches is None else self.patches

    @property
    def takes_polish(self) -> bool:
        """Whether to polish."""
        return self._is_free if self.polish is None else self.polish

    @property
    def _is_free(self) -> bool:
        """Whether nobody prescribed along what vertices move."""
        return isinstance(self.directions, str) and self.directions == _DIRECTIONS

    @cached_property
    def entries(self) -> list[Entry]:
        """The directions as a list; arrays named by "file:PATH" are read, once."""
        result: list[Entry] = []
        for item in self._given():
            if not isinstance(item, str):
                result.append(item)
                continue
            for name in item.split(","):
                name = name.strip()
                path = name.removeprefix("file:")
                result.append(name if path == name else (name, read_directions(Path(path))))
        return result

    @cached_property
    def selection(self) -> Selection:
        """The vertices to relax; a file named by ``vertices`` is read, once."""
        fix, only = _names(self.fix), _names(self.only)
        return Selection(fix, only, self.below, self.layers, self._vertices())

    def _vertices(self) -> np.ndarray | None:
        if isinstance(self.vertices, str | Path):
            return read_vertices(Path(self.vertices))
        return None if self.vertices is None else whole_numbers(np.asarray(self.vertices), "vertices")

    def _given(self) -> Sequence[str | np.ndarray]:
        return [self.directions] if isinstance(self.directions, str | np.ndarray) else self.directions

    def record(self) -> dict[str, Any]:
        """The options as JSON-ready data."""
        return {
            "directions": ",".join(d if isinstance(d, str) else f"array{d.shape}" for d in self._given()),
            "center": None if self.center is None else [float(c) for c in self.center],
            "axis": None if self.axis is None else [float(a) for a in self.axis],
            "order": self.order,
            "seed": int(self.seed),
            "boundary": self.boundary,
            "feature_angle": float(self.feature_angle),
            "max_deviation": None if self.max_deviation is None else float(self.max_deviation),
            "fix": list(_names(self.fix)),
            "only": list(_names(self.only)),
            "below": None if self.below is None else float(self.below),
            "layers": int(self.layers),
            "vertices": _described(self.vertices),
            "straighten": bool(self.straighten),
            "untangle": bool(self.untangle),
            "patches": self.takes_patches,
            "polish": self.takes_polish,
            "floor": float(self.floor),
            "preset": self.preset,
            "max_iterations": int(self.stopping.max_iterations),
            "tol": float(self.stopping.tol),
            "patience": int(self.stopping.patience),
            "target": None if self.stopping.target is None else float(self.stopping.target),
            "time_limit": None if self.stopping.time_limit is None else float(self.stopping.time_limit),
        }


def _names(given: Names) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else tuple(given)


def _described(vertices: Vertices | None) -> str | None:
    if vertices is None or isinstance(vertices, str | Path):
        return None if vertices is None else str(vertices)
    return f"array{np.shape(vertices)}"
