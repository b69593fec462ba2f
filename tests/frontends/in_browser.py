"""Decals in a real browser, served by trame, as a program.

    python -m tests.frontends.in_browser NAME [firefox]

Firefox needs a display, such as that of ``xvfb-run -a``; `touch` is for Chromium alone, and `sandbox` has no
fingers there.
``page``, ``sandbox``, ``panels``, ``snowman``, ``lab`` and ``touch`` take a path behind their name, where
they save the picture of their page of docs.
"""

import asyncio
import io
import re
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any
from unittest.mock import patch
from urllib.parse import urlsplit

import numpy as np
import pytest
import pyvista as pv
from PIL import Image
from playwright.async_api import Page, expect
from trame.app import get_server
from trame.ui.vuetify3 import VAppLayout
from trame_pyvista.widgets import PyVistaRCAView, PyVistaRemoteView
from trame_server.core import Server

import decals
from blobtree import Point
from blobtree.nodes.paths import node_at
from decals.apps.lab.lesson import LESSONS, load_lessons, shown
from decals.apps.lab.page import LabPage
from decals.apps.models.scenes import empty_scene
from decals.apps.sandbox.page import Page as SandboxPage
from decals.apps.sandbox.view import StreamedView
from decals.editing.recovery import AUTOSAVE_SECONDS
from decals.editing.scatter_commands import decals_on
from decals.scenes.camera import UPRIGHT
from decals.scenes.objects import bounds_of
from decals.window import EditWindow, notebook
from tests.apps.lab.answers import ANSWERS, STEP
from tests.decals.editing.scenes import digest, scene, tree_of
from tests.decals.vtk.scenes import both
from tests.decals.window.driver import Driver
from tests.frontends import page as docs
from tests.frontends.browsing import (
    CHOSEN,
    LOSS,
    PATIENCE,
    PICTURE,
    drag,
    drawn,
    opened,
    point,
    pull,
    seen,
    served,
    shows,
    trace,
    until,
    violations,
)
from tests.oracles.contact import RIM, falloff, pressed_away

SCROLLED_TWICE = """() => {
  const scrolls = (e) =>
    e.scrollHeight > e.clientHeight + 1 && /auto|scroll/.test(getComputedStyle(e).overflowY);
  const areas = [...document.querySelectorAll("*")].filter(scrolls);
  return areas.filter((e) => areas.some((other) => other !== e && other.contains(e))).map((e) => e.className);
}"""
"""Classes of areas that scroll inside others."""

BLOB = Point((0, 0, 0), radius=1.0) + Point((1.2, 0.4, 0), radius=0.6)
DEFINED = "getComputedStyle(document.activeElement, '::after').content"
"""The definition that the page shows of the symbol with the focus."""
EMPTY = empty_scene(["scale"], UPRIGHT["y"])
BARE = decals.Scene(objects=(), camera=decals.Camera((0, 0, 8)))
"""A scene without objects, in whose place a lesson comes."""
WIDE = 1280, 800
"""Size of a laptop's window."""
COLD = 400
"""Seconds: lesson 6 compiles kernels of solids in contact, where the cache has none."""
NUMBERS = count()
"""Of servers, which trame finds by their names."""


@asynccontextmanager
async def sandboxed(
    scene: decals.Scene,
    file: Path | None = None,
    *,
    size: tuple[int, int] = WIDE,
    touch: bool = False,
    kind: Any = SandboxPage,
    **options: Any,
) -> AsyncIterator[tuple[Page, Any, EditWindow]]:
    """A page of the sandbox in a browser, with its window, on a scene; its files lie beside `file`."""
    server = get_server(f"sandbox {next(NUMBERS)}", client_type="vue3")
    if file is not None:
        options["folder"] = file.parent
    with EditWindow(scene, path=file, plotter=pv.Plotter(off_screen=True)) as window:
        window.show()
        sandbox_page = kind(server, window, **options)
        async with served(server, size=size, guard=sandbox_page.guard, touch=touch) as browser:
            yield browser, sandbox_page, window


async def show_all(browser: Page, window: EditWindow) -> None:
    """Let the view hold all of the scene, and wait until the browser shows that."""
    window.subplot.vtk_renderer.ResetCamera()
    window.redraw(whole=True)
    await shows(browser, window.plotter)


async def page(picture: str | None = None) -> None:
    """The app of the page: decals are seen as the plotter draws them, turned, grown and resized."""
    session: dict[str, Any] = {"__name__": "__main__"}
    with patch.object(Server, "start"):
        exec(compile(docs.code("browser"), "pyvista.md", "exec"), session)
    plotter, scale = session["pl"], session["scene"].decals.radii[0]
    async with served(session["server"]) as browser:
        first = await shows(browser, plotter)
        assert covered(first).mean() > 0.1
        if picture is not None:
            image = Image.open(io.BytesIO(await browser.screenshot())).convert("RGB")
            image.quantize(256).save(picture, optimize=True)
        position = plotter.camera.position
        await drag(browser, plotter, (40, 40), (80, 60), (140, 70))
        await until(lambda: plotter.camera.position != position)
        turned = await shows(browser, plotter)
        assert np.abs(turned - first).mean() > 2
        slider = browser.get_by_role("slider")
        for _ in range(4):
            await slider.press("ArrowLeft")
        await until(lambda: np.isclose(plotter.decals.scene.decals.radii[0], 0.6 * scale))
        smaller = await shows(browser, plotter)
        assert np.abs(smaller - turned).mean() > 2
        await browser.set_viewport_size({"width": 420, "height": 300})
        await until(lambda: plotter.window_size == [420, 240])
        assert (await shows(browser, plotter)).shape == (240, 420, 3)


def covered(picture: np.ndarray) -> np.ndarray:
    """Return True for pixels that differ from the background."""
    differs: np.ndarray = np.abs(picture - picture[0, 0]).max(axis=-1) > 8
    return differs


async def user() -> None:
    """A click selects a decal, a drag moves it, keys undo that: the first picture comes back.

    Decals are scattered in the background, and the page shows them when they are done.
    """
    plotter = pv.Plotter(off_screen=True)
    server = get_server("user", client_type="vue3")
    page = {"VAppLayout": VAppLayout, "PyVistaRemoteView": PyVistaRemoteView}
    page |= {"scene": scene(), "pl": plotter, "server": server}
    exec(compile(docs.code("editing"), "pyvista.md", "exec"), page)
    window = page["window"]
    driver = Driver(window)
    async with served(server) as browser:
        first, state = await shows(browser, plotter), driver.state
        number, at = next(driver.visible())
        await drag(browser, plotter, at)
        await until(lambda: window.actions.state.selection == (number,))
        await drag(browser, plotter, at, (at[0] + 6, at[1]), (at[0] + 20, at[1] + 6))
        await until(lambda: driver.session.labels == ("move",) and not window.tools.dragging)
        moved = await shows(browser, plotter)
        assert np.abs(moved - first).mean() > 0.5
        await browser.keyboard.press("Control+z")
        await until(lambda: driver.state == state)
        await browser.keyboard.press("Escape")
        await until(lambda: window.actions.state.selection == ())
        np.testing.assert_array_equal(await shows(browser, plotter), first)
        await scattering(browser, window, driver)
    window.close()
    await asyncio.sleep(0)
    assert not [task for task in asyncio.all_tasks() if "EditWindow" in task.get_name()]


async def scattering(browser: Page, window: EditWindow, driver: Driver) -> None:
    """Keys act where the pointer is, also where it went without a button."""
    on_tree = set(decals_on(window.document, [0]).tolist())
    number, at = next((number, at) for number, at in driver.visible() if number in on_tree)
    await point(browser, window.plotter, at)
    await browser.keyboard.press("g")
    await until(lambda: driver.session.labels == ("scatter",) and not window.busy)
    assert number not in window.document.decals.numbers
    picture = drawn(window.plotter)  # draws nothing: the last frame was a whole one
    async with asyncio.timeout(PATIENCE):
        while np.abs(await seen(browser) - picture).mean() > LOSS:
            await asyncio.sleep(0.1)
    await browser.keyboard.press("Shift+N")
    await until(lambda: len(window.document.objects) == 3)
    assert driver.session.labels[-1] == f"add {window.document.objects[2].name}"


async def streamed() -> None:
    """trame-rca's view, which pyvista takes too: decals are seen, and turned."""
    plotter = pv.Plotter(off_screen=True)
    plotter.decals.add_scene(both(), camera=True)
    server = get_server("streamed", client_type="vue3")
    with VAppLayout(server, full_height=True):
        view = PyVistaRCAView(plotter, style="width: 100%; height: 100%")
    async with served(server) as browser:
        first = await shows(browser, view.plotter)
        await drag(browser, plotter, (40, 40), (80, 60), (140, 70))
        await until(lambda: np.abs(drawn(plotter) - first).mean() > 2)
        turned = await shows(browser, plotter)
        plotter.add_on_render_callback(lambda _: view.render())
        bare = both().replace(decals=both().decals[:0])
        plotter.decals.scene = bare
        plotter.render()
        assert np.abs(await shows(browser, plotter) - turned).mean() > 2


async def sandbox(picture: str | None = None) -> None:
    """A user of the sandbox builds, changes and undoes a model, and sees each step."""
    requests: list[str] = []

    def normal() -> Any:
        plane = sandbox_page.sandbox.display.options.slice
        return plane and plane.normal

    async with sandboxed(decals.cover(BLOB, count=60, images=["tile"])) as (browser, sandbox_page, window):
        plotter, state = window.plotter, digest(window.document)
        browser.on("request", lambda request: requests.append(request.url))
        first = await shows(browser, plotter)
        await browser.evaluate("document.querySelector('#app').innerHTML = ''")  # as trame's page, if late
        await expect(browser.locator("[role=application]")).to_be_visible()
        await browser.get_by_text("Point").nth(1).click()
        await until(lambda: window.actions.state.primitive == (0, (1,)))
        for _ in range(3):
            await browser.get_by_role("slider", name="radius").press("ArrowRight")
        await until(lambda: set(window.session.labels) == {"set radius"} and not window.session.stroke_open)
        slid = window.session.labels
        assert np.abs(await shows(browser, plotter) - first).mean() > 0.5
        for key, labels in (("z", slid[:-1]), ("y", slid)):  # the pointer is not over the view
            await browser.get_by_role("slider", name="radius").press(f"Control+{key}")
            await until(lambda labels=labels: window.session.labels == labels)  # type: ignore[misc]
        await by_keys(browser)
        await moves(browser)
        await clicks(browser, window)
        await hovers(browser, window)
        await browser.get_by_role("button", name="Add", exact=True).click()
        groups = browser.locator(".v-overlay--active .v-list-subheader")
        await groups.get_by_text("basic").wait_for()
        assert await groups.count() > 5
        await browser.get_by_label("search in primitives").fill("TORUS:")
        await expect(groups).to_have_count(1)
        kinds = browser.locator(".v-overlay--active .v-list-item-title")
        await expect(kinds).to_have_count(1)
        await kinds.get_by_text("Torus", exact=True).hover()
        await expect(browser.locator(".hovered line")).to_have_count(12)
        ghost = np.array(sandbox_page.sandbox.values()["hovered"]["lines"])
        await kinds.get_by_text("Torus", exact=True).click()
        await until(lambda: window.session.labels[-1:] == ("add Torus",))
        await expect(browser.locator(".hovered line")).to_have_count(0)  # though the mouse rests
        sandbox_page.sandbox.hover("0/2")
        np.testing.assert_allclose(sandbox_page.sandbox.values()["hovered"]["lines"], ghost, atol=1e-3)
        sandbox_page.sandbox.hover("")
        await placed(browser, window)
        field = browser.get_by_role("textbox", name="ring radius")
        await field.fill("0.6")
        await field.press("Enter")
        await until(lambda: window.session.labels[-1:] == ("set ring_radius",))
        await browser.get_by_text(
            "set ring_radius", exact=True
        ).first.wait_for()  # the field has its value back
        if picture is not None:
            await show_all(browser, window)
            await save_picture(browser, Path(picture))
        await browser.get_by_role("textbox", name="ring radius").fill("-1")
        await browser.get_by_role("textbox", name="ring radius").press("Enter")
        await until(lambda: "expected a number above 0" in sandbox_page.sandbox.status)
        await expect(browser.get_by_role("textbox", name="ring radius")).to_have_value("0.6")
        await browser.locator(".cube polygon").filter(has_text=re.compile("^right view")).click()
        await until(lambda: np.allclose(plotter.camera.direction, (-1, 0, 0), atol=1e-6))
        await browser.get_by_role("button", name="View", exact=True).click()
        await choose(browser, "slice", "y")
        await browser.keyboard.press("Escape")
        await until(lambda: normal() is not None)
        before = normal()
        await pull(browser, await at_rest(browser, sandbox_page, "tilt slice"), (32, -28), steps=1)
        await until(lambda: not np.allclose(normal(), before))
        cut = sandbox_page.sandbox.display.options.slice
        await pull(browser, await at_rest(browser, sandbox_page, "slice"), (20, -20), steps=1)
        await until(lambda: sandbox_page.sandbox.display.options.slice != cut)
        assert np.allclose(normal(), cut.normal if cut else 0.0)
        distance = plotter.camera.distance
        if CHOSEN.get() == "chromium":
            await fingers(browser, [(-40, 0), (40, 0)], [(-60, 0), (60, 0)], [(-80, 0), (80, 0)])
            await until(lambda: np.isclose(plotter.camera.distance, 0.5 * distance, rtol=0.02))
        await browser.get_by_text("Start", exact=True).click()
        await until(lambda: digest(window.document) == state)
        await until(lambda: window.session.undone_labels == (*slid, "add Torus", "set ring_radius"))
        assert all("127.0.0.1" in url for url in requests)


async def clicks(browser: Page, window: EditWindow) -> None:
    """Clicks at one place of the view select a decal, its primitive and the sum, and rows follow."""
    state, rows = window.actions.state, browser.locator(".v-list-item--active")
    number, at = next(Driver(window).visible())
    await drag(browser, window.plotter, at)
    await until(lambda: state.selection == (number,) and state.primitive is None)
    for name, depth in (("Point", 1), ("Sum", 0)):
        await drag(browser, window.plotter, at)
        await until(lambda depth=depth: state.primitive is not None and len(state.primitive[1]) == depth)  # type: ignore[misc]
        await rows.get_by_text(name, exact=True).wait_for()
        assert state.selection == ()
    await drag(browser, window.plotter, (4, 4))
    await until(lambda: state.primitive is None)
    await browser.get_by_text("Point").nth(1).click()
    await until(lambda: state.primitive == (0, (1,)))


async def moves(browser: Page) -> None:
    """During a drag the view gets each place of the pointer once, in Chromium before the next frame."""
    view = browser.locator("[role=application]")
    box = await view.bounding_box()
    assert box is not None
    await view.evaluate("""view => {
      window.moves = [];
      const moved = event => window.moves.push([event.clientX, event.isTrusted]);
      view.addEventListener("pointermove", moved, true);
      window.watched = () => (view.removeEventListener("pointermove", moved, true), window.moves);
    }""")
    left = round(box["x"]) + 4
    places = [left + 3 * step for step in (*range(7), *range(5, -1, -1))]  # and back: the view stays
    await browser.mouse.move(places[0], box["y"] + 4)
    await browser.mouse.down()
    for x in places[1:]:
        await asyncio.sleep(0.05)
        await browser.mouse.move(x, box["y"] + 4)
    await asyncio.sleep(0.1)
    await browser.mouse.up()
    seen_moves = await browser.evaluate("window.watched()")
    assert [x for x, _ in seen_moves][-len(places) + 1 :] == places[1:]
    if CHOSEN.get() == "chromium":
        assert sum(not trusted for _, trusted in seen_moves) >= 6


async def hovers(browser: Page, window: EditWindow) -> None:
    """Nodes are added by Shift in the view; rows light up with places, and places with rows."""
    state, lit = window.actions.state, browser.locator(".lit")
    places = {}
    for _, at in Driver(window).visible():
        pick = window.tools.at(*at)
        assert pick is not None
        places[window.actions.trees.nodes_at(pick)[0]] = at
    at, there = places[0, (0,)], places[0, (1,)]
    await point(browser, window.plotter, at)
    await lit.get_by_text("Point").wait_for()
    await lit.get_by_text("layer 0").wait_for()
    await point(browser, window.plotter, (4, 4))
    await lit.first.wait_for(state="detached")
    await browser.get_by_text("Point").nth(1).hover()
    await expect(browser.locator(".hovered line")).to_have_count(12)
    await browser.get_by_text("layer 0").hover()
    await browser.locator(".hovered circle").first.wait_for()
    await browser.get_by_role("button", name="tile", exact=True).hover()
    await expect(browser.locator(".hovered [marker-end='url(#top)']").first).to_be_attached()
    await browser.get_by_text("Point").nth(0).click()
    await until(lambda: state.nodes == ((0, (0,)),))
    rows = browser.locator("[data-roving] .v-list-item--active")
    await expect(rows).to_have_count(1)
    await browser.keyboard.down("Shift")
    await drag(browser, window.plotter, there)
    await browser.keyboard.up("Shift")
    await until(lambda: state.nodes == ((0, (0,)), (0, (1,))))
    await expect(rows).to_have_count(2)
    await browser.keyboard.down("Control")
    await drag(browser, window.plotter, at)
    await browser.keyboard.up("Control")
    await until(lambda: state.nodes == ((0, (1,)),))


async def placed(browser: Page, window: EditWindow) -> None:
    """A kind is placed and sized by the mouse, which shows its shape before; it can be left, and undone."""
    labels, (_, at) = window.session.labels, next(Driver(window).visible())
    leave = browser.get_by_role("button", name="Leave", exact=True)
    for left in (partial(browser.keyboard.press, "Escape"), leave.click, None):
        await browser.get_by_role("button", name="Add", exact=True).click()
        await browser.get_by_label("search in primitives").fill("cone")
        await browser.get_by_title("place a Cone by the mouse").click()
        await browser.get_by_text("Click where the Cone goes").wait_for()
        await point(browser, window.plotter, at)
        await expect(browser.locator(".hovered line").nth(12)).to_be_attached()
        if left:
            await left()
            await browser.get_by_text("Click where the Cone goes").wait_for(state="detached")
        else:
            await drag(browser, window.plotter, at, (at[0] + 20, at[1]), (at[0] + 140, at[1]))
            await expect(browser.locator(".hovered line")).to_have_count(0)
    await until(lambda: window.session.labels == (*labels, "add Cone"))
    await until(lambda: not window.background.busy)
    low, high = node_at(tree_of(window.document), window.actions.state.primitive[1]).bounds  # type: ignore[index]
    box = bounds_of(window.document.objects)
    assert (high - low).max() > 0.15 * (box[1] - box[0]).max()  # a click makes a tenth
    await browser.keyboard.press("Control+z")
    await until(lambda: window.session.labels == labels)
    await browser.get_by_text("Torus", exact=True).first.click()


async def fingers(browser: Page, *places: Sequence[tuple[float, float]]) -> None:
    """Put fingers on the view one after the other, and move them; places count from its middle, in pixels."""
    box = await browser.locator(PICTURE).first.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    touch = await browser.context.new_cdp_session(browser)
    steps = [[{"x": x + a, "y": y + b, "id": n} for n, (a, b) in enumerate(place)] for place in places]
    begun = [("touchStart", steps[0][: n + 1]) for n in range(len(steps[0]))]
    for kind, points in [*begun, *(("touchMove", step) for step in steps[1:]), ("touchEnd", [])]:
        await touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        await asyncio.sleep(0.1)


REACHED = """button => {
  const box = button.getBoundingClientRect();
  const at = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
  const inside = box.x >= 0 && box.y >= 0 && box.right <= innerWidth && box.bottom <= innerHeight;
  return inside && button.contains(at) && Math.min(box.width, box.height) >= 24;
}"""
"""True for a button that a finger reaches: it lies in the window, and nothing above it."""


async def touch(picture: str | None = None) -> None:
    """On a phone and on a tablet, fingers reach everything, drag decals, and turn, zoom and move the view.

    They draw the outline of a guess too.
    """
    for name, size in (("phone", (390, 844)), ("tablet", (820, 1180))):
        await on_device(name, size, picture if name == "phone" else None)
        lessons = load_lessons(LESSONS)
        page = sandboxed(BARE, size=size, touch=True, kind=LabPage, lessons=lessons, begin=1)
        async with page as (browser, lab_page, _):
            await guess(browser, lab_page, finger=True)


async def on_device(name: str, size: tuple[int, int], picture: str | None = None) -> None:
    """What a user does with fingers on a screen of a size."""
    file = Path(tempfile.mkdtemp()) / "a-scene-with-a-long-name.json"
    scene = decals.cover(BLOB, count=60, images=["tile"])
    async with sandboxed(scene, file, size=size, touch=True) as (browser, _, window):
        await shows(browser, window.plotter)
        await reachable(browser)
        await by_fingers(browser, window)
        if picture is not None:
            await show_all(browser, window)
            image = Image.open(io.BytesIO(await browser.screenshot())).convert("RGB")
            image.save(picture, quality=80, optimize=True)
        for side, row in (("left", "Point"), ("right", "Scattering")):
            shown = browser.get_by_role("button", name=row, exact=True).first
            if name == "phone":
                await browser.get_by_label(f"{side} panel").first.tap()
            await browser.wait_for_function(REACHED, arg=await shown.element_handle())  # panels slide
            if side == "left":
                await shown.tap()
                await until(lambda: window.actions.state.primitive == (0, (0,)))
            if name == "phone":
                await browser.get_by_label(f"{side} panel").first.tap()
        await browser.get_by_role("button", name=re.compile("^delete the selected")).tap()
        await until(lambda: window.session.labels[-1:] == ("remove a primitive",))
        await browser.get_by_role("button", name="undo").first.tap()
        await until(lambda: window.session.undone_labels == ("remove a primitive",))
        await browser.get_by_role("button", name=re.compile("^save")).first.tap()
        await until(file.exists)
        await browser.get_by_role("button", name=re.compile("^show this help")).tap()
        await browser.get_by_text("Page up", exact=True).wait_for()
        await accessible(browser)


async def reachable(browser: Page) -> None:
    """Make sure that fingers reach all buttons of the toolbar, that no name is cut, and nothing scrolls."""
    buttons = await browser.locator(".toolbar button:visible").all()
    missed = [await one.get_attribute("aria-label") for one in buttons if not await one.evaluate(REACHED)]
    assert (len(buttons), missed) == (27, [])
    assert await browser.evaluate("document.documentElement.scrollWidth <= innerWidth")
    cut = "name => name.scrollHeight > name.clientHeight + 1 || name.scrollWidth > name.clientWidth"
    assert not await browser.locator(".toolbar h1").evaluate(cut)


async def by_fingers(browser: Page, window: EditWindow) -> None:
    """One finger selects and drags a decal; two turn and zoom the view, and three move it."""
    plotter, driver = window.plotter, Driver(window)
    camera, (width, height) = plotter.camera, plotter.window_size
    number, at = min(
        driver.visible(), key=lambda one: abs(one[1][0] - width / 2) + abs(one[1][1] - height / 2)
    )
    place = at[0] + 0.5 - width / 2, height / 2 - at[1] - 0.5
    await fingers(browser, [place])
    await until(lambda: window.actions.state.selection == (number,))
    await fingers(browser, [place], [(place[0] + 6, place[1])], [(place[0] + 20, place[1])])
    await until(lambda: window.session.labels == ("move",) and not window.tools.dragging)
    before = digest(window.document)
    target, direction, distance = camera.focal_point, np.array(camera.direction), camera.distance
    await fingers(browser, *([(-40 + x, 0), (40 + x, 0)] for x in (0, 20, 40)))
    turned = np.degrees(np.arccos(np.array(camera.direction) @ direction))
    assert 0.5 * 200 * 40 / height < turned < 1.5 * 200 * 40 / height
    np.testing.assert_allclose(camera.focal_point, target)
    direction = np.array(camera.direction)
    await fingers(browser, *([(-x, 0), (x, 0)] for x in (40, 60, 80)))
    await until(lambda: np.isclose(camera.distance, 0.5 * distance, rtol=0.02))
    await fingers(browser, *([(-40, y), (40, y), (0, y + 40)] for y in (0, 20, 40)))
    assert not np.allclose(camera.focal_point, target)
    np.testing.assert_allclose(camera.direction, direction, atol=1e-6)
    assert digest(window.document) == before


async def by_keys(browser: Page) -> None:
    """Arrows lead through the toolbar and the outline, and few steps of Tab from there to the fields."""

    async def focused() -> str:
        return str(
            await browser.evaluate("document.activeElement.ariaLabel ?? document.activeElement.innerText")
        )

    await browser.get_by_role("button", name="File", exact=True).focus()
    for key, name in (("ArrowRight", "View"), ("ArrowLeft", "File"), ("Tab", "Point"), ("ArrowUp", "Point")):
        await browser.keyboard.press(key)
        assert (await focused()).strip().lower() == name.lower()
    await browser.keyboard.press("ArrowRight")
    assert await focused() == "hide Point"
    steps = 0
    while await focused() != "center 1":
        await browser.keyboard.press("Tab")
        assert (steps := steps + 1) < 14


async def keyboard() -> None:
    """With keys alone a user adds, places, resizes, removes, undoes, scatters and saves, from the start."""
    file = Path(tempfile.mkdtemp()) / "scene.json"
    async with sandboxed(EMPTY, file, start=True) as (browser, _, window):
        press, toolbar = browser.keyboard.press, partial(browser.get_by_role, "button", exact=True)

        async def tab_to(what: str, key: str = "Tab") -> None:
            """Press Tab until something is true of the element `e` with the focus."""
            steps = 0
            while not await browser.evaluate(f"(e => {what})(document.activeElement)"):
                await press(key)
                assert (steps := steps + 1) < 60, what

        async def add(sought: str, *keys: str) -> None:
            """Add what a search finds, from the toolbar, which has the focus before and after."""
            entries = len(window.session.labels)
            await press("Enter")
            await expect(browser.get_by_label("search in primitives")).to_be_focused()
            await browser.keyboard.type(sought)
            for key in (*keys, "Enter"):
                await press(key)
            await until(lambda: len(window.session.labels) > entries and not window.background.busy)
            await expect(toolbar(name="Add")).to_be_focused()

        await expect(browser.get_by_label("New model")).to_be_visible()
        await tab_to("e.ariaLabel === 'New model'")
        await press("Enter")
        await browser.get_by_label("New model").wait_for(state="hidden")
        await tab_to("e.innerText.trim() === 'FILE'")
        for name in ("View", "Add"):
            await press("ArrowRight")
            await expect(toolbar(name=name)).to_be_focused()
        await add("a ball")
        await add("cyl", "ArrowDown")  # a Superquadric, which can be a cylinder, comes after it
        tree: Any = tree_of(window.document)
        assert [type(node).__name__ for node in tree.children] == ["Point", "Cylinder"], tree
        await browser.get_by_label("start 2", exact=True).wait_for()
        await press("Tab")
        await expect(toolbar(name="Cylinder")).to_be_focused()
        await tab_to("e.ariaLabel === 'start 2'")
        await press("Control+a")
        await browser.keyboard.type("0.3")
        await press("Tab")
        await until(lambda: window.session.labels[-1:] == ("set start",) and not window.background.busy)
        before = window.session.labels
        await tab_to("e.role === 'slider'")
        for _ in range(3):
            await press("ArrowRight")
        await until(lambda: len(window.session.labels) > len(before) and not window.session.stroke_open)
        await press("Control+z")
        await until(lambda: window.session.labels == before)
        assert not await browser.locator("[role=application] [tabindex='0']").count()  # the view is one stop
        await tab_to("e.dataset.ctrlKeys")
        await tab_to("e.innerText.trim() === 'Cylinder' && e.draggable", "Shift+Tab")
        await press("Delete")
        await until(lambda: window.session.labels[-1:] == ("remove a primitive",))
        await expect(browser.locator("[draggable=true]:focus")).to_have_count(1)  # the next row has it
        await press("Control+z")
        await until(lambda: window.session.labels == before)
        await toolbar(name="Cylinder").wait_for()
        for _ in range(await browser.locator("[draggable=true]").count()):
            await press("ArrowUp")
        for name in ("Sum", "Point", "Cylinder"):
            await press("ArrowDown")
            await expect(toolbar(name=name)).to_be_focused()
        await press("Enter")
        await tab_to("e.innerText.trim().toLowerCase() === 'scatter on this part'")
        await press("Enter")
        await until(lambda: window.session.labels == (*before, "scatter on Cylinder") and not window.busy)
        assert len(window.actions.state.selection) == len(window.document.decals) > 0
        await press("Control+s")
        await until(file.exists)


async def creature(picture: str | None = None) -> None:
    """From an empty start a user builds a creature, covers, brushes, undoes, saves and loads it."""
    file = Path(tempfile.mkdtemp()) / "scene.json"
    async with sandboxed(EMPTY, file, start=True) as (browser, sandbox_page, window):
        plotter = window.plotter
        user = Builder(browser, window)
        await accessible(browser)
        await browser.get_by_label("New model").click()
        await until(lambda: not sandbox_page.sandbox.values()["start"]["open"])
        await browser.get_by_text("The scene is empty").wait_for()
        empty = digest(window.document)
        await user.add("Point", "#4f8f6f", center=(0, 0, 0), radius=1.0)
        await user.add("Point", "#4f8f6f", center=(0, 0.5, 1.2), radius=0.7)
        await user.add("Segment", "#3f6f9f", start=(0.5, -0.5, 0.6), end=(0.9, -1.5, 0.8), radius=0.3)
        await user.mirror()
        await user.add("Segment", "#3f6f9f", start=(0.5, -0.5, -0.6), end=(0.9, -1.5, -0.7), radius=0.3)
        await user.mirror()
        await user.add("Segment", "#9f6f3f", start=(0.3, 1.0, 1.1), end=(0.6, 1.6, 1.0), radius=0.2)
        await user.mirror()
        await user.add("Point", "#202020", center=(0.3, 0.7, 1.8), radius=0.2)
        await user.mirror()
        await user.add("Segment", "#4f8f6f", start=(0, 0, -0.8), end=(0, 0.4, -2.0), radius=0.3)
        await user.add("Point", "#9f3f3f", center=(0, 0.2, 1.9), radius=0.25)
        tree: Any = tree_of(window.document)
        assert len(tree.children) == 12
        assert tree.children[3].end == (-0.9, -1.5, 0.8)
        await browser.keyboard.press("Escape")
        await outline_rows(browser)
        await browser.get_by_text("Sum", exact=True).click()
        await browser.get_by_role("button", name="Sum", exact=True).click()  # selects no less
        await until(lambda: window.actions.state.primitive == (0, ()))
        await browser.keyboard.press("Escape")
        await until(lambda: window.actions.state.primitive is None)
        await show_all(browser, window)
        middle = plotter.window_size[0] // 2, plotter.window_size[1] // 2
        await point(browser, plotter, middle)
        await browser.keyboard.press("g")
        await until(lambda: window.session.labels[-1] == "scatter" and not window.busy)
        driver = Driver(window)
        before = await shows(browser, plotter)
        number, at = next(driver.visible())
        await drag(browser, plotter, at)
        await until(lambda: window.actions.state.selection == (number,))
        owners = {place: driver.owner(place) for place in around(at, 60)}
        await drag(browser, plotter, at, (at[0] + 6, at[1]), (at[0] + 14, at[1] + 4))
        await until(lambda: window.session.labels[-1] == "move" and not window.tools.dragging)
        await browser.keyboard.press("Escape")
        await until(lambda: window.actions.state.selection == ())
        after = await shows(browser, plotter)
        kept = [p for p, owner in owners.items() if owner not in (-1, number) and driver.owner(p) == owner]
        changes = [np.abs(after[-1 - y, x] - before[-1 - y, x]).max() for x, y in kept]
        assert max(changes) > 8  # a neighbour that stays shows another part of its image
        await browser.get_by_label("push brush").click()
        await drag(browser, plotter, middle, (middle[0] + 8, middle[1]), (middle[0] + 24, middle[1]))
        await until(lambda: window.session.labels[-1] == "push brush" and not window.tools.dragging)
        await browser.get_by_label("select and move decals").click()
        last = await shows(browser, plotter)
        await accessible(browser)
        if picture is not None:
            await save_picture(browser, Path(picture))
        entries = len(window.session.labels)
        await browser.get_by_text("Start", exact=True).click()
        await until(lambda: window.session.labels == () and not window.busy)
        assert digest(window.document) == empty
        sandbox_page.sandbox.go_to(entries)
        await shows(browser, plotter)
        await browser.keyboard.press("Control+s")
        sandbox_page.sandbox.perform("save")
        await until(lambda: not window.background.busy and not window.session.modified)
        file = Path(str(window.actions.files.path))
    async with sandboxed(decals.load_scene(file), file) as (browser, _, loaded):
        async with asyncio.timeout(PATIENCE):  # the first picture may come before the page has its layout
            while (again := await shows(browser, loaded.plotter)).shape != last.shape:
                await asyncio.sleep(0.1)
        assert np.abs(again - last).mean() < 0.5


async def outline_rows(browser: Page) -> None:
    """Rows are found by a part of their name, and those below a folded row are not shown."""

    async def shown() -> list[str]:
        rows = browser.locator(".v-list[data-roving] [role=listitem]:visible .v-list-item-title")
        return [text.strip() for text in await rows.all_inner_texts()]

    rows, search = await shown(), browser.get_by_role("textbox", name="search in the outline")
    assert len(rows) == 15
    assert rows[1:4] == ["Sum", "Point", "Point"]
    await search.fill("SEG")
    assert await shown() == ["Segment"] * 7
    await search.fill("")
    for name, kept in (("Sum", 2), (rows[0], 1)):
        await browser.get_by_label(f"nodes below {name}").click()
        assert await shown() == rows[:kept] + rows[-1:]
    for name in (rows[0], "Sum"):
        await browser.get_by_label(f"nodes below {name}").click()
    assert await shown() == rows


class Builder:
    """A user that adds primitives with the menu, and sets their values in the panel."""

    def __init__(self, browser: Page, window: EditWindow) -> None:
        self._browser, self._window = browser, window

    async def _done(self, entries: int) -> None:
        await until(lambda: len(self._window.session.labels) >= entries and not self._window.background.busy)

    async def add(self, kind: str, color: str, **values: Any) -> None:
        """Add a primitive and set its values, one undo entry each."""
        entries = len(self._window.session.labels)
        await self._browser.get_by_role("button", name="Add", exact=True).click()
        await self._browser.locator(".v-overlay--active .v-list-item").get_by_text(kind, exact=True).click()
        await self._done(entries + 1)
        for name, value in values.items():
            parts = value if isinstance(value, tuple) else (value,)
            for i, part in enumerate(parts):
                label = f"{name} {i + 1}" if isinstance(value, tuple) else name
                await self._set(label, str(part))
        await self._set("color", color)

    async def _set(self, label: str, text: str) -> None:
        role = "textbox" if label != "color" else None
        field = self._browser.get_by_role("textbox", name=label, exact=True)
        if role is None:
            field = self._browser.locator("input[type=color]").first
        await field.wait_for()
        if await field.input_value() == text:
            return
        entries = self._window.session.labels
        await field.fill(text)
        await field.dispatch_event("change")
        await until(lambda: self._window.session.labels != entries and not self._window.background.busy)

    async def mirror(self) -> None:
        """Add the mirror image of the selected primitive, and keep it selected."""
        entries = len(self._window.session.labels)
        await self._browser.mouse.move(1100, 500)  # the view takes keys once the pointer enters it
        await point(self._browser, self._window.plotter, (20, 200))
        await self._browser.keyboard.press("Shift+D")
        await self._done(entries + 1)


def around(at: tuple[int, int], reach: int) -> list[tuple[int, int]]:
    """Return pixels around a pixel."""
    steps = range(-reach, reach + 1, 6)
    return [(at[0] + x, at[1] + y) for x in steps for y in steps]


async def accessible(browser: Page, part: str = "html") -> None:
    """Make sure that axe-core finds nothing serious in the page, or in a part of it."""
    serious = [
        (one["id"], one["impact"], [node["html"][:160] for node in one["nodes"]][:4])
        for one in await violations(browser, part)
        if one["impact"] in ("serious", "critical")
    ]
    assert not serious, serious


async def access() -> None:
    """All menus, panels and dialogs of the sandbox are accessible, light and dark, and on small screens."""
    scene = decals.cover(BLOB, count=40, images=["tile", "scale"])
    async with sandboxed(scene, Path(tempfile.mkdtemp()) / "scene.json") as (browser, _, window):
        state, escape = window.actions.state, partial(browser.keyboard.press, "Escape")
        await browser.emulate_media(reduced_motion="reduce")
        button = partial(browser.get_by_role, "button", exact=True)
        await shows(browser, window.plotter)
        for name in ("Scattering", "Drawing"):
            await button(name=name).click()
        for _ in ("light", "dark"):
            for name in ("File", "View", "Add", "Modify", "Combine", "Actions"):
                await button(name=name).click()
                await browser.locator(".v-overlay--active").first.wait_for()
                await accessible(browser)
                await escape()
                await browser.locator(".v-overlay--active").first.wait_for(state="detached")
            await accessible(browser)
            await button(name="light or dark (Alt + L)").click()
        await browser.get_by_text("Point").nth(1).click()
        await browser.get_by_role("heading", name="Point", exact=True).wait_for()
        await accessible(browser)
        await browser.get_by_text("Point").nth(1).click(button="right")
        await browser.get_by_text("Isolate, or show all", exact=True).wait_for()
        await accessible(browser)
        await escape()
        await button(name="tile").click()
        await browser.get_by_role("heading", name="Image tile", exact=True).wait_for()
        await accessible(browser)
        number, at = next(Driver(window).visible())
        await drag(browser, window.plotter, at)
        await until(lambda: state.selection == (number,))
        await button(name="more about interaction").click()
        await browser.locator(".word").wait_for()
        await accessible(browser)
        await escape()
        await browser.locator(".word").wait_for(state="hidden")
        await browser.get_by_label("scatter brush").click()
        await browser.get_by_role("heading", name="scatter brush", exact=True).wait_for()
        for width, height in ((1280, 800), (820, 1180), (390, 844)):
            await browser.set_viewport_size({"width": width, "height": height})
            await until(lambda width=width: window.plotter.window_size[0] <= width)  # type: ignore[misc]
            await accessible(browser)
        for side in ("left", "right"):
            await browser.get_by_label(f"{side} panel").first.click()
            await accessible(browser)


async def sandbox_start(picture: str | None = None) -> None:
    """From the start page a user opens a sample, brushes and clicks decals, drops an image and saves."""
    folder = Path(tempfile.mkdtemp())
    decals.save_scene(EMPTY, folder / "older.json")
    page = sandboxed(EMPTY, folder / "scene.json", start=True, lessons=["First lesson", "Second lesson"])
    async with page as (browser, sandbox_page, window):
        plotter = window.plotter
        headings = await browser.locator(".v-dialog h2").all_inner_texts()
        assert headings == ["Lessons", "New model, or a sample", "Files in this folder"]
        await browser.get_by_role("button", name="Second lesson").focus()
        for _ in range(2):  # over the new model
            await browser.keyboard.press("Tab")
        await expect(browser.get_by_label("sample creature")).to_be_focused()
        await browser.keyboard.press("Enter")
        await until(lambda: len(window.document.decals) == 500)
        await shows(browser, plotter)
        await asyncio.sleep(AUTOSAVE_SECONDS + 1.0)
        assert [*folder.iterdir()] == [folder / "older.json"]  # the sample has no edits to recover
        assert (
            await browser.title()
            == f"{window.session.title_of(window.actions.files.path)} \N{EN DASH} sandbox"
        )
        middle = plotter.window_size[0] // 2, plotter.window_size[1] // 2
        path = [(middle[0] + x, middle[1]) for x in (0, 10, 30)]
        for brush in ("erase", "scatter", "push"):
            await browser.get_by_label(f"{brush} brush").click()
            await until(lambda brush=brush: window.actions.state.brush.brush == brush)  # type: ignore[misc]
            await drag(browser, plotter, *path)
            await until(lambda brush=brush: window.session.labels[-1:] == (f"{brush} brush",))  # type: ignore[misc]
            await until(lambda: not window.tools.dragging)
        await browser.get_by_label("select and move decals").click()
        await until(lambda: window.actions.state.brush.brush == "select")
        await shows(browser, plotter)
        driver = Driver(window)
        number, at = next(driver.visible())
        await drag(browser, plotter, at)
        await until(lambda: window.actions.state.selection == (number,))
        await browser.get_by_role("slider", name="opacity").press("ArrowLeft")
        await until(lambda: window.session.labels[-1] == "set opacity")
        await browser.get_by_role("button", name="more about interaction").click()
        await browser.locator(".word").get_by_text("Only decals of one layer").wait_for()
        await browser.keyboard.press("Escape")
        await browser.locator(".word").wait_for(state="hidden")
        assert sandbox_page.sandbox.values()["pick"]["decal"] == str(number)
        await shows(browser, plotter)
        if picture is not None:
            await save_picture(browser, Path(picture))
        await browser.get_by_role("button", name="File", exact=True).click()
        await browser.get_by_label("file name").fill("mine.py")
        await browser.get_by_role("button", name="Write", exact=True).click()
        await until((folder / "mine.py").exists)
        await browser.get_by_label("file name").wait_for(state="hidden")
        await escapes(browser, window)
        await browser.get_by_role("button", name="File", exact=True).click()
        async with browser.expect_download() as download:
            await browser.get_by_label("download this file").click()
        downloaded = await (await download.value).path()
        assert downloaded.read_bytes() == (folder / "mine.py").read_bytes()
        await browser.get_by_text("Open or new").click()
        Image.new("RGB", (8, 8), "red").save(folder / "dot.png")
        await browser.get_by_label("open from this computer").set_input_files(str(folder / "dot.png"))
        await until(lambda: len(window.document.images) == 2)


async def escapes(browser: Page, window: EditWindow) -> None:
    """Escape closes an open list or menu first, wherever the focus is, and then ends what the view does."""
    brush, selected = window.actions.state.brush, window.actions.state.selection
    await browser.get_by_role("combobox", name="interaction", exact=True).press("ArrowDown")
    entry = browser.get_by_role("option", name="overlap", exact=True)
    await entry.wait_for()
    await browser.keyboard.press("Escape")
    await entry.wait_for(state="hidden")
    assert window.actions.state.selection == selected != ()
    await browser.keyboard.press("Escape")  # the focus is still on the list
    await until(lambda: window.actions.state.selection == ())
    await browser.get_by_label("erase brush").click()
    await until(lambda: brush.brush == "erase")
    for focus in ("[role=application]", ".toolbar button"):
        await browser.get_by_role("button", name="View", exact=True).click()
        menu = browser.get_by_text("Keep this view")
        await menu.wait_for()
        await browser.locator(focus).first.evaluate("one => one.focus()")
        await browser.keyboard.press("Escape")
        await menu.wait_for(state="hidden")
        assert brush.brush == "erase"
    await browser.keyboard.press("Escape")
    await until(lambda: brush.brush == "select")


async def images(browser: Page, window: EditWindow) -> None:
    """Images are added with buttons beside the list, and replaced in their panel; undo takes all back."""
    document = window.document
    folder = Path(tempfile.mkdtemp())
    for name, color in (("first", "red"), ("second", "blue")):
        Image.new("RGB", (8, 8), color).save(folder / f"{name}.png")
    before, names = digest(document), [image.source for image in document.images]
    chooser = browser.get_by_label("add images")
    await chooser.set_input_files([folder / "first.png", folder / "second.png"])
    await until(lambda: [image.source for image in document.images] == [*names, "first", "second"])
    await browser.get_by_role("heading", name="Images", exact=True).wait_for()
    await browser.get_by_role("button", name="first", exact=True).click()
    await browser.get_by_label("replace this image").set_input_files(folder / "second.png")
    await until(lambda: [image.source for image in document.images] == [*names, "second", "second"])
    await browser.get_by_role("button", name="add image rivet").click()
    await until(lambda: document.images[-1].source == "rivet")
    for _ in range(4):
        await browser.keyboard.press("Control+z")
    await until(lambda: digest(document) == before)


DROP = """(label) => {
  const files = new DataTransfer(), canvas = document.createElement('canvas');
  const row = [...document.querySelectorAll('[role=button]')].find(one => one.innerText.trim() === label);
  return new Promise(done => canvas.toBlob(blob => {
    files.items.add(new File([blob], 'dropped.png', {type: 'image/png'}));
    const event = {dataTransfer: files, bubbles: true, cancelable: true};
    done(row.dispatchEvent(new DragEvent('drop', event)));
  }, 'image/png'));
}"""
"""Drop a picture on a row of the outline."""

FOLLOWS = """(labels) => {
  const rows = [...document.querySelectorAll('[role=button]')].map(one => one.innerText.trim());
  return rows.indexOf(labels[0]) < rows.indexOf(labels[1]);
}"""
"""Return True if one row of the outline is above another."""


async def panels(picture: str | None = None) -> None:
    """A user renames and drags rows, drops images, and sets material, scattering and drawing."""

    def row(label: str) -> Any:
        return browser.get_by_role("button", name=label, exact=True)

    async def rename(label: str, name: str) -> None:
        await row(label).first.dblclick()
        await browser.get_by_role("textbox", name=f"new name of {label}", exact=True).wait_for()
        await browser.keyboard.type(name)
        await browser.keyboard.press("Enter")
        await row(name).wait_for()

    async def done(label: str) -> None:
        await until(lambda: window.session.labels[-1:] == (label,) and not window.background.busy)

    scene = decals.cover(BLOB, count=40, images=["tile", "scale"])
    async with sandboxed(scene) as (browser, sandbox_page, window):
        document, state = window.document, digest(window.document)
        await browser.emulate_media(reduced_motion="reduce")
        await expect(browser.locator(".toolbar button").first).to_have_css("transition-duration", "0s")
        await rename("Point", "body")
        await rename("layer 0", "armour")
        await rename("model 1", "snail")
        assert tree_of(document)(np.zeros((1, 3)))[0] > 0.5
        await row("body").drag_to(row("Point"))
        await done("move in the tree")
        await row("scale").drag_to(row("armour"))
        await done("change the image")
        assert set(document.decals.decals.images.tolist()) == {1}
        await browser.evaluate(DROP, "armour")
        await done("add an image")
        await images(browser, window)
        assert set(document.decals.decals.images.tolist()) == {2}
        await row("tile").drag_to(browser.get_by_label("view of the scene"))
        await done("add")
        (added,) = window.actions.state.selection
        assert document.decals[added].images.tolist() == [0]
        await row("body").click(button="right")
        await browser.get_by_text("Isolate, or show all", exact=True).click()
        await done("isolate")
        await browser.get_by_label("hide Point").click()
        await done("show")
        await row("tile").click()
        await browser.get_by_role("slider", name="metallic").press("End")
        await done("set metallic")
        await row("Scattering").click()
        for name, value in (("count", "90"), ("radius factor", "0.8"), ("jitter size", "0.2")):
            field = browser.get_by_role("textbox", name=name, exact=True)
            await field.fill(value)
            await field.press("Enter")
        await choose(browser, "sizing", "touching")
        await browser.get_by_role("button", name="Scatter again").click()
        await done("scatter")
        assert len(document.decals) == 90
        if picture is not None:
            await show_all(browser, window)
            await save_picture(browser, Path(picture))
        await row("Drawing").click()
        await browser.get_by_label("background top").wait_for()
        before = await seen(browser)
        await browser.get_by_label("background top").evaluate(
            "input => { input.value = '#ffe0c0'; input.dispatchEvent(new Event('change')); }"
        )
        await done("set background.top")
        async with asyncio.timeout(PATIENCE):
            while np.abs(await seen(browser) - before).mean() <= 5:
                await asyncio.sleep(0.1)
        await choose(browser, "contact", "radial")
        await done("set contact")
        await row("snail").click(button="right")
        await browser.get_by_text("Duplicate", exact=True).click()
        await done("duplicate snail")
        await row("snail 2").wait_for()
        upper = {"x": 20.0, "y": 3.0}
        await row("snail 2").drag_to(row("snail"), target_position=upper)
        await done("reorder objects")
        assert [item.name for item in document.objects] == ["snail 2", "snail"]
        await browser.keyboard.press("Control+z")
        await done("duplicate snail")
        await browser.wait_for_function(FOLLOWS, arg=["snail", "snail 2"])
        await row("snail 2").drag_to(row("snail"))
        await done("move snail 2 into snail")
        assert len(document.objects) == 1
        await browser.keyboard.press("Control+z")
        await row("snail 2").wait_for()
        await row("body").first.click(button="right")
        await browser.get_by_text("Duplicate", exact=True).click()
        await done("duplicate a primitive")
        await row("Point").first.click()
        await browser.get_by_role("heading", name="Point", exact=True).wait_for()  # the panel has changed
        await choose(browser, "kind", "Torus")
        await done("replace Point by Torus")
        await row("Torus").wait_for()
        sandbox_page.sandbox.unwrap()  # is refused, in red
        await browser.locator(".refused").wait_for()
        await accessible(browser, ".refused")
        await browser.keyboard.press("Alt+l")
        await browser.locator(".v-theme--dark").first.wait_for()
        await browser.get_by_label("light or dark").click()
        await browser.locator(".v-theme--dark").first.wait_for(state="detached")
        await browser.get_by_label("light or dark").click()
        await accessible(browser, ".refused")
        await browser.get_by_text("Start", exact=True).click()
        await until(lambda: digest(document) == state)
        assert sandbox_page.sandbox.values()["done"] == []


async def fields() -> None:
    """What is typed in a field is taken or dropped, and never becomes another edit."""
    file = Path(tempfile.mkdtemp()) / "fields.json"  # its folder gets the recovery file
    async with sandboxed(scene(), file) as (browser, _, window):
        keys = window.actions.state
        assert await browser.title() == "fields.json \N{EN DASH} sandbox"
        await browser.get_by_text("Point", exact=True).first.click()
        field = browser.locator("input[aria-label='radius']").first
        view = browser.locator("[role=application]")
        await expect(field).to_have_value("1")
        await field.press("End")
        await browser.keyboard.type("55")
        await browser.keyboard.press("Control+z")
        await expect(field).to_have_value("1")
        await view.hover(position={"x": 300, "y": 200})
        await view.hover(position={"x": 320, "y": 220})
        await browser.keyboard.type("1x")  # X evens decals out in the view
        await expect(field).to_have_value("11x")
        await browser.keyboard.press("Escape")
        await expect(field).to_have_value("1")
        for text in ("-5", "abc"):
            await field.fill(text)
            await field.press("Enter")
            await browser.get_by_role("alert").filter(has_text="radius: expected").wait_for()
            assert await field.get_attribute("aria-invalid") == "true"
            await expect(field).to_have_value("1")
        await field.fill("0.8")
        await browser.get_by_text("Point", exact=True).nth(1).click()
        await until(lambda: keys.primitive == (0, (1,)) and not window.background.busy_editing)
        assert window.session.labels == ("set radius",)
        await expect(field).to_have_value("0.5")
        await field.fill("0.4")
        await browser.get_by_role("button", name="undo").first.click()
        await until(lambda: window.session.undone_labels == ("set radius",))
        await expect(field).to_have_value("0.5")
        await field.fill("0.7")
        await browser.keyboard.press("Escape")
        await expect(field).to_have_value("0.5")
        assert keys.primitive == (0, (1,))
        await field.fill("0.5")  # its own value: Escape deselects the node, whose field goes
        await browser.keyboard.press("Escape")
        await expect(field).to_have_count(0)
        assert keys.primitive is None
        await browser.get_by_text("Point", exact=True).nth(1).click()
        await until(lambda: keys.primitive == (0, (1,)))
        await browser.get_by_role("button", name="undo").first.focus()
        await browser.keyboard.press("Escape")
        await until(lambda: keys.primitive is None)


async def zone() -> None:
    """A part of a model gets decals of its own by four clicks, and a lasso's decals by three; others stay."""
    for size in ((1280, 800), (820, 1180), (390, 844)):
        async with sandboxed(
            decals.cover(BLOB, count=80, images=["tile", "scale"]), size=size
        ) as opened_page:
            await zones(*opened_page)


async def zones(browser: Page, _: Any, window: EditWindow) -> None:
    """What a user clicks for a zone, in a window of any size."""
    document, state = window.document, window.actions.state
    phone = await browser.evaluate("innerWidth < 600")

    async def show(side: str) -> None:
        if phone:
            await browser.get_by_label(f"{side} panel").first.click()

    await show_all(browser, window)
    before, numbers = digest(document), document.decals.numbers
    small = Driver(window)
    _, at = next((n, at) for n, at in small.visible() if document.decals[n].positions[0, 0] > 1.4)
    await drag(browser, window.plotter, at)
    await until(lambda: len(state.selection) == 1)
    await drag(browser, window.plotter, at)
    await until(lambda: state.primitive == (0, (1,)))
    await show("right")
    await browser.get_by_role("button", name="Scatter on this part").click()
    await until(lambda: window.session.labels == ("scatter on Point",) and not window.busy)
    new = np.setdiff1d(document.decals.numbers, numbers)
    assert state.selection == tuple(new.tolist())
    assert document.decals.take(new).positions[:, 0].min() > 0.6
    await browser.get_by_role("heading", name=f"{len(new)} decals").wait_for()
    await choose(browser, "image", "scale")
    await until(lambda: set(document.decals.take(new).images.tolist()) == {1})
    kept = np.intersect1d(document.decals.numbers, numbers)
    assert 0 < len(kept) < 80
    await show("right")
    await browser.keyboard.press("Escape")
    await until(lambda: state.selection == ())
    for _ in range(2):
        await browser.get_by_role("button", name="undo").first.click()
    await until(lambda: digest(document) == before)
    await browser.get_by_label("lasso: drag").click()
    width, height = window.plotter.window_size
    x, y = (0.2, 0.5, 0.5, 0.2, 0.2), (0.2, 0.2, 0.8, 0.8, 0.25)  # corners; browsers send few moves when busy
    path = (np.interp(np.linspace(0, 4, 33), range(5), part) for part in (x, y))
    places = np.stack([*path], axis=1) * (width, height)
    await drag(browser, window.plotter, *((int(right), int(up)) for right, up in places))
    await until(lambda: len(state.selection) > 3)
    chosen = state.selection
    await show("right")
    await browser.get_by_role("button", name="Scatter in their place").click()
    label = f"scatter in place of {len(chosen)} decals"
    await until(lambda: window.session.labels == (label,) and not window.busy)
    assert not np.isin(chosen, document.decals.numbers).any()
    assert len(np.intersect1d(document.decals.numbers, numbers)) == 80 - len(chosen)


async def snowman(picture: str | None = None) -> None:
    """A snowman with scales, from the start page on, by the screen alone: with a mouse, and with a finger."""
    for size, touch in ((WIDE, False), ((390, 844), True)):
        file = Path(tempfile.mkdtemp()) / "snowman.json"
        async with sandboxed(EMPTY, file, start=True, size=size, touch=touch) as (browser, _, window):
            await browser.get_by_label("New model").wait_for()
            began = time.monotonic()
            clicks = await build_snowman(browser, window, touch=touch)
            await until(file.exists)
            print(f"{size[0]} x {size[1]}: {clicks} clicks, {time.monotonic() - began:.0f} s")
            tree: Any = tree_of(window.document)
            below, middle, head = tree.children
            assert below.center[1] + below.radius < middle.center[1] < head.center[1]
            assert below.radius > middle.radius > head.radius
            assert len(window.document.decals) == 100
            if picture is not None and not touch:
                await browser.keyboard.press("Escape")
                await until(lambda window=window: not window.busy)  # type: ignore[misc]
                await shows(browser, window.plotter)
                await save_picture(browser, Path(picture))


async def build_snowman(browser: Page, window: EditWindow, *, touch: bool) -> int:
    """Build it; the number of clicks, taps and drags."""
    clicks, plotter = count(), window.plotter

    async def press(found: Any) -> None:
        """Click or tap on the middle of what is seen."""
        next(clicks)
        await browser.wait_for_function(REACHED, arg=await found.element_handle())  # menus and panels slide
        await (found.tap() if touch else found.click())

    async def stroke(start: tuple[float, float], along: float) -> None:
        """Drag to the right, from a place that counts from the middle of the view, upward."""
        next(clicks)
        box = await browser.locator(PICTURE).first.bounding_box()
        assert box is not None
        x, y = start[0], -start[1]
        if touch:
            await fingers(browser, *([(x + share * along, y)] for share in (0.0, 0.4, 0.8, 1.0)))
        else:
            middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
            await pull(browser, (middle[0] + x, middle[1] + y), (along, 0.0))

    def rows() -> tuple[float, float]:
        """Return the least and the greatest height of the model above the middle of the view, in pixels."""
        width, height = plotter.window_size
        seen_rows = [y for y in range(int(height)) if window.tools.at(width / 2, y)]
        return seen_rows[0] - float(height) / 2, seen_rows[-1] - float(height) / 2

    async def changed(label: str, number: int) -> None:
        await until(lambda: window.session.labels[-1:] == (label,) and len(window.session.labels) == number)
        await until(lambda: not window.background.busy_editing)

    add = browser.get_by_role("button", name="Add", exact=True)
    await press(browser.get_by_label("New model"))
    await press(add)
    kinds = browser.locator(".v-overlay--active .v-list-item-title")
    await press(kinds.get_by_text("Point", exact=True))
    await changed("add point 1", 1)
    radius = (rows()[1] - rows()[0]) / 2
    for number, size in ((2, 0.85 * radius), (3, 0.65 * radius)):
        await press(add)
        await press(browser.get_by_title("place a Point by the mouse"))
        await stroke((0.0, rows()[1] + 0.8 * size), size)
        await changed("add Point", number)
    if touch:
        await press(browser.get_by_label("right panel").first)
    await press(browser.get_by_role("button", name="Scatter decals"))
    await changed("scatter", 4)
    if touch:
        await press(browser.get_by_label("right panel").first)
    await press(browser.get_by_role("button", name=re.compile("^save")))
    return next(clicks)


async def copies() -> None:
    """The copies of a repeat get the same decals, if a switch says so; undo takes them back."""
    async with sandboxed(decals.cover(BLOB, count=60, images=["tile"])) as (browser, _, window):
        await browser.get_by_text("Sum", exact=True).click()
        await browser.get_by_role("button", name="Modify", exact=True).click()
        await browser.locator(".v-overlay--active .v-list-item").get_by_text("Repeat", exact=True).click()
        await until(
            lambda: window.session.labels[-1:] == ("put Sum under Repeat",) and not window.background.busy
        )
        field = browser.get_by_role("textbox", name="step 1", exact=True)
        await field.fill("6")
        await field.press("Enter")
        await until(lambda: window.session.labels[-1:] == ("set step",) and not window.background.busy)
        repeat: Any = tree_of(window.document)
        before = digest(window.document)
        await browser.get_by_role("button", name="Scattering", exact=True).click()
        field = browser.get_by_role("textbox", name="count", exact=True).first
        await field.fill(str(20 * repeat.count))
        await field.press("Enter")
        await browser.get_by_label("same decals on all copies").click()
        await accessible(browser)
        await browser.get_by_role("button", name="Scatter again").click()
        await until(lambda: window.session.labels[-1:] == ("scatter",) and not window.busy)
        first, *others = np.split(window.document.decals.column("positions"), repeat.count)
        for number, positions in enumerate(others, 1):
            np.testing.assert_allclose(positions, first + number * np.array(repeat.step), atol=1e-4)
        await show_all(browser, window)
        await browser.get_by_label("undo").first.click()
        await until(lambda: digest(window.document) == before)


async def filled() -> None:
    """A pull bares a part of the skin: the page counts the places, and one click fills them."""
    scene = decals.cover(BLOB, count=60, images=["tile", "scale"])
    button = re.compile(r"^Fill \d+ bare places?$")
    async with sandboxed(scene) as (browser, _, window):
        await browser.get_by_text("Point", exact=True).nth(1).click()
        field = browser.get_by_role("textbox", name="center 1", exact=True)
        await field.fill("2.1")
        await field.press("Enter")
        await browser.get_by_role("button", name=button).wait_for()
        assert decals.measure(window.document.scene).coverage < 0.999
        pulled = digest(window.document)
        await browser.get_by_role("button", name=button).click()
        await until(lambda: window.session.labels[-1:] == ("fill bare places",) and not window.busy)
        assert decals.measure(window.document.scene).coverage > 0.9999
        await browser.get_by_role("button", name=button).wait_for(state="detached")
        await shows(browser, window.plotter)
        await browser.get_by_label("undo").first.click()
        await until(lambda: digest(window.document) == pulled)
        await browser.get_by_role("button", name=button).wait_for()


async def lab(picture: str | None = None) -> None:
    """A student answers each lesson's question wrong, then right."""
    requests: list[str] = []
    async with sandboxed(BARE, lessons=load_lessons(LESSONS), kind=LabPage) as (browser, lab_page, window):
        browser.on("request", lambda request: requests.append(request.url))
        await arrives(browser, lab_page, window, 2)
        for number, attempts in enumerate(ANSWERS):
            await choose(browser, "lesson", lab_page.lab.values()["lab_titles"][number]["title"])
            await until(partial(shows_lesson, lab_page, number))
            await guess(browser, lab_page)
            for attempt in attempts:
                await answer(browser, lab_page, *attempt.settings)
                kind = "success" if attempt.right else "warning"
                await browser.locator(f".v-alert.text-{kind}").get_by_text(attempt.words).wait_for()
            tasks = browser.locator("[data-task]")
            assert await tasks.count() == len(lab_page.lab.lesson.settings.question.checks)
            if not attempts[-1].right:
                await find_step(browser, lab_page)
            follows = browser.get_by_role("button", name="Next lesson")
            await expect(follows).to_have_count(int(number + 1 < len(ANSWERS)))
            lowest = browser.get_by_label(lab_page.lab.values()["lab_sliders"][-1]["label"], exact=True).last
            box = await lowest.bounding_box()
            assert box is not None
            assert box["y"] + box["height"] <= 800  # in sight below text, question and verdict
            assert await browser.evaluate(SCROLLED_TWICE) == []
            await accessible(browser)
            if picture is not None and number == 1:
                await shows(browser, window.plotter)
                await save_picture(browser, Path(picture))
        assert all("127.0.0.1" in url or url.startswith("data:") for url in requests)
        await puzzle(browser, lab_page)
        await choose(browser, "lesson", lab_page.lab.values()["lab_titles"][0]["title"])
        await until(partial(shows_lesson, lab_page, 0))
        await guess(browser, lab_page)
        before = lab_page.lab.probe
        await pull(browser, await at_rest(browser, lab_page, "probe"), (40, 0))
        await until(lambda: lab_page.lab.probe[0] > before[0] + 0.05 and not lab_page.lab.busy)
        await until_readings(browser, lab_page)
        await sliced(browser, lab_page, picture)
        symbol = browser.locator(".lesson-side abbr[data-symbol='g']").first
        assert "falloff" in str(await symbol.get_attribute("title"))
        await browser.get_by_role("button", name="lines of Python for this picture").click()
        lines = browser.locator("pre.script")
        await lines.get_by_text("decals.load_scene").wait_for()
        assert (await lines.inner_text()).rstrip() == lab_page.lab.script().rstrip()
        await accessible(browser)
        await browser.keyboard.press("Escape")
        await lines.wait_for(state="hidden")
        curve = browser.locator("path[data-symbol='g']")
        await browser.get_by_text("Text of the lesson").click()
        for place in (".lesson-side abbr", ".readings abbr", ".formula abbr", ".plot tspan"):
            await browser.locator(f"{place}[data-symbol='g']").first.hover()
            await expect(browser.locator("[data-region='g']").first).to_have_css("opacity", "0.5")
            await expect(curve).to_have_css("stroke-width", "5px")
            await browser.get_by_role("button", name="Check the answer").hover()
            await expect(curve).to_have_css("stroke-width", "2px")
        for place, words in (
            (".lesson-side abbr[data-symbol='g']", "falloff"),
            (".readings abbr", "visible radius"),
        ):
            await browser.locator(place).first.focus()  # as a tap and the Tab key give it
            assert words in await browser.evaluate(DEFINED)
        await browser.set_viewport_size({"width": 820, "height": 1180})  # a tablet
        parts = [browser.locator(part) for part in (".lesson-side", "[role=application]", ".plots")]
        async with asyncio.timeout(PATIENCE):
            while True:
                text, view, plots = [await part.bounding_box() for part in parts]
                assert text is not None
                assert view is not None
                assert plots is not None
                if view["x"] >= text["width"] > 300 and plots["y"] >= view["y"] + view["height"] > 600:
                    break
                await asyncio.sleep(0.1)
        assert min(view["width"], plots["width"]) > 400
        await browser.get_by_role("button", name="open in the sandbox").click()
        await until(lambda: not lab_page.sandbox.in_lesson)
        assert len(window.document.decals.numbers) == 1
        await browser.set_viewport_size({"width": 390, "height": 844})  # a phone
        await browser.evaluate("trame.state.set('left_open', false)")
        await browser.get_by_role("button", name="File", exact=True).click()
        await browser.get_by_text("Open or new").click()
        await browser.get_by_role("button", name="Two decals", exact=True).click()
        see = browser.get_by_role("button", name="See", exact=True)
        await see.scroll_into_view_if_needed()  # below the pad of the outline, once the panel is open
        await browser.wait_for_function(REACHED, arg=await see.element_handle())
        shown_view, panel = [
            await browser.locator(part).bounding_box()
            for part in ("[role=application]", ".v-navigation-drawer:has(.lesson-side)")
        ]
        assert shown_view is not None
        assert panel is not None
        assert shown_view["height"] > 200  # above the lesson
        assert panel["y"] >= shown_view["y"] + shown_view["height"]


CHOSEN_AT_ONCE = """async (option) => {
  option.click();
  await new Promise(requestAnimationFrame);
  return document.querySelector(".coming").innerText;
}"""
"""Choose an entry, and return what stands above the view in the next frame of the page."""


async def arrives(browser: Page, lab_page: LabPage, window: EditWindow, number: int) -> None:
    """The title of a lesson covers the picture of the one before at once, until its own is there."""
    title, cover = lab_page.lab.values()["lab_titles"][number]["title"], browser.locator(".coming")
    await cover.wait_for(state="detached")
    before = lab_page.lab.begun
    await browser.get_by_role("combobox", name="lesson", exact=True).press("ArrowDown")
    with patch.object(StreamedView, "shows", lambda _, begun: begun == before):
        option = browser.get_by_role("option", name=title, exact=True)
        assert title in await option.evaluate(CHOSEN_AT_ONCE)
        await until(partial(shows_lesson, lab_page, number))
        await browser.get_by_role("heading", name=title.split(". ")[1], exact=True).wait_for()
        await expect(cover).to_contain_text(title)
    await cover.wait_for(state="detached")
    await shows(browser, window.plotter)


async def puzzle(browser: Page, lab_page: LabPage) -> None:
    """Play the puzzle of the address, and share one of other sizes."""
    await browser.evaluate("location.hash = '#puzzle=0.5,0.45,0.4,0.3&par=0.5,25'")
    await until(lambda: lab_page.lab.waits and lab_page.lab.experiment().decals.radii[3] == np.float32(0.3))
    await guess(browser, lab_page)
    cells = browser.locator(".scores td")
    await browser.locator(".scores").get_by_text("★").wait_for()  # of the second par
    now, par, best = (await cells.all_inner_texts())[:3]
    assert (par, best) == ("0.5", now)
    await browser.get_by_role("button", name="Share as a puzzle").click()
    await browser.get_by_text("Link to the puzzle:").get_by_text("#puzzle=0.5,0.45,0.4,0.3&par=").wait_for()


async def guess(browser: Page, lab_page: LabPage, *, finger: bool = False) -> None:
    """Guess before contact is switched on, and see the truth; nothing shows it before."""
    question = lab_page.lab.lesson.settings.guess
    assert question is not None
    await browser.get_by_text("follow after your guess").wait_for()
    assert await browser.locator(".plot, [data-task]").count() == 0
    value = (question.low + question.high) / 2
    if question.sketch:
        await trace(browser, browser.locator(".pad circle").first, finger=finger)
    await browser.get_by_label(question.label).fill(f"{value:g}")
    await browser.get_by_role("button", name="See", exact=True).click()
    answered = browser.get_by_text(f"you guessed {shown(np.array(value))}, it is now ")
    await answered.wait_for(timeout=1000 * COLD)
    await browser.locator(".plot").first.wait_for()
    assert await browser.locator(".scale path").count() in (1, 2)
    if question.sketch:
        difference = float(await browser.locator("[data-difference]").inner_text())
        assert difference == pytest.approx(pressed_away(), abs=2.0)
        assert await browser.locator(".pad :is(path, polygon)").count() == 3  # the pad's outline is empty


async def sliced(browser: Page, lab_page: LabPage, picture: str | None) -> None:
    """Cut the lesson open, and drag the probe and the slice with the mouse: the readings follow."""
    await browser.get_by_role("button", name="View", exact=True).click()
    await choose(browser, "slice", "y")
    await browser.keyboard.press("Escape")
    await browser.mouse.move(*(await at_rest(browser, lab_page, "probe")))  # the menu is closed
    view = await browser.locator(PICTURE).first.bounding_box()
    assert view is not None
    corner = view["x"] + 20, view["y"] + view["height"] - 20
    await pull(browser, corner, (60, -70))  # turn the plate
    for handle in ("probe", "slice"):
        before = lab_page.lab.probe
        await pull(browser, await at_rest(browser, lab_page, handle), (10, -30))
        await until(partial(has_moved, lab_page, before))
        await until_readings(browser, lab_page)
    assert np.abs(lab_page.lab.probe)[1:].min() > 0.02  # beside the middle, and above the plate
    if picture is not None:
        await save_picture(browser, Path(picture).with_stem(f"{Path(picture).stem}-slice"))
    await browser.get_by_role("button", name="View", exact=True).click()
    await choose(browser, "slice", "none")
    await browser.keyboard.press("Escape")
    await until(lambda: lab_page.lab.probe == lab_page.lab.lesson.settings.probe and not lab_page.lab.busy)


async def save_picture(browser: Page, path: Path) -> None:
    """Write the window as a picture of the documentation."""
    image = Image.open(io.BytesIO(await browser.screenshot())).convert("RGB")
    image.resize((960, 600), Image.Resampling.LANCZOS).save(path, quality=80, optimize=True)


def has_moved(lab_page: LabPage, before: tuple[float, float, float]) -> bool:
    """Return True once the probe lies elsewhere, and its values are known."""
    return lab_page.lab.probe != before and not lab_page.lab.busy


async def until_readings(browser: Page, lab_page: LabPage) -> None:
    """Wait until the page shows d and f of the probe as the formulas of float64 give them."""
    radius = lab_page.lab.experiment().decals.radii[0]
    d = np.linalg.norm(lab_page.lab.probe) / (radius / RIM)
    expected = {"d": shown(d), "f = g(d)": shown(falloff(d))}
    names, numbers = (browser.locator(f".readings {tag}") for tag in ("th", "td"))
    async with asyncio.timeout(PATIENCE):
        while True:
            texts = dict(zip(await names.all_inner_texts(), await numbers.all_inner_texts(), strict=False))
            if expected.items() <= texts.items():
                return
            await asyncio.sleep(0.1)


async def answer(browser: Page, lab_page: LabPage, *settings: tuple[str, float | str]) -> None:
    """Move controls of a lesson, named by the beginning of their label, and check the answer."""
    for name, value in settings:
        sliders = lab_page.lab.values()["lab_sliders"]
        label = next(s["name"] for s in sliders if s["name"].startswith(name))
        if isinstance(value, str):
            await choose(browser, label, value)
            continue
        field = browser.get_by_role("textbox", name=label, exact=True)
        await field.fill(str(value))
        await field.press("Enter")
    await until(lambda: not lab_page.lab.busy)
    await browser.get_by_role("button", name="Check the answer").click()


async def find_step(browser: Page, lab_page: LabPage) -> None:
    """Find the first even step by what the verdict says: go back, or move further."""
    low, high = 1, 60
    while high - low > 1:
        middle = (low + high) // 2
        await answer(browser, lab_page, (STEP, middle))
        verdict = browser.locator(".v-alert").get_by_text(re.compile(rf"after step {middle} ", re.IGNORECASE))
        text = await verdict.inner_text()
        if text.startswith("Right"):
            return
        low, high = (low, middle) if "Go back" in text else (middle, high)
    await answer(browser, lab_page, (STEP, high))
    await browser.locator(".v-alert.text-success").get_by_text(f"after step {high} ").wait_for()


def shows_lesson(lab_page: LabPage, number: int) -> bool:
    """Return True if the lab is at a lesson."""
    return bool(lab_page.lab.values()["lab_number"] == number)


async def at_rest(browser: Page, sandbox_page: SandboxPage, name: str) -> tuple[float, float]:
    """Wait until the page shows a handle where the server has it; its middle."""
    async with asyncio.timeout(PATIENCE):
        while True:
            view = await browser.locator("svg.above").last.bounding_box()
            box = await browser.locator(f"[data-handle='{name}']").bounding_box()
            handles = sandbox_page.sandbox.values()["gizmo"]["handles"]
            place = next(((h["x"], h["y"]) for h in handles if h["name"] == name), None)
            if view is not None and box is not None and place is not None:
                middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
                there = view["x"] + place[0] * view["width"], view["y"] + place[1] * view["height"]
                if np.allclose(middle, there, atol=1.0):
                    return middle
            await asyncio.sleep(0.1)


async def choose(browser: Page, label: str, option: str) -> None:
    """Choose an entry of a list."""
    await browser.get_by_role("combobox", name=label, exact=True).press("ArrowDown")
    await browser.get_by_role("option", name=option, exact=True).click()


async def ended() -> None:
    """Done saves the scene and ends the server of a notebook at once; the page opens when it comes back."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.json"
        decals.save_scene(EMPTY, file)
        with notebook._served(file) as (process, url):
            async with opened(url, ends=True) as browser:
                assert "token" not in browser.url
                await browser.emulate_media(color_scheme="dark")
                await browser.reload()
                await browser.locator(".v-theme--dark").first.wait_for()
                await browser.get_by_role("button", name="Done").click()
                await asyncio.to_thread(process.wait, notebook.STOP_SECONDS)
                await browser.get_by_text("Unsaved changes are kept").wait_for()
                await browser.route("**/*", lambda route: route.fulfill(body="is back"))
                await browser.get_by_text("is back").wait_for()


async def shared() -> None:
    """A browser that watches can ask for control while the driver chooses a scene, and drives then."""
    page = sandboxed(EMPTY, folder=Path(tempfile.mkdtemp()), start=True, shared=True)
    async with page as (driver, sandbox_page, window):
        await driver.get_by_label("New model").wait_for()
        port = urlsplit(driver.url).port
        assert port is not None
        async with opened(sandbox_page.guard.url(port), size=WIDE) as watcher:
            await watcher.get_by_role("button", name="Ask for control").click()
            assert not await watcher.get_by_label("New model").is_visible()
            await driver.keyboard.press("Escape")
            await driver.get_by_role("button", name="Pass control").click()
            await watcher.get_by_role("button", name="Add", exact=True).click()
            await watcher.get_by_text("Torus", exact=True).click()
            await until(lambda: len(window.document.objects) == 1)
            await driver.get_by_role("button", name="Torus", exact=True).wait_for()
            await driver.get_by_role("button", name="Ask for control").wait_for()


def main() -> None:
    """Run one of the functions above, by its name."""
    name, *arguments = sys.argv[1:]
    checks = {
        "page": page,
        "user": user,
        "streamed": streamed,
        "sandbox": sandbox,
        "start": sandbox_start,
        "creature": creature,
        "lab": lab,
        "ended": ended,
        "panels": panels,
        "fields": fields,
        "filled": filled,
        "copies": copies,
        "access": access,
        "zone": zone,
        "snowman": snowman,
        "shared": shared,
        "touch": touch,
        "keyboard": keyboard,
    }
    if "firefox" in arguments:
        arguments.remove("firefox")
        CHOSEN.set("firefox")
    asyncio.run(checks[name](*arguments))
    print("done")


if __name__ == "__main__":
    main()
