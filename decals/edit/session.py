"""One stack of commands: do, undo, redo, strokes and saving."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from blobtree.progress import Progress
from decals.checks import instance, shown
from decals.edit.change import Change, Parts, Rows
from decals.edit.document import Document
from decals.errors import InvalidEdit
from decals.scenes.camera import Camera
from decals.scenes.scene import Scene
from decals.scenes.scene_file import save_scene

FEW = 500
"""Decals that change their places in an index one by one sooner than another index is brought over."""


class Command(Protocol):
    """Something to do to a document. It computes; the session changes."""

    @property
    def label(self) -> str:
        """What undo would take back, in plain words."""
        ...

    def change(self, document: Document) -> Change:
        """Give the change; the document stays as it is, and errors leave no trace."""
        ...


@dataclass(frozen=True, eq=False)
class Done:
    """An entry of the stack."""

    label: str
    change: Change


class EditSession:
    """A document and everything that was done to it.

    Commands between `begin` and `end` become one entry: a drag is undone as a whole.

    Parameters
    ----------
    scene
        What there is at first. Undoing everything gives back this, bit for bit, numbers included.
    """

    def __init__(self, scene: Scene) -> None:
        self.document = Document(scene)
        self._done: list[Done] = []
        self._undone: list[Done] = []
        self._stroke: Done | None = None
        self._saved: Done | None = None
        self._listeners: list[Callable[[Change], None]] = []
        self._age = 0

    # -- doing ------------------------------------------------------------------------------------------

    def do(self, command: Command) -> Change:
        """Carry out a command; what it raises leaves everything as it was."""
        known = callable(getattr(command, "change", None)) and hasattr(command, "label")
        if not known or isinstance(command, type):
            raise InvalidEdit(f"expected a command such as Scale([7], 1.5), got {shown(command)}")
        return self._carry_out(command.label, command.change(self.document))

    def _carry_out(self, label: str, change: Change) -> Change:
        if change.empty:
            return change
        self._put(change.after, change.parts_after)
        self._undone.clear()
        if self._stroke is None:
            self._done.append(Done(label, change))
        else:
            self._stroke = Done(self._stroke.label, self._stroke.change.then(change))
        self._tell(change)
        return change

    def undo(self) -> str | None:
        """Take back the last entry; its label, or None where there is none."""
        self.end()
        if not self._done:
            return None
        entry = self._done.pop()
        self._undone.append(entry)
        self._revert(entry.change)
        return entry.label

    def redo(self) -> str | None:
        """Do again what was undone last; its label, or None where there is none."""
        self.end()
        if not self._undone:
            return None
        entry = self._undone.pop()
        self._done.append(entry)
        self._put(entry.change.after, entry.change.parts_after)
        self._tell(entry.change)
        return entry.label

    def _revert(self, change: Change) -> None:
        self._put(change.before, change.parts_before)
        self._tell(change)

    def _put(self, rows: Rows, parts: Parts) -> None:
        self._age += 1
        self.document.put(rows, parts)

    @property
    def next_undo(self) -> Done | None:
        """What `undo` would take back."""
        return self._done[-1] if self._done else None

    @property
    def next_redo(self) -> Done | None:
        """What `redo` would do again."""
        return self._undone[-1] if self._undone else None

    @property
    def labels(self) -> tuple[str, ...]:
        """What was done and can be undone, the first thing first."""
        return tuple(entry.label for entry in self._done)

    # -- strokes ----------------------------------------------------------------------------------------

    def begin(self, label: str) -> None:
        """Let all that follows be one entry, until `end`."""
        instance("label", label, str, InvalidEdit, "it says what was done, such as 'a drag'")
        self.end()
        self._age += 1
        self._stroke = Done(label, Change())

    def end(self) -> None:
        """End a stroke; one that did nothing leaves no entry."""
        stroke, self._stroke = self._stroke, None
        self._age += stroke is not None
        if stroke is not None and not stroke.change.empty:
            self._done.append(stroke)

    def take_back(self) -> None:
        """Go back to where the open stroke began, and stay in it."""
        if self._stroke is not None and not self._stroke.change.empty:
            self._revert(self._stroke.change)
            self._stroke = Done(self._stroke.label, Change())

    def cancel(self) -> None:
        """Go back to where the open stroke began, and forget it."""
        self.take_back()
        self._age += self._stroke is not None
        self._stroke = None

    @contextmanager
    def stroke(self, label: str) -> Iterator[None]:
        """`begin` and `end` around a block; an error takes all of it back."""
        self.begin(label)
        try:
            yield
        except BaseException:
            self.cancel()
            raise
        self.end()

    # -- elsewhere --------------------------------------------------------------------------------------

    def fork(self) -> "Fork":
        """Give a session that is where this one is, for any thread to go on with.

        What is done there is seen here once this one adopts it, at once however much it is.
        """
        return Fork(self)

    def adopt(self, fork: "Fork") -> bool:
        """Go on where a fork of this session is; nobody may use the fork any more.

        False where something was done here since it was made: nothing happens then, and what was done to that
        fork can be done to another.
        """
        instance("fork", fork, Fork, InvalidEdit, "session.fork() makes one")
        if fork.origin is not self or not fork.current:
            return False
        if fork.small:
            for rows, parts in fork.puts:
                self.document.put(rows, parts)
        else:
            self.document.adopt(fork.document)
        self._done, self._undone, self._stroke = fork._done, fork._undone, fork._stroke
        self._age += 1
        for change in fork.heard:
            self._tell(change)
        return True

    # -- around it --------------------------------------------------------------------------------------

    def listen(self, listener: Callable[[Change], None]) -> Callable[[], None]:
        """Call a function after every change, with the change (or the one that was taken back).

        What comes back ends it; calling that twice is harmless.
        """
        if not callable(listener):
            raise InvalidEdit(f"listener: expected a function of a change, got {shown(listener)}")
        self._listeners.append(listener)

        def stop() -> None:
            if listener in self._listeners:
                self._listeners.remove(listener)

        return stop

    def _tell(self, change: Change) -> None:
        for listener in [*self._listeners]:  # some end with what they hear
            listener(change)

    @property
    def modified(self) -> bool:
        """Whether there is something that was not saved."""
        return self._stroke is not None or self.next_undo is not self._saved

    def save(self, path: str | os.PathLike[str], *, camera: Camera | None = None) -> None:
        """Write the scene to a file, whole or not at all (`decals.save_scene`), with a camera if given."""
        self.saving(path, camera=camera).write()()

    def saving(self, path: str | os.PathLike[str], *, camera: Camera | None = None) -> "Saving":
        """Give what writes the scene as it is now, whatever is done to it meanwhile."""
        named = isinstance(path, str | os.PathLike) and os.fspath(path)
        if not named or "\0" in str(path):
            raise InvalidEdit(f"expected a path to save to, got {shown(path)}")
        self.end()
        return Saving(self, path, camera)


class Fork(EditSession):
    """A session that begins where another one is.

    Attributes
    ----------
    origin, origin_age
        The other one, and how often it had changed.
    heard, puts
        The changes since then, and what they put on.
    """

    def __init__(self, origin: EditSession) -> None:
        self.origin, self.origin_age = origin, origin._age
        self.heard: list[Change] = []
        self.puts: list[tuple[Rows, Parts]] = []
        self.document = origin.document.fork()
        self._done, self._undone, self._stroke = [*origin._done], [*origin._undone], origin._stroke
        self._saved, self._age = origin._saved, origin._age
        self._listeners = [self.heard.append]

    @property
    def current(self) -> bool:
        """Whether nothing was done to the other one since."""
        return self.origin_age == self.origin._age

    def _put(self, rows: Rows, parts: Parts) -> None:
        super()._put(rows, parts)
        self.puts.append((rows, parts))

    def adopt(self, fork: "Fork") -> bool:
        """Go on where a fork of this one is, as any session does."""
        adopted = super().adopt(fork)
        if adopted:
            self.puts += fork.puts
        return adopted

    @property
    def small(self) -> bool:
        """Whether so few decals changed that it is no work to change them in the other session too."""
        return sum(len(rows.numbers) for rows, _ in self.puts) <= FEW

    def prepare(self, *, surfaces: bool) -> None:
        """Do what whoever adopts this would wait for: lay out the index, and make surfaces if wished."""
        if not self.small:
            self.document.decals.index  # noqa: B018  (it is laid out where it is asked for)
        if surfaces:
            self.document.make_surfaces()


class Saving:
    """Writes what a session held when this was made; any thread may do it.

    Parameters
    ----------
    session
        What is told, in the end, what of it was saved.
    path, camera
        The file, and the camera to put into it; None for the document's.
    """

    def __init__(self, session: EditSession, path: str | os.PathLike[str], camera: Camera | None) -> None:
        self._session, self._path, self._camera = session, path, camera
        self._document, self._last = session.document.fork(), session.next_undo

    def write(self, progress: Progress | None = None) -> Callable[[], None]:
        """Write the file; what comes back is to be called where the session is, and lets it know."""
        save_scene(self._document.scene.replace(camera=self._camera), self._path, progress=progress)

        def note() -> None:
            self._session._saved = self._last

        return note
