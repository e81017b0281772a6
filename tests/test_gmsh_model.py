"""The current model of Gmsh is improved in place, on its own geometry."""

import subprocess
import sys

import numpy as np
import pytest

import dvr_cli.gmsh
from dvr_cli.errors import InputError, UsageError
from gmsh_session import gmsh_session


def plate_with_hole(gmsh, size=0.12):
    """A box with a round hole, meshed by Gmsh without its optimiser."""
    occ = gmsh.model.occ
    occ.cut([(3, occ.addBox(0, 0, 0, 1, 1, 0.4))], [(3, occ.addCylinder(0.5, 0.5, -0.1, 0, 0, 1, 0.2))])
    occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.Optimize", 0)
    gmsh.model.mesh.generate(3)


def state(gmsh):
    """Tags and coordinates of all nodes, and all elements, as Gmsh has them."""
    tags, points, _ = gmsh.model.mesh.getNodes()
    types, elements, nodes = gmsh.model.mesh.getElements()
    return tags, points.reshape(-1, 3), [types.tolist(), *(a.tolist() for a in (*elements, *nodes))]


def inverted_after_raising_the_order(gmsh):
    """How many tetrahedra Gmsh finds inverted once edges have nodes in their middles, on the geometry."""
    gmsh.model.mesh.setOrder(2)
    tetrahedra, _ = gmsh.model.mesh.getElementsByType(11)
    return int((gmsh.model.mesh.getElementQualities(tetrahedra, "minSJ") <= 0.0).sum())


def largest_distance(gmsh):
    """The largest distance of a node from where its parameters put it on its curve or surface."""
    largest = 0.0
    for dimension, entity in [*gmsh.model.getEntities(1), *gmsh.model.getEntities(2)]:
        tags, points, parameters = gmsh.model.mesh.getNodes(dimension, entity)
        if len(tags):
            largest = max(largest, np.abs(gmsh.model.getValue(dimension, entity, parameters) - points).max())
    return largest


@pytest.mark.parametrize("boundary", ["fixed", "slide", "project"])
def test_vertices_stay_on_the_geometry_and_the_order_can_be_raised(boundary):
    with gmsh_session() as gmsh:
        plate_with_hole(gmsh)
        tags, points, elements = state(gmsh)
        report = dvr_cli.gmsh.smooth_model(boundary=boundary)
        tags_after, points_after, elements_after = state(gmsh)
        assert report.after.q1 > report.before.q1
        assert elements_after == elements
        assert tags_after.tolist() == tags.tolist()
        assert not np.array_equal(points_after, points)
        assert largest_distance(gmsh) < 1e-12
        assert inverted_after_raising_the_order(gmsh) == 0


def test_without_new_parameters_raising_the_order_inverts_elements():
    with gmsh_session() as gmsh:
        plate_with_hole(gmsh)
        dvr_cli.gmsh.smooth_model(boundary="slide")
        tags, points, _ = state(gmsh)
    with gmsh_session() as gmsh:
        plate_with_hole(gmsh)
        for tag, point in zip(tags, points, strict=True):
            gmsh.model.mesh.setNode(tag, point, [])
        assert inverted_after_raising_the_order(gmsh) > 0


def test_the_report_is_about_the_model_as_it_is():
    with gmsh_session() as gmsh:
        gmsh.model.occ.addSphere(0, 0, 0, 1)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.4)
        gmsh.model.mesh.generate(3)
        report = dvr_cli.gmsh.smooth_model(boundary="project")
        again = dvr_cli.gmsh.smooth_model(boundary="project", max_iterations=0, patches=False, polish=False)
        assert again.before.q1 == pytest.approx(report.after.q1, rel=1e-12)
        [(_, surface)] = gmsh.model.getEntities(2)
        _, points, _ = gmsh.model.mesh.getNodes(2, surface)
        assert np.linalg.norm(points.reshape(-1, 3), axis=1) == pytest.approx(1.0, abs=1e-12)


def test_volumes_are_regions_and_groups_stay():
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        occ.fragment([(3, occ.addBox(0, 0, 0, 1, 1, 1))], [(3, occ.addBox(0, 0, 1, 1, 1, 1))])
        occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [1], 7, "lower")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
        gmsh.model.mesh.generate(3)
        _, points, _ = state(gmsh)
        saved = gmsh.option.getNumber("Mesh.SaveAll")
        dvr_cli.gmsh.smooth_model()
        _, points_after, _ = state(gmsh)
        between = points[:, 2] == 1.0
        assert between.sum() > 8
        assert np.array_equal(points_after[between], points[between])
        assert gmsh.model.getPhysicalName(3, 7) == "lower"
        assert gmsh.option.getNumber("Mesh.SaveAll") == saved


def test_a_mesh_without_geometry_is_smoothed(tmp_path):
    path = str(tmp_path / "plain.msh")
    with gmsh_session(Mesh_SaveAll=1) as gmsh:
        plate_with_hole(gmsh)
        gmsh.write(path)
    with gmsh_session() as gmsh:
        gmsh.open(path)
        report = dvr_cli.gmsh.smooth_model(boundary="slide")
        assert report.after.q1 > report.before.q1


def test_planar_models_are_smoothed():
    with gmsh_session() as gmsh:
        gmsh.model.occ.addDisk(0, 0, 0, 1, 0.7)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.2)
        gmsh.model.mesh.generate(2)
        report = dvr_cli.gmsh.smooth_model(boundary="project")
        assert report.after.q1 > report.before.q1
        assert largest_distance(gmsh) < 1e-12


def test_one_line_says_what_is_wrong():
    with gmsh_session() as gmsh:
        with pytest.raises(InputError, match="has no mesh"):
            dvr_cli.gmsh.smooth_model()
        plate_with_hole(gmsh, 0.5)
        with pytest.raises(UsageError, match="bundary"):
            dvr_cli.gmsh.smooth_model(bundary="slide")
        gmsh.model.mesh.setOrder(2)
        with pytest.raises(InputError, match="second order"):
            dvr_cli.gmsh.smooth_model()
    with pytest.raises(UsageError, match=r"call gmsh\.initialize"):
        dvr_cli.gmsh.smooth_model()


def test_gmsh_is_not_imported_before_it_is_needed():
    code = "import sys, dvr_cli.gmsh; print('gmsh' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "False"
