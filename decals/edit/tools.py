"""Hands to edits: pointer, wheel and keys, in any window or none."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from decals.checks import finite, instance, shown
from decals.edit.actions import Actions
from decals.edit.commands import Carry
from decals.edit.keys import action_of
from decals.edit.pick import Pick, pick
from decals.edit.places import first_hit, nearest, turns
from decals.errors import InvalidEdit
from decals.surfaces.surface import Floats

Ray = tuple[ArrayLike, ArrayLike]
"""Origin and direction in the scene's coordinates."""

Hidden = Callable[[float, float, Floats], bool]
"""Whether something else in the window hides a point of a surface, at a place in pixels."""

CLICK = 3.0
"""A press that moves farther than so many pixels is a drag."""


class Tools:
    """Turns what hands do into actions, by the table in `decals.edit.keys`.

    Places are in pixels. Every method says whether the event was used: what is not is the camera's.

    Parameters
    ----------
    actions
        Selection and actions.
    ray
        Gives the ray through a place in the window, None outside of it.
    hidden
        What is hidden cannot be picked, nor be gone to.
    """

    def __init__(
        self,
        actions: Actions,
        ray: Callable[[float, float], Ray | None],
        hidden: Hidden = lambda _x, _y, _point: False,
    ) -> None:
        self.actions = instance("actions", actions, Actions, InvalidEdit, "Actions(session) makes some")
        self._ray, self._hidden = ray, hidden
        self._pressed: tuple[float, float] | None = None
        self._held: _Held | None = None
        self._strayed = False

    @property
    def dragging(self) -> bool:
        """Whether decals are being moved now."""
        return self._held is not None and self._strayed

    def at(self, x: float, y: float) -> Pick | None:
        """Say what is under a place."""
        x, y = _place(x, y)
        ray = self._ray(x, y)
        found = None if ray is None else pick(self.actions.session.document, *ray)
        return None if found is None or self._hidden(x, y, found.position) else found

    def key(self, name: str, x: float, y: float, *, ctrl: bool = False, shift: bool = False) -> bool:
        """Take a key that was pressed while the cursor was at a place."""
        return self._ask(name, x, y, ctrl=ctrl, shift=shift)

    def wheel(self, up: bool, x: float, y: float, *, ctrl: bool = False, shift: bool = False) -> bool:
        """Take one step of the wheel."""
        return self._ask("WheelUp" if up else "WheelDown", x, y, ctrl=ctrl, shift=shift)

    def press(self, x: float, y: float, *, ctrl: bool = False, shift: bool = False) -> bool:
        """Take the left button going down."""
        self._pressed, self._strayed, self._held = _place(x, y), False, None
        if ctrl:
            return True
        found = None if shift or not self.actions.selection else self.at(x, y)
        if found is None or found.owner not in self.actions.selection:
            return False
        self._held = _Held(self.actions, found)
        return True

    def move(self, x: float, y: float) -> bool:
        """Take the pointer being somewhere else."""
        x, y = _place(x, y)
        if self._pressed is None:
            return False
        if not self._strayed and np.hypot(x - self._pressed[0], y - self._pressed[1]) > CLICK:
            self._strayed = True
            if self._held is not None:
                self._held.begin()
        if self._held is None:
            return False
        if self._strayed:
            ray = self._ray(x, y)
            if ray is not None:
                self._held.move(ray, lambda point: self._hidden(x, y, point))
        return True

    def release(self, x: float, y: float, *, ctrl: bool = False, shift: bool = False) -> bool:
        """Take the left button going up."""
        held, self._held, pressed, self._pressed = self._held, None, self._pressed, None
        if pressed is None:
            return False
        if self._strayed:
            self._strayed = False
            if held is not None:
                self.actions.settle()
        else:
            self._ask("Click", x, y, ctrl=ctrl, shift=shift)
        return held is not None or ctrl

    def _ask(self, name: str, x: float, y: float, *, ctrl: bool, shift: bool) -> bool:
        if not isinstance(name, str):
            raise InvalidEdit(f"key: expected its name, such as 'z', got {shown(name)}")
        x, y = _place(x, y)
        action = action_of(name, ctrl=ctrl, shift=shift)
        if action is None:
            return False
        if action == "let_go":
            self._held = None
        if self.dragging:
            self.actions.settle()
        self.actions.perform(action, lambda: self.at(x, y))
        self._go_on()
        return True

    def _go_on(self) -> None:
        """After an action in its middle a drag is another entry, if what it holds is still there."""
        if self._held is not None and not self._held.there:
            self._held = None
        if self._held is not None and self._strayed:
            self._held.begin()


def _place(x: float, y: float) -> tuple[float, float]:
    """A place in pixels."""
    return finite("x", x, InvalidEdit), finite("y", y, InvalidEdit)


class _Held:
    """What is selected, held at one decal: it follows the pointer over the surfaces."""

    def __init__(self, actions: Actions, found: Pick) -> None:
        self._actions = actions
        rest = tuple(number for number in actions.selection if number != found.owner)
        self._numbers = np.array([found.owner, *rest], np.int64)
        center = actions.session.document.decals[found.owner].positions[0]
        self._normal = found.normal
        self._offset: Floats = center - found.position

    @property
    def there(self) -> bool:
        """Whether nobody deleted any of it."""
        return bool(self._actions.session.document.decals.has(self._numbers).all())

    def begin(self) -> None:
        """Let what follows be one entry."""
        self._actions.begin("move")

    def move(self, ray: Ray, hidden: Callable[[Floats], bool]) -> None:
        """Go to where the ray meets a surface; stay where it meets none that is seen."""
        document = self._actions.session.document
        found = first_hit(document.objects, *ray)
        if not len(found.objects) or hidden(found.positions[0]):
            return
        offset = turns(self._normal[None], found.normals)[0] @ self._offset
        goal = nearest(document.objects, found.positions + offset)
        self._actions.attempt(Carry(self._numbers, goal.positions[0], goal.normals[0]))
