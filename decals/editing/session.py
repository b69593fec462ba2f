"""Edit sessions: commands with undo and redo, strokes, forks for background threads, and saving."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from blobtree.progress import Progress
from blobtree.validation import describe
from decals.editing.document import DecalStates, Document, Edit, SceneParts
from decals.editing.locks import check_locks
from decals.errors import InvalidEdit
from decals.scenes.camera import Camera
from decals.scenes.files import save_scene
from decals.scenes.objects import forget_surface
from decals.scenes.scene import Scene
from decals.validation import instance, whole_number

MAX_REPLAYED_DECALS = 500
"""A session repeats a fork's edits of at most so many decals; otherwise it adopts the fork's index."""

MAX_SURFACES = 8
"""Entries before the present state, and after it, whose objects keep surfaces; others compute them again."""

MAX_HISTORY_BYTES = 1 << 28
"""Memory of the entries of a session, about; beyond it the oldest ones are forgotten, but never the last."""

UNTITLED = "untitled"
"""Title of a scene without a file."""

ENTRY_BYTES = 4096
"""Memory of an entry beside what its edit holds, at most."""


class Command(Protocol):
    """A change to make to a document. It only computes the edit; the session applies it."""

    @property
    def label(self) -> str:
        """What the command does, in a few words, as undo names it."""
        ...

    def compute(self, document: Document) -> Edit:
        """Return the edit; the document stays as it is."""
        ...


Step = Callable[["EditSession"], str]
"""Edits a session, and returns a message for the user (empty for none)."""


def step_of(command: Command) -> Step:
    """Return the step that carries out a command."""

    def step(session: "EditSession") -> str:
        session.do(command)
        return command.label

    return step


def takes_long(command: Command) -> bool:
    """Return True if a command says that it belongs in the background by its attribute ``long``.

    Commands for many decals, which query surfaces at many points, or build surfaces, are long.
    """
    return bool(getattr(command, "long", False))


@dataclass(frozen=True, eq=False)
class UndoEntry:
    """An entry of the undo stack: one command, or one stroke of several.

    Attributes
    ----------
    label
        What was done, in a few words.
    edit
        The edit that undo takes back.
    mark
        Identity of the state after the entry.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, TurnDecals
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(TurnDecals([1], 60))
    >>> session.next_undo.label
    'turn'
    """

    label: str
    edit: Edit
    mark: object = field(default_factory=object, repr=False)

    @property
    def held_bytes(self) -> int:
        """Approximate memory of the entry, in bytes."""
        return ENTRY_BYTES + self.edit.held_bytes


@dataclass
class History:
    """Entries that can be undone and redone, the open stroke, and the forgotten entries.

    ``start`` is the mark of the oldest state that undo reaches; so many entries before it are ``forgotten``.
    ``held_bytes`` is the approximate memory of the entries that can be undone.
    """

    done: list[UndoEntry] = field(default_factory=list)
    undone: list[UndoEntry] = field(default_factory=list)
    stroke: UndoEntry | None = None
    start: object = field(default_factory=object)
    forgotten: int = 0
    held_bytes: int = 0

    def copy(self) -> "History":
        """Return an independent copy; entries are immutable and shared."""
        return replace(self, done=[*self.done], undone=[*self.undone])

    def add(self, entry: UndoEntry, max_bytes: int) -> None:
        """Add a last entry; forget the oldest ones while all take more than ``max_bytes``. The last stays."""
        self.done.append(entry)
        self.held_bytes += entry.held_bytes
        count = 0
        while self.held_bytes > max_bytes and count < len(self.done) - 1:
            self.held_bytes -= self.done[count].held_bytes
            count += 1
        if count:
            self.start, self.forgotten = self.done[count - 1].mark, self.forgotten + count
            del self.done[:count]

    def take_back(self) -> UndoEntry:
        """Move the last entry to those that can be redone, and return it."""
        entry = self.done.pop()
        self.held_bytes -= entry.held_bytes
        self.undone.append(entry)
        return entry


class EditSession:
    """A document with undo and redo.

    Commands between `begin_stroke` and `end_stroke` become one undo entry, such as a drag.

    Parameters
    ----------
    scene
        The scene, or document, to edit. Undoing everything restores it bit for bit, decal numbers included.
    max_history_bytes
        Memory of the entries that can be undone, about. Beyond it the oldest ones are forgotten.

    Attributes
    ----------
    document : Document
        The current state.

    Raises
    ------
    InvalidScene
        ``scene`` is neither a `Scene` nor a `Document`.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import ScaleDecals
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=4, images=["eye"])
    >>> session = decals.editing.EditSession(scene)
    >>> edit = session.do(ScaleDecals([2], 1.5))
    >>> session.labels
    ('scale',)
    >>> session.undo()
    'scale'
    >>> session.redo()
    'scale'
    >>> edited = session.document.scene
    """

    def __init__(self, scene: Scene | Document, *, max_history_bytes: int = MAX_HISTORY_BYTES) -> None:
        self.document = scene if isinstance(scene, Document) else Document.from_scene(scene)
        self._max_history_bytes = whole_number("max_history_bytes", max_history_bytes, 0, None, InvalidEdit)
        self._history = History()
        self._saved = self._history.start
        self._listeners: list[Callable[[Edit], None]] = []
        self._revision = 0

    # -- commands ---------------------------------------------------------------------------------------

    def do(self, command: Command) -> Edit:
        """Carry out a command and return its edit.

        Parameters
        ----------
        command
            Such as `decals.editing.ScaleDecals`. If it raises, the document stays as it was.

        Raises
        ------
        InvalidEdit
            The argument is not a command, or it does not fit the document.
        """
        known = callable(getattr(command, "compute", None)) and hasattr(command, "label")
        if not known or isinstance(command, type):
            raise InvalidEdit(f"expected a command such as ScaleDecals([7], 1.5), got {describe(command)}")
        edit = command.compute(self.document)
        if self.document.has_locks and not getattr(command, "ignores_locks", False):
            check_locks(self.document, edit)
        if edit.empty:
            return edit
        self._apply(edit.after, edit.parts_after)
        history = self._history
        history.undone.clear()
        if history.stroke is None:
            self._add(UndoEntry(command.label, edit))
        else:
            history.stroke = UndoEntry(history.stroke.label, history.stroke.edit.then(edit))
        self._notify(edit)
        return edit

    def undo(self) -> str | None:
        """Undo the last entry and return its label, or None without an entry."""
        self.end_stroke()
        if not self._history.done:
            return None
        entry = self._history.take_back()
        self._forget_surfaces(self._history.undone)
        self._revert(entry.edit)
        return entry.label

    def redo(self) -> str | None:
        """Redo the entry that was undone last and return its label, or None without an entry."""
        self.end_stroke()
        if not self._history.undone:
            return None
        entry = self._history.undone.pop()
        self._add(entry)
        self._apply(entry.edit.after, entry.edit.parts_after)
        self._notify(entry.edit)
        return entry.label

    def _add(self, entry: UndoEntry) -> None:
        self._history.add(entry, self._max_history_bytes)
        self._forget_surfaces(self._history.done)

    def _forget_surfaces(self, entries: list[UndoEntry]) -> None:
        """Forget the surfaces of objects that only entries far from the present state have."""
        if len(entries) > MAX_SURFACES:
            near = {item for kept in entries[-MAX_SURFACES:] for item in kept.edit.objects}
            far = entries[-MAX_SURFACES - 1].edit.objects
            for item in set(far) - near - {*self.document.objects}:
                forget_surface(item)

    def _revert(self, edit: Edit) -> None:
        self._apply(edit.before, edit.parts_before)
        self._notify(edit)

    def _apply(self, states: DecalStates, parts: SceneParts) -> None:
        self._revision += 1
        self.document.apply(states, parts)

    @property
    def next_undo(self) -> UndoEntry | None:
        """Entry that `undo` would undo."""
        return self._history.done[-1] if self._history.done else None

    @property
    def next_redo(self) -> UndoEntry | None:
        """Entry that `redo` would redo."""
        return self._history.undone[-1] if self._history.undone else None

    @property
    def position(self) -> object:
        """Mark of the present state in the history; undo and redo return to the same ones."""
        return self._history.done[-1].mark if self._history.done else self._history.start

    @property
    def forgotten(self) -> int:
        """Number of the oldest entries that can no longer be undone, see ``max_history_bytes``."""
        return self._history.forgotten

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the entries that can be undone, oldest first."""
        return tuple(entry.label for entry in self._history.done)

    @property
    def undone_labels(self) -> tuple[str, ...]:
        """Labels of the entries that can be redone, the next one first."""
        return tuple(entry.label for entry in reversed(self._history.undone))

    # -- strokes ----------------------------------------------------------------------------------------

    @property
    def stroke_open(self) -> bool:
        """True between `begin_stroke` and `end_stroke`."""
        return self._history.stroke is not None

    def begin_stroke(self, label: str) -> None:
        """Collect all following commands in one undo entry, until `end_stroke`."""
        instance("label", label, str, InvalidEdit, "name what is done, such as 'a drag'")
        self.end_stroke()
        self._revision += 1
        self._history.stroke = UndoEntry(label, Edit())

    def end_stroke(self) -> None:
        """End the stroke; a stroke that changed nothing leaves no entry."""
        stroke, self._history.stroke = self._history.stroke, None
        self._revision += stroke is not None
        if stroke is not None and not stroke.edit.empty:
            self._add(stroke)

    def revert_stroke(self) -> None:
        """Restore the state at the beginning of the open stroke, and keep the stroke open."""
        stroke = self._history.stroke
        if stroke is not None and not stroke.edit.empty:
            self._revert(stroke.edit)
            self._history.stroke = UndoEntry(stroke.label, Edit())

    def cancel_stroke(self) -> None:
        """Restore the state at the beginning of the open stroke, and drop the stroke."""
        self.revert_stroke()
        self._revision += self.stroke_open
        self._history.stroke = None

    @contextmanager
    def stroke(self, label: str) -> Iterator[None]:
        """Make a ``with`` block one undo entry; an error restores the state before the block."""
        self.begin_stroke(label)
        try:
            yield
        except BaseException:
            self.cancel_stroke()
            raise
        self.end_stroke()

    # -- forks ------------------------------------------------------------------------------------------

    def fork(self) -> "Fork":
        """Return a copy of the session that another thread may edit; `adopt` brings its edits back."""
        return Fork(self)

    def adopt(self, fork: "Fork") -> bool:
        """Take over the state of a fork of this session, which must not be used afterwards.

        The time does not grow with the number of edited decals.

        Returns
        -------
        bool
            False if this session was edited after the fork was made. Then nothing happens.
        """
        instance("fork", fork, Fork, InvalidEdit, "session.fork() makes one")
        if fork.origin is not self or not fork.current:
            return False
        if fork.small:
            for states, parts in fork.applied:
                self.document.apply(states, parts)
        else:
            self.document.adopt(fork.document)
        self._history = fork._history
        self._revision += 1
        for edit in fork.edits:
            self._notify(edit)
        return True

    def forget_history(self) -> None:
        """Drop all entries, as after another file was opened; the present state counts as saved."""
        self.end_stroke()
        self._history = History()
        self._saved = self._history.start
        self._revision += 1

    @property
    def changes(self) -> int:
        """Number that grows with every change of the document or of the history."""
        return self._revision

    def mark_saved(self) -> None:
        """Count the present state as saved, such as a scene that can be opened again."""
        self.end_stroke()
        self._saved = self.position

    # -- listeners and files ----------------------------------------------------------------------------

    def subscribe(self, listener: Callable[[Edit], None]) -> Callable[[], None]:
        """Call a function after every change of the document.

        Parameters
        ----------
        listener
            Called with the edit that was done, undone or redone.

        Returns
        -------
        callable
            Ends the subscription; calling it twice is harmless.
        """
        if not callable(listener):
            raise InvalidEdit(f"listener: expected a function of an edit, got {describe(listener)}")
        self._listeners.append(listener)

        def unsubscribe() -> None:
            if listener in self._listeners:
                self._listeners.remove(listener)

        return unsubscribe

    def _notify(self, edit: Edit) -> None:
        for listener in [*self._listeners]:  # a listener may unsubscribe itself
            listener(edit)

    @property
    def modified(self) -> bool:
        """True if there are edits since the last save."""
        stroke = self._history.stroke
        return (stroke is not None and not stroke.edit.empty) or self.position is not self._saved

    def title_of(self, path: str | os.PathLike[str] | None) -> str:
        """Return the name of the session's file, with a star in front if there are unsaved changes."""
        name = UNTITLED if path is None else Path(path).name
        return f"*{name}" if self.modified else name

    def save(self, path: str | os.PathLike[str], *, camera: Camera | None = None) -> None:
        """Write the scene to a file, completely or not at all; see `decals.save_scene`.

        Parameters
        ----------
        path
            The file.
        camera
            Camera to store. Default: the document's.
        """
        self.begin_save(path, camera=camera).write()()

    def begin_save(self, path: str | os.PathLike[str], *, camera: Camera | None = None) -> "SaveJob":
        """Return a job that writes the scene as it is now; later edits do not change the file.

        An open stroke ends.

        Parameters
        ----------
        path
            The JSON file.
        camera
            Camera to store. Default: the document's.

        Raises
        ------
        InvalidEdit
            ``path`` is not a path.
        """
        named = isinstance(path, str | os.PathLike) and os.fspath(path)
        if not named or "\0" in str(path):
            raise InvalidEdit(f"expected a path to save to, got {describe(path)}")
        self.end_stroke()
        return SaveJob(self, path, camera)


class Fork(EditSession):
    """A session that begins with the state of another one, its origin.

    Parameters
    ----------
    origin
        The session to copy.

    Attributes
    ----------
    origin
        The session that was copied.
    edits, applied
        Edits since then, and the sides of edits that were applied, undo included.
    """

    def __init__(self, origin: EditSession) -> None:
        super().__init__(origin.document.fork(), max_history_bytes=origin._max_history_bytes)
        self._history = origin._history.copy()
        self.origin, self._origin_revision = origin, origin._revision
        self._saved = origin._saved
        self.edits: list[Edit] = []
        self.applied: list[tuple[DecalStates, SceneParts]] = []
        self.subscribe(self.edits.append)

    @property
    def current(self) -> bool:
        """True while the origin was not changed."""
        return self._origin_revision == self.origin._revision

    def _apply(self, states: DecalStates, parts: SceneParts) -> None:
        super()._apply(states, parts)
        self.applied.append((states, parts))

    def adopt(self, fork: "Fork") -> bool:
        """Take over the state of a fork of this fork; see `EditSession.adopt`."""
        adopted = super().adopt(fork)
        if adopted:
            self.applied += fork.applied
        return adopted

    def replay(self) -> Iterator[Scene]:
        """Undo everything, then redo it, and yield the scene at the beginning and after each entry."""
        count = len(self.labels)
        while self.undo() is not None:
            pass
        yield self.document.scene
        for _ in range(count):
            self.redo()
            yield self.document.scene

    @property
    def small(self) -> bool:
        """True if so few decals changed that the origin can quickly repeat the edits."""
        return sum(len(states.numbers) for states, _ in self.applied) <= MAX_REPLAYED_DECALS

    def prepare(self, *, surfaces: bool) -> None:
        """Build what the origin would have to build after `adopt`: the decal index, kernels and surfaces."""
        self.document.decals.load_kernels()
        if not self.small:
            self.document.decals.index  # noqa: B018  (the index is built on access)
        if surfaces:
            self.document.prepare_surfaces()


class SaveJob:
    """Writes the state that a session had when the job was made; any thread may run it.

    Parameters
    ----------
    session
        The session to save.
    path
        The file.
    camera
        Camera to store; None for the document's.
    """

    def __init__(self, session: EditSession, path: str | os.PathLike[str], camera: Camera | None) -> None:
        self._session, self._path, self._camera = session, path, camera
        self._document, self._position = session.document.fork(), session.position

    def write(self, progress: Progress | None = None) -> Callable[[], None]:
        """Write the file, and return a function that marks the session as saved, for the session's thread."""
        save_scene(self._document.scene.replace(camera=self._camera), self._path, progress=progress)

        def mark_saved() -> None:
            self._session._saved = self._position

        return mark_saved
