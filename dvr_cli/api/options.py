"""The options of ``dvr smooth`` and ``smooth``, checked as far as that needs no mesh."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from dvr_cli.api.metric import MetricSource, metric_source
from dvr_cli.api.selection import Selection
from dvr_cli.backend import NUMPY, Backend
from dvr_cli.errors import UsageError
from dvr_cli.files.arrays import read_directions, read_vertices, whole_numbers
from dvr_cli.mesh.domain import Domain, domain_of
from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.region_choice import RegionChoice
from dvr_cli.options import OPTIONS, check_fields, check_names, default
from dvr_cli.relax.directions import Entry, check_name
from dvr_cli.relax.engines.choice import choose_engine, has_numba, thread_count
from dvr_cli.relax.stopping import Stopping

BOUNDARIES = OPTIONS["boundary"].values.names  # each frees the vertices of those before it, and more
# What the others of them keep of the input's shape, in words.
BOUNDARY_KEEPS = {
    "slide": "planes, straight edges, regions and groups keep their shape",
    "project": "curved boundaries keep their shape to within --max-deviation",
}

# What a preset fixes; "paper" is the paper's Algorithm 1, which makes a given number of sweeps.
PRESETS: dict[str, dict[str, Any]] = {
    "paper": {
        "directions": "random",
        "order": "natural",
        "patches": False,
        "polish": False,
        "keep_height": False,
        "tol": 0.0,
        "shape": "ideal",
    },
}

Directions = str | np.ndarray | Sequence[str | np.ndarray]
Names = str | Sequence[str]
Vertices = str | Path | np.ndarray | Sequence[int]


@dataclass(frozen=True)
class SmoothOptions:
    """The options of a run; the fields are those of ``dvr smooth --help``.

    directions: comma-separated names, an array (N, d) or (K, N, d), or a list of these, one a sweep, cycled.
    center, axis: for "circumferential" and "radial"; default the centroid of the points and the z axis.
    order: "coloured", "natural" or "shuffled". seed: for random directions and the shuffled order.
    boundary: "fixed", or "slide": vertices of the boundary, of interfaces and of embedded cells move within
        straight lines and planes; or "project": also along curved ones, on those of the input, as
        vertices of surfaces in space always do.
    feature_angle: degrees, from 0 to 180; where a boundary turns by more it is a feature and keeps its shape.
    max_deviation: how far a curved boundary may come from the input's, None for 1e-3 of the diagonal of
        the bounding box.
    fix, only, below, layers: see Selection; fix and only are one name or several. vertices: numbers from 0,
        or the path of a .npy, .csv or .txt file with them.
    regions: what tells regions apart, whose interfaces stay: names of cell data and groups, by default all
        that look like it; "none"; or an array of a number for each cell.
    shape: "auto", "ideal" or "input": what cells are measured against, see ``shapes.shaped``.
    metric: a tensor a vertex, in which all cells have the ideal shape for their target: the name of a point
        field, the path of a MEDIT .sol or .solb file, or an array; see ``metric.tensors_of``.
    straighten: take curved second-order cells as straight. stopping: when to stop.
    untangle: make inverted elements positive first; by default with the default directions where the input
        has any and is no surface, see ``untangling.untangles``.
    patches: after the sweeps move the surroundings of the worst elements jointly, worst first; by default
        with the default directions if numba is installed, as it takes long without.
    polish: afterwards raise the mean quality, so that the quality vector below the level of care does not
        decrease; by default with the default directions and no target. floor: keep all qualities above so
        much of the Q1 reached, and nothing else.
    keep_height: take no element below the smallest altitude of the input; by default with the default
        directions and no metric.
    preset: "paper" for the paper's Algorithm 1: random directions, natural order, max_iterations sweeps.
    engine: "auto", "numpy" or "numba"; threads: by default all cores. Neither changes the result.
    """

    directions: Directions = default("directions")
    center: Sequence[float] | None = None
    axis: Sequence[float] | None = None
    order: str = default("order")
    seed: int = default("seed")
    boundary: str = default("boundary")
    feature_angle: float = default("feature_angle")
    max_deviation: float | None = None
    fix: Names = ()
    only: Names = ()
    below: float | None = None
    layers: int = default("layers")
    vertices: Vertices | None = None
    regions: Names | np.ndarray = ()
    shape: str = default("shape")
    metric: str | Path | np.ndarray | None = None
    straighten: bool = default("straighten")
    untangle: bool | None = None
    patches: bool | None = None
    polish: bool | None = None
    floor: float | None = None
    keep_height: bool | None = None
    preset: str | None = None
    engine: str = default("engine")
    threads: int | None = None
    stopping: Stopping = field(default_factory=Stopping)

    @classmethod
    def of(cls, given: Mapping[str, Any], **fixed: Any) -> SmoothOptions:
        """The options ``given`` by name, those of stopping among them, and those that are ``fixed``.

        Options of commands that are not about smoothing are passed over. Raises UsageError for wrong values.
        """
        values = {name: value for name, value in {**given, **fixed}.items() if value is not None}
        stopping, own = _names_of(Stopping), _names_of(cls)
        return cls(
            **{name: value for name, value in values.items() if name in own},
            stopping=Stopping(**{name: value for name, value in values.items() if name in stopping}),
        )

    def __post_init__(self) -> None:
        """Check what can be checked without a mesh; raises UsageError, InputError for an unreadable array."""
        if self.preset is not None:
            self._take_preset(self.preset)
        check_fields(self)
        choose_engine(self.engine, 0, 0)
        thread_count(self.threads)
        for entry in self.entries:
            if isinstance(entry, str):
                check_name(entry)
        _ = self.selection  # which checks itself
        if self.metric is not None:
            self._check_metric()

    def _check_metric(self) -> None:
        """Raise UsageError for what a metric excludes, InputError for a file that cannot be read."""
        if self.shape == "input":
            raise UsageError(
                "metric: leave out shape input; in a metric cells have the ideal shape as target"
            )
        _ = self.metric_source

    def _take_preset(self, name: str) -> None:
        """Set what the preset fixes; UsageError where something else was asked for."""
        OPTIONS["preset"].check(name)
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
        """True if patches are to be relaxed."""
        return self.is_free and has_numba() if self.patches is None else self.patches

    @property
    def takes_polish(self) -> bool:
        """True if the run is to be polished."""
        usual = self.is_free and self.stopping.target is None
        return usual if self.polish is None else self.polish

    @property
    def takes_descent(self) -> bool:
        """True if the run is to begin with a descent."""
        moves = self.stopping.max_iterations > 0 and self.stopping.target is None
        return self.is_free and moves and self.takes_polish and self.floor is None

    @property
    def keeps_altitude(self) -> bool:
        """True if the smallest altitude must not fall."""
        usual = self.is_free and self.metric is None
        return usual if self.keep_height is None else self.keep_height

    @property
    def is_free(self) -> bool:
        """True if nobody prescribed the directions in which vertices move."""
        return isinstance(self.directions, str) and self.directions == default("directions")

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

    @property
    def region_choice(self) -> RegionChoice:
        """The regions as ``domain_of`` takes them."""
        return self.regions if isinstance(self.regions, np.ndarray) else _names(self.regions)

    @cached_property
    def metric_source(self) -> MetricSource | None:
        """The origin of the metric, None without one; a file is read, once."""
        return metric_source(self.metric)

    @property
    def shape_mode(self) -> str:
        """The kind of shape that cells are measured against: the option shape, or "metric"."""
        return self.shape if self.metric is None else "metric"

    def tensors(self, mesh: Mesh) -> np.ndarray | None:
        """(N, k, k) the metric's tensor at each vertex of a mesh, None without one."""
        return None if self.metric_source is None else self.metric_source.tensors(mesh)

    def _vertices(self) -> np.ndarray | None:
        if isinstance(self.vertices, str | Path):
            return read_vertices(Path(self.vertices))
        return None if self.vertices is None else whole_numbers(np.asarray(self.vertices), "vertices")

    def _given(self) -> Sequence[str | np.ndarray]:
        return [self.directions] if isinstance(self.directions, str | np.ndarray) else self.directions

    def domain(self, mesh: Mesh, backend: Backend = NUMPY) -> Domain:
        """The domain of a mesh that is smoothed with these options; backend: what computes."""
        return domain_of(mesh, self.straighten, backend, self.region_choice)

    def record(self) -> dict[str, Any]:
        """The options as JSON-ready data."""
        regions = self.region_choice
        special = {
            "directions": ",".join(d if isinstance(d, str) else f"array{d.shape}" for d in self._given()),
            "vertices": _described(self.vertices),
            "metric": _described(self.metric),
            "regions": _described(regions) if isinstance(regions, np.ndarray) else list(regions),
            "patches": self.takes_patches,
            "polish": self.takes_polish,
            "keep_height": self.keeps_altitude,
        }
        return {
            name: special[name] if name in special else option.record(self._value(name))
            for name, option in OPTIONS.items()
            if option.recorded
        }

    def _value(self, name: str) -> Any:
        return getattr(self if hasattr(self, name) else self.stopping, name)


def check_known(given: Iterable[str]) -> None:
    """Raise UsageError, which tells the nearest name, unless all ``given`` names are options of smoothing."""
    check_names(given, [*_names_of(SmoothOptions), *_names_of(Stopping)])


def _names_of(options: type) -> list[str]:
    return [each.name for each in fields(options) if each.name != "stopping"]


def _names(given: Names) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else tuple(given)


def _described(value: Vertices | None) -> str | None:
    """A value that may be the name of a file, or an array, for a report."""
    if value is None or isinstance(value, str | Path):
        return None if value is None else str(value)
    return f"array{np.shape(value)}"
