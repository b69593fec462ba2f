"""Overlay of the editing window: outlines, the handle of a primitive, a status line, and the help."""

import itertools
import math
import textwrap
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike
from vtkmodules.vtkInteractionWidgets import vtkSphereWidget

from blobtree._typing import Float32Array, Float64Array
from blobtree.nodes.paths import Path, node_in_world
from decals.editing.action_state import ActionState
from decals.editing.actions import KEYS, Actions
from decals.editing.queries import ANGLES, outlines
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact
from decals.scenes.objects import TreeObject, bounds_of
from decals.vtk.adapters import weak_callback

MAX_OUTLINES = 64
"""Number of outlined decals, at most."""

OUTLINE_COLOR = (1.0, 0.75, 0.1)
OUTLINE_WIDTH = 3
LIFT_PIXELS = 3.0
"""Distance of outlines before the surface, in pixels of its frame: its depth has steps of that size."""

TEXT_BACKGROUND_OPACITY = 0.85

LINE_HEIGHT, LETTER_WIDTH = 1.3, 0.62
"""Sizes of the help's font, relative to its size."""

MIN_HELP_SIZE, MAX_HELP_SIZE = 6, 18
"""Size of the help's font, in pixels."""

HELP_BORDER = 60
"""Space above and below the help, in pixels."""

MAX_HELP_PAGES = 3
"""Pages of the help, at most: so many are needed in a window of 400 × 300 pixels."""

TEXT_MARGIN = 12
"""Space beside text, in pixels."""

WIDE_LETTERS = 0.9
"""Number of wide letters in the width of an average letter."""

MAX_STATUS_HEIGHT = 0.3
"""Height of the status relative to the window, at most."""

ELLIPSIS = " …"
"""End of a status that was cut."""


class Overlay:
    """Outlines, status and help in a plotter.

    Parameters
    ----------
    plotter
        The plotter; its active subplot shows the overlay.
    state
        State of the window.
    draw_scale
        Returns the size of the surface's frame over that of the window.

    Attributes
    ----------
    status
        Text at the bottom.
    lines
        The drawn outlines.
    moving
        True while a slider of a page moves: outlines, which take longer than a frame, follow at its end.
    """

    def __init__(
        self, plotter: pv.BasePlotter, state: ActionState, draw_scale: Callable[[], float] = lambda: 1.0
    ) -> None:
        self._plotter: Any = plotter
        self._state = state
        self._draw_scale = draw_scale
        self._renderer: Any = plotter.renderer
        self.moving = False
        self.lines = pv.PolyData()
        self._outlined: tuple[object, ...] = ()
        self._actor = plotter.add_mesh(
            pv.Line((0, 0, 0), (0, 0, 0)),
            color=OUTLINE_COLOR,
            line_width=OUTLINE_WIDTH,
            lighting=False,
            pickable=False,
            reset_camera=False,
            render=False,
            name="decals-selection",
        )
        self._actor.mapper.dataset = self.lines
        self._actor.use_bounds = False
        self._actor.ForceTranslucentOn()  # so that it writes no depth and occludes nothing
        self._tag = self._renderer.AddObserver("StartEvent", weak_callback(self._lift))
        self.shows_status = True  # else a page around the plotter shows it
        self.status, self._help_lines = "", KEYS.help_lines()
        self._status: Any = plotter.add_text(
            "", position=(TEXT_MARGIN, 10), font_size=9, color="black", render=False, name="decals-status"
        )
        self._help: Any = plotter.add_text(
            "\n".join(self._help_lines),
            position=(TEXT_MARGIN, 40),
            font_size=8,
            color="black",
            font="courier",
            render=False,
            name="decals-help",
        )
        for text in (self._status, self._help):
            text.prop.SetBackgroundColor(1.0, 1.0, 1.0)
            text.prop.SetBackgroundOpacity(TEXT_BACKGROUND_OPACITY)
        self._help.SetVisibility(False)

    def outline(
        self,
        numbers: tuple[int, ...],
        nodes: Sequence[tuple[int, Path]],
        contact: AnyContact,
        mapping: ImageMapping,
    ) -> None:
        """Outline the visible parts of decals, else nodes by the boxes around their own surfaces.

        The outlines of decals follow later if kernels must be compiled for them first.
        """
        document = self._state.session.document
        drawn = (document.decals.version, numbers, contact, mapping) if numbers else nodes
        key = (document.objects, drawn) if drawn else ()
        if key == self._outlined:
            return
        last = numbers[-MAX_OUTLINES:]
        angles = ANGLES if len(last) == 1 else ANGLES // 2
        modes: dict[str, Any] = {"contact": contact, "mapping": mapping, "angles": angles}
        lines: list[Any] | None = []
        if last:
            lines = self._state.asked(
                "outline", lambda asked: list(outlines(asked, last, **modes)), quiet=True
            )
        if lines is None:
            return
        self._outlined = key
        if not last:
            trees = [(document.objects[number], path) for number, path in nodes]
            lines = [
                edge
                for item, path in trees
                if isinstance(item, TreeObject)
                for edge in box_edges(*node_in_world(item.tree, path).bounds)
            ]
        self.lines.copy_from(_polylines(lines))
        self._actor.SetVisibility(bool(lines))

    def _lift(self) -> None:
        """Move the outlines towards the camera, which leaves them where they are in the picture."""
        camera, matrix = self._renderer.camera, np.eye(4)
        share = 2.0 * LIFT_PIXELS / (self._draw_scale() * self._plotter.window_size[1])
        if camera.parallel_projection:
            matrix[:3, 3] = -share * camera.parallel_scale * np.array(camera.direction)
        else:
            share *= np.tan(np.radians(camera.view_angle) / 2.0)
            matrix[:3] *= 1.0 - share
            matrix[:3, 3] = share * np.array(camera.position)
        self._actor.user_matrix = matrix

    def show_status(self, text: str) -> None:
        """Show a text at the bottom, in several lines if it is too long."""
        self.status = text
        if not self.shows_status:
            return
        self._status.SetInput(text)
        size = [0.0, 0.0]
        self._status.GetSize(self._renderer, size)
        width, height = self._renderer.GetSize()
        room = width - 2 * TEXT_MARGIN
        if size[0] > room > 0:
            letters = max(int(len(text) * room / size[0] * WIDE_LETTERS), len(ELLIPSIS))
            lines = max(int(height * MAX_STATUS_HEIGHT / size[1]), 1)
            wrapped = textwrap.wrap(text, letters, max_lines=lines, placeholder=ELLIPSIS)
            self._status.SetInput("\n".join(wrapped))

    def hide_status(self) -> None:
        """Leave status and help to a page around the plotter."""
        self.shows_status = False
        self._status.SetInput("")

    def show_help(self, page: int) -> int:
        """Show a page of the help, from 1, as large as the window allows, or hide it for 0.

        Returns
        -------
        int
            Number of pages: several in a low window.
        """
        if not self.shows_status:
            return 1
        width, height = self._renderer.GetSize()
        lines = self._help_lines
        fitting = (height - HELP_BORDER) / (LINE_HEIGHT * MIN_HELP_SIZE)
        pages: int = min(max(math.ceil(len(lines) / max(fitting - 1.0, 1.0)), 1), MAX_HELP_PAGES)
        self._help.SetVisibility(page > 0)
        if page > 0:
            count = math.ceil(len(lines) / pages)
            first = (min(page, pages) - 1) * count
            shown = lines[first : first + count]
            if pages > 1:
                shown.append("h: next page" if page < pages else "h: hide the help")
            by_height = (height - HELP_BORDER) / (LINE_HEIGHT * (count + (pages > 1)))
            by_width = (width - 2 * TEXT_MARGIN) / (LETTER_WIDTH * max(map(len, lines)))
            self._help.SetInput("\n".join(shown))
            self._help.prop.SetFontSize(max(MIN_HELP_SIZE, min(MAX_HELP_SIZE, int(min(by_height, by_width)))))
        return pages

    def release(self) -> None:
        """Remove everything from the plotter."""
        self._renderer.RemoveObserver(self._tag)
        for actor in (self._actor, self._status, self._help):
            self._plotter.remove_actor(actor, render=False)

    @property
    def help_visible(self) -> bool:
        """True while the help is visible."""
        return bool(self._help.GetVisibility())


def box_edges(low: ArrayLike, high: ArrayLike) -> list[Float32Array]:
    """Return the edges of a box, given by its corners, shape (2, 3) each."""
    corners = [
        np.where(side, high, low).astype(np.float32) for side in itertools.product((False, True), repeat=3)
    ]
    return [np.stack([corners[i], corners[i | bit]]) for i in range(8) for bit in (1, 2, 4) if not i & bit]


def _polylines(lines: list[Float32Array]) -> pv.PolyData:
    """Return lines, shape (k, 3) each, as one dataset."""
    if not lines:
        return pv.PolyData()
    counts = [len(line) for line in lines]
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    cells = [np.concatenate([[n], start + np.arange(n)]) for n, start in zip(counts, starts, strict=True)]
    return pv.PolyData(np.concatenate(lines), lines=np.concatenate(cells))


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
    click
        Called after a press and a release at one place.

    Attributes
    ----------
    widget
        VTK's widget; None while no primitive is selected.
    dragging
        True during a drag.
    visible
        False if a page around the plotter shows handles of its own.
    """

    def __init__(
        self,
        renderer: Any,
        actions: Actions,
        redraw: Callable[[bool], None],
        click: Callable[[], None] = lambda: None,
    ) -> None:
        self._renderer, self._actions, self._redraw, self._click = renderer, actions, redraw, click
        self.widget: Any = None
        self._released: Any = None
        self._primitive: tuple[int, Path] | None = None
        self._drag_start: Float64Array = np.zeros(3)
        self.dragging, self.visible = False, True

    def update(self) -> None:
        """Put the ball at the selected primitive, or remove it; a drag is not disturbed."""
        if self.dragging or not self.visible:
            return
        primitive = self._actions.state.primitive
        if primitive is None or primitive != self._primitive:
            self.release()
        if primitive is None:
            return
        center = self._actions.trees.handle_position
        if self.widget is None:
            self.widget, self._primitive = self._new_widget(center), primitive
        self.widget.SetCenter(*center.tolist())

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
        self.dragging, self._drag_start = True, np.array(self.widget.GetCenter())
        self._actions.trees.begin_drag()

    def move(self) -> None:
        """Drag the primitive to the ball."""
        self._actions.trees.drag(np.array(self.widget.GetCenter()) - self._drag_start)
        self._redraw(False)

    def end(self) -> None:
        """End the drag."""
        moved = (np.array(self.widget.GetCenter()) != self._drag_start).any()
        self._actions.trees.end_drag()
        self.dragging = False
        if not moved:
            self._click()
        self._redraw(True)

    def release(self) -> None:
        """Remove the ball; VTK may be in the middle of one of its events, so it is kept for a while."""
        if self.widget is not None:
            self._released = self.widget
            self.widget.RemoveAllObservers()
            if self._renderer.GetRenderWindow() is not None:  # else the plotter was closed before
                self.widget.Off()
            self.widget = self._primitive = None
