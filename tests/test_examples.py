"""The paper's experiments, as small versions of the examples: its claims hold, and figures are drawn."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from dvr_cli.quality.vector import at_least
from needs import require

require("matplotlib")
require("scipy")

EXAMPLES = Path(__file__).parents[1] / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("fig*.py"))


@pytest.fixture(scope="module")
def small():
    """The result of an example's small version, computed once, and its module."""
    done = {}

    def run(name):
        if name not in done:
            module = import_module(name)
            done[name] = module, module.experiment(small=True)
        return done[name]

    return run


def test_one_vertex(small):
    """Fig. 4: optima at λ = 0.25 and 0.125; 0.65 and 0.90 become 0.80 both. Fig. 1: each move helps."""
    _, moves = small("fig01_04_one_vertex")
    first, second = moves["Fig. 1, first"], moves["Fig. 1, second"]
    assert first.before.min() < first.after.min() == pytest.approx(second.before.min())
    assert second.before.min() < second.after.min()
    assert moves["Fig. 4a"].step == pytest.approx(0.25, abs=5e-4)
    assert moves["Fig. 4b"].step == pytest.approx(0.125, abs=5e-4)
    assert moves["Fig. 4b"].before == pytest.approx([0.65, 0.90], abs=5e-4)
    assert moves["Fig. 4b"].after == pytest.approx([0.80, 0.80], abs=5e-4)
    steps = np.linspace(-0.6, 0.6, 1201)
    for move in moves.values():
        assert move.curves(steps).min(axis=1).max() <= move.after.min() + 1e-12


def test_random_triangles(small):
    """Fig. 6: Q1 grows by factors exceeding 80 in all trials, and from 10 to 50 sweeps still."""
    _, result = small("fig06_random_triangles")
    assert result.factors.min() > 80
    assert len(result.vectors[0]) == 86
    assert at_least(result.vectors[50], result.vectors[10])
    assert at_least(result.vectors[10], result.vectors[0])
    # better shaped triangles are sacrificed for the worst ones
    assert (result.vectors[50] < result.vectors[10]).any()


def test_random_tetrahedra(small):
    """Fig. 7: relaxing improves the mesh in every trial, Laplacian smoothing makes it worse."""
    _, result = small("fig07_random_tetrahedra")
    assert len(result.before) == 135
    assert (result.trials[:, 0] > 10 * result.before[0]).all()
    assert result.laplacian[0] < result.before[0]


def test_collection(small):
    """Fig. 8 and 9: the poorest quality improves in all meshes, by a factor of two at least."""
    require("gmsh")
    _, results = small("fig08_09_collection")
    assert len(results) == 5
    for one in results:
        assert one.after[0] > 2 * one.before[0] > 0, one.name


def test_time(small):
    """Fig. 10: as many tetrahedra around a vertex whatever the size, which makes a sweep linear."""
    _, timings = small("fig10_time")
    relaxed = [one.relaxed for one in timings]
    assert relaxed == sorted(relaxed)
    assert relaxed[-1] > 4 * relaxed[0]
    rings = [one.ring for one in timings]
    assert max(rings) < 1.2 * min(rings)


def test_orders(small):
    """Fig. 11: the order matters little: no component of the quality vectors differs by more than 15 %."""
    _, results = small("fig11_orders")
    for one in results:
        assert len({vector.tobytes() for vector in one.shuffled}) == len(one.shuffled)
        assert one.natural[0] > 10 * one.before[0]
        np.testing.assert_allclose(one.shuffled, np.broadcast_to(one.natural, one.shuffled.shape), rtol=0.15)


def test_mesh_motion(small):
    """Fig. 12: both approach the mesh of equilateral triangles, along circles in far fewer sweeps."""
    _, runs = small("fig12_mesh_motion")
    assert all(run.q1[-1] >= 0.95 for run in runs.values())
    assert len(runs["axis"].q1) - 1 >= 2 * (len(runs["circumferential"].q1) - 1)


def test_boundary_motion(small):
    """Fig. 13: inverted elements are made positive and the mesh straightened, sooner with circles."""
    _, runs = small("fig13_boundary_motion")
    for run in runs.values():
        assert run.q1[0] < 0 < run.q1[-1]
    axis, circles = runs["axis"], runs["circumferential,radial"]
    assert min(axis.q1[-1], circles.q1[-1]) >= 0.95
    assert len(circles.q1) < 0.75 * len(axis.q1)


def test_evolving_domain(small):
    """Fig. 14: all meshes conform and are valid with all qualities above 0.5, much as the domain changes."""
    _, meshes = small("fig14_15_evolving_domain")
    assert all(mesh.minimum > 0.5 for mesh in meshes)
    assert any(mesh.q1_projected < 0 for mesh in meshes)
    assert all(mesh.distance < 1e-12 for mesh in meshes)
    for mesh in meshes:
        size = np.linalg.norm(mesh.background[mesh.triangles[0, 0]] - mesh.background[mesh.triangles[0, 1]])
        assert np.linalg.norm(mesh.points - mesh.background, axis=1).max() < 2 * size
    area, expected = [enclosed(mesh.nodes) for mesh in meshes], 2 * np.pi * 0.016
    assert area[0] - area[-1] == pytest.approx(expected, rel=0.03)  # curve shortening: dA/dt = -2π


def enclosed(nodes):
    """The area in a closed polygon."""
    x, y = nodes.T
    return 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))


@pytest.mark.parametrize("name", NAMES)
def test_figures(small, name, tmp_path):
    """Each is drawn from the small version without a complaint, and stands in the gallery and its folder."""
    if name == "fig08_09_collection":
        require("gmsh")
    module, result = small(name)
    module.draw(result).savefig(tmp_path / "figure.png", dpi=40)
    assert (tmp_path / "figure.png").stat().st_size > 5000
    gallery = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    assert f"figures/{name}.png" in gallery
    assert f"{name}.py" in gallery
    assert (EXAMPLES / "figures" / f"{name}.png").stat().st_size < 300_000
