"""The choice among engines: a record and a name among the option's values are an engine."""

from dataclasses import replace

import numpy as np
import pytest

import dvr_cli
from dvr_cli.backend import NUMPY
from dvr_cli.errors import UsageError
from dvr_cli.options import OPTIONS
from dvr_cli.relax.engines import choice
from dvr_cli.relax.engines.numpy_engine import NumpyEngine
from meshes import random_mesh


class Counting(NumpyEngine):
    """An engine that only tests know; it counts what it is asked for."""

    asked = 0

    def _relax(self, *batch):
        Counting.asked += 1
        return super()._relax(*batch)


def test_a_new_record_is_an_engine(monkeypatch):
    mesh = random_mesh("triangle", 0)
    cells = [(block.type, block.vertices) for block in mesh.cells]
    with pytest.raises(UsageError, match="engine: unknown 'counting'; known: auto, numpy, numba"):
        dvr_cli.smooth(mesh.points, cells, engine="counting")
    kind = choice.EngineKind("counting", NUMPY, (__name__, "Counting"))
    monkeypatch.setitem(choice.KINDS, kind.name, kind)
    row = OPTIONS["engine"]
    names = replace(row.values, names=(*row.values.names, kind.name))
    monkeypatch.setitem(OPTIONS, "engine", replace(row, values=names))
    points, report = dvr_cli.smooth(mesh.points, cells, engine="counting", max_iterations=2)
    assert Counting.asked > 0
    assert report.engine == "counting"
    assert np.array_equal(
        points, dvr_cli.smooth(mesh.points, cells, engine="numpy", max_iterations=2)[0]
    )  # the same computes
