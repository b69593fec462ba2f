"""The proxy actor of a scene's objects among VTK's actors: it has their bounds, and triggers drawing."""

from collections.abc import Callable, Iterable

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkCommand, vtkObject
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from blobtree._typing import Float64Array
from blobtree.tracing.tree_cells import tracing_cells
from decals.rendering.viewpoint import Bounds
from decals.scenes.objects import Box, SceneObject, TreeObject, bounds_of
from decals.scenes.origin import WORLD, Origin
from decals.vtk.adapters import matrix_of


def box_around(objects: Iterable[SceneObject]) -> Box:
    """Return lower and upper corner of objects.

    The box of a tree encloses the blocks that its surface may cross, which drawing needs anyway. It may be
    loose around stretched parts. If the surface was built, its exact box is used.
    """
    boxes = [
        _tree_box(item) if isinstance(item, TreeObject) and "surface" not in vars(item) else bounds_of([item])
        for item in objects
    ]
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def _tree_box(item: TreeObject) -> Box:
    """Return the box of all blocks with a tape, or of the field's support if there are none."""
    return tracing_cells(item.tree).crossed_box or item.tree.support


NAME = "plotter.decals"
"""Name of the actor in pyvista; another actor of this name would replace it."""


class ProxyActor:
    """An invisible actor with the bounds of a scene's objects.

    VTK updates its mapper while it draws opaque actors, and sends an EndEvent. A scene that is drawn then
    lies under translucent actors, volumes, text and widgets. The actor has faces without area at the corners
    of the bounds: VTK would skip an actor without cells, and cull an actor without bounds.

    Parameters
    ----------
    renderer
        A pyvista renderer.
    draw
        Called when the renderer draws opaque actors.
    """

    def __init__(self, renderer: pv.Renderer, draw: Callable[[], None]) -> None:
        self._renderer = renderer
        self._origin = WORLD
        faces = [[3, i, i, i] for i in range(8)]
        self._corners = pv.PolyData(np.zeros((8, 3)), faces=np.ravel(faces))
        self._mapper = vtkPolyDataMapper()
        self._mapper.SetInputData(self._corners)
        self.actor = vtkActor()
        self.actor.SetMapper(self._mapper)
        self._observed: list[tuple[vtkObject, int]] = [
            (self._mapper, self._mapper.AddObserver(vtkCommand.EndEvent, lambda *_: draw())),
            (renderer, renderer.AddObserver(vtkCommand.StartEvent, lambda *_: self._move_to_end())),
        ]

    def enclose(self, bounds: Bounds | None) -> None:
        """Set the bounds, None for an empty scene, and add the actor to the renderer."""
        if bounds is not None:
            choice = np.indices((2, 2, 2)).reshape(3, 8).T
            self._corners.points = np.where(choice, *np.asarray(bounds, np.float64)[::-1])
        self._mapper.SetInputData(pv.PolyData() if bounds is None else self._corners)
        if not self.present:
            self._renderer.add_actor(self.actor, name=NAME, pickable=False, render=False)

    def place(self, origin: Origin) -> None:
        """Move the actor to the origin of its scene, which float32 coordinates are relative to."""
        if origin != self._origin:
            self.actor.SetPosition(*np.add(self.actor.GetPosition(), np.subtract(origin, self._origin)))
            self._origin = origin

    @property
    def present(self) -> bool:
        """True while the actor is among the renderer's actors; pyvista's ``clear`` removes it."""
        return bool(self._renderer.HasViewProp(self.actor))

    @property
    def visible(self) -> bool:
        """True if the renderer draws the actor, and so the scene; False if it is hidden or has no objects."""
        cells = self._mapper.GetInput().GetNumberOfCells()
        return cells > 0 and bool(self.actor.GetVisibility()) and self.present

    def remove(self) -> None:
        """Remove the actor from the renderer."""
        if self.present:
            self._renderer.remove_actor(self.actor, render=False)

    def matrix(self) -> Float64Array:
        """Return the actor's matrix to the world, (4, 4); identity unless the actor was moved."""
        return matrix_of(self.actor)

    def _move_to_end(self) -> None:
        """Move the actor behind all others: edges are blended with the opaque actors drawn before."""
        props = self._renderer.GetViewProps()
        if self._renderer.HasViewProp(self.actor) and props.GetLastProp() is not self.actor:
            props.RemoveItem(self.actor)
            props.AddItem(self.actor)

    def release(self) -> None:
        """Remove the actor and its observers."""
        self.remove()
        for subject, tag in self._observed:
            subject.RemoveObserver(tag)
        self._observed.clear()
