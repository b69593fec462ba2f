"""The prop that stands for our objects among VTK's: it gives them bounds, and a moment in which to draw."""

from collections.abc import Callable

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkCommand, vtkObject
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from decals.scenes.viewpoint import Bounds, Floats
from decals.vtk.camera import matrix_of

NAME = "plotter.decals"
"""What pyvista calls the actor: an actor of the user's that had the same name would take its place."""


class Anchor:
    """An actor that draws nothing itself.

    VTK updates a mapper while it draws opaque actors, and says so by an EndEvent: what is drawn then lies
    under translucent actors, volumes, text and widgets. The actor has faces without area at the corners of
    our bounds: without cells it would not be drawn, without bounds culled.

    Parameters
    ----------
    renderer
        A pyvista renderer.
    draw
        Called whenever the renderer draws opaque actors.
    """

    def __init__(self, renderer: pv.Renderer, draw: Callable[[], None]) -> None:
        self._renderer = renderer
        faces = [[3, i, i, i] for i in range(8)]
        self._corners = pv.PolyData(np.zeros((8, 3)), faces=np.ravel(faces))
        self._mapper = vtkPolyDataMapper()
        self._mapper.SetInputData(self._corners)
        self.actor = vtkActor()
        self.actor.SetMapper(self._mapper)
        self._observed: list[tuple[vtkObject, int]] = [
            (self._mapper, self._mapper.AddObserver(vtkCommand.EndEvent, lambda *_: draw())),
            (renderer, renderer.AddObserver(vtkCommand.StartEvent, lambda *_: self._come_last())),
        ]

    def place(self, bounds: Bounds | None) -> None:
        """Stand around a box, or nowhere; the first time, join the renderer's actors."""
        if bounds is not None:
            choice = np.indices((2, 2, 2)).reshape(3, 8).T
            self._corners.points = np.where(choice, *np.asarray(bounds, np.float64)[::-1])
        self._mapper.SetInputData(pv.PolyData() if bounds is None else self._corners)
        if not self.there:
            self._renderer.add_actor(self.actor, name=NAME, pickable=False, render=False)

    @property
    def there(self) -> bool:
        """Whether the actor is among the renderer's; pyvista's ``clear`` takes it out too."""
        return bool(self._renderer.HasViewProp(self.actor))

    def leave(self) -> None:
        """Leave the renderer's actors."""
        if self.there:
            self._renderer.remove_actor(self.actor, render=False)

    def matrix(self) -> Floats:
        """Where the actor stands in the world, ``float64[4, 4]``; identity, unless somebody moved it."""
        return matrix_of(self.actor)

    def _come_last(self) -> None:
        """Edges are blended over what is there, so other opaque actors go first."""
        props = self._renderer.GetViewProps()
        if self._renderer.HasViewProp(self.actor) and props.GetLastProp() is not self.actor:
            props.RemoveItem(self.actor)
            props.AddItem(self.actor)

    def release(self) -> None:
        """Leave, and forget whom to call."""
        self.leave()
        for subject, tag in self._observed:
            subject.RemoveObserver(tag)
        self._observed.clear()
