"""A handle in the window that moves a primitive of a tree."""

from collections.abc import Callable
from typing import Any

import numpy as np
from vtkmodules.vtkInteractionWidgets import vtkSphereWidget

from decals.edit.actions import Actions
from decals.scenes.scene import bounds_of
from decals.surfaces.surface import Floats
from decals.vtk.weak import weakly

SIZE = 0.03
"""Radius of the handle, in diagonals of the scene."""

COLOR, TAKEN = (0.2, 0.6, 1.0), (1.0, 0.75, 0.8)
"""Of the handle, and while it is held."""
ROUND = 16
"""Sides of the ball that is drawn."""


class Grip:
    """A ball on the surface where a primitive is held; dragging it drags the primitive.

    Parameters
    ----------
    renderer
        The vtkRenderer in which it is seen.
    actions
        Know what is held, and move it.
    redraw
        Called after every step, and with True at the end.

    Attributes
    ----------
    moving
        Whether it is being dragged now.
    """

    def __init__(self, renderer: Any, actions: Actions, redraw: Callable[[bool], None]) -> None:
        self._renderer, self._actions, self._redraw = renderer, actions, redraw
        self._widget: Any = None
        self._held: Any = None
        self._start: Floats = np.zeros(3, np.float32)
        self.moving = False

    def update(self) -> None:
        """Show the handle where the held primitive is now, or none."""
        if self.moving:
            return
        if self._actions.grip != self._held or self._actions.grip is None:
            self.release()
        if self._actions.grip is None:
            return
        center = self._actions.grip_center
        if self._widget is None:
            self._widget, self._held = self._make(center), self._actions.grip
        self._widget.SetCenter(*center.tolist())

    def _make(self, center: Floats) -> Any:
        low, high = bounds_of(self._actions.session.document.objects)
        widget: Any = vtkSphereWidget()  # its stubs know events by number alone
        widget.SetRepresentationToSurface()
        widget.GetSphereProperty().SetColor(*COLOR)
        widget.GetSelectedSphereProperty().SetColor(*TAKEN)
        widget.SetThetaResolution(ROUND)
        widget.SetPhiResolution(ROUND)
        widget.SetRadius(SIZE * float(np.linalg.norm(high - low)))
        widget.SetCenter(*center.tolist())
        widget.SetInteractor(self._renderer.GetRenderWindow().GetInteractor())
        widget.SetCurrentRenderer(self._renderer)
        widget.On()
        widget.AddObserver("StartInteractionEvent", weakly(self.begin))
        widget.AddObserver("InteractionEvent", weakly(self.move))
        widget.AddObserver("EndInteractionEvent", weakly(self.end))
        return widget

    def begin(self) -> None:
        """The handle was taken."""
        self.moving, self._start = True, np.array(self._widget.GetCenter())
        self._actions.begin_grip()

    def move(self) -> None:
        """The handle is somewhere else."""
        self._actions.move_grip(np.array(self._widget.GetCenter()) - self._start)
        self._redraw(False)

    def end(self) -> None:
        """The handle was let go."""
        self._actions.end_grip()
        self.moving = False
        self._redraw(True)

    @property
    def widget(self) -> Any:
        """VTK's widget, None while nothing is held."""
        return self._widget

    def release(self) -> None:
        """Take the handle away."""
        if self._widget is not None:
            self._widget.RemoveAllObservers()
            if self._renderer.GetRenderWindow() is not None:  # else somebody closed the window before us
                self._widget.Off()
            self._widget = self._held = None
