"""Actions on decals: add, resize, turn, recolour, reorder, relax and scatter."""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Int32Array
from blobtree.progress import Progress
from decals.editing.action_state import ActionState, Cursor, WindowActions, require_pick
from decals.editing.commands import AddDecals, MapValues, OrderDecals, ScaleDecals, TurnDecals
from decals.editing.document import Document
from decals.editing.inputs import inputs_of
from decals.editing.key_bindings import Group
from decals.editing.queries import mean_normal, nearest_points
from decals.editing.scatter_commands import RelaxDecals, ScatterDecals
from decals.editing.session import Command, EditSession
from decals.errors import InvalidEdit
from decals.model import LAYER_LIMIT, NO_IMAGE, Decals, Interaction
from decals.scattering.orientation import tangents
from decals.scenes.objects import bounds_of

FIRST_RADIUS = 0.05
"""Radius of the first decal of a scene, in diagonals of the scene."""

SCALE_STEP, TURN_STEP, FADE_STEP = 1.1, 7.5, 0.8
"""Change by one key press or wheel step: factor of the radius, degrees, factor of the opacity."""

FIRST_DECAL_COUNT = 100
"""Number of decals scattered over an object without decals."""

TINTS = ((1.0, 1.0, 1.0), (0.95, 0.45, 0.35), (0.95, 0.8, 0.35), (0.5, 0.85, 0.5), (0.4, 0.6, 0.95))
"""sRGB colours that the tint key goes through."""


def new_decal(document: Document, position: Float32Array, normal: Float32Array, model: int | None) -> Decals:
    """Return a decal at a surface point.

    Parameters
    ----------
    document
        The document, for the usual size.
    position, normal
        The point and its unit normal, shape (3,) each.
    model
        Number of the decal to copy; None for a decal of median radius with the first image.
    """
    positions, normals = position[None], normal[None]
    if model is not None:
        like = document.decals[model]
        normals = mean_normal(document.objects, position, normal, float(like.radii[0]))[None]
        turned = tangents(positions, normals, like.tangents[0], 0)
        return like.replace(positions=positions, normals=normals, tangents=turned)
    radii = document.decals.column("radii")
    low, high = bounds_of(document.objects)
    radius = float(np.median(radii)) if len(radii) else FIRST_RADIUS * float(np.linalg.norm(high - low))
    normals = mean_normal(document.objects, position, normal, radius)[None]
    return Decals(
        positions,
        normals,
        tangents(positions, normals, (1.0, 0.0, 0.0), 0),
        np.array([radius], np.float32),
        images=np.array([0 if document.images else NO_IMAGE]),
    )


Filling: TypeAlias = Callable[[Callable[[], int]], Any]
"""A function of a pick of an object, which it may leave out, to the command that fills bare places."""


class DecalActions(WindowActions):
    """Actions on the selected decals, and on decals under the cursor.

    Parameters
    ----------
    state
        State of the window.
    filling
        Returns the command that fills the places that the last edit opened, else those of the picked object.
    """

    _scatter_count = 0

    def __init__(self, state: ActionState, filling: Filling) -> None:
        super().__init__(state)
        self._filling = filling

    def _map(self, label: str, name: str, function: Callable[[Decals], ArrayLike]) -> None:
        """Set a value of the selected decals to a function of them."""
        self._state.run(MapValues(self._state.selected_numbers, name, function, label))

    @property
    def _last_selected(self) -> Decals:
        return self._state.session.document.decals[int(self._state.selected_numbers[-1])]

    @Group.DECALS.action("add_decal", "a", summary="add a decal under the cursor")
    def add_decal(self, cursor: Cursor, **values: ArrayLike) -> None:
        """Add a decal like the last selected one, but with other values of `Decals`, and select it."""
        state, pick = self._state, require_pick(cursor)
        model = state.selection[-1] if state.selection else None
        document = state.session.document
        decal = new_decal(document, pick.position, pick.normal, model).replace(**values)
        layer = int(decal.layers[0])
        hidden = layer in document.hidden.decals.layers and not len(document.decals_of_layer(layer))
        if hidden or layer in document.locked_layers:
            state_of, change = ("hidden", "show") if hidden else ("locked", "unlock")
            raise InvalidEdit(
                f"layer {layer} is {state_of}; {change} it in the outline, or select a decal of another layer"
            )
        state.run(AddDecals(decal))
        state.selection = (state.session.document.decals.next_number - 1,)

    @Group.DECALS.action("larger", "Ctrl+WheelUp", "plus", "equal", "KP_Add", summary="larger", repeats=True)
    def larger(self, _cursor: Cursor) -> None:
        """Enlarge the selected decals."""
        self._state.run(ScaleDecals(self._state.selected_numbers, SCALE_STEP))

    @Group.DECALS.action("smaller", "Ctrl+WheelDown", "minus", "KP_Subtract", summary="smaller", repeats=True)
    def smaller(self, _cursor: Cursor) -> None:
        """Shrink the selected decals."""
        self._state.run(ScaleDecals(self._state.selected_numbers, 1.0 / SCALE_STEP))

    @Group.DECALS.action(
        "turn_left", "Shift+WheelUp", "comma", summary="turn counter-clockwise", repeats=True
    )
    def turn_left(self, _cursor: Cursor) -> None:
        """Turn the selected decals counter-clockwise."""
        self._state.run(TurnDecals(self._state.selected_numbers, TURN_STEP))

    @Group.DECALS.action("turn_right", "Shift+WheelDown", "period", summary="turn clockwise", repeats=True)
    def turn_right(self, _cursor: Cursor) -> None:
        """Turn the selected decals clockwise."""
        self._state.run(TurnDecals(self._state.selected_numbers, -TURN_STEP))

    @Group.DECALS.action("next_image", "i", summary="next image")
    def next_image(self, _cursor: Cursor) -> None:
        """Give each selected decal the next image; after the last one comes the plain tint."""
        self._shift_image(1)

    @Group.DECALS.action("previous_image", "Shift+i", summary="previous image")
    def previous_image(self, _cursor: Cursor) -> None:
        """Give each selected decal the previous image."""
        self._shift_image(-1)

    def _shift_image(self, step: int) -> None:
        count = len(self._state.session.document.images) - NO_IMAGE
        self._map("change the image", "images", lambda d: (d.images - NO_IMAGE + step) % count + NO_IMAGE)

    @Group.DECALS.action("next_tint", "t", summary="next tint")
    def next_tint(self, _cursor: Cursor) -> None:
        """Give the selected decals the tint after the first one's."""

        def tint(decals: Decals) -> ArrayLike:
            nearest = int(np.abs(np.array(TINTS) - decals.tints[0]).sum(axis=1).argmin())
            return TINTS[(nearest + 1) % len(TINTS)]

        self._map("tint", "tints", tint)

    @Group.DECALS.action("fainter", "o", summary="more transparent", repeats=True)
    def fainter(self, _cursor: Cursor) -> None:
        """Lower the opacity of the selected decals."""
        self._map("fade", "opacities", lambda d: d.opacities * FADE_STEP)

    @Group.DECALS.action("stronger", "Shift+o", summary="less transparent", repeats=True)
    def stronger(self, _cursor: Cursor) -> None:
        """Raise the opacity of the selected decals."""
        self._map("fade", "opacities", lambda d: np.minimum(d.opacities / FADE_STEP, 1.0))

    @Group.DECALS.action("layer_up", "Prior", summary="one layer up")
    def layer_up(self, _cursor: Cursor) -> None:
        """Raise the layer of the selected decals."""
        self._shift_layer(1)

    @Group.DECALS.action("layer_down", "Next", summary="one layer down")
    def layer_down(self, _cursor: Cursor) -> None:
        """Lower the layer of the selected decals."""
        self._shift_layer(-1)

    def _shift_layer(self, step: int) -> None:
        def shifted(decals: Decals) -> Int32Array:
            layers: Int32Array = np.clip(decals.layers + step, -LAYER_LIMIT, LAYER_LIMIT - 1)
            return layers

        self._map(f"layer {shifted(self._last_selected)[0]}", "layers", shifted)

    @Group.DECALS.action("bring_to_front", "Shift+Prior", summary="in front of its layer")
    def bring_to_front(self, _cursor: Cursor) -> None:
        """Draw the selected decals over all others of their layers and interactions."""
        self._order(front=True)

    @Group.DECALS.action("send_to_back", "Shift+Next", summary="behind its layer")
    def send_to_back(self, _cursor: Cursor) -> None:
        """Draw the selected decals under all others of their layers and interactions."""
        self._order(front=False)

    def _order(self, *, front: bool) -> None:
        command = OrderDecals(self._state.selected_numbers, front)
        after = command.numbers_after(self._state.session.document)

        def select() -> None:
            self._state.selection = tuple(after.tolist())

        self._state.run(command, select)

    @Group.DECALS.action("next_interaction", "k", summary="push, overlap or independent")
    def next_interaction(self, _cursor: Cursor) -> None:
        """Give each selected decal the next interaction."""

        def shifted(decals: Decals) -> Int32Array:
            interactions: Int32Array = (decals.interactions + 1) % len(Interaction)
            return interactions

        name = Interaction(int(shifted(self._last_selected)[0])).name.lower()
        self._map(f"interaction: {name}", "interactions", shifted)

    @Group.MANY.action("relax", "x", summary="even out the decals around the cursor")
    def relax(self, cursor: Cursor) -> None:
        """Even out the decals around the cursor."""
        self._state.run(RelaxDecals(require_pick(cursor).position))

    @Group.MANY.action("fill", "Shift+g", summary="fill bare places: those of the last pull, else all here")
    def fill(self, cursor: Cursor) -> None:
        """Fill the places that the last edit of a shape opened, else all of the object under the cursor."""
        command = self._filling(lambda: require_pick(cursor).object)

        def step(session: EditSession) -> str:
            count = len(session.do(command).after.numbers)
            return f"{count} new decals fill the bare places" if count else "no place is bare"

        self._state.background.edit(command.label, step, inputs=inputs_of(command))

    @Group.MANY.action("scatter", "g", summary="scatter new decals over the object under the cursor")
    def scatter(self, cursor: Cursor) -> None:
        """Replace the decals on an object by as many scattered ones, with another seed each time."""
        self.scatter_over((require_pick(cursor).object,))

    def scatter_over(
        self,
        numbers: tuple[int, ...],
        count: int | None = None,
        seed: int | None = None,
        *,
        command: type[ScatterDecals] = ScatterDecals,
        **options: Any,
    ) -> None:
        """Replace the decals on objects by scattered ones.

        Parameters
        ----------
        numbers
            Indices of the objects.
        count
            Number of decals. None stands for as many as there are, or 100.
        seed
            Random seed. Default: another one each time.
        command
            Class of the command.
        options
            Those of `ScatterDecals`.
        """
        document = self._state.session.document
        self._scatter_count += 1
        seed = self._scatter_count if seed is None else seed
        objects, images = document.objects, len(document.images)
        positions = document.decals.column("positions")

        def compute(progress: Progress, cancel: Callable[[], bool]) -> Command:
            on = nearest_points(objects, positions).objects if count is None else np.zeros(0)
            wanted = (int(np.isin(on, numbers).sum()) or FIRST_DECAL_COUNT) if count is None else count
            scattered = command(numbers, wanted, seed, options)
            return scattered.compute_command(objects, images, progress=progress, cancel=cancel)

        self._state.background.compute("scatter", compute)
