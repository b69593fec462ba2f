"""What the key table names: actions on what is selected and on what is under the cursor."""

from collections.abc import Callable
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree import BlobTreeError
from blobtree.progress import Progress
from decals.checks import shown
from decals.edit.background import Background, are_many, doing, takes_long
from decals.edit.change import Change, Numbers
from decals.edit.commands import Add, Adjust, Delete, Duplicate, Scale, Turn
from decals.edit.keys import BINDINGS, CAMERA
from decals.edit.new_decals import decal_at
from decals.edit.places import nearest
from decals.edit.population import Relax, Scatter
from decals.edit.session import Command, Done, EditSession
from decals.edit.shape_actions import TINTS, Cursor, ShapeActions, under
from decals.errors import DecalsError, InvalidEdit
from decals.model import LAYERS, PLAIN, Decals, Interaction
from decals.scenes.camera import Camera

LARGER, TURN, FAINTER = 1.1, 7.5, 0.8
"""What one step of the wheel or a key does: factors, and degrees."""

FIRST_COAT = 100
"""Decals of a coat for an object that has none."""


class Actions(ShapeActions):
    """Selection, and one method for each action of the table; those on shapes stand in `ShapeActions`.

    Parameters
    ----------
    session
        What is edited.
    path
        Where to save.
    threaded
        Whether what takes long goes on in a thread; then somebody calls ``background.look`` now and then.

    Attributes
    ----------
    help
        Whether the help is wanted.
    camera
        Gives the camera to save with the scene; None for the document's.
    release
        Lets go of the session, which may outlive this.
    """

    def __init__(
        self,
        session: EditSession,
        *,
        path: str | PathLike[str] | None = None,
        threaded: bool = False,
    ) -> None:
        super().__init__(session)
        self.path = path
        self.help = False
        self.camera: Callable[[], Camera | None] = lambda: None
        self.background = Background(session, self._say, self.settle, threaded=threaded)
        self._coats = 0
        self._series: tuple[str, object] | None = None
        self._stroke = object()
        self.release = session.listen(self._forget_gone)

    # -- doing ------------------------------------------------------------------------------------------

    def perform(self, action: str, cursor: Cursor) -> None:
        """Carry out an action; what cannot be done is said in `message`, and nothing changes."""
        if not isinstance(action, str) or action not in _TEXTS or not hasattr(self, f"_{action}"):
            raise InvalidEdit(f"action: expected one of the table of keys, got {shown(action)}")
        series = (action, self.selection) if action in _SERIES else None
        if series != self._series:
            self._stroke = object()
            self.session.end()
        try:
            if series is not None and series != self._series:
                self.session.begin(_TEXTS[action])
            getattr(self, f"_{action}")(cursor)
        except (DecalsError, BlobTreeError) as error:
            self.message = str(error)
        self._series = series

    def attempt(self, command: Command) -> None:
        """Do a command, as hands ask for again and again; what cannot be done is said in `message`."""
        self._follow(command.label, doing(command), long=takes_long(command))

    def settle(self) -> None:
        """End what goes on: the next action is an entry of its own."""
        self._series, self._stroke = None, object()
        stroke = self._stroke
        self.background.afterwards(lambda: self._end(stroke))

    def begin(self, label: str) -> None:
        """End what goes on; all that follows is one entry until `settle`."""
        self.settle()
        self._stroke = object()
        self.session.begin(label)

    def _end(self, stroke: object) -> None:
        """End a stroke, unless it has ended and another one goes on."""
        if stroke is self._stroke:
            self.session.end()

    def _say(self, text: str) -> None:
        self.message = text

    def _do(self, command: Command, done: Callable[[], None] | None = None) -> None:
        """Do a command, in the background if it takes long; then what goes with it."""
        if takes_long(command):
            self.background.edit(command.label, doing(command), done)
            return
        self.session.do(command)
        self.message = command.label
        if done is not None:
            done()

    def _forget_gone(self, change: Change) -> None:
        self._loosen(change)
        there = self.session.document.decals.has(np.array(self.selection, np.int64))
        self.selection = tuple(n for n, stays in zip(self.selection, there, strict=True) if stays)

    def _chosen(self) -> Numbers:
        if not self.selection:
            raise InvalidEdit("select a decal first: click on one")
        return np.array(self.selection, np.int64)

    @property
    def _last(self) -> Decals:
        """The decal that was selected last."""
        return self.session.document.decals[int(self._chosen()[-1])]

    def _alter(self, label: str, name: str, value: Callable[[Decals], ArrayLike]) -> None:
        self._do(Adjust(self._chosen(), name, value, label))

    # -- selecting --------------------------------------------------------------------------------------

    def _pick(self, cursor: Cursor) -> None:
        found = cursor()
        self.selection = () if found is None or found.owner < 0 else (found.owner,)
        self.message = f"decal {found.owner}" if found is not None and self.selection else ""

    def _pick_also(self, cursor: Cursor) -> None:
        found = cursor()
        if found is None or found.owner < 0:
            return
        rest = tuple(number for number in self.selection if number != found.owner)
        self.selection = rest if found.owner in self.selection else (*rest, found.owner)
        self.message = f"{len(self.selection)} decals"

    def _pick_all(self, _cursor: Cursor) -> None:
        self.selection = tuple(self.session.document.decals.numbers.tolist())
        self.message = f"{len(self.selection)} decals"

    def _let_go(self, _cursor: Cursor) -> None:
        self.selection, self.message = (), ""
        self.background.cancel()
        self.session.cancel()

    # -- decals -----------------------------------------------------------------------------------------

    def _place(self, cursor: Cursor) -> None:
        found = under(cursor)
        model = self.selection[-1] if self.selection else None
        self._do(Add(decal_at(self.session.document, found.position, found.normal, model)))
        self.selection = (self.session.document.decals.next_number - 1,)

    def _duplicate(self, _cursor: Cursor) -> None:
        if self._means_held:
            self._duplicate_held()
            return
        count = len(self.selection)

        def select() -> None:
            end = self.session.document.decals.next_number
            self.selection = tuple(range(end - count, end))

        self._do(Duplicate(self._chosen()), select)

    def _delete(self, _cursor: Cursor) -> None:
        if self._means_held:
            self._delete_held()
        else:
            self._do(Delete(self._chosen()))

    @property
    def _means_held(self) -> bool:
        """Whether a primitive is meant, as no decal is selected."""
        return self.grip is not None and not self.selection

    def _larger(self, _cursor: Cursor) -> None:
        self._do(Scale(self._chosen(), LARGER))

    def _smaller(self, _cursor: Cursor) -> None:
        self._do(Scale(self._chosen(), 1.0 / LARGER))

    def _turn_left(self, _cursor: Cursor) -> None:
        self._do(Turn(self._chosen(), TURN))

    def _turn_right(self, _cursor: Cursor) -> None:
        self._do(Turn(self._chosen(), -TURN))

    def _next_image(self, _cursor: Cursor, step: int = 1) -> None:
        count = len(self.session.document.images) - PLAIN
        self._alter("change the image", "images", lambda d: (d.images - PLAIN + step) % count + PLAIN)

    def _previous_image(self, cursor: Cursor) -> None:
        self._next_image(cursor, -1)

    def _next_tint(self, _cursor: Cursor) -> None:
        def tint(decals: Decals) -> ArrayLike:
            nearest = int(np.abs(np.array(TINTS) - decals.tints[0]).sum(axis=1).argmin())
            return TINTS[(nearest + 1) % len(TINTS)]

        self._alter("tint", "tints", tint)

    def _fainter(self, _cursor: Cursor) -> None:
        self._alter("fade", "opacities", lambda d: d.opacities * FAINTER)

    def _stronger(self, _cursor: Cursor) -> None:
        self._alter("fade", "opacities", lambda d: np.minimum(d.opacities / FAINTER, 1.0))

    def _layer_up(self, _cursor: Cursor, step: int = 1) -> None:
        def shifted(decals: Decals) -> NDArray[np.int32]:
            layers: NDArray[np.int32] = np.clip(decals.layers + step, -LAYERS, LAYERS - 1)
            return layers

        self._alter(f"layer {shifted(self._last)[0]}", "layers", shifted)

    def _layer_down(self, cursor: Cursor) -> None:
        self._layer_up(cursor, -1)

    def _next_interaction(self, _cursor: Cursor) -> None:
        def other(decals: Decals) -> NDArray[np.int32]:
            interactions: NDArray[np.int32] = (decals.interactions + 1) % len(Interaction)
            return interactions

        name = Interaction(int(other(self._last)[0])).name.lower()
        self._alter(f"interaction: {name}", "interactions", other)

    # -- many -------------------------------------------------------------------------------------------

    def _relax(self, cursor: Cursor) -> None:
        self._do(Relax(under(cursor).position))

    def _scatter(self, cursor: Cursor) -> None:
        document, number = self.session.document, under(cursor).object
        self._coats += 1
        seed, objects, images = self._coats, document.objects, len(document.images)
        positions = document.decals.column("positions")

        def work(tell: Progress, stop: Callable[[], bool]) -> Command:
            count = int((nearest(objects, positions).objects == number).sum()) or FIRST_COAT
            return Scatter((number,), count, seed).coat(objects, images, progress=tell, cancel=stop)

        self.background.make("scatter", work)

    # -- the scene --------------------------------------------------------------------------------------

    def _undo(self, _cursor: Cursor) -> None:
        self._step_back(self.session.next_undo, "undo", _undone)

    def _redo(self, _cursor: Cursor) -> None:
        self._step_back(self.session.next_redo, "redo", _done_again)

    def _step_back(self, entry: Done | None, name: str, step: Callable[[EditSession, Done], str]) -> None:
        """Go back or forth by an entry of the stack, in the background if it is a large one."""
        self.background.wait(making=False)
        if entry is None:
            self.message = f"nothing to {name}"
        elif are_many(entry.change.after.numbers):
            self.background.edit(name, lambda session: step(session, entry))
        else:
            self.message = step(self.session, entry)

    def _save(self, _cursor: Cursor) -> None:
        if self.path is None:
            raise InvalidEdit("nowhere to save to; name a file when you open the window")
        self.background.save(self.path, self.camera())

    def _help(self, _cursor: Cursor) -> None:
        self.help = not self.help


def _undone(session: EditSession, entry: Done) -> str:
    if session.next_undo is not entry:
        raise InvalidEdit("something else was done meanwhile; undo again")
    return f"undid: {session.undo()}"


def _done_again(session: EditSession, entry: Done) -> str:
    if session.next_redo is not entry:
        raise InvalidEdit("something else was done meanwhile; there is nothing to redo")
    return f"did again: {session.redo()}"


_TEXTS = {binding.action: binding.text for binding in BINDINGS if binding.action != CAMERA}
_SERIES = {"larger", "smaller", "turn_left", "turn_right", "fainter", "stronger", "thicker", "thinner"}
"""Actions that, done again and again, are one entry of the stack."""
