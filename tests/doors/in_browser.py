"""Decals in a real browser, served by trame, as a program: ``python -m tests.doors.in_browser NAME``.

``page`` takes a path behind its name, where it saves the picture of docs/pyvista.md.
"""

import asyncio
import io
import sys
from typing import Any
from unittest.mock import patch

import numpy as np
import pyvista as pv
from PIL import Image
from trame.app import get_server
from trame.ui.vuetify3 import VAppLayout
from trame.widgets import vuetify3
from trame_pyvista.widgets import PyVistaRCAView, PyVistaRemoteView
from trame_server.core import Server

from decals.window import EditWindow
from tests.doors import page as docs
from tests.doors.browsing import drag, drawn, served, shows, until
from tests.edit.scenes import scene
from tests.vtk.scenes import both
from tests.window.driver import Driver


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
    """Where something other than the background is."""
    return np.abs(picture - picture[0, 0]).max(axis=-1) > 8


async def hands() -> None:
    """A click selects a decal, a drag moves it, a button undoes that: the first picture comes back."""
    plotter = pv.Plotter(off_screen=True)
    window = EditWindow(scene(), plotter=plotter)
    window.show()
    driver = Driver(window)
    server = get_server("hands", client_type="vue3")

    def undo() -> None:
        window.tools.key("z", 0, 0, ctrl=True)
        window.tools.key("Escape", 0, 0)
        window.actions.message = ""
        window.redraw(whole=True)

    with VAppLayout(server, full_height=True):
        vuetify3.VBtn("undo", click=undo, height=40)
        PyVistaRemoteView(plotter, style="height: calc(100% - 40px)")
    async with served(server) as browser:
        first, state = await shows(browser, plotter), driver.state
        number, at = next(driver.visible())
        await drag(browser, plotter, at)
        await until(lambda: window.actions.selection == (number,))
        await drag(browser, plotter, at, (at[0] + 6, at[1]), (at[0] + 20, at[1] + 6))
        await until(lambda: driver.session.labels == ("move",) and not window.tools.dragging)
        moved = await shows(browser, plotter)
        assert np.abs(moved - first).mean() > 0.5
        await browser.get_by_role("button").click()
        await until(lambda: driver.state == state)
        np.testing.assert_array_equal(await shows(browser, plotter), first)
    window.close()


async def streamed() -> None:
    """trame-rca's view, which pyvista takes too: decals are seen, and turned."""
    plotter = pv.Plotter(off_screen=True)
    plotter.decals.add_scene(both())
    server = get_server("streamed", client_type="vue3")
    with VAppLayout(server, full_height=True):
        view = PyVistaRCAView(plotter, style="width: 100%; height: 100%")
    async with served(server) as browser:
        first = await shows(browser, view.plotter)
        await drag(browser, plotter, (40, 40), (80, 60), (140, 70))
        await until(lambda: np.abs(drawn(plotter) - first).mean() > 2)
        await shows(browser, plotter)


def main() -> None:
    """Run one of the functions above, by its name."""
    name, *arguments = sys.argv[1:]
    asyncio.run({"page": page, "hands": hands, "streamed": streamed}[name](*arguments))
    print("done")


if __name__ == "__main__":
    main()
