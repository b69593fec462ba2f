"""A real browser before a page that this process serves: what it shows, and user for it."""

import asyncio
import io
import shutil
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from contextvars import ContextVar
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from PIL import Image
from playwright.async_api import Browser, ConsoleMessage, Locator, Page, Playwright, async_playwright, expect

from decals.apps.sandbox.guard import Guard

CHOSEN: ContextVar[str] = ContextVar("browser", default="chromium")
"""The browser of all checks, "chromium" or "firefox"."""

NAMES = ("chromium", "chromium-browser", "google-chrome")
SIZE = (500, 380)
PATIENCE = 120
"""Seconds: the first frame compiles shaders."""
expect.set_options(timeout=1000 * PATIENCE)
PICTURE = "canvas, img.image-display-area"
"""Where trame's views show what they get."""
ABOVE = "svg, .brush { visibility: hidden !important }"
"""Hides the orientation cube, handles and the circle of the brush."""
ON_SCREEN = """circle => {
  const onto = circle.getScreenCTM();
  const {x, y} = new DOMPoint(circle.cx.baseVal.value, circle.cy.baseVal.value).matrixTransform(onto);
  return [x, y, circle.r.baseVal.value * onto.a];
}"""
"""Centre and radius of a circle on the screen; the boxes of browsers hold more or less of its line too."""

REST_MS = 300
"""Milliseconds for which a finger rests before it is lifted."""

ERRORS = """window.pageErrors = [];
window.addEventListener('error', event => window.pageErrors.push(event.message));"""
"""Collects the errors that a page shows in its console, also those of observers."""
REFUSED = "net::ERR_CONNECTION_REFUSED"
LOSS = 2.0
"""Levels of 255 in the mean that JPEG may take away."""


def browser_path() -> str | None:
    """Where a browser of Chromium's kind is installed."""
    return next((path for path in map(shutil.which, NAMES) if path), None)


def firefox_path() -> str | None:
    """Where Firefox is installed."""
    return next((path for path in map(shutil.which, ("firefox", "firefox-esr")) if path), None)


async def launched(player: Playwright) -> Browser:
    """Start the chosen browser; playwright drives Debian's Firefox on a screen alone, such as xvfb's."""
    if CHOSEN.get() == "firefox":
        return await player.firefox.launch(
            channel="moz-firefox", executable_path=firefox_path(), headless=False
        )
    arguments = ["--no-sandbox", "--disable-gpu"]
    return await player.chromium.launch(executable_path=browser_path(), args=arguments)


@asynccontextmanager
async def opened(
    url: str, *, size: tuple[int, int] = SIZE, ends: bool = False, touch: bool = False
) -> AsyncIterator[Page]:
    """A page in a browser without a screen, which must end without an error; its server may end before.

    The console of the sandbox's pages, whose address has a token, stays empty.
    """
    async with async_playwright() as player:
        browser = await launched(player)
        page = await browser.new_page(viewport={"width": size[0], "height": size[1]}, has_touch=touch)
        page.set_default_timeout(1000 * PATIENCE)
        written: list[str] = []
        page.on("console", lambda message: written.append(line_of(message)))
        page.on("pageerror", lambda error: written.append(str(error)))
        await page.add_init_script(ERRORS)
        await page.goto(url)
        await page.wait_for_selector(PICTURE)
        yield page
        errors = await page.evaluate("window.pageErrors")
        assert errors == [], errors
        if "token=" in url:
            assert [line for line in written if not (ends and REFUSED in line)] == []
        await browser.close()


def line_of(message: ConsoleMessage) -> str:
    """What a page writes to its console, and where."""
    return f"{message.type}: {message.text} ({message.location.get('url')})"


@asynccontextmanager
async def served(
    server: Any, *, size: tuple[int, int] = SIZE, guard: Guard | None = None, touch: bool = False
) -> AsyncIterator[Page]:
    """The page of a trame server of this process, which may have a guard."""
    task = server.start(
        exec_mode="task",
        host="127.0.0.1",
        port=0,
        timeout=0,
        open_browser=False,
        show_connection_info=False,
    )
    await server.ready
    url = guard.url(server.port) if guard else f"http://127.0.0.1:{server.port}/"
    async with opened(url, size=size, touch=touch) as page:
        yield page
    await server.stop()
    await task


async def seen(page: Page) -> np.ndarray:
    """The picture in the page's canvas, ``int[h, w, 3]``, without what the page draws above it."""
    data = await page.locator(PICTURE).first.screenshot(style=ABOVE)
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)


def drawn(plotter: pv.Plotter) -> np.ndarray:
    """The picture that pyvista saves, ``int[h, w, 3]``."""
    return np.asarray(plotter.screenshot(None, return_img=True))[..., :3].astype(int)


async def until(true: Callable[[], bool]) -> None:
    """Let the server go on until something is so."""
    async with asyncio.timeout(PATIENCE):
        while not true():
            await asyncio.sleep(0.05)


async def shows(page: Page, plotter: pv.Plotter) -> np.ndarray:
    """Wait until the browser shows what the plotter draws; that picture."""
    async with asyncio.timeout(PATIENCE):
        while True:
            there, here = await seen(page), drawn(plotter)
            if there.shape == here.shape and np.abs(there - here).mean() < LOSS:
                return here
            await asyncio.sleep(0.1)


async def point(page: Page, plotter: pv.Plotter, *places: tuple[int, int]) -> None:
    """Move the pointer over the canvas; places count from the lower left, as VTK's do."""
    box = await page.locator(PICTURE).first.bounding_box()
    assert box is not None
    height = plotter.window_size[1]
    for x, y in places:
        await page.mouse.move(box["x"] + x + 0.5, box["y"] + height - 1 - y + 0.5)
        await asyncio.sleep(0.05)


async def drag(page: Page, plotter: pv.Plotter, *places: tuple[int, int]) -> None:
    """A drag over the canvas with the left button."""
    await point(page, plotter, places[0])
    await page.mouse.down()
    await point(page, plotter, *places[1:])
    await page.mouse.up()


async def pull(page: Page, start: tuple[float, float], by: tuple[float, float], *, steps: int = 5) -> None:
    """A drag of the mouse from a place of the page by some pixels, in several steps."""
    await page.mouse.move(*start)
    await page.mouse.down()
    await page.mouse.move(start[0] + by[0], start[1] + by[1], steps=steps)
    await page.mouse.up()


async def trace(page: Page, circle: Locator, *, finger: bool = False) -> None:
    """Draw along a circle of the page with the mouse, or in Chromium with a finger."""
    await circle.scroll_into_view_if_needed()
    x, y, radius = await circle.evaluate(ON_SCREEN)
    angles = np.linspace(0.0, 2.0 * np.pi, 60)
    places = np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1)
    if finger:
        touch = await page.context.new_cdp_session(page)
        points = [[{"x": right, "y": down}] for right, down in places.tolist()]
        steps = [("touchStart", points[0]), *(("touchMove", at) for at in points[1:]), ("touchEnd", [])]
        for kind, at in steps:
            if (
                kind == "touchEnd"
            ):  # a finger that is lifted in motion glides on, and the next tap ends that alone
                await page.wait_for_timeout(REST_MS)
            await touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": at})
        return
    await page.mouse.move(*places[0])
    await page.mouse.down()
    for place in places[1:]:
        await page.mouse.move(*place)
    await page.mouse.up()


async def violations(page: Page, part: str = "html") -> list[dict[str, Any]]:
    """What axe-core finds in a part of a page; axe-playwright-python brings its script."""
    found = find_spec("axe_playwright_python")
    assert found is not None, "pip install axe-playwright-python"
    assert found.origin is not None
    await page.evaluate((Path(found.origin).parent / "axe.min.js").read_text(encoding="utf-8"))
    run = "part => axe.run(part, { resultTypes: ['violations'] }).then(result => result.violations)"
    listed: list[dict[str, Any]] = await page.evaluate(run, part)
    return listed
