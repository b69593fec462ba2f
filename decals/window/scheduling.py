"""Scheduling in a window: warm-up in slices, ticks in an asyncio loop, and limits of update rates."""

import asyncio
import time
import weakref
from collections.abc import Callable
from typing import Protocol

from decals.vtk.subplot import SubplotRenderer

SLICE_SECONDS = 0.04
"""Time for which the window computes or draws before it handles input again."""

STATUS_INTERVAL = 0.1
"""Seconds between two updates of a progress text."""

TICK_MILLISECONDS = 20
"""Time between two ticks of a window."""


class RateLimit:
    """Limits how often something is done.

    Parameters
    ----------
    interval
        Shortest time between two times, in seconds.
    """

    def __init__(self, interval: float) -> None:
        self._interval = interval
        self._last = 0.0

    def take(self) -> bool:
        """Return True, and start the next interval, if the last interval is over."""
        now = time.perf_counter()
        over = now - self._last > self._interval
        if over:
            self._last = now
        return over


class Warmup:
    """Compiles and uploads, in slices, what a subplot needs for its next frame.

    Parameters
    ----------
    subplot
        The subplot.
    show
        Draws the frame, with the status.
    give_up
        Called before an error is raised because the frame cannot be drawn.

    Attributes
    ----------
    status
        What is being prepared, in plain words; empty for nothing.
    """

    def __init__(
        self, subplot: SubplotRenderer, show: Callable[[], None], give_up: Callable[[], None]
    ) -> None:
        self._subplot, self._show, self._give_up = subplot, show, give_up
        self._limit = RateLimit(STATUS_INTERVAL)
        self.status = ""

    def advance(self) -> bool:
        """Warm up for one slice and return True, or return False if the last frame needs no warm-up."""
        if not self._subplot.warming_up:
            return False
        self.status = ""
        try:
            status = self._subplot.warm(SLICE_SECONDS)
        except BaseException:
            self._give_up()
            raise
        self.status = "" if status is None else f"preparing: {status}"
        if self._limit.take() or status is None:
            self._show()
        return True


class Ticking(Protocol):
    """An object with work to do in small steps."""

    @property
    def busy(self) -> bool:
        """True while there is work."""
        ...

    def tick(self) -> None:
        """Do one step."""
        ...


def running_loop() -> asyncio.AbstractEventLoop | None:
    """Return the asyncio loop that runs in this thread, or None."""
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        return None


class AsyncTicker:
    """Calls ``tick`` from a task of the running asyncio loop, while there is work.

    Parameters
    ----------
    target
        The object with work. It is not kept alive.
    """

    def __init__(self, target: Ticking) -> None:
        self._target = weakref.ref(target)
        self._task: asyncio.Task[None] | None = None

    def wake(self) -> None:
        """Start the task, if an asyncio loop runs and no task does."""
        loop, task = running_loop(), self._task
        if loop is not None and (task is None or task.done() or task.get_loop() is not loop):
            self._task = loop.create_task(_tick_while_busy(self._target), name="ticks of an EditWindow")

    def stop(self) -> None:
        """Cancel the task."""
        if self._task is not None and not self._task.get_loop().is_closed():
            self._task.cancel()
        self._task = None


async def _tick_while_busy(target: "weakref.ref[Ticking]") -> None:
    while _tick(target()):
        await asyncio.sleep(TICK_MILLISECONDS / 1000)


def _tick(target: Ticking | None) -> bool:
    """Do one step, and return True if there is more work."""
    if target is None or not target.busy:
        return False
    target.tick()
    return target.busy
