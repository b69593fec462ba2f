"""Actions that move the camera of the view: sides, projection, and what it frames."""

import numpy as np
from numpy.typing import ArrayLike

from blobtree.nodes.paths import node_in_world
from blobtree.validation import describe
from decals.editing.action_state import ActionState, Cursor, WindowActions
from decals.editing.key_bindings import Group
from decals.errors import InvalidEdit
from decals.scenes.camera import PRESETS, UPRIGHT, Axes
from decals.scenes.objects import TreeObject, bounds_of

SIDE_KEYS = {
    "front": "1",
    "back": "2",
    "right": "3",
    "left": "4",
    "top": "7",
    "bottom": "8",
    "three-quarter": "0",
}
"""Keys of the sides."""

UPRIGHT_COSINE = 0.999
"""Cosine of the angle between a camera's up and an axis from which on the model stands along that axis."""


class ViewActions(WindowActions):
    """Actions on the camera of the window.

    Parameters
    ----------
    state
        State of the window.

    Attributes
    ----------
    axes : Axes
        Which way the scene stands.
    """

    def __init__(self, state: ActionState) -> None:
        super().__init__(state)
        self.stand(state.session.document.camera.up)

    def stand(self, up: ArrayLike) -> None:
        """Take the axis along the upward direction of a camera, shape (3,), as that of the scene; else y."""
        along = np.asarray(up, np.float64) / np.linalg.norm(up)
        standing = [axes for axes in UPRIGHT.values() if along @ np.array(axes.up) > UPRIGHT_COSINE]
        self.axes: Axes = next(iter(standing), UPRIGHT["y"])

    def look_from(self, name: str) -> None:
        """Look at the present target from a preset, or from between sides, such as "top front right".

        Raises
        ------
        InvalidEdit
            There is no such direction, or no window.
        """
        words = name.split() if isinstance(name, str) else []
        known = all(word in PRESETS for word in words)
        parts = np.sum([PRESETS[word] for word in words], axis=0) if words and known else np.zeros(3)
        if not parts.any():
            raise InvalidEdit(f"side: expected one or more of {', '.join(PRESETS)}, got {describe(name)}")
        upright = bool(parts[[0, 2]].any())
        up = self.axes.up if upright else -np.sign(parts[1]) * np.array(self.axes.front)
        self._state.camera.look(parts @ self.axes.matrix, up)

    @Group.CAMERA.action(
        "frame", "f", "Home", summary="show the selection, or everything, as large as it fits"
    )
    def frame(self, _cursor: Cursor) -> None:
        """Show the selected decals or node, or the whole scene, as large as it fits."""
        state, document = self._state, self._state.session.document
        if state.selection:
            rows = document.decals.take(state.selected_numbers)
            radii = rows.radii[:, None]
            low, high = (rows.positions - radii).min(axis=0), (rows.positions + radii).max(axis=0)
        elif state.primitive is not None:
            number, path = state.primitive
            item = document.objects[number]
            assert isinstance(item, TreeObject)
            low, high = node_in_world(item.tree, path).bounds
        elif document.objects:
            low, high = bounds_of(document.objects)
        else:
            return
        state.camera.frame(low, high)

    @Group.CAMERA.action("orthographic", "5", summary="with perspective, or without")
    def toggle_projection(self, _cursor: Cursor) -> None:
        """Look in perspective, or in parallel."""
        camera = self._state.camera
        camera.parallel = not camera.parallel
        self._state.message = f"{'parallel' if camera.parallel else 'perspective'} projection"


for _side, _key in SIDE_KEYS.items():
    _register = Group.CAMERA.action(f"view_{_side}", _key, summary=f"{_side} view")
    setattr(
        ViewActions, f"look_from_{_side}", _register(lambda actions, _, side=_side: actions.look_from(side))
    )
