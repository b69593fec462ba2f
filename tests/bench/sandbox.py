"""The sandbox in headless Chromium: milliseconds from a slider or a drag to the next frame in the browser.

Of all pages of lessons, ``lesson_first_s`` is the longest time to the first picture, and ``lesson_drag_ms``
the longest median of the script of one step of a drag.

``session_s`` is the time from the command of one session until its page is served, and
``session_processor_s`` that of the processors, which other programs hardly affect.

``server_ms`` is the time of a drag on the server alone: from its message until the picture is sent.
``server_slider_ms`` is that of a slider. With ``--server-only``, ``server_traced_ms`` and so on are of a
camera that turns, by the mode of the view.

    python -m tests.bench.sandbox
    python -m tests.bench.sandbox --decals 1000 --events 20 --json sandbox.json
    python -m tests.bench.sandbox --server-only     # no browser: for a remote machine with a graphics card

Needs playwright and Chromium, except with ``--server-only``. Frames are drawn by this process; without a
graphics card, on the processor.
"""

import asyncio
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from trame.app import get_server

import decals
from blobtree import Point
from decals.apps.sandbox.page import Page as SandboxPage
from decals.window import EditWindow
from decals.window.host_plotter import new_plotter
from decals.window.view_modes import MODES
from tests.bench.command_line import bench_parser, show, write
from tests.decals.window.driver import Driver

if TYPE_CHECKING:
    from playwright.async_api import Page

SIZE = 1200, 800
REST_SECONDS = 0.5
"""Time between two events."""

MOVE_SECONDS = 0.04
"""Time between two moves of the pointer; the page drops those that follow sooner."""

TREE = Point((0, 0, 0), radius=1.0) + Point((1.2, 0.4, 0), radius=0.6) + Point((-1.0, -0.3, 0.4), radius=0.5)

CHANGED = 24
"""Levels of 255 by which a pixel of another picture differs: JPEG changes them by less."""

IMAGE = 'img[src^="blob:"]'
"""The last picture in the page."""

WATCH = """([picture, changed]) => {
  const image = document.querySelector(picture), canvas = document.createElement('canvas');
  const pixels = () => {
    [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
    const context = canvas.getContext('2d', {willReadFrequently: true});
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, canvas.width, canvas.height).data;
  };
  const watch = window.watch = {arm: () => {
    [watch.before, watch.began, watch.ended] = [pixels(), null, null];
  }};
  const begin = event => { watch.began ??= event.timeStamp; };
  ['keydown', 'mousemove'].forEach(kind => window.addEventListener(kind, begin, true));
  image.addEventListener('load', () => {
    if (!watch.before || watch.ended || watch.began === null) return;
    const now = performance.now(), data = pixels();
    const differs = data.length !== watch.before.length
      || data.some((level, i) => Math.abs(level - watch.before[i]) > changed);
    if (differs) watch.ended = now;
  });
}"""
"""Note in the page when an event came, and when another picture had been decoded."""

LONGEST = 5.0
"""Seconds after which an event without a new frame counts as missed."""


SESSION = ("-m", "decals", "sandbox", "--port", "0", "--no-browser", "--session")


def session_start() -> dict[str, float]:
    """Return the times until a new process serves the page of an empty session."""
    began = time.perf_counter()
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(
            [sys.executable, *SESSION], cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        ) as process,
    ):
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(b"0123456789abcdef\n")
        process.stdin.flush()
        next(line for line in process.stdout if line.startswith(b"http://"))
        figures = {"session_s": time.perf_counter() - began}
        stat = Path(f"/proc/{process.pid}/stat")
        if stat.exists():  # Linux
            user, system = map(int, stat.read_text(encoding="ascii").rpartition(")")[2].split()[11:13])
            figures["session_processor_s"] = (user + system) / os.sysconf("SC_CLK_TCK")
        process.stdin.close()
    return figures


async def measure(count: int, events: int, *, server_only: bool = False) -> dict[str, float]:
    """Return the figures for a number of decals and of events."""
    began = time.perf_counter()
    scene = decals.cover(TREE, count=count, images=["scale"])
    plotter = new_plotter(True, SIZE)
    server = get_server("sandbox bench", client_type="vue3")
    window = EditWindow(scene, plotter=plotter)
    window.show()
    page = SandboxPage(server, window)
    figures = await (_on_server if server_only else _in_browser)(server, page, window, events, began)
    window.close()
    if server_only:
        return figures
    from tests.bench.lesson_pages import measured_lessons

    return figures | await measured_lessons(events)


async def _in_browser(
    server: Any, page: SandboxPage, window: EditWindow, events: int, began: float
) -> dict[str, float]:
    from tests.frontends.browsing import PICTURE, served, until

    on_server = _clock(page, window)
    async with served(server, size=SIZE, guard=page.guard) as browser:
        await until(lambda: not window.subplot.warming_up)
        figures = {"first_picture_warm_s": time.perf_counter() - began}
        await browser.wait_for_selector(IMAGE, state="attached")
        await browser.evaluate(WATCH, [IMAGE, CHANGED])
        await browser.get_by_text("Point").nth(1).click()
        slider = browser.get_by_role("slider", name="radius")
        await slider.focus()
        times = []
        for number in range(events):
            await asyncio.sleep(REST_SECONDS)
            times.append(await _timed(browser, browser.keyboard.press(("PageUp", "PageDown")[number % 2])))
        figures |= _summary("slider", times) | _summary("server_slider", on_server)
        on_server.clear()
        page.sandbox.select("")
        x, y = _picked_decal(window)
        box = await browser.locator(PICTURE).first.bounding_box()
        assert box is not None
        left, top = box["x"] + x, box["y"] + window.plotter.window_size[1] - y
        await browser.mouse.move(left, top)
        await browser.mouse.down()
        await until(lambda: window.tools.drags_decals)
        times = []
        for step in range(events):
            await asyncio.sleep(REST_SECONDS)
            x = left + 20 + 20 * (step % 2)
            first, event = browser.mouse.move(x - 1, top), browser.mouse.move(x, top)
            times.append(await _timed(browser, event, first))  # the page sends no first move after a rest
        await browser.mouse.up()
        return figures | _summary("drag", times) | _summary("server", on_server)


async def _on_server(
    server: Any, page: SandboxPage, window: EditWindow, events: int, began: float
) -> dict[str, float]:
    """Return the figures of the server alone, from the calls that a browser's messages lead to."""
    on_server = _clock(page, window)
    task = server.start(
        exec_mode="task", port=0, timeout=0, open_browser=False, show_connection_info=False, host="127.0.0.1"
    )
    await server.ready
    while window.subplot.warming_up:
        await asyncio.sleep(0.05)
    figures = {"first_picture_warm_s": time.perf_counter() - began}
    window.plotter.render_window.SetSize(SIZE)
    point = next(row["key"] for row in page.values()["outline"] if row["label"] == "Point")
    page.sandbox.select(point)
    for step in range(events):
        await asyncio.sleep(REST_SECONDS)
        page.sandbox.set_control("node", "radius", 1.0 + 0.05 * (1 + step % 2), last=False)
    await asyncio.sleep(REST_SECONDS)
    figures |= _summary("server_slider", on_server)
    page.sandbox.select("")
    x, y = _picked_decal(window)
    driver = Driver(window)
    driver.event("MouseMoveEvent", (x, y))
    driver.event("LeftButtonPressEvent", (x, y))
    assert window.tools.drags_decals
    await asyncio.sleep(REST_SECONDS)
    on_server.clear()
    for step in range(events):
        await asyncio.sleep(REST_SECONDS)
        driver.event("MouseMoveEvent", (x + 20 + 20 * (step % 2), y))
        page.view.update()  # as after each message of the view
    await asyncio.sleep(REST_SECONDS)
    driver.event("LeftButtonReleaseEvent", (x, y))
    figures |= _summary("server", on_server)
    for mode in MODES:
        page.sandbox.set_control("display", "mode", mode)
        await asyncio.sleep(REST_SECONDS)
        while window.busy or page.values()["display"]["busy"]:
            await asyncio.sleep(0.05)
        on_server.clear()
        for step in range(events):
            await asyncio.sleep(REST_SECONDS)
            window.begin_motion()
            window.subplot.vtk_renderer.camera.Azimuth((-5.0, 5.0)[step % 2])
            page.view.update()
        await asyncio.sleep(REST_SECONDS)
        figures |= _summary(f"server_{mode}", on_server)
    await server.stop()
    await task
    return figures


def _picked_decal(window: EditWindow) -> tuple[int, int]:
    """Select the decal in the middle of the view, and return its pixel, counted from the lower left."""
    driver = Driver(window)
    if next(driver.visible(), None) is None:
        driver.finish()  # a thread compiles the kernels of the first pick
    number, (x, y) = next(driver.visible())
    window.actions.state.selection = (number,)
    return x, y


def _clock(page: SandboxPage, window: EditWindow) -> list[float]:
    """Return the list to which every input adds its milliseconds on the server, until its picture is sent."""
    began: list[float] = []
    times: list[float] = []

    def starting(call: Callable[..., Any]) -> Callable[..., Any]:
        def started(*arguments: Any) -> Any:
            began.append(time.perf_counter())
            return call(*arguments)

        return started

    def publish(image: bytes, size: tuple[int, int], **to: str) -> None:
        sent(image, size, **to)
        if began:
            times.append(1000.0 * (time.perf_counter() - began[0]))
            began.clear()

    sent = page.view._publish
    page.view._publish = publish  # type: ignore[method-assign]
    page.sandbox.schedule = starting(page.sandbox.schedule)
    window.tools.move = starting(window.tools.move)  # type: ignore[method-assign]
    window.begin_motion = starting(window.begin_motion)  # type: ignore[method-assign]
    return times


async def _timed(
    browser: "Page", event: Coroutine[Any, Any, None], first: Coroutine[Any, Any, None] | None = None
) -> float:
    """Return the milliseconds from an event to another picture by the page's clock, −1 for none.

    Another event may come first, which changes nothing.
    """
    if first is not None:
        await first
        await asyncio.sleep(MOVE_SECONDS)
    await browser.evaluate("watch.arm()")
    began = time.perf_counter()
    await event
    while time.perf_counter() - began < LONGEST:
        await asyncio.sleep(0.05)
        taken: float | None = await browser.evaluate("watch.ended && watch.ended - watch.began")
        if taken is not None:
            return taken
    return -1.0


def _summary(name: str, times: list[float]) -> dict[str, float]:
    seen = [value for value in times if value >= 0.0]
    if not seen:
        return {f"{name}_missed": float(len(times))}
    middle, slow = np.percentile(seen, (50, 95))
    return {f"{name}_ms": middle, f"{name}_p95_ms": slow, f"{name}_missed": float(len(times) - len(seen))}


def main() -> None:
    """Print the figures, and write them."""
    parser = bench_parser("sandbox", __doc__)
    parser.add_argument("--decals", type=int, default=1000)
    parser.add_argument("--events", type=int, default=20)
    parser.add_argument("--server-only", action="store_true", help="no browser, only the server's times")
    options = parser.parse_args()
    figures = session_start()
    figures |= asyncio.run(measure(options.decals, options.events, server_only=options.server_only))
    show(figures)
    write(options.json, figures)


if __name__ == "__main__":
    main()
