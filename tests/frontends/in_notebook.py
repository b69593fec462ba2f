"""Decals in a live notebook, as a program: ``python -m tests.frontends.in_notebook``.

A kernel runs a scene as the last line of a cell, and then the cell of docs/pyvista.md. A browser opens the
frame that the second cell shows.
"""

import asyncio
import base64
import io
import re
from typing import Any

import nbformat
import numpy as np
import pyvista as pv
from nbclient import NotebookClient
from PIL import Image

from decals import Scene, render
from tests.frontends import page as docs
from tests.frontends.browsing import LOSS, PATIENCE, drag, drawn, opened, seen

MAKE = """
import decals
from blobtree import Point
scene = decals.cover(Point((0, 0, 0), radius=1.0), count=60, images=["scale"])
scene
"""
MENU = 70
"""Height of what pyvista's viewer lays over the picture, in pixels."""


async def main() -> None:
    """Run the cells; look at the picture of the first, and at the frame of the last."""
    v4: Any = nbformat.v4  # its functions have no types
    cells = [v4.new_code_cell(source) for source in (MAKE, docs.code("notebook"))]
    client = NotebookClient(v4.new_notebook(cells=cells), timeout=300, kernel_name="python3")
    names: dict[str, Scene] = {}
    exec(MAKE, names)
    async with client.async_setup_kernel():
        for number, cell in enumerate(cells):
            await client.async_execute_cell(cell, number)
        shown = [output.data for output in cells[0].outputs if "data" in output]
        (still,) = [data["image/png"] for data in shown if "image/png" in data]  # others show progress
        (url,) = re.findall(r'<iframe src="(http[^"]*)"', str(client.widget_state))
        picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(still))))
        np.testing.assert_array_equal(picture, render(names["scene"], size=(640, 480)))
        await live(url, names["scene"])
    print("done")


async def live(url: str, scene: Scene) -> None:
    """The frame shows what a plotter draws here, and turns."""
    async with opened(url, size=(600, 400)) as page:
        height, width = (await seen(page)).shape[:2]
        plotter = pv.Plotter(off_screen=True, window_size=[width, height])
        plotter.decals.add_scene(scene, camera=True)
        here = drawn(plotter)[MENU:]
        async with asyncio.timeout(PATIENCE):
            while np.abs((await seen(page))[MENU:] - here).mean() > LOSS:
                await asyncio.sleep(0.1)
            await drag(page, plotter, (150, 150), (200, 160), (280, 190))
            while np.abs((await seen(page))[MENU:] - here).mean() < 2 * LOSS:
                await asyncio.sleep(0.1)
        plotter.close()


if __name__ == "__main__":
    asyncio.run(main())
