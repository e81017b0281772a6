"""Pages of HTML: what is in them, and what they do in a browser, which has no network."""

from __future__ import annotations

import hashlib
import io
import json
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

import dvr_cli
from cli_support import BEST, fan, write
from dvr_cli.files.reading import open_mesh
from dvr_cli.quality.cell_measures import measure_field
from dvr_cli.report.plot import COLOURS
from dvr_cli.report.plot_mesh import colour_scale
from meshes import random_mesh
from needs import require, require_program

ROOT = Path(__file__).parents[2]
PATIENCE = 120_000  # milliseconds; other tests may take the cores
VIEWER = ROOT / "dvr_cli" / "report" / "viewer"


class Links(HTMLParser):
    """What a page refers to, and its tags."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.targets: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.targets += [
            value or "" for name, value in attrs if name in ("href", "xlink:href", "src", "srcset")
        ]
        self.targets += [url for _, value in attrs for url in re.findall(r"url\(([^)]*)\)", value or "")]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    playwright = require("playwright.sync_api")
    path = require_program("chromium", "chromium-browser", "google-chrome")
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=path, args=["--no-sandbox"], timeout=PATIENCE)
        yield started
        started.close()


@pytest.fixture
def opened(browser, tmp_path) -> Iterator[Any]:
    """Open a page that a command wrote: nothing but its file is asked for, and nothing goes wrong in it."""
    context = browser.new_context(viewport={"width": 1000, "height": 1200}, offline=True)
    context.set_default_timeout(PATIENCE)
    asked, wrong = [], []

    def open_page(path: Path) -> Any:
        page = context.new_page()
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto(path.as_uri())
        page.wait_for_selector("#view[data-ready]")
        wait_until_drawn(page)
        assert asked == [path.as_uri()]
        return page

    yield open_page
    assert wrong == []
    assert len(asked) == 1
    context.close()


@pytest.fixture
def report(dvr, tmp_path):
    """A report as a page of HTML, of a mesh whose name has to be quoted."""
    path = tmp_path / "report.html"
    source = fan(tmp_path / "a<b>&c.msh")
    result = dvr("smooth", source, tmp_path / "out.msh", "-d", "axis", "--report", path)
    assert result.code == 0
    assert not (tmp_path / "out.quality.json").exists()
    return path, result.err


def test_a_page_needs_nothing_beside_itself(report):
    path, _ = report
    text = path.read_text("utf-8")
    links = Links()
    links.feed(text)
    assert {"svg", "pre", "path", "script"} <= links.tags
    assert not {"link", "iframe", "img", "object", "embed"} & links.tags
    assert links.targets
    assert all(target.startswith(("#", "data:")) for target in links.targets)
    assert "@import" not in text
    assert (VIEWER / "three.LICENSE").read_text("utf-8") in text


def test_a_page_has_the_report_in_words(report):
    path, said = report
    text = path.read_text("utf-8")
    assert "a&lt;b&gt;&amp;c.msh" in text
    assert "a<b>" not in text
    pre = text.split("<pre>")[1].split("</pre>")[0]
    for line in said.splitlines()[3:16]:
        assert line.rstrip() in pre


def test_a_planar_mesh_in_a_browser(report, opened):
    """The colours of the page are those of the mesh and of the lines; an element that is clicked is named."""
    page = opened(report[0])
    pixels = imread(io.BytesIO(page.screenshot(full_page=True)))[..., :3].reshape(-1, 3)

    def share(colour):
        return float((np.abs(pixels - colour).max(axis=1) < 0.02).mean())

    best = colour_scale()(BEST)[:3]  # the quality of all four triangles afterwards
    before = opened_pixels(page.locator(".frame").nth(0))
    after = opened_pixels(page.locator(".frame").nth(1))
    assert all(share(to_rgb(colour)) > 1e-4 for colour in COLOURS[:2])
    assert share((1.0, 1.0, 1.0)) > 0.3
    # afterwards the square is of the best colour but for its lines, before it is not
    inside = (after < 0.99).any(axis=-1)
    assert (np.abs(after[inside] - best).max(axis=1) < 0.02).mean() > 0.8
    assert (np.abs(before - best).max(axis=-1) < 0.02).mean() < 0.1

    box = page.locator(".frame").nth(1).bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + 0.25 * box["height"])
    wait_until_drawn(page)
    said = page.locator(".said").text_content()
    assert said.startswith("triangle 2, mean ratio: before ")
    assert said.endswith(f", after {BEST:.4g}")
    assert page.locator("[name=cut]").count() == 0


def wait_until_drawn(page) -> None:
    """The viewer draws before the next frame, what a slider asks for before the one after it."""
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def opened_pixels(locator) -> np.ndarray:
    """(h, w, 3) what is seen at an element of a page."""
    wait_until_drawn(locator.page)
    return imread(io.BytesIO(locator.screenshot()))[..., :3]


@pytest.fixture
def boxes(dvr, tmp_path):
    """27 hexahedra in the unit cube, each in a box 9 i + 3 j + k of its own, before and after; their page."""
    mesh = random_mesh("hexahedron", 3)
    source = write(tmp_path / "in.vtk", mesh.points, {"hexahedron": mesh.cells[0].vertices})
    output, path = tmp_path / "out.vtk", tmp_path / "page.html"
    run = ["smooth", source, output, "--engine", "numpy", "--plot", path, "--measure", "min-angle"]
    assert dvr(*run, "--no-report", "-d", "axis", "-n", "2").code == 0
    states = [open_mesh(each).mesh for each in (source, output)]
    centroids = [mesh.points[mesh.cells[0].vertices].mean(axis=1) for mesh in states]
    numbers = np.floor(3 * centroids[0]).astype(int) @ (9, 3, 1)
    assert sorted(numbers) == list(range(27))
    angles = [measure_field(mesh, "min-angle", mesh.points)[0] for mesh in states]
    assert (angles[0] != angles[1]).any()
    return path, numbers, centroids, angles


def test_a_volume_mesh_turns_and_is_picked(boxes, opened):
    """The ray through the middle of the cube ends in a known box, also after half a turn by the mouse."""
    path, numbers, _, angles = boxes
    page = opened(path)
    frame, other = (page.locator(".frame").nth(i).bounding_box() for i in (0, 1))

    def click(box, right=0.0):
        page.mouse.click(box["x"] + box["width"] / 2 + right, box["y"] + box["height"] / 2)
        wait_until_drawn(page)
        return page.locator(".said").text_content()

    def told(i, j, k):
        cell = numbers.tolist().index(9 * i + 3 * j + k)
        before, after = (float(f"{each[cell]:.4g}") for each in angles)
        return f"hexahedron {cell}, smallest angle: before {before:g}°, after {after:g}°"

    # from the middle along (.52, -.74, .43) the ray leaves the cube at (.85, 0, .79)
    assert click(frame) == click(other) == told(2, 0, 2)
    assert page.locator(".ring:not([hidden])").count() == 2
    shown = opened_pixels(page.locator(".frame").nth(1))

    # a drag by the height of a pane is a whole turn; the other pane turns along: (-.52, .74, .43)
    x, y = frame["x"] + 50, frame["y"] + 50
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 100, y)
    page.mouse.move(x + page.locator(".frame").nth(0).evaluate("frame => frame.clientHeight") / 2, y)
    page.mouse.up()
    assert click(other) == click(frame) == told(0, 2, 2)
    assert (opened_pixels(page.locator(".frame").nth(1)) != shown).any(axis=-1).mean() > 0.05

    # beside the cube there is nothing
    assert click(frame, right=0.49 * frame["width"]).startswith("Drag to turn")
    assert page.locator(".ring:not([hidden])").count() == 0


def test_a_volume_mesh_is_cut_and_its_worst_elements_are_gone_to(boxes, opened):
    path, _, centroids, angles = boxes
    page = opened(path)
    expect = require("playwright.sync_api").expect

    def assert_shown(*masks):
        for i, mask in enumerate(masks):
            text = f"{int(mask.sum())} of 27 elements shown"
            expect(page.locator(".shown").nth(i)).to_have_text(text, timeout=PATIENCE)

    everything = np.ones(27, dtype=bool)
    assert_shown(everything, everything)
    triangles = page.locator(".frame").nth(0).get_attribute("data-triangles")
    assert triangles == str(2 * 6 * 9)
    # the direction that hides is the one towards the viewer: x > 0.4, but y < 1 - 0.4
    page.locator("[name=cut]").fill("400")
    assert_shown(*(each[:, 0] <= 0.4 for each in centroids))
    page.select_option("[name=axis]", "y")
    assert_shown(*(each[:, 1] >= 0.6 for each in centroids))
    page.locator("[name=cut]").fill("1000")
    assert_shown(everything, everything)

    # the scale goes from the best angle to the one that a hundredth is below
    worst, best = min(np.quantile(each, 0.01) for each in angles), max(each.max() for each in angles)
    page.locator("[name=limit]").fill("500")
    assert_shown(*(each <= (worst + best) / 2 for each in angles))
    assert page.locator(".limit").text_content() == f"{float(f'{(worst + best) / 2:.4g}'):g}°"
    page.locator("[name=reset]").click()
    assert_shown(everything, everything)

    for i, each in enumerate(angles):
        listed = page.locator(".pane").nth(i).locator("li button")
        order = np.argsort(each, kind="stable")[:10]
        assert [int(button.get_attribute("data-cell")) for button in listed.all()] == order.tolist()
        listed.nth(3).click()
        wait_until_drawn(page)
        assert page.locator(".said").text_content().startswith(f"hexahedron {order[3]}, ")
        pane, ring = (page.locator(kind).nth(i).bounding_box() for kind in (".frame", ".ring"))
        for place, extent in (("x", "width"), ("y", "height")):
            assert ring[place] + ring[extent] / 2 == pytest.approx(pane[place] + pane[extent] / 2, abs=2.0)
        # what lies before it is cut away
        toward = np.array([0.52, -0.74, 0.43])
        assert_shown(*[hidden @ toward <= centroids[i][order[3]] @ toward + 1e-4 for hidden in centroids])


def test_a_surface_in_a_browser(dvr, tmp_path, opened):
    """A tent of two triangles in space, and inverted elements apart: there are none on a surface."""
    path = tmp_path / "page.html"
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 1], [1, 2, 0], [0, 2, 0]]
    source = write(tmp_path / "tent.vtk", points, {"quad": [[0, 1, 2, 3], [3, 2, 4, 5]]})
    assert dvr("report", "quality", source, "--plot", path).code == 0
    page = opened(path)
    quality = dvr_cli.quality_report(*tent(source)).quality.elements
    told = f"{float(f'{quality[0]:.4g}'):g}"
    box = page.locator(".frame").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2 + 20)
    wait_until_drawn(page)
    assert page.locator(".said").text_content() == f"quad 0, mean ratio: tent.vtk {told}"
    page.locator("[name=cut]").fill("0")
    page.wait_for_function("document.querySelector('.shown').textContent === '0 of 2 elements shown'")


def tent(source):
    mesh = open_mesh(source).mesh
    return mesh.points, [(block.type, block.vertices) for block in mesh.cells]


def test_the_viewer_is_the_one_that_documents_name():
    """Version and checksum in docs/design.md are those of the recipe and of the file it makes."""
    text = " ".join((ROOT / "docs" / "design.md").read_text("utf-8").split())
    library = (VIEWER / "three.min.js").read_bytes()
    recipe = json.loads((ROOT / "viewer" / "package.json").read_text("utf-8"))
    assert f"three.js {recipe['devDependencies']['three']}" in text
    assert f"esbuild {recipe['devDependencies']['esbuild']}" in text
    assert hashlib.sha256(library).hexdigest() in text
    assert len(library) < 600_000
    assert "</script" not in library.decode() + (VIEWER / "viewer.js").read_text("utf-8")
