"""Pointer tools: pointer, wheel and key events to actions, for any window or none."""

from collections.abc import Callable
from enum import Enum, auto

import numpy as np

from blobtree._typing import Float32Array, Float64Array, Int64Array
from blobtree.validation import describe
from decals.editing.actions import KEYS, Actions
from decals.editing.brush_settings import Brush, Stroke
from decals.editing.commands import MoveDecals
from decals.editing.gizmo import Ray, on_plane
from decals.editing.queries import (
    SurfacePick,
    facing_decals,
    first_hit,
    inside_polygon,
    nearest_points,
    pick,
    shortest_rotations,
)
from decals.errors import InvalidEdit
from decals.validation import any_number, instance

Occluded = Callable[[float, float, Float32Array], bool]
"""Returns True if another object in the window hides a surface point, at a pixel."""

CLICK_DISTANCE = 3.0
"""A press that moves farther than this is a drag, in pixels."""


class Press(Enum):
    """State of the left button."""

    UP = auto()
    DOWN = auto()
    """Pressed, and not moved beyond `CLICK_DISTANCE`."""
    DRAG = auto()


class PointerTools:
    """Translates pointer, wheel and key events to actions, by the key table.

    Coordinates ``x, y`` are in pixels from the lower left corner. ``ctrl`` and ``shift`` are True while these
    keys are down. Every event method returns True if the event was used; otherwise it belongs to the camera.

    Parameters
    ----------
    actions
        The actions.
    ray
        Returns the ray through a pixel, or None outside the picture.
    occluded
        Hidden points can neither be picked nor be the target of a drag.
    pixels
        Returns the pixels at which points appear, shape (n, 2), for boxes and lassos.

    Attributes
    ----------
    selection_line
        Corners of the box or lasso that is being drawn, in pixels.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import Actions, PointerTools
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=20, images=["eye"])
    >>> rays = scene.camera.rays(100, 100)
    >>> actions = Actions(decals.editing.EditSession(scene))
    >>> tools = PointerTools(actions, lambda x, y: (rays.origin, rays.directions(x, y)))
    >>> tools.press(50, 50), tools.release(50, 50)
    (False, False)
    >>> len(actions.state.selection)
    1
    """

    def __init__(
        self,
        actions: Actions,
        ray: Callable[[float, float], Ray | None],
        occluded: Occluded = lambda _x, _y, _point: False,
        pixels: Callable[[Float32Array], Float64Array] = lambda points: np.full((len(points), 2), np.nan),
    ) -> None:
        self.actions = instance("actions", actions, Actions, InvalidEdit, "Actions(session) makes some")
        self._ray, self._occluded, self._pixels = ray, occluded, pixels
        self.selection_line: list[tuple[float, float]] = []
        self._press, self._press_position, self._last_click = Press.UP, (0.0, 0.0), (-np.inf, -np.inf)
        self._drag: DecalDrag | SurfaceDrag | None = None
        self._handle_press: tuple[float, float] | None = None
        self._brush: Stroke | None = None
        self._brush_start: object = None
        self.actions.forget_press = self.forget_press

    @property
    def dragging(self) -> bool:
        """True while decals are dragged or brushed."""
        return self._brush is not None or (self._drag is not None and self._press is Press.DRAG)

    @property
    def drags_decals(self) -> bool:
        """True while the button is down on a selected decal, or a brush is."""
        return self._drag is not None or self._brush is not None

    def at(self, x: float, y: float) -> SurfacePick | None:
        """Return the surface point at a pixel, or None."""
        surface_pick = self._behind(x, y)
        if surface_pick is None or self._occluded(x, y, surface_pick.position):
            return None
        return surface_pick

    def _behind(self, x: float, y: float) -> SurfacePick | None:
        """Return the surface point at a pixel, whatever hides it, or None."""
        ray = self._ray(*_checked_pixel(x, y))
        return ray and self.actions.state.asked(
            "find the surface", lambda document: pick(document, *ray, contact=document.drawing.contact)
        )

    def click_through(self, x: float, y: float) -> None:
        """Click again on the surface behind the handle of the selected node."""
        self.actions.perform("select_further", lambda: self._behind(x, y))

    def press_handle(self, name: str, x: float, y: float, length: float) -> None:
        """Press a handle of the selected node, whose axes have a length in model units."""
        ray = self._ray(*_checked_pixel(x, y))
        if ray is not None:
            self.actions.trees.begin_handle_drag(name, ray, length)
            self._handle_press = x, y

    def drag_handle(self, x: float, y: float, *, snap: bool, last: bool) -> None:
        """Drag the pressed handle to a pixel; if it is released where it was pressed, click through it."""
        ray, start = self._ray(*_checked_pixel(x, y)), self._handle_press
        if start is not None and np.hypot(x - start[0], y - start[1]) <= CLICK_DISTANCE:
            if last:
                self._handle_press = None
                self.actions.trees.end_drag()
                self.click_through(x, y)
            return
        self._handle_press = None
        if ray is not None:
            self.actions.trees.drag_handle(ray, snap=snap)
        if last:
            self.actions.trees.end_drag()

    def key(
        self, name: str, x: float, y: float, *, ctrl: bool = False, shift: bool = False, text: str = ""
    ) -> bool:
        """Handle a key press with the cursor at a pixel; ``text`` is the character that the key types.

        While a prompt is open it receives all keys.
        """
        prompt = self.actions.state.prompt
        if prompt.open and isinstance(name, str):
            prompt.key(name, "" if ctrl else text)
            return True
        return self._perform(name, x, y, ctrl=ctrl, shift=shift)

    def wheel(self, up: bool, x: float, y: float, *, ctrl: bool = False, shift: bool = False) -> bool:
        """Handle one step of the wheel."""
        return self._perform("WheelUp" if up else "WheelDown", x, y, ctrl=ctrl, shift=shift)

    def press(self, x: float, y: float, *, ctrl: bool = False, shift: bool = False) -> bool:
        """Handle a press of the left button."""
        self._press_position, self._press, self._drag = _checked_pixel(x, y), Press.DOWN, None
        if ctrl:
            return True
        brush = Brush.SELECT if shift else self.actions.state.brush.brush
        self.selection_line = [(x, y)] if brush in (Brush.BOX, Brush.LASSO) else []
        if self.selection_line:
            return True
        if brush is Brush.PULL:
            surface_pick, ray = self.at(x, y), self._ray(x, y)
            if surface_pick is not None and ray is not None:
                self._drag = SurfaceDrag(self.actions, surface_pick, ray)
            return surface_pick is not None
        if brush not in (Brush.SELECT, Brush.ADD):
            return self._begin_brush(x, y)
        selection = self.actions.state.selection
        surface_pick = None if shift or not selection else self.at(x, y)
        if surface_pick is None or surface_pick.owner not in selection:
            return False
        self._drag = DecalDrag(self.actions, surface_pick)
        return True

    def _begin_brush(self, x: float, y: float) -> bool:
        """Begin a stroke of the brush; where there is no surface, the press belongs to the camera."""
        surface_pick, state = self.at(x, y), self.actions.state
        if surface_pick is None:
            return False
        if state.brush.brush is Brush.PAINT:
            state.primitive, state.selection = None, ()
        self._brush = self.actions.brush.stroke(self._also_select)
        state.begin_stroke(self._brush.label)
        self._brush_start = state.session.position
        self._brush.touch(surface_pick.position, surface_pick.normal)
        return True

    def _end_brush(self, brush: Stroke) -> None:
        """End a stroke of the brush; a message says if it changed nothing."""
        state, start = self.actions.state, self._brush_start
        state.end_stroke()

        def check() -> None:
            if state.session.position is start and state.brush.brush is not Brush.PAINT:
                state.show(f"{brush.label}: nothing to change here")

        state.background.when_followed(check)

    def move(self, x: float, y: float) -> bool:
        """Handle a move of the pointer."""
        x, y = _checked_pixel(x, y)
        if self._press is Press.UP:
            return False
        if self.selection_line:
            (left, low), box = self.selection_line[0], self.actions.state.brush.brush is Brush.BOX
            line = [(left, low), (x, low), (x, y), (left, y)]
            self.selection_line = line if box else [*self.selection_line, (x, y)]
            return True
        if self._brush is not None:
            surface_pick = self.at(x, y)
            if surface_pick is not None:
                self._brush.touch(surface_pick.position, surface_pick.normal)
            return True
        distance = np.hypot(x - self._press_position[0], y - self._press_position[1])
        if self._press is Press.DOWN and distance > CLICK_DISTANCE:
            self._press = Press.DRAG
            if self._drag is not None:
                self._drag.begin()
        if self._drag is None:
            return False
        if self._press is Press.DRAG:
            ray = self._ray(x, y)
            if ray is not None:
                self._drag.move(ray, lambda point: self._occluded(x, y, point))
        return True

    def release(self, x: float, y: float, *, ctrl: bool = False, shift: bool = False) -> bool:
        """Handle the release of the left button."""
        press, self._press = self._press, Press.UP
        drag, self._drag = self._drag, None
        brush, self._brush = self._brush, None
        if press is Press.UP:
            return False
        line, self.selection_line = self.selection_line, []
        if len(line) > 2:
            self._select_inside(line)
            return True
        if brush is not None:
            self._end_brush(brush)
            return True
        if press is Press.DOWN:
            self._click(x, y, ctrl=ctrl, shift=shift)
        elif drag is not None:
            drag.end()
        return drag is not None or ctrl

    def _click(self, x: float, y: float, *, ctrl: bool, shift: bool) -> None:
        """Handle a press and release at one place; the second at a place is another gesture."""
        again = np.hypot(x - self._last_click[0], y - self._last_click[1]) <= CLICK_DISTANCE
        self._last_click = x, y
        if self.actions.state.brush.brush is Brush.ADD and not ctrl and not shift:
            self.actions.perform("add_decal", lambda: self.at(x, y))
            return
        self._perform(
            "Click again" if again and not ctrl and not shift else "Click", x, y, ctrl=ctrl, shift=shift
        )

    def cancel(self) -> None:
        """Forget the press of the button, and revert what its drag has changed."""
        self.forget_press()
        self._press = Press.UP
        self.actions.state.background.revert_drag()

    def forget_press(self) -> bool:
        """Forget what the press of the button has begun; return True if that was a drag, a box or a lasso."""
        dragged = self.dragging or bool(self.selection_line)
        self.selection_line, self._drag, self._brush, self._handle_press = [], None, None, None
        return dragged

    def _also_select(self, numbers: Int64Array) -> None:
        """Add decals to the selection."""
        state = self.actions.state
        others = [number for number in numbers.tolist() if number not in state.selection]
        state.selection += state.selectable(others)
        state.message = f"{len(state.selection)} decals"

    def _select_inside(self, line: list[tuple[float, float]]) -> None:
        """Select the visible decals whose centres appear in a polygon."""
        state = self.actions.state
        document = state.session.document
        numbers = document.decals.numbers
        places = self._pixels(document.decals.column("positions"))
        inside = inside_polygon(places, line)
        rays = [self._ray(*place) for place in places[inside].tolist()]
        known = np.array([ray is not None for ray in rays], np.bool_)
        near = numbers[inside][known]
        seen = facing_decals(document, near, [ray for ray in rays if ray is not None])
        state.primitive, state.selection = None, state.selectable(near[seen])
        state.message = f"{len(state.selection)} decals"

    def _perform(self, name: str, x: float, y: float, *, ctrl: bool, shift: bool) -> bool:
        if not isinstance(name, str):
            raise InvalidEdit(f"key: expected its name, such as 'z', got {describe(name)}")
        x, y = _checked_pixel(x, y)
        action = KEYS.action_of(name, ctrl=ctrl, shift=shift)
        if action is None:
            return False
        reverts = action == "deselect"
        if self.dragging and not reverts:
            self.actions.state.end_stroke()
        self.actions.perform(action, lambda: self.at(x, y))
        if not reverts:
            self._continue_drag()
        return True

    def _continue_drag(self) -> None:
        """Continue a drag after an action as another undo entry, unless its decals were deleted."""
        if self._drag is not None and not self._drag.possible:
            self._drag = None
        if self._drag is not None and self._press is Press.DRAG:
            self._drag.begin()
        if self._brush is not None:
            self.actions.state.begin_stroke(self._brush.label)


def _checked_pixel(x: float, y: float) -> tuple[float, float]:
    return any_number("x", x, InvalidEdit), any_number("y", y, InvalidEdit)


class DecalDrag:
    """A drag of the selected decals over the surfaces.

    Parameters
    ----------
    actions
        The actions.
    start
        The pressed point, on one of the selected decals.
    """

    def __init__(self, actions: Actions, start: SurfacePick) -> None:
        self._actions = actions
        others = tuple(number for number in actions.state.selection if number != start.owner)
        self._numbers = np.array([start.owner, *others], np.int64)
        center = actions.state.session.document.decals[start.owner].positions[0]
        self._normal = start.normal
        self._offset: Float32Array = center - start.position

    @property
    def possible(self) -> bool:
        """True unless one of the decals was deleted."""
        return bool(self._actions.state.session.document.decals.has(self._numbers).all())

    def begin(self) -> None:
        """Begin an undo entry."""
        self._actions.state.begin_stroke("move")

    def move(self, ray: Ray, occluded: Callable[[Float32Array], bool]) -> None:
        """Move the decals to the visible surface point along a ray; without one they stay."""
        document = self._actions.state.session.document
        hit = first_hit(document.shown_objects, *ray)
        if not len(hit.objects) or occluded(hit.positions[0]):
            return
        offset = shortest_rotations(self._normal[None], hit.normals)[0] @ self._offset
        target = nearest_points(document.shown_objects, hit.positions + offset)
        self._actions.state.run_latest(MoveDecals(self._numbers, target.positions[0], target.normals[0]))

    def end(self) -> None:
        """End the undo entry."""
        self._actions.state.end_stroke()


class SurfaceDrag:
    """A drag of a point of the surface, in the plane through it that faces the viewer.

    Parameters
    ----------
    actions
        The actions.
    start
        The pressed point.
    ray
        The ray through it.
    """

    def __init__(self, actions: Actions, start: SurfacePick, ray: Ray) -> None:
        self._trees, self._start, self._toward = actions.trees, start, ray[1]
        self._attempt = actions.state.attempt
        self.possible = True

    def begin(self) -> None:
        """Begin an undo entry; refused if the pressed object was removed meanwhile."""
        self._attempt(lambda: self._trees.begin_surface_drag(self._start), waits=False)

    def move(self, ray: Ray, _occluded: Callable[[Float32Array], bool]) -> None:
        """Drag the point to a ray."""
        end = on_plane(self._start.position, self._toward, ray)
        if end is not None:
            self._trees.drag_surface(self._start.position, end)

    def end(self) -> None:
        """End the undo entry; if the object has no visible surface left, the drag is reverted."""
        self._trees.end_drag()
