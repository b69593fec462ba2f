"""The handle of the selected primitive: a ball on the surface that moves it."""

from collections.abc import Callable
from typing import Any

import numpy as np
from vtkmodules.vtkInteractionWidgets import vtkSphereWidget

from blobtree._typing import Float32Array, Float64Array
from blobtree.nodes.paths import Path
from decals.editing.actions import Actions
from decals.scenes.objects import bounds_of
from decals.vtk.weak_callback import weak_callback

HANDLE_RADIUS = 0.03
"""Radius of the handle, in diagonals of the scene."""

HANDLE_COLOR, DRAGGED_COLOR = (0.2, 0.6, 1.0), (1.0, 0.75, 0.8)
"""Colours of the handle at rest and in a drag."""

HANDLE_RESOLUTION = 16
"""Sides of the drawn ball."""


class PrimitiveHandle:
    """A ball at the selected primitive; dragging it drags the primitive.

    Parameters
    ----------
    renderer
        The vtkRenderer that shows the ball.
    actions
        Actions of the window.
    redraw
        Called after each step with False, and at the end of a drag with True.

    Attributes
    ----------
    dragging
        True during a drag.
    """

    def __init__(self, renderer: Any, actions: Actions, redraw: Callable[[bool], None]) -> None:
        self._renderer, self._actions, self._redraw = renderer, actions, redraw
        self._widget: Any = None
        self._primitive: tuple[int, Path] | None = None
        self._drag_start: Float64Array = np.zeros(3)
        self.dragging = False

    def update(self) -> None:
        """Put the ball at the selected primitive, or remove it; a drag is not disturbed."""
        if self.dragging:
            return
        primitive = self._actions.state.primitive
        if primitive is None or primitive != self._primitive:
            self.release()
        if primitive is None:
            return
        center = self._actions.trees.handle_position
        if self._widget is None:
            self._widget, self._primitive = self._new_widget(center), primitive
        self._widget.SetCenter(*center.tolist())

    def _new_widget(self, center: Float32Array) -> Any:
        low, high = bounds_of(self._actions.state.session.document.objects)
        widget: Any = vtkSphereWidget()  # VTK's stubs know events by number only
        widget.SetRepresentationToSurface()
        widget.GetSphereProperty().SetColor(*HANDLE_COLOR)
        widget.GetSelectedSphereProperty().SetColor(*DRAGGED_COLOR)
        widget.SetThetaResolution(HANDLE_RESOLUTION)
        widget.SetPhiResolution(HANDLE_RESOLUTION)
        widget.SetRadius(HANDLE_RADIUS * float(np.linalg.norm(high - low)))
        widget.SetCenter(*center.tolist())
        widget.SetInteractor(self._renderer.GetRenderWindow().GetInteractor())
        widget.SetCurrentRenderer(self._renderer)
        widget.On()
        widget.AddObserver("StartInteractionEvent", weak_callback(self.begin))
        widget.AddObserver("InteractionEvent", weak_callback(self.move))
        widget.AddObserver("EndInteractionEvent", weak_callback(self.end))
        return widget

    def begin(self) -> None:
        """Begin a drag."""
        self.dragging, self._drag_start = True, np.array(self._widget.GetCenter())
        self._actions.trees.begin_drag()

    def move(self) -> None:
        """Drag the primitive to the ball."""
        self._actions.trees.drag(np.array(self._widget.GetCenter()) - self._drag_start)
        self._redraw(False)

    def end(self) -> None:
        """End the drag."""
        self._actions.trees.end_drag()
        self.dragging = False
        self._redraw(True)

    @property
    def widget(self) -> Any:
        """VTK's widget; None while no primitive is selected."""
        return self._widget

    def release(self) -> None:
        """Remove the ball."""
        if self._widget is not None:
            self._widget.RemoveAllObservers()
            if self._renderer.GetRenderWindow() is not None:  # else the plotter was closed before
                self._widget.Off()
            self._widget = self._primitive = None
