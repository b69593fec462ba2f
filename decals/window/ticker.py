"""Ticks for a window in a loop of asyncio's, such as a browser's server runs, in place of a timer."""

import asyncio
import weakref
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from decals.window.window import EditWindow

TICK = 20
"""Milliseconds between looks at what goes on."""


def running_loop() -> asyncio.AbstractEventLoop | None:
    """The loop from within which this is called, if any."""
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        return None


class Ticker:
    """Calls a window's `tick` from a task that is there only while something goes on.

    It does not keep the window alive.
    """

    def __init__(self, window: "EditWindow") -> None:
        self._window = weakref.ref(window)
        self._task: asyncio.Task[None] | None = None

    def wake(self) -> None:
        """Begin to tick, if a loop runs here and nobody ticks in it yet."""
        loop, task = running_loop(), self._task
        if loop is not None and (task is None or task.done() or task.get_loop() is not loop):
            self._task = loop.create_task(_ticks(self._window), name="ticks of an EditWindow")

    def stop(self) -> None:
        """Tick no more."""
        if self._task is not None and not self._task.get_loop().is_closed():
            self._task.cancel()
        self._task = None


async def _ticks(window: "weakref.ref[EditWindow]") -> None:
    while _goes_on(window()):
        await asyncio.sleep(TICK / 1000)


def _goes_on(window: "EditWindow | None") -> bool:
    """Let a window tick; whether there is more to come."""
    if window is None or not window.busy:
        return False
    window.tick()
    return window.busy
