"""Progress in the title of a window."""

import threading
from typing import Any


class WindowTitle:
    """Shows the progress of work that blocks a window in the window's title.

    Parameters
    ----------
    plotter
        The plotter of the window.
    """

    def __init__(self, plotter: Any) -> None:
        self._plotter = plotter

    @property
    def visible(self) -> bool:
        """True if the window is on a screen."""
        return self._plotter.render_window is not None and not getattr(self._plotter, "off_screen", False)

    def show(self, stage: str, _fraction: float) -> None:
        """Show a stage before the title, or the title alone after the work (an empty stage).

        Other threads than the main one change nothing: they block no window, and must not call VTK.
        """
        if not self.visible or threading.current_thread() is not threading.main_thread():
            return
        title = str(self._plotter.title)
        text = f"{stage[0].upper()}{stage[1:]} - {title}" if stage else title
        self._plotter.render_window.SetWindowName(text)
