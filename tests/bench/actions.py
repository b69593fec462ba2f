"""Benchmark of editor actions: ``python -m tests.bench.actions [--json PATH] [--quick]``.

Each gesture of the key table is made in an off-screen window with 1,000, 20,000 and 100,000 decals, on a mesh
and on a tree. The figure is the longest time in which the window handles no input: the event itself and each
poll of the background work, with the uploads of a frame but without drawing it. The second figure is the
processor time of the window's thread, which other programs do not affect. The third is the whole time,
background work included.
"""

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from decals import MeshObject
from decals.editing import KEYS, EditSession
from decals.editing.key_bindings import CAMERA
from decals.vtk.subplot import FrameStatus
from decals.window import EditWindow
from tests.bench.command_line import bench_parser, write
from tests.bench.scenes import bench_scene
from tests.bench.window import Figures, machine
from tests.decals.window.driver import Driver

TARGET = 100.0
"""Milliseconds in which the window may handle no input."""
COUNTS = (1_000, 20_000, 100_000)
MODELS = ("knot", "creature")
SIZE = (600, 400)
RUNS = 2
GESTURES = {"select": "Click", "select_also": "Shift+Click"}
"""Gestures of actions without a key."""
OF_SELECTED = (
    "duplicate", "delete", "larger", "smaller", "turn_left", "turn_right", "next_image", "previous_image",
    "next_tint", "fainter", "stronger", "layer_up", "layer_down", "next_interaction",
)  # fmt: skip
OF_TREES = (
    "select_primitive", "drag_primitive", "thicker", "thinner", "next_color", "next_join", "add_ball",
    "add_limb",
)  # fmt: skip
BEFORE = {"redo": "undo"}
"""Actions that an action needs before it, untimed."""


class Times(NamedTuple):
    """Longest block in wall time and in processor time of the window's thread, and whole time; in ms."""

    block: float
    used: float
    whole: float


class User:
    """A simulated user that performs gestures in a window and measures how long they block."""

    def __init__(self, window: EditWindow) -> None:
        self.driver, self.window = Driver(window), window
        window.plotter.render = self._bring  # a frame without its drawing
        self.at = self._place()

    def _bring(self) -> None:
        subplot = self.window.subplot
        options = subplot._frame_options(SIZE, 1.0, 1)
        warm = subplot._current_frames().is_warm(self.window.document, options)
        subplot.status = FrameStatus.DRAWN if warm else FrameStatus.WARMING_UP
        if not subplot.warming_up:  # otherwise the window compiles programs, slice by slice
            with subplot.current():
                subplot.renderer._uploads.scene(self.window.document, subplot.drawing)
                subplot.renderer.context.gl.finish()

    def _place(self) -> tuple[int, int]:
        """Return a pixel where a decal is visible."""
        width, height = SIZE
        rng = np.random.default_rng(0)
        for x, y in rng.integers((width // 4, height // 4), (3 * width // 4, 3 * height // 4), (1000, 2)):
            hit = self.window.tools.at(int(x), int(y))
            if hit is not None and hit.owner >= 0:
                return int(x), int(y)
        raise RuntimeError("no decal is visible")

    def gesture(self, one: str) -> None:
        """Perform a gesture of the key table."""
        *modifiers, name = one.split("+")
        held = {"ctrl": "Ctrl" in modifiers, "shift": "Shift" in modifiers}
        if name == "Click":
            self.driver.click(self.at, **held)
        elif name.startswith("Wheel"):
            self.driver.wheel(self.at, up=name == "WheelUp", **held)
        else:
            self.driver.key(name, self.at, **held)

    def blocks(self, step: Callable[[], object]) -> Times:
        """Perform a step, and wait for the background work that it starts."""
        begin = time.perf_counter()
        times = [_timed(step)]
        while self.window.background.busy or self.window.subplot.warming_up:
            self.window._status_limit._last = 0.0
            times.append(_timed(self.window.tick))
            time.sleep(0.005)
        block, used = np.max(times, axis=0)
        return Times(float(block), float(used), 1e3 * (time.perf_counter() - begin))

    def drag_primitive(self) -> Times:
        """Move the selected primitive by its handle; measure start, moves and end."""
        widget = self.window.handle.widget
        center = np.array(widget.GetCenter())
        reach = 0.002 * float(np.linalg.norm(np.subtract(*self.window.document.scene.bounds)))
        results = [self.blocks(lambda: widget.InvokeEvent("StartInteractionEvent"))]
        for step in (1, 2, 3):
            widget.SetCenter(*np.add(center, (reach * step, 0, 0)).tolist())
            results.append(self.blocks(lambda: widget.InvokeEvent("InteractionEvent")))
        results.append(self.blocks(lambda: widget.InvokeEvent("EndInteractionEvent")))
        return _combined(results)

    def drag(self) -> Times:
        """Drag the selection; measure press, moves and release."""
        x, y = self.at
        events = [("LeftButtonPressEvent", self.at)]
        events += [("MouseMoveEvent", (x + step, y)) for step in (4, 8, 12)]
        events += [("LeftButtonReleaseEvent", (x + 12, y))]
        results = [
            self.blocks(lambda name=name, place=place: self.driver.event(name, place))  # type: ignore[misc]
            for name, place in events
        ]
        return _combined(results)


def _combined(results: list[Times]) -> Times:
    """Combine the times of several steps."""
    blocks, used, wholes = np.array(results).T
    return Times(float(blocks.max()), float(used.max()), float(wholes.sum()))


def _timed(step: Callable[[], object]) -> tuple[float, float]:
    """Return the wall time and the processor time of this thread for a step, in ms."""
    begin, used = time.perf_counter(), time.thread_time()
    step()
    return 1e3 * (time.perf_counter() - begin), 1e3 * (time.thread_time() - used)


def cases() -> Iterator[tuple[str, str, str, str]]:
    """Yield name, action, gesture and previous selection ("", "one" or "all") of each case."""
    for binding in KEYS.bindings:
        if binding.action == CAMERA:
            continue
        keys = [one for one in binding.gestures if "Wheel" not in one and "Click" not in one]
        gesture = GESTURES.get(binding.action) or keys[0]
        if binding.action in OF_SELECTED or binding.action == "move":
            for selected in ("one", "all"):
                yield f"{binding.action}_{selected}", binding.action, gesture, selected
        else:
            yield binding.action, binding.action, gesture, ""
    yield "drag_primitive", "drag_primitive", "m", ""
    for action in ("undo", "redo"):
        yield f"{action}_all", action, "Ctrl+z" if action == "undo" else "Ctrl+y", "all"


def measure(user: User, action: str, gesture: str, selected: str) -> Times:
    """Return the median times of some runs of a case."""
    results = []
    for run in range(1 if action == "scatter" else RUNS + 1):
        user.blocks(lambda: user.gesture("Escape"))
        if selected:
            user.gesture("Click")
        if selected == "all":
            user.gesture("Ctrl+a")
        user.blocks(lambda: None)
        if action in ("undo", "redo"):
            user.blocks(lambda: user.gesture("plus" if selected else "a"))
        if action in BEFORE:
            user.blocks(lambda: user.gesture("Ctrl+z"))
        steps = len(user.window.session.labels)
        if action == "drag_primitive":
            user.blocks(lambda: user.gesture(gesture))
        special = {"move": user.drag, "drag_primitive": user.drag_primitive}
        times = special.get(action, lambda: user.blocks(lambda: user.gesture(gesture)))()
        results.append(times)
        user.blocks(lambda: user.window.actions.state.end_stroke())
        while len(user.window.session.labels) > (steps if action not in ("undo", "redo") else 0):
            user.blocks(lambda: user.gesture("Ctrl+z"))
        if user.window.actions.state.primitive:
            user.blocks(lambda: user.gesture("m"))
        if action == "help" and run == RUNS:
            user.window.actions.help_page = 0
    return Times(*np.median(results[1:] or results, axis=0).tolist())


def scene_figures(model: str, count: int, only: tuple[str, ...], folder: Path) -> Iterator[Figures]:
    """Measure all cases in a scene."""
    session = EditSession(bench_scene(model, count, SIZE))
    with EditWindow(session, path=folder / "scene.json", off_screen=True, size=SIZE, samples=1) as window:
        window.show()
        user = User(window)
        for name, action, gesture, selected in cases():
            on_mesh = isinstance(session.document.objects[0], MeshObject)
            if action not in only or (on_mesh and action in OF_TREES):
                continue
            times = measure(user, action, gesture, selected)
            yield {f"{model}_{count}_{name}_{key}_ms": value for key, value in times._asdict().items()}


def main() -> None:
    """Parse the command line, measure, print and write."""
    parser = bench_parser("actions", __doc__)
    parser.add_argument("--quick", action="store_true", help="only 1,000 decals")
    parser.add_argument("--counts", default=",".join(map(str, COUNTS)))
    parser.add_argument("--models", default=",".join(MODELS))
    parser.add_argument("--skip", default="", help="actions to leave out, such as scatter")
    parser.add_argument("--only", default="", help="actions to measure, as in decals.editing.KEYS")
    arguments = parser.parse_args()
    counts = COUNTS[:1] if arguments.quick else tuple(int(count) for count in arguments.counts.split(","))
    skipped = arguments.skip.split(",")
    only = (
        tuple(arguments.only.split(",")) if arguments.only else tuple(action for _, action, _, _ in cases())
    )
    only = tuple(action for action in only if action not in skipped)
    print(f"python -m tests.bench.actions {' '.join(sys.argv[1:])}".rstrip(), machine(), sep="\n", flush=True)
    print(f"target: no block above {TARGET:g} ms; longest block, its processor time, whole time; in ms")
    figures: Figures = {}
    with TemporaryDirectory() as folder:
        for model in arguments.models.split(","):
            for count in counts:
                for results in scene_figures(model, count, only, Path(folder)):
                    figures |= results
                    block, used, whole = results.values()
                    key, over = next(iter(results)).removesuffix("_block_ms"), "over" * (block > TARGET)
                    print(f"{key:40} {block:>9.1f} {used:>9.1f} {whole:>9.1f} {over}".rstrip(), flush=True)
                    write(arguments.json, figures)


if __name__ == "__main__":
    main()
