"""Hands for a window without a screen: synthetic events of VTK's interactor."""

import numpy as np

from decals.window import EditWindow
from tests.edit.scenes import digest


class Driver:
    """A window and what can be done to it."""

    def __init__(self, window: EditWindow, renderer=None):
        self.window = window
        self.renderer = renderer or window.plotter.renderer
        self.document, self.session = window.document, window.session
        self.plotter = window.plotter
        self._interactor = window.plotter.iren.interactor

    def event(self, name, at, *, ctrl=False, shift=False, key=None):
        self._interactor.SetEventInformation(int(at[0]), int(at[1]), int(ctrl), int(shift), "\0", 0, key)
        getattr(self._interactor, name)()

    def click(self, at, **modifiers):
        self.event("LeftButtonPressEvent", at, **modifiers)
        self.event("LeftButtonReleaseEvent", at, **modifiers)

    def drag(self, *places, **modifiers):
        self.event("LeftButtonPressEvent", places[0], **modifiers)
        for place in places[1:]:
            self.event("MouseMoveEvent", place, **modifiers)
        self.event("LeftButtonReleaseEvent", places[-1], **modifiers)

    def key(self, name, at=(1, 1), **modifiers):
        self.event("KeyPressEvent", at, key=name, **modifiers)
        self.event("CharEvent", at, key=name, **modifiers)

    def press(self, name, at=(1, 1), **modifiers):
        """Press a key, and let what it begins come to its end."""
        self.key(name, at, **modifiers)
        self.finish()

    def wheel(self, at, *, up=True, **modifiers):
        self.event("MouseWheelForwardEvent" if up else "MouseWheelBackwardEvent", at, **modifiers)

    def pixel(self, point):
        corner, size = np.array(self.renderer.GetOrigin()), self.renderer.GetSize()
        clip = self.window.stage.viewpoint().matrix @ np.append(np.asarray(point, float), 1.0)
        return tuple((corner + (clip[:2] / clip[3] + 1) / 2 * size).astype(int).tolist())

    def visible(self):
        """Numbers of decals that show at their own centre, and where; from the middle of the window on."""
        decals = self.document.decals
        middle = np.add(self.renderer.GetOrigin(), np.array(self.renderer.GetSize()) / 2)
        places = [(self.pixel(decals[n].positions[0]), n) for n in decals.numbers.tolist()]
        for at, number in sorted(places, key=lambda place: np.hypot(*(np.array(place[0]) - middle))):
            found = self.window.tools.at(*at)
            if found is not None and found.owner == number:
                yield number, at

    def finish(self):
        """Let the window see what goes on in the background come to its end."""
        while self.window.background.busy:
            for worker in (self.window.background._edits, self.window.background._saves):
                if worker._thread is not None:
                    worker._thread.join(30)
            self.window.tick()

    def shot(self):
        """The whole frame, ``uint8[h, w, 3]``."""
        self.window.rest()
        return np.asarray(self.plotter.screenshot(None, return_img=True))[..., :3]

    def owners(self):
        """Owner, and place in its image, of every pixel."""
        stage = self.window.stage
        with stage.current():
            found = stage.renderer.buffers(
                self.document, size=tuple(self.renderer.GetSize()), viewpoint=stage.viewpoint()
            )
        return found.owner, found.uv

    @property
    def state(self):
        return digest(self.document)
