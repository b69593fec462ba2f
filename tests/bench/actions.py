"""How long each action blocks the window: ``python -m tests.bench.actions [--json PATH] [--quick]``.

Every gesture of the key table is made in a window without a screen, among 1,000, 20,000 and 100,000 decals,
on a mesh and on a tree. What counts is the longest time between two chances for the window to listen: the
event itself and each look after the background work, with all that a frame brings to the graphics card, but
without the drawing. On a machine with other work the processor time of the window's thread, which stands
behind, says more. Where something goes on in the background the last column has its whole time.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from decals.edit import EditSession
from decals.edit.keys import BINDINGS, CAMERA
from decals.scenes.scene import MeshObject
from decals.window import EditWindow
from tests.bench.scenes import bench_scene
from tests.bench.window import Figures, machine
from tests.window.driver import Driver

TARGET = 100.0
"""Milliseconds that the window may be deaf."""
COUNTS = (1_000, 20_000, 100_000)
MODELS = ("knot", "creature")
SIZE = (600, 400)
RUNS = 2
KEYS = {"pick": "Click", "pick_also": "Shift+Click"}
"""Gestures that are no keys, where the table has no key for an action."""
OF_SELECTED = (
    "duplicate", "delete", "larger", "smaller", "turn_left", "turn_right", "next_image", "previous_image",
    "next_tint", "fainter", "stronger", "layer_up", "layer_down", "next_interaction",
)  # fmt: skip
OF_TREES = (
    "grip", "grip_move", "thicker", "thinner", "next_color", "next_join", "new_ball", "new_limb",
)  # fmt: skip
BEFORE = {"redo": "undo"}
"""What is done first, untimed."""


class Times(NamedTuple):
    """Longest time without listening, on the clock and of the window's thread's processor, and all; in ms."""

    block: float
    used: float
    whole: float


class Hand:
    """Does one thing after another in a window, and measures how long that blocks."""

    def __init__(self, window: EditWindow) -> None:
        self.driver, self.window = Driver(window), window
        window.plotter.render = self._bring  # a frame but for its drawing
        self.at = self._place()

    def _bring(self) -> None:
        stage = self.window.stage
        look = stage._look(SIZE, 1.0, 1)
        stage.waiting = not stage._use_frame().ready(self.window.document, look)
        if not stage.waiting:  # otherwise the window makes programs, slice by slice
            with stage.current():
                stage.renderer._uploads.of(self.window.document)
                stage.renderer.context.gl.finish()

    def _place(self) -> tuple[int, int]:
        """A place where a decal shows."""
        width, height = SIZE
        rng = np.random.default_rng(0)
        for x, y in rng.integers((width // 4, height // 4), (3 * width // 4, 3 * height // 4), (1000, 2)):
            found = self.window.tools.at(int(x), int(y))
            if found is not None and found.owner >= 0:
                return int(x), int(y)
        raise RuntimeError("no decal is seen")

    def gesture(self, one: str) -> None:
        """Make a gesture of the key table."""
        *modifiers, name = one.split("+")
        held = {"ctrl": "Ctrl" in modifiers, "shift": "Shift" in modifiers}
        if name == "Click":
            self.driver.click(self.at, **held)
        elif name.startswith("Wheel"):
            self.driver.wheel(self.at, up=name == "WheelUp", **held)
        else:
            self.driver.key(name, self.at, **held)

    def blocks(self, step: Callable[[], object]) -> Times:
        """Do a step, and look after what it leaves to the background."""
        begin = time.perf_counter()
        times = [_timed(step)]
        while self.window.background.busy or self.window.stage.waiting:
            self.window._told = 0.0
            times.append(_timed(self.window.tick))
            time.sleep(0.005)
        block, used = np.max(times, axis=0)
        return Times(float(block), float(used), 1e3 * (time.perf_counter() - begin))

    def move_grip(self) -> Times:
        """Move the held primitive a little by its handle; the longest of taking it, moving and letting go."""
        widget = self.window.grip.widget
        center = np.array(widget.GetCenter())
        reach = 0.002 * float(np.linalg.norm(np.subtract(*self.window.document.scene.bounds)))
        found = [self.blocks(lambda: widget.InvokeEvent("StartInteractionEvent"))]
        for step in (1, 2, 3):
            widget.SetCenter(*np.add(center, (reach * step, 0, 0)).tolist())
            found.append(self.blocks(lambda: widget.InvokeEvent("InteractionEvent")))
        found.append(self.blocks(lambda: widget.InvokeEvent("EndInteractionEvent")))
        return _together(found)

    def drag(self) -> Times:
        """Drag what is selected; the longest of press, moves and release."""
        x, y = self.at
        events = [("LeftButtonPressEvent", self.at)]
        events += [("MouseMoveEvent", (x + step, y)) for step in (4, 8, 12)]
        events += [("LeftButtonReleaseEvent", (x + 12, y))]
        found = [
            self.blocks(lambda name=name, place=place: self.driver.event(name, place))  # type: ignore[misc]
            for name, place in events
        ]
        return _together(found)


def _together(found: list[Times]) -> Times:
    """Several steps as one."""
    blocks, used, wholes = np.array(found).T
    return Times(float(blocks.max()), float(used.max()), float(wholes.sum()))


def _timed(step: Callable[[], object]) -> tuple[float, float]:
    """Milliseconds that a step takes on the clock, and of the processor in this thread."""
    begin, used = time.perf_counter(), time.thread_time()
    step()
    return 1e3 * (time.perf_counter() - begin), 1e3 * (time.thread_time() - used)


def cases() -> Iterator[tuple[str, str, str, str]]:
    """Name, action, gesture, and what is selected before: "", "one" or "all"."""
    for binding in BINDINGS:
        if binding.action == CAMERA:
            continue
        keys = [one for one in binding.gestures if "Wheel" not in one and "Click" not in one]
        gesture = KEYS.get(binding.action) or keys[0]
        if binding.action in OF_SELECTED or binding.action == "move":
            for selected in ("one", "all"):
                yield f"{binding.action}_{selected}", binding.action, gesture, selected
        else:
            yield binding.action, binding.action, gesture, ""
    yield "grip_move", "grip_move", "m", ""
    for action in ("undo", "redo"):
        yield f"{action}_all", action, "Ctrl+z" if action == "undo" else "Ctrl+y", "all"


def measure(hand: Hand, action: str, gesture: str, selected: str) -> Times:
    """Median of a few runs of one case."""
    found = []
    for run in range(1 if action == "scatter" else RUNS + 1):
        hand.blocks(lambda: hand.gesture("Escape"))
        if selected:
            hand.gesture("Click")
        if selected == "all":
            hand.gesture("Ctrl+a")
        hand.blocks(lambda: None)
        if action in ("undo", "redo"):
            hand.blocks(lambda: hand.gesture("plus" if selected else "a"))
        if action in BEFORE:
            hand.blocks(lambda: hand.gesture("Ctrl+z"))
        steps = len(hand.window.session.labels)
        if action == "grip_move":
            hand.blocks(lambda: hand.gesture(gesture))
        special = {"move": hand.drag, "grip_move": hand.move_grip}
        times = special.get(action, lambda: hand.blocks(lambda: hand.gesture(gesture)))()
        found.append(times)
        hand.blocks(lambda: hand.window.actions.settle())
        while len(hand.window.session.labels) > (steps if action not in ("undo", "redo") else 0):
            hand.blocks(lambda: hand.gesture("Ctrl+z"))
        if hand.window.actions.grip:
            hand.blocks(lambda: hand.gesture("m"))
        if action == "help" and run == RUNS:
            hand.window.actions.help = False
    return Times(*np.median(found[1:] or found, axis=0).tolist())


def scene_figures(model: str, count: int, only: tuple[str, ...], folder: Path) -> Iterator[Figures]:
    """Measure all cases in one scene."""
    session = EditSession(bench_scene(model, count, SIZE))
    with EditWindow(session, path=folder / "scene.json", off_screen=True, size=SIZE, samples=1) as window:
        window.show()
        hand = Hand(window)
        for name, action, gesture, selected in cases():
            on_mesh = isinstance(session.document.objects[0], MeshObject)
            if action not in only or (on_mesh and action in OF_TREES):
                continue
            times = measure(hand, action, gesture, selected)
            yield {f"{model}_{count}_{name}_{key}_ms": value for key, value in times._asdict().items()}


def main() -> None:
    """Measure, print, and write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true", help="1,000 decals alone")
    parser.add_argument("--counts", default=",".join(map(str, COUNTS)))
    parser.add_argument("--models", default=",".join(MODELS))
    parser.add_argument("--skip", default="", help="some that are left out, such as scatter")
    parser.add_argument("--only", default="", help="some of the actions, as decals.edit.keys names them")
    arguments = parser.parse_args()
    counts = COUNTS[:1] if arguments.quick else tuple(int(count) for count in arguments.counts.split(","))
    skipped = arguments.skip.split(",")
    only = (
        tuple(arguments.only.split(",")) if arguments.only else tuple(action for _, action, _, _ in cases())
    )
    only = tuple(action for action in only if action not in skipped)
    print(f"python -m tests.bench.actions {' '.join(sys.argv[1:])}".rstrip(), machine(), sep="\n", flush=True)
    print(f"target: no block above {TARGET:g} ms; longest block, of that processor, whole time; in ms")
    figures: Figures = {}
    with TemporaryDirectory() as folder:
        for model in arguments.models.split(","):
            for count in counts:
                for found in scene_figures(model, count, only, Path(folder)):
                    figures |= found
                    block, used, whole = found.values()
                    key, over = next(iter(found)).removesuffix("_block_ms"), "over" * (block > TARGET)
                    print(f"{key:40} {block:>9.1f} {used:>9.1f} {whole:>9.1f} {over}".rstrip(), flush=True)
                    if arguments.json:
                        arguments.json.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
