"""UserInput for a window without a screen: synthetic events of VTK's interactor."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from decals.rendering import RenderOptions
from decals.window import EditWindow
from tests.decals.editing.scenes import digest


class Driver:
    """A window and what can be done to it."""

    def __init__(self, window: EditWindow, renderer: Any = None) -> None:
        self.window = window
        self.renderer = renderer or window.plotter.renderer
        self.document, self.session = window.document, window.session
        self.plotter = window.plotter
        self._interactor = window.plotter.iren.interactor

    def event(
        self, name: str, at: Any, *, ctrl: Any = False, shift: Any = False, key: Any = None, text: str = "\0"
    ) -> None:
        self._interactor.SetEventInformation(int(at[0]), int(at[1]), int(ctrl), int(shift), text, 0, key)
        getattr(self._interactor, name)()

    def click(self, at: Any, **modifiers: Any) -> None:
        self.event("LeftButtonPressEvent", at, **modifiers)
        self.event("LeftButtonReleaseEvent", at, **modifiers)

    def drag(self, *places: Any, **modifiers: Any) -> None:
        self.event("LeftButtonPressEvent", places[0], **modifiers)
        for place in places[1:]:
            self.event("MouseMoveEvent", place, **modifiers)
        self.event("LeftButtonReleaseEvent", places[-1], **modifiers)

    def key(self, name: str, at: Any = (1, 1), **modifiers: Any) -> None:
        self.event("KeyPressEvent", at, key=name, **modifiers)
        self.event("CharEvent", at, key=name, **modifiers)

    def type(self, text: str) -> None:
        """Press the keys of some characters."""
        for letter in text:
            self.key("unnamed", text=letter)

    def press(self, name: str, at: Any = (1, 1), **modifiers: Any) -> None:
        """Press a key, and let what it begins come to its end."""
        self.key(name, at, **modifiers)
        self.finish()

    def wheel(self, at: Any, *, up: Any = True, **modifiers: Any) -> None:
        self.event("MouseWheelForwardEvent" if up else "MouseWheelBackwardEvent", at, **modifiers)

    def pixel(self, point: Any) -> Any:
        corner, size = np.array(self.renderer.GetOrigin()), self.renderer.GetSize()
        clip = self.window.subplot.viewpoint().matrix @ np.append(np.asarray(point, float), 1.0)
        return tuple((corner + (clip[:2] / clip[3] + 1) / 2 * size).astype(int).tolist())

    def visible(self) -> Iterator[Any]:
        """Numbers of decals that show at their own centre, and where; from the middle of the window on."""
        decals = self.document.decals
        middle = np.add(self.renderer.GetOrigin(), np.array(self.renderer.GetSize()) / 2)
        places = [(self.pixel(decals[n].positions[0]), n) for n in decals.numbers.tolist()]
        for at, number in sorted(places, key=lambda place: np.hypot(*(np.array(place[0]) - middle))):
            found = self.window.tools.at(*at)
            if found is not None and found.owner == number:
                yield number, at

    def owner(self, at: Any) -> int:
        """The decal that shows at a pixel; -1 for none."""
        found = self.window.tools.at(*at)
        return -1 if found is None else found.owner

    def finish(self) -> None:
        """Let the window see what goes on in the background come to its end."""
        while self.window.background.busy:
            for worker in (self.window.background._edits, *self.window.background._next_files):
                if worker._run is not None:
                    worker._run.ended(30)
            self.window.tick()

    def shot(self) -> Any:
        """The whole frame, ``uint8[h, w, 3]``."""
        self.window.draw_whole_frame()
        return np.asarray(self.plotter.screenshot(None, return_img=True))[..., :3]

    def owners(self) -> Any:
        """Owner, and place in its image, of every pixel."""
        subplot = self.window.subplot
        with subplot.current():
            found = subplot.renderer.buffers(
                self.document,
                RenderOptions(size=tuple(self.renderer.GetSize())),
                viewpoint=subplot.viewpoint(),
            )
        return found.owner, found.uv

    @property
    def state(self) -> Any:
        return digest(self.document)
