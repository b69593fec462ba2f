"""Benchmark of response times: ``python -m tests.bench.window [--json PATH] [--quick] [--only drag,turn]``.

Synthetic events drive an off-screen window with 1,000 decals. Each step runs from the event to the finished
frame. Wall time includes other work of the machine. Processor time of all threads, llvmpipe's included,
divided by the cores is a lower bound of the time on an idle machine.
"""

import os
import platform
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from decals.editing import EditSession
from decals.window import EditWindow
from decals.window.frames import REFINE_DELAY, FrameState
from tests.bench.command_line import bench_parser, write
from tests.bench.opening import opening
from tests.bench.scenes import bench_scene
from tests.decals.window.driver import Driver

Figures = dict[str, float]

TARGETS = {
    "knot_drag_ms": "≤ 100",
    "creature_drag_ms": "≤ 100",
    "knot_turn_ms": "≤ 100",
    "creature_turn_ms": "≤ 100",
    "creature_primitive_ms": "≤ 100",
    **{
        f"{name}_{kind}_longest_ms": "≤ 100"
        for name in ("knot", "creature")
        for kind in ("scatter", "relax", "save")
    },
    "knot_rest_longest_block_ms": "≤ 100",
    "creature_rest_longest_block_ms": "≤ 100",
    "knot_1000_open_longest_block_ms": "≤ 100",
    "knot_100000_open_longest_block_ms": "≤ 100",
    "creature_1000_open_longest_block_ms": "≤ 100",
    "creature_100000_open_longest_block_ms": "≤ 100",
}
MODELS = ("knot", "creature")
BACKGROUND = {"scatter": "g", "relax": "x", "save": "Ctrl+s"}
"""Background jobs and their keys."""
KINDS = ("open", "whole", "rest", "drag", "turn", "primitive", *BACKGROUND)
OPENED = (1_000, 100_000)
"""Numbers of decals in opened windows; the driver caches shaders (Mesa: MESA_SHADER_CACHE_DIR)."""
STEPS = 25
MAX_SCATTERED = 1000
"""Number of decals up to which `decals.scatter` distributes them."""
EVENT_INTERVAL = 1 / 60
"""Seconds between two input events during background work."""
WARM_UP = 8
"""Untimed first steps, which compile programs and settle the scale of frames."""


def timed(step: Callable[[], object]) -> tuple[float, float]:
    """Return the wall and processor time of a step in ms."""
    wall, used = time.perf_counter(), time.process_time()
    step()
    cores = os.cpu_count() or 1
    return 1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - used) / cores


def medians(name: str, times: list[tuple[float, float]]) -> Figures:
    """Return the medians of the timed steps."""
    wall, used = np.array(times[WARM_UP:] or times).T
    return {f"{name}_ms": float(np.median(wall)), f"{name}_busy_ms": float(np.median(used))}


def around(at: tuple[int, int], steps: int, radius: float = 30.0) -> list[tuple[int, int]]:
    """Return pixels on a spiral around a pixel."""
    angles = np.linspace(0, 4 * np.pi, steps)
    return [
        (int(at[0] + radius * t / 12 * np.cos(t)), int(at[1] + radius * t / 12 * np.sin(t))) for t in angles
    ]


def drag(driver: Driver, name: str, steps: int) -> Figures:
    """Drag one decal; steps beside the surface, which change nothing, do not count."""
    _, at = next(driver.visible())
    driver.click(at)
    driver.event("LeftButtonPressEvent", at)
    subplot = driver.window.subplot
    draw, drawn = subplot.draw, []
    subplot.draw = lambda: drawn.append(timed(draw)[0])  # type: ignore[method-assign]
    times: list[tuple[float, float]] = []
    shares = []
    for place in around(at, 2 * steps + WARM_UP, radius=15.0):
        before = driver.document.decals.version
        step = timed(lambda place=place: driver.event("MouseMoveEvent", place))  # type: ignore[misc]
        if driver.document.decals.version == before:
            del drawn[len(times) :]
            continue
        times.append(step)
        shares.append(subplot.drawn_fraction)
    del subplot.draw
    scale = driver.window.subplot.draw_scale
    driver.event("LeftButtonReleaseEvent", at)
    driver.key("z", ctrl=True)
    return medians(f"{name}_drag", times) | {
        f"{name}_drag_scale": scale,
        f"{name}_drag_draw_ms": float(np.median(drawn[WARM_UP:] or drawn)),
        f"{name}_drag_share": float(np.median(shares[WARM_UP:] or shares)),
        f"{name}_drag_steps": len(times[WARM_UP:] or times),
    }


def turn(driver: Driver, name: str, steps: int) -> Figures:
    """Turn the camera."""
    driver.key("Escape")
    driver.event("LeftButtonPressEvent", (4, 4))
    places = [(4 + 5 * step, 4 + 2 * step) for step in range(steps + WARM_UP)]
    times = [
        timed(lambda place=place: driver.event("MouseMoveEvent", place))  # type: ignore[misc]
        for place in places
    ]
    driver.event("LeftButtonReleaseEvent", (4, 4))
    return medians(f"{name}_turn", times)


def primitive(driver: Driver, name: str, steps: int) -> Figures:
    """Move a primitive by its handle."""
    _, at = next(driver.visible())
    driver.key("m", at)
    handle = driver.window.handle
    center = np.array(handle.widget.GetCenter())
    reach = 0.002 * float(np.linalg.norm(np.subtract(*driver.document.scene.bounds)))

    def move(step: int) -> None:
        handle.widget.SetCenter(*np.add(center, (reach * step, 0, 0)).tolist())
        handle.widget.InvokeEvent("InteractionEvent")

    handle.widget.InvokeEvent("StartInteractionEvent")
    times = [timed(lambda step=step: move(step)) for step in range(steps + WARM_UP)]  # type: ignore[misc]
    handle.widget.InvokeEvent("EndInteractionEvent")
    driver.key("z", ctrl=True)
    driver.key("m", at)
    return medians(f"{name}_primitive", times)


def background(driver: Driver, name: str, kind: str) -> Figures:
    """Turn the camera while a background job runs."""
    gesture = BACKGROUND[kind]
    _, at = next(driver.visible())
    begin = time.perf_counter()
    first = timed(lambda: driver.key(gesture[-1], at, ctrl=gesture.startswith("Ctrl")))[0]
    driver.event("LeftButtonPressEvent", (4, 4))
    place, times, looks = 4, [], [0.0]
    while driver.window.background.busy:
        place = 4 + (place + 3) % 200
        times.append(timed(lambda: driver.event("MouseMoveEvent", (place, 9)))[0])  # noqa: B023
        driver.window._status_limit._last = np.inf  # frames come by themselves
        looks.append(timed(driver.window.tick)[0])
        time.sleep(max(0.0, EVENT_INTERVAL - 1e-3 * (times[-1] + looks[-1])))
    driver.event("LeftButtonReleaseEvent", (4, 4))
    return {
        f"{name}_{kind}_s": time.perf_counter() - begin,
        f"{name}_{kind}_key_ms": first,
        f"{name}_{kind}_median_ms": float(np.median(times)),
        f"{name}_{kind}_longest_ms": max(times),
        f"{name}_{kind}_seen_ms": looks[-1],
    }


def whole(window: EditWindow, name: str) -> Figures:
    """Draw whole frames with one sample per pixel."""

    def elsewhere() -> None:
        window.plotter.camera.Azimuth(1.0)  # an unchanged frame is not drawn again
        window.draw_whole_frame()

    wall, used = np.median([timed(elsewhere) for _ in range(3)], axis=0)
    return {f"{name}_whole_ms": float(wall), f"{name}_whole_busy_ms": float(used)}


def rest(window: EditWindow, name: str) -> Figures:
    """Refine the frame after a movement, until it is whole with four samples per pixel.

    The longest block is the longest time in which the window handles no input, in wall time and in processor
    time of all threads, which other programs do not affect.
    """
    window.frames.samples = 2
    window.redraw(whole=False)
    window.frames._changed_at -= REFINE_DELAY
    begin, ticks = time.perf_counter(), []
    while window.frames.state is FrameState.COARSE:
        ticks.append(timed(window.tick))
    seconds = time.perf_counter() - begin
    window.frames.samples = 1
    longest, used = np.max(ticks, axis=0)
    return {
        f"{name}_rest_longest_block_ms": float(longest),
        f"{name}_rest_longest_used_ms": float(used) * (os.cpu_count() or 1),
        f"{name}_rest_slices": len(ticks),
        f"{name}_rest_s": seconds,
    }


def measure(
    name: str, kinds: tuple[str, ...], size: tuple[int, int], count: int, steps: int
) -> Iterator[Figures]:
    """Measure a model with each kind of input."""
    if "open" in kinds:
        for decals in OPENED:
            yield opening(name, size, decals)
    if set(kinds) <= {"open"}:
        return
    session = EditSession(bench_scene(name, count, size, scattered=count <= MAX_SCATTERED))
    with (
        TemporaryDirectory() as folder,
        EditWindow(
            session, path=Path(folder) / "scene.json", off_screen=True, size=size, samples=1
        ) as window,
    ):
        window.show()
        at_rest = {"whole": whole, "rest": rest}
        for kind, resting in at_rest.items():
            if kind in kinds:
                yield resting(window, name)
        window.draw_whole_frame = window.plotter.render  # type: ignore[method-assign]
        driver = Driver(window)
        moving = {"drag": drag, "turn": turn}
        if name == "creature":
            moving |= {"primitive": primitive}
        for kind, step in moving.items():
            if kind in kinds:
                window.begin_motion()
                yield step(driver, name, steps)
        for kind in BACKGROUND:
            if kind in kinds:
                window.begin_motion()
                yield background(driver, name, kind)


def machine() -> str:
    """Describe the machine."""
    packages = ", ".join(f"{name} {version(name)}" for name in ("vtk", "pyvista", "moderngl", "warp-lang"))
    with EditWindow(bench_scene("knot", 10, (64, 48)), off_screen=True, size=(64, 48)) as window:
        window.show()
        card = window.subplot.renderer.context.name
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    return f"{platform.machine()}, {os.cpu_count()} cores, load {load:.1f}; {card}; {packages}"


def main() -> None:
    """Parse the command line, measure, print and write."""
    parser = bench_parser("window", __doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--size", default="1200x800")
    parser.add_argument("--count", type=int, default=1000, help="decals")
    parser.add_argument("--only", default=",".join(KINDS), help=f"some of {', '.join(KINDS)}")
    arguments = parser.parse_args()
    width, height = (int(side) for side in arguments.size.split("x"))
    kinds, steps = tuple(arguments.only.split(",")), 8 if arguments.quick else STEPS
    if not set(kinds) <= set(KINDS):
        parser.error(f"--only: expected some of {', '.join(KINDS)}, got {arguments.only}")
    print(f"python -m tests.bench.window {' '.join(sys.argv[1:])}".rstrip(), machine(), sep="\n", flush=True)
    figures: Figures = {}
    for name in MODELS:
        for found in measure(name, kinds, (width, height), arguments.count, steps):
            figures |= found
            for key, value in found.items():
                print(f"{key:32} {value:>12.4g}  {TARGETS.get(key, '')}".rstrip(), flush=True)
            write(arguments.json, figures)


if __name__ == "__main__":
    main()
