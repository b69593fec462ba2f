"""State that the actions of one window share: selection, messages, strokes and background jobs."""

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Int64Array
from blobtree.kernels import NotCompiled, without_compiling
from blobtree.nodes.paths import Path
from decals.editing.background import BackgroundJobs, Busy
from decals.editing.brush_settings import BrushSettings
from decals.editing.commands import SetDrawing
from decals.editing.document import Document, Edit
from decals.editing.inputs import inputs_of
from decals.editing.prompts import PromptLine
from decals.editing.queries import SurfacePick, on_shown_surfaces
from decals.editing.session import Command, EditSession, Step, step_of, takes_long
from decals.editing.tree_commands import same_structure
from decals.errors import ImplicitDecalsError, InvalidEdit
from decals.scenes.objects import Paths, SceneObject
from decals.validation import instance

Cursor = Callable[[], SurfacePick | None]
"""Returns the surface point under the cursor, or None."""


COMPILING = "kernels are compiled for this machine, once; try again in a moment"
"""Message after input that needs them."""

Answer = TypeVar("Answer")
Item = TypeVar("Item")

SLOW_STEP = 0.08
"""Processor time in seconds from which on a step of a drag counts as slow."""


class ViewCamera(Protocol):
    """The camera of a window."""

    parallel: bool
    """True for a parallel projection."""

    def eye_and_target(self) -> tuple[ArrayLike, ArrayLike]:
        """Return the position of the eye and the point that it looks at, shape (3,) each."""

    def look(self, toward: ArrayLike, up: ArrayLike) -> None:
        """Look at the same target from a direction, shape (3,)."""

    def frame(self, low: ArrayLike, high: ArrayLike) -> None:
        """Show a box, given by its corners, as large as it fits."""


class StillCamera:
    """The camera of a document without a window, which stays.

    Parameters
    ----------
    session
        The session.
    """

    parallel = False

    def __init__(self, session: EditSession) -> None:
        self._session = session

    def eye_and_target(self) -> tuple[ArrayLike, ArrayLike]:
        """Return eye and target of the document's camera."""
        camera = self._session.document.camera
        return camera.position, camera.target

    def look(self, _toward: ArrayLike, _up: ArrayLike) -> None:
        """Raise `InvalidEdit`: there is no window."""
        raise InvalidEdit("no window is open whose camera could move; set the scene's camera")

    def frame(self, low: ArrayLike, high: ArrayLike) -> None:
        """Raise `InvalidEdit`, too."""
        self.look(low, high)


def joined(items: tuple[Item, ...], item: Item, *, toggle: bool) -> tuple[Item, ...]:
    """Return items with another item as the last. With `toggle`, an item among them is removed."""
    others = tuple(one for one in items if one != item)
    return others if toggle and item in items else (*others, item)


def require_pick(cursor: Cursor) -> SurfacePick:
    """Return the surface point under the cursor, or raise `InvalidEdit`."""
    pick = cursor()
    if pick is None:
        raise InvalidEdit("no surface under the cursor; point at one")
    return pick


class ActionState:
    """Selection, message, strokes and background jobs of one window.

    Parameters
    ----------
    session
        The edited session.
    threaded
        If True, long edits run in threads, and the owner calls ``background.poll`` regularly.

    Attributes
    ----------
    selection
        Numbers of the selected decals, in the order of their selection.
    nodes
        Object and path of each selected node, in the order of their selection.
    primitive
        The last of them, if any; setting it deselects the others.
    handle_offset
        Offset of the primitive's handle from the middle of its box, shape (3,).
    picked
        The surface point of the last click, if it met one.
    message
        Result of the last action, in plain words.
    refusal
        Why the last input was refused; "" if it was not.
    refusals
        Number of inputs that were refused.
    prompt
        The open prompt, if any; it receives all keys.
    brush
        The brush that a drag uses.
    snap
        A dragged primitive moves by multiples of this along each axis; 0 for any distance.
    camera
        The camera of the window. Default: the document's, which stays.
    background
        Long edits and saves.
    """

    def __init__(self, session: EditSession, *, threaded: bool = False) -> None:
        self.session = instance("session", session, EditSession, InvalidEdit, "EditSession(scene) makes one")
        self.selection: tuple[int, ...] = ()
        self.nodes: tuple[tuple[int, Path], ...] = ()
        self.handle_offset: Float32Array = np.zeros(3, np.float32)
        self.picked: SurfacePick | None = None
        self.message, self.refusal, self.refusals = "", "", 0
        self.prompt = PromptLine(self.show)
        self.brush = BrushSettings()
        self.snap = 0.0
        self.camera: ViewCamera = StillCamera(session)
        self.background = BackgroundJobs(session, self.show, self.end_stroke, self.refuse, threaded=threaded)
        self._series: tuple[str, object] | None = None
        self._stroke = object()
        self._slow_steps = 0
        self._unsubscribe = session.subscribe(self._drop_deleted)

    def close(self) -> None:
        """Unsubscribe from the session, which may outlive the window."""
        self._unsubscribe()

    def show(self, message: str) -> None:
        """Set the message."""
        self.message = message

    def refuse(self, error: Exception) -> None:
        """Set the message to the reason why an input was refused."""
        self.refusals += 1
        self.refusal = str(error)
        self.show(self.refusal)

    def attempt(self, request: Callable[[], None], *, waits: bool = True) -> None:
        """Carry out a request of the user; an error becomes the message.

        Parameters
        ----------
        request
            The request.
        waits
            If True, a request that another edit blocks follows that edit, unless the selection changes.
        """
        if self.message == self.refusal:
            self.message = ""
        self.refusal = ""
        try:
            request()
        except Busy as error:
            follows = waits and self.background.wait(
                error.label, lambda: self.attempt(request), lambda: (self.selection, self.primitive)
            )
            if not follows:
                self.refuse(error)
        except ImplicitDecalsError as error:
            self.refuse(error)

    # -- selection --------------------------------------------------------------------------------------

    @property
    def selected_numbers(self) -> Int64Array:
        """Numbers of the selected decals; `InvalidEdit` if there are none."""
        if not self.selection:
            raise InvalidEdit("no decal is selected; click on one")
        return np.array(self.selection, np.int64)

    def selectable(self, numbers: ArrayLike) -> tuple[int, ...]:
        """Return the numbers of decals whose layer is not locked, and that lie on something that is shown."""
        document, given = self.session.document, np.asarray(numbers, np.int64)
        exist: Int64Array = given[document.decals.has(given)]
        locked = np.isin(document.decals.take(exist).layers, document.locked_layers)
        free = exist[~locked]
        return tuple(free[on_shown_surfaces(document, free)].tolist())

    @property
    def primitive(self) -> tuple[int, Path] | None:
        """Object and path of the node that was selected last."""
        return self.nodes[-1] if self.nodes else None

    @primitive.setter
    def primitive(self, place: tuple[int, Path] | None) -> None:
        self.nodes = () if place is None else (place,)

    @property
    def primitive_is_subject(self) -> bool:
        """True if duplicate and delete apply to the primitive: one is selected, and no decal is."""
        return self.primitive is not None and not self.selection

    def select_primitive(self, number: int, path: Path, handle_offset: Float32Array | None) -> None:
        """Select a primitive and deselect all decals; None keeps the offset of the handle."""
        self.primitive, self.selection = (number, path), ()
        if handle_offset is not None:
            self.handle_offset = handle_offset

    def _drop_deleted(self, edit: Edit) -> None:
        """Deselect decals that an edit deleted or hid, and nodes whose paths lead elsewhere now."""
        before, after = edit.parts_before.objects, edit.parts_after.objects
        if self.nodes and before is not None:
            common = min(len(before), len(after))
            kept = [n for n in range(common) if same_structure(before[n], after[n])]
            self.nodes = tuple(place for place in self.nodes if place[0] in kept)
        exist = self.session.document.decals.has(np.array(self.selection, np.int64))
        self.selection = tuple(n for n, kept in zip(self.selection, exist, strict=True) if kept)
        if self.selection and _hidden_paths(before) != _hidden_paths(after):
            with suppress(NotCompiled):  # what is selected can be projected
                self.selection = self.selectable(self.selection)

    # -- strokes ----------------------------------------------------------------------------------------

    def begin_stroke(self, label: str) -> None:
        """End the open stroke, and collect all following edits in one undo entry until `end_stroke`."""
        self.end_stroke()
        self._stroke, self._slow_steps = object(), 0
        self.session.begin_stroke(label)

    def end_stroke(self) -> None:
        """End the open stroke once all its background edits are adopted."""
        self._series, self._stroke = None, object()
        stroke = self._stroke
        self.background.when_followed(lambda: self._end(stroke))

    def _end(self, stroke: object) -> None:
        """End a stroke, unless another one has begun since."""
        if stroke is self._stroke:
            self.session.end_stroke()

    def begin_series(self, series: tuple[str, object] | None, label: str) -> None:
        """Continue the open stroke for a repetition of the last action, or begin another stroke.

        Parameters
        ----------
        series
            Name of the action, and the selection; None for actions that do not repeat.
        label
            Name of the undo entry.
        """
        if series == self._series:
            return
        self._stroke, self._slow_steps = object(), 0
        self.session.end_stroke()
        if series is not None:
            self.session.begin_stroke(label)
        self._series = series

    # -- commands ---------------------------------------------------------------------------------------

    def run(self, command: Command, done: Callable[[], None] | None = None) -> None:
        """Carry out a command, in the background if it takes long, then call ``done``."""
        step = step_of(command)
        if takes_long(command) or not self._done_now(step):
            self.background.edit(command.label, step, done, inputs=inputs_of(command))
        elif done is not None:
            done()

    def _done_now(self, step: Step) -> bool:
        """Carry out a step and return True, or return False if kernels must be compiled for it first."""
        try:
            with self._promptly():
                self.message = step(self.session)
        except NotCompiled:
            return False
        return True

    def _promptly(self) -> AbstractContextManager[None]:
        """Return a context in which threads alone compile kernels, if there are any."""
        return without_compiling() if self.background.threaded else nullcontext()

    def asked(
        self, label: str, question: Callable[[Document], Answer], *, quiet: bool = False
    ) -> Answer | None:
        """Return the answer to a question about the document.

        It is None if kernels must be compiled for it first. A thread compiles them. A message says so, except
        with `quiet`, for callers that repeat the question in the next frame.
        """
        try:
            with self._promptly():
                return question(self.session.document)
        except NotCompiled:
            fork = self.session.document.fork()
            self.background.prepare(label, lambda: question(fork))
            if not quiet:
                self.show(COMPILING)
            return None

    def draw_with(self, label: str, *, last: bool = True, **options: Any) -> None:
        """Draw the scene with other options of `Drawing`; steps with one label are one undo entry."""
        drawing = replace(self.session.document.drawing, **options)
        self.run_step(SetDrawing(drawing, label), last=last)

    def run_step(self, command: Command, *, last: bool) -> None:
        """Carry out a step of a slider; steps with one label and selection are one undo entry."""
        series, long = (command.label, self.selection), takes_long(command)
        self.run_in_series(series, command.label, step_of(command), long=long, last=last)
        if last:
            self.end_stroke()

    def run_in_series(
        self, series: tuple[str, object], label: str, step: Step, *, long: bool, last: bool
    ) -> None:
        """Carry out a step of a series as `run_latest_step` does.

        The last one raises `Busy` if it has to wait, so `attempt` lets it follow the running edit.
        """
        if last and long and not self.background.following:
            self.background.require_idle(label)  # before a stroke begins, which the running edit would notice
        self.begin_series(series, label)
        try:
            self.run_latest_step(label, step, long=long, waits=last)
        except Busy:
            self.end_stroke()
            raise

    def run_latest(self, command: Command) -> None:
        """Carry out a command of a drag; errors become the message."""
        self.run_latest_step(command.label, step_of(command), long=takes_long(command))

    def run_latest_step(self, label: str, step: Step, *, long: bool, waits: bool = False) -> None:
        """Carry out a step of a drag, in the background if it is long; errors become the message.

        Two slow steps in a row count as long for the rest of the stroke. ``waits`` raises `Busy`.
        """
        try:
            began = time.thread_time()
            if long or self._slow_steps > 1 or not self._done_now(step):
                self.background.edit_latest(label, step)
            else:
                self._slow_steps = self._slow_steps + 1 if time.thread_time() - began > SLOW_STEP else 0
        except ImplicitDecalsError as error:
            if waits and isinstance(error, Busy):
                raise
            self.refuse(error)


def _hidden_paths(objects: Sequence[SceneObject] | None) -> list[Paths]:
    return [item.hidden for item in objects or ()]


class WindowActions:
    """Base of classes of actions on the state of a window.

    Parameters
    ----------
    state
        State of the window.
    """

    def __init__(self, state: ActionState) -> None:
        self._state = state
