"""What a window does until all is there that its frames take for the first time."""

import time
from collections.abc import Callable

from decals.vtk.stage import Stage

SLICE = 0.04
"""Seconds for which something is made or drawn at a time; in between the window listens."""

NEWS = 0.1
"""Seconds between two pictures of how far something is."""


class Waiting:
    """Makes, slice by slice, what a patient stage's frames did without, such as programs.

    Parameters
    ----------
    stage
        Whose frames they are.
    show
        Shows the frame, with a line of text.
    give_up
        Called where frames cannot be drawn at all, before the error is raised.

    Attributes
    ----------
    news
        What is being made, in plain words; nothing where nothing is.
    """

    def __init__(self, stage: Stage, show: Callable[[], None], give_up: Callable[[], None]) -> None:
        self._stage, self._show, self._give_up = stage, show, give_up
        self._told = 0.0
        self.news = ""

    def go_on(self) -> bool:
        """Make for a while what the last frame did without; False where it lacked nothing."""
        if not self._stage.waiting:
            return False
        self.news = ""
        try:
            news = self._stage.warm(SLICE)
        except BaseException:
            self._give_up()
            raise
        self.news = "" if news is None else f"preparing: {news}"
        now = time.perf_counter()
        if news is None or now - self._told > NEWS:
            self._told = now
            self._show()
        return True
