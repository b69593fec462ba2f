"""Random messages of two browsers to the sandbox's server: valid, malformed, torn and in wrong orders.

    python -m tests.apps.sandbox.messages --count 10000

Browsers vanish while they drag and while they wait for answers; a third one takes 2 s for each picture.
Strangers ask with wrong tokens and as foreign pages. A fifth of the messages goes to a page that the browsers
share: messages of the one that only watches must change nothing. The figures are printed as JSON: errors of
the server, what strangers and watchers got, connections that the server ended without a reason, whether
undoing all restores the first scene bit for bit, and the growth of the memory once the first tenth has been
sent and once the first half has. Browsers and server share a loop, so the server does not look whether
browsers are alive: on a busy machine they would seem dead.

They also say for how long the server's loop did not return to its other tasks: time on the clock, which other
work on the machine lengthens, and processor time of the loop's thread. Those with most of that are listed
with the last message, the mode of the view, and the place in the program at which they were late. Places at
which that thread loads kernels are listed too, and each counts as a failure: it would wait for their
compilation on a machine that has none.
"""

import argparse
import asyncio
import contextlib
import json
import logging
import math
import os
import random
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any
from unittest.mock import patch

import numpy as np

from decals.apps.memory import import_ahead, keep_memory_low, share_heap
from decals.editing import KEYS
from decals.window import EditWindow
from tests.apps.sandbox.attacks import Server
from tests.apps.sandbox.browsers import CALLS, SIZE, Browser, Connect, serve
from tests.apps.sandbox.kernel_waits import KernelWaits, kernel_waits
from tests.apps.sandbox.misuse import ask_as_stranger, random_steps
from tests.decals.editing.scenes import digest
from tests.endurance import growth, kept_megabytes

ODD: list[Any] = [None, "", "x", -1, 0, 7, 0.5, 1e308, float("nan"), True, [], {}, [1, 2, 3], "0", "#00ff00"]
ODD += [{"a": 1}, "\0", "x" * 3000, [[1, [2]]], -(2**40), b"\xff"]
KEYS_OF_ROWS = ["", "0", "0/0", "0/1", "0/1/0", "object 0", "object 1", "image 0", "1", "9/9", "-1", "a/b"]
UNDONE = ("close", "camera", "move", "add_image", "save", "save_as", "export")
ACTIONS = [binding.action for binding in KEYS.bindings if binding.action not in UNDONE]
KINDS = ["Point", "Torus", "Box", "Twist", "Repeat", "Offset", "Union", "Difference", "Nothing"]
NAMES = ["radius", "center", "degrees", "color", "opacity", "layer", "image", "tint", "spill", "interaction"]
OPTIONS = ["mode", "overlay", "slice", "slice_position", "slice_normal", "up", "orthographic", "axes"]
SHOWN = ["traced", "polygonized", "normals", "none", "seeds", "owners", "folds", "contact lines", "x", "z"]
FIRST_VIEW = {"mode": "traced", "overlay": "none", "slice": "none"}
CHANGES = ["rename", "remove", "duplicate", "move", "group", "hide", "lock", "isolate"]
HANDLES = ["move", "move x", "turn y", "scale", "start 0", "slice", "tilt slice"]
EVENTS: dict[str, list[list[Any]]] = {
    "select": [KEYS_OF_ROWS],
    "mark": [KEYS_OF_ROWS],
    "open_lesson": [[0, 1, 9, -1, "x"]],
    "set_control node": [
        ["node"],
        NAMES,
        [0.2, 0.9, "3", [0, 0, 1], "#ff0000"],
        [True, False],
        [[], [], [0], [1], [9]],
    ],
    "scatter": [],
    "scatter_zone": [],
    "add": [KINDS],
    "add_at": [KINDS, ["view 5000/5000", "view 0/10000", "view 99999/1", "0/1"], ["", "view 6000/5000"]],
    "wrap": [KINDS],
    "combine": [KINDS],
    "unwrap": [],
    "perform": [ACTIONS],
    "show_help": [[True, False]],
    "go_to": [[0, 1, 2, 3, 5]],
    "set_control display": [
        ["display"],
        OPTIONS,
        [*SHOWN, 0.3, True, False],
        [True, False],
        [[], [], [0], [1], [9]],
    ],
    "pinch": [[0.1, 0.0], [-0.2, 0.0], [0.5, 1.0, 3.0], ["begin", "move", "end"], [2, 3]],
    "move_camera": [["frame", "look", "keep", "go"], ["front", "top", 0, 3]],
    "set_control decals": [
        ["decals"],
        NAMES,
        [0.1, 0.5, 2, "overlap", "tint alone", "#0000ff", True],
        [True, False],
    ],
    "set_control brush": [
        ["brush"],
        ["brush", "radius", "density", "images"],
        ["select", "scatter", "push", "lasso", 0.3, ["scale"]],
    ],
    "set_control drawing": [
        ["drawing"],
        ["contact", "mapping", "stiffness", "filtered"],
        ["product", "elastic", "walked", 2.0],
    ],
    "set_control scattering": [
        ["scattering"],
        ["count", "factor", "sizing", "jitter.size", "images", "zone_density", "same_on_copies"],
        [3, "10", 0.5, "touching", ["scale"], True],
    ],
    "set_control image": [["image"], ["roughness", "relief"], [0.2, 0.5], [True, False]],
    "change_row": [KEYS_OF_ROWS, CHANGES, ["name", "0/1", "0"]],
    "drag_handle": [HANDLES, ["begin", "move", "end"], [0.1, 0.5, 0.8], [0.3, 0.6], [True, False]],
    "open_file": [["../x.json", "none.json", "a\0.json"]],
    "read_file": [["../x.json", "scene.json", "mine.py"], [0, 5, -1]],
    "write_file": [["../x.py", "x.exe", "no/x.json"]],
    "add_built_in": [["eye", "tile", "x"]],
    "place_image": [KEYS_OF_ROWS, ["view 5000/5000", "view 0/0", "view 1", "0"]],
    "hover": [
        [*KEYS_OF_ROWS, "layer 0", "view 5000/5000", "view x", "kind Box view 4000/6000", "kind x view 1/1"]
    ],
    "close_lesson": [[True, False]],
    "check": [],
    "puzzle": [["puzzle=0.5,0.4,0.4,0.3&par=1,4", "puzzle=1", 7]],
    "guess": [[0.4, -3, 1e300, "x", [0.2]]],
    "upload": [[[{}], [{"name": "a.ply", "content": b"x"}], 3], [*KEYS_OF_ROWS, "light", "view 5000/5000"]],
}
"""Arguments of the page's events, by their names; a second word tells two kinds of one event apart."""

WAIT_SECONDS = 60.0
"""Longest time until an answer comes, and until background work ends."""

PICTURE_SECONDS = 2.0
"""Time that the slow browser takes for a picture."""

SAMPLES = 20
"""Looks at the memory during a run."""

SHARED_PART = 0.2
"""Part of the messages that goes to a page which the browsers share."""

FIRST_PARTS = {"growth_mb_per_1000": 0.1, "steady_growth_mb_per_1000": 0.5}
"""Parts of a run after which the memory should not grow, by the name of the figure."""

LATE_MS = 100.0
"""Milliseconds within which any input should be answered."""

LISTED_PAUSES = 12
"""Longest pauses that are listed."""

TURN_SECONDS = 0.001
"""Time for which the task that watches the loop sleeps."""

WORKERS = frozenset({"walks", "warm-up"})
"""Names of threads that end soon: each computes one result, or notices that nothing needs it any more."""

PACKAGES = "blobtree", "decals"
"""Packages one of whose functions a pause is attributed to."""


@dataclass(frozen=True)
class Pause:
    """A time for which the loop does not return to its tasks.

    Attributes
    ----------
    cause
        What was going on.
    place
        Innermost function of our packages in which the loop's thread was late; empty for a short pause.
    clock_ms, busy_ms
        Milliseconds on the clock, and of the thread's processor time.
    """

    cause: str
    place: str
    clock_ms: float
    busy_ms: float


class LoopWatch:
    """Measures the pauses of the running asyncio loop.

    Parameters
    ----------
    cause
        Returns what is going on.

    Attributes
    ----------
    clock, busy
        Numbers of pauses by their milliseconds on the clock, and by those of the thread's processor time.
    longest
        The late pause of each cause and place with most processor time.
    """

    def __init__(self, cause: Callable[[], str]) -> None:
        self._cause = cause
        self.clock: Counter[float] = Counter()
        self.busy: Counter[float] = Counter()
        self.longest: dict[tuple[str, str], Pause] = {}
        self._turned_at, self._place = math.inf, ""

    async def run(self) -> None:
        """Measure until the task is cancelled."""
        ended = threading.Event()
        thread = threading.Thread(target=self._look, args=(threading.get_ident(), ended), daemon=True)
        thread.start()
        try:
            while True:
                self._place, self._turned_at, busy_before = "", time.monotonic(), time.thread_time()
                await asyncio.sleep(TURN_SECONDS)
                clock = 1000.0 * (time.monotonic() - self._turned_at - TURN_SECONDS)
                self._note(clock, 1000.0 * (time.thread_time() - busy_before))
        finally:
            ended.set()

    def _note(self, clock: float, busy: float) -> None:
        pause = Pause(self._cause(), self._place, round(max(clock, 0.0), 1), round(busy, 1))
        self.clock[pause.clock_ms] += 1
        self.busy[pause.busy_ms] += 1
        key = pause.cause, pause.place
        if clock > LATE_MS and (key not in self.longest or busy > self.longest[key].busy_ms):
            self.longest[key] = pause

    def _look(self, watched: int, ended: threading.Event) -> None:
        """Note where the loop's thread is once a pause is late."""
        while not ended.wait(LATE_MS / 4000.0):
            late = time.monotonic() - self._turned_at > LATE_MS / 1000.0
            if late and not self._place:
                self._place = place_of(sys._current_frames().get(watched))


def place_of(frame: FrameType | None) -> str:
    """Return the innermost function of our packages that a frame is in."""
    while frame is not None:
        name = frame.f_globals.get("__name__", "")
        if name.partition(".")[0] in PACKAGES:
            return f"{name}.{frame.f_code.co_qualname}"
        frame = frame.f_back
    return "elsewhere"


def summary(name: str, pauses: Counter[float]) -> dict[str, float]:
    """Return the 99th percentile and the maximum of some pauses, and the number of late ones."""
    milliseconds, times = np.transpose(sorted(pauses.items() or [(0.0, 1)]))
    common = milliseconds[np.searchsorted(np.cumsum(times), 0.99 * times.sum())]
    late = int(times[milliseconds > LATE_MS].sum())
    return {
        f"loop_{name}_p99_ms": float(common),
        f"loop_{name}_max_ms": float(milliseconds[-1]),
        f"loop_{name}_late": late,
    }


class Messages:
    """Sends random messages to a page, and counts what happens.

    Parameters
    ----------
    window, page, connect
        What `serve` gives to its check.
    folder
        Folder of the page's files.
    seed
        Seed of the messages.
    shared
        The browsers share the page.
    waits
        Notes where the server's loop loads kernels.
    """

    def __init__(
        self,
        window: EditWindow,
        page: Any,
        connect: Connect,
        folder: Path,
        seed: int,
        *,
        shared: bool,
        waits: KernelWaits,
    ) -> None:
        self._window, self._page, self._connect = window, page, connect
        self._folder, self._shared, self._waits = folder, shared, waits
        self._rng = random.Random(f"{seed}:{shared}")
        guard, port = page.guard, page._server.port
        nothing: Any = None
        self._server = Server("here", nothing, folder, guard.address(port), guard.token)
        self._modes = {name: getattr(window.subplot, name) for name in ("contact", "mapping", "stiffness")}
        self._browsers: list[Browser] = []
        self._tasks: list[asyncio.Task[None]] = []
        self._message = ""
        self._watch = LoopWatch(lambda: f"{self._message} in mode {page.sandbox.display.options.mode}")
        self._memory: list[tuple[int, float]] = []
        self.changed = self.unanswered = 0
        self.restored = True
        self.intrusions: list[str] = []
        self.lost: list[str] = []

    async def run(self, count: int, report: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
        """Send messages and return the figures; now and then, undo all that they did."""
        before = self._saved()
        self._browsers = [await self._connect(), await self._connect()]
        self._tasks = [asyncio.create_task(self._watch.run())]
        if not self._shared:  # it could become the driver
            self._tasks.append(asyncio.create_task(self._read_slowly()))
        for number in range(1, count + 1):
            labels = self._window.session.labels
            await self._send()
            await self._replace_lost()
            self.changed += labels != self._window.session.labels
            self._window.actions.state.prompt.close()
            if len(self._window.document.objects) > 4 or len(self._window.document.decals) > 300:
                await self._answer("go_to", self._trigger(self._driver(), "go_to", 0))
            if number % max(count // SAMPLES, 1) == 0:
                await self._undo_all()
                self.restored = self.restored and self._saved() == before
                self._window.session.forget_history()
                self._memory.append((number, kept_megabytes()))  # the server gives memory back every 10 s
                report({"sent": number, **self.figures()})
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for browser in self._browsers:
            await browser.close()
        return {"sent": count, **self.figures()}

    def figures(self) -> dict[str, Any]:
        """Return the figures so far."""
        longest = sorted(self._watch.longest.values(), key=lambda pause: -pause.busy_ms)
        return {
            "changed": self.changed,
            "restored": self.restored,
            "unanswered": self.unanswered,
            "intrusions": len(self.intrusions),
            "first_intrusions": self.intrusions[:3],
            "lost": len(self.lost),
            "first_lost": self.lost[:3],
            "memory_mb": round(self._memory[-1][1]) if self._memory else 0,
            **{name: round(growth(self._memory, part), 2) for name, part in FIRST_PARTS.items()},
            **summary("clock", self._watch.clock),
            **summary("busy", self._watch.busy),
            "longest_pauses": [asdict(pause) for pause in longest[:LISTED_PAUSES]],
            "kernel_waits": self._waits.places,
        }

    def _saved(self) -> tuple[str, bytes]:
        """Return the identities of all parts of the document, and the bytes of its file."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scene.json"
            self._window.document.scene.save(path)
            return digest(self._window.document), path.read_bytes()

    async def _read_slowly(self) -> None:
        browser = await self._connect()
        try:
            await browser.watch_slowly(PICTURE_SECONDS)
        finally:
            await browser.close()

    async def _undo_all(self) -> None:
        """End all input, undo everything, show the scene itself, and wait until nothing is to be done."""
        for number in range(len(self._browsers)):
            await self._answer("mouse", self._mouse(number, "up"))
        self._page.sandbox.end_input()
        await self._wait_until(lambda: not self._window.background.busy)
        self._page.sandbox.go_to(0)
        for option, first in FIRST_VIEW.items():
            self._page.sandbox.set_control("display", option, first)
        for name, mode in self._modes.items():  # keys change those of the window, as they move the camera
            setattr(self._window.subplot, name, mode)
        for _ in range(2):  # the view shows what was being made, then the scene
            await self._wait_until(self._rests)

    def _rests(self) -> bool:
        """Bring the page up to date; return True if it has sent the last picture, and threads have ended."""
        self._page.refresh()
        works = {thread.name for thread in threading.enumerate()} & WORKERS
        drawing = self._window.busy or self._window.frames.outdated or self._page.view._task is not None
        return not (works or drawing or self._page.sandbox.display.values()["busy"])

    @staticmethod
    async def _wait_until(true: Callable[[], bool]) -> None:
        end = time.monotonic() + WAIT_SECONDS
        while not true() and time.monotonic() < end:
            await asyncio.sleep(0.01)

    # -- messages ---------------------------------------------------------------------------------------

    async def _send(self) -> None:
        """Send one message or several; those of a browser that watches must change nothing."""
        number = self._rng.randrange(len(self._browsers))
        together = self._rng.random() < 0.1
        if not self._watches(number) or together or not self._is_steady():
            await self._send_as(number, together=together)
        else:
            before = self._changeable()
            await self._send_as(number, together=False)
            if self._changeable() != before:
                self.intrusions.append(f"a watcher's {self._message}")

    async def _send_as(self, number: int, *, together: bool) -> None:
        """Send one message or several as a browser, or events of all browsers together."""
        rng, kind = self._rng, self._rng.random()
        if together:
            await asyncio.gather(*(self._event(number) for number in range(len(self._browsers))))
        elif kind < 0.02:
            await self._reconnect(number, rng.choice((self._tear, self._vanish, self._leave)))
        elif kind < 0.04:
            self._message = "stranger"
            if got := await ask_as_stranger(self._server, rng):
                self.intrusions.append(got)
        elif kind < 0.08:
            await self._send_steps(number)
        elif kind < 0.16:
            name = rng.choice(CALLS)
            odd = [rng.choice(ODD) for _ in range(rng.randrange(4))]
            await self._answer(name, self._browsers[number].call(name, *odd))
        elif kind < 0.41:
            await self._answer("mouse", self._mouse(number))
        else:
            await self._event(number)
        if rng.random() < 0.5:
            if self._window.tools.dragging:
                await self._answer("mouse", self._mouse(number, "up"))
            await self._wait_until(lambda: not self._window.background.busy)

    async def _send_steps(self, number: int) -> None:
        """Send messages in a wrong order: one after the other, all at once, or as the last of a browser."""
        calls = [partial(self._step, number, *step) for step in random_steps(self._rng)]
        kind = self._rng.random()
        if kind < 0.5:
            for call in calls:
                await call()
        elif kind < 0.8:
            await asyncio.gather(*(call() for call in calls))
        else:
            tasks = [asyncio.ensure_future(call()) for call in calls]
            await asyncio.sleep(0)
            await self._browsers[number].break_off()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self._browsers[number] = await self._connect()

    async def _step(self, number: int, name: str, *arguments: Any) -> None:
        """Send a message of `random_steps`."""
        browser = self._browsers[number]
        if name == "mouse":
            call: Awaitable[Any] = self._mouse(number, *arguments)
        elif name == "lifecycle":
            call = browser.call("trame.lifecycle.update", *arguments)
        elif name in ("pass_control", "ask_to_drive"):
            call = browser.trigger(name)
        else:
            call = self._trigger(number, name, *arguments)
        await self._answer(f"step {name} {arguments[:1]}", call)

    # -- browsers that watch ----------------------------------------------------------------------------

    def _watches(self, number: int) -> bool:
        """Return True if a browser only watches what another one does."""
        driver = self._page._connections.driving("")["driver"]
        return self._shared and bool(self._browsers[number].driving["number"] != driver)

    def _driver(self) -> int:
        return next(number for number in range(len(self._browsers)) if not self._watches(number))

    def _is_steady(self) -> bool:
        """Return True if nothing goes on that changes the document by itself."""
        window = self._window
        return not (window.background.busy or window.session.stroke_open or window.tools.dragging)

    def _changeable(self) -> tuple[Any, ...]:
        """Return what messages of a browser that drives can change."""
        state, options = self._window.actions.state, self._page.sandbox.display.options
        files = sorted((path.name, path.stat().st_size) for path in self._folder.rglob("*"))
        chosen = state.selection, state.primitive, self._window.actions.help_page
        return self._window.session.labels, chosen, options, self._page._server.state.theme, files

    async def _event(self, number: int) -> None:
        rng = self._rng
        name = rng.choice([*EVENTS])
        arguments = [rng.choice(ODD if rng.random() < 0.15 else choices) for choices in EVENTS[name]]
        if name != "perform" or arguments[0] in ACTIONS:
            await self._answer(f"{name} {arguments[:1]}"[:40], self._trigger(number, name, *arguments))

    def _trigger(self, number: int, name: str, *arguments: Any) -> Awaitable[Any]:
        name = name.split()[0]  # the lab's events have names alone
        return self._browsers[number].trigger(getattr(self._page.sandbox, name, name), *arguments)

    def _mouse(self, number: int, action: str = "") -> Awaitable[Any]:
        at = self._rng.uniform(0, SIZE[0]), self._rng.uniform(0, SIZE[1])
        action = action or self._rng.choice(("down", "move", "move", "up"))
        return self._browsers[number].mouse(at, down=action != "up", action=action)

    async def _answer(self, name: str, call: Awaitable[Any]) -> None:
        """Wait for the answer to a message; a refusal is one."""
        self._message = name
        try:
            await asyncio.wait_for(call, WAIT_SECONDS)
        except TimeoutError:
            self.unanswered += 1
        except ConnectionError:
            pass  # the server has ended the connection, which `_replace_lost` counts
        except Exception as error:  # the client raises a bare one for each refusal
            if type(error) is not Exception:
                raise

    async def _reconnect(self, number: int, end: Callable[[int], Awaitable[None]]) -> None:
        await end(number)
        await self._browsers[number].close()
        wrong = self._rng.choice([odd for odd in ODD if odd is not None])  # None stands for the token
        with contextlib.suppress(PermissionError):
            intruder = await self._connect(wrong)
            self.intrusions.append(f"stranger with {wrong!r:.50}")
            await intruder.close()
        self._browsers[number] = await self._connect()

    async def _replace_lost(self) -> None:
        """Count connections that the server has ended without a reason, and connect again."""
        for number, browser in enumerate(self._browsers):
            if browser.socket.closed:
                self.lost.append(f"{self._message}: code {browser.socket.close_code}")
                await browser.close()
                self._browsers[number] = await self._connect()

    async def _tear(self, number: int) -> None:
        """Send bytes that are no message; the server ends the connection."""
        browser, rng = self._browsers[number], self._rng
        if rng.random() < 0.3:
            await browser.socket.send_str("x{]")
        else:
            await browser.socket.send_bytes(rng.randbytes(rng.randrange(1, 60)))
        with contextlib.suppress(TimeoutError):  # a first part of a longer message is waited for
            await browser.ended(1.0)

    async def _vanish(self, number: int) -> None:
        """Leave in a drag."""
        for action in ("down", "move"):
            await self._answer("mouse", self._mouse(number, action))

    async def _leave(self, number: int) -> None:
        """Leave before the answer comes."""
        task = asyncio.ensure_future(self._trigger(number, "scatter"))
        await asyncio.sleep(0)
        await self._browsers[number].close()
        task.cancel()


def measure(
    count: int, seed: int, report: Callable[[dict[str, Any]], None] = lambda _: None
) -> dict[str, Any]:
    """Send random messages to a server of this process, and return the figures."""
    share_heap()
    shared_count = int(SHARED_PART * count)
    errors: list[str] = []

    class Noted(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            errors.append(record.getMessage())

    def send(part: int, folder: Path, *, shared: bool) -> dict[str, Any]:
        """Send a part of the messages to a server of its own."""
        figures: dict[str, Any] = {}

        async def check(window: EditWindow, page: Any, connect: Connect) -> None:
            keep_memory_low()
            import_ahead()
            loop = asyncio.get_running_loop()
            loop.set_exception_handler(lambda _, context: errors.append(repr(context)))
            waits.noting = True
            messages = Messages(window, page, connect, folder, seed, shared=shared, waits=waits)
            figures.update(await messages.run(part, report))
            waits.noting = False

        serve(check, lessons=True, folder=folder, shared=shared)
        return figures

    noted = Noted(logging.ERROR)
    logging.getLogger().addHandler(noted)
    try:
        with (
            tempfile.TemporaryDirectory() as name,
            patch.dict(os.environ, WSLINK_HEART_BEAT="0"),
            kernel_waits() as waits,
        ):
            figures = send(count - shared_count, Path(name), shared=False)
            others = send(shared_count, Path(name), shared=True)
    finally:
        logging.getLogger().removeHandler(noted)
    for key in ("sent", "changed", "unanswered", "intrusions", "first_intrusions", "lost", "first_lost"):
        figures[key] += others[key]
    figures["restored"] &= others["restored"]
    return {**figures, "errors": len(errors), "first_errors": errors[:3]}


def faults(figures: dict[str, Any]) -> int:
    """Return the number of failures among the figures of a run."""
    counts: list[int] = [figures[name] for name in ("errors", "unanswered", "intrusions", "lost")]
    return sum(counts) + (not figures["restored"]) + len(figures["kernel_waits"])


def main() -> int:
    """Print the figures as JSON; the exit code is 1 after a failure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    figures = measure(
        options.count, options.seed, lambda part: print(json.dumps(part), file=sys.stderr, flush=True)
    )
    print(json.dumps(figures))
    return int(faults(figures) > 0)


if __name__ == "__main__":
    sys.exit(main())
