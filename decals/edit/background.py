"""Long edits and saves beside the window.

An edit that takes long is done to a fork of the session, in a thread. The session then adopts the fork, which
takes no time however much was changed. Where hands did something meanwhile, the edit is done again to another
fork: what it comes to is always what it comes to in the moment in which it is seen, and what hands did stays.
"""

from collections.abc import Callable
from os import PathLike

from blobtree import BlobTreeError
from blobtree.progress import Cancel, Progress
from decals.edit.change import Numbers
from decals.edit.commands import OfNumbers
from decals.edit.jobs import Job, Outcome, Worker
from decals.edit.objects import AddObject, RemoveObject
from decals.edit.population import Coat, Relax, Scatter
from decals.edit.primitives import OfPrimitive
from decals.edit.session import Command, EditSession, Saving
from decals.errors import DecalsError, InvalidEdit
from decals.scenes.camera import Camera

MANY = 500
"""Decals that are changed at once, while the window waits."""

LONG = (AddObject, Coat, OfPrimitive, Relax, RemoveObject, Scatter)
"""Commands that ask many places of surfaces, or make surfaces."""

PATIENCE = 5.0
"""Seconds that closing waits for the thread of an edit: Python may end next, under what is being computed."""

WAIT = "wait for what goes on, or press Escape"

Step = Callable[[EditSession], str]
"""Does something to a session; what it did, in plain words, or nothing where that was said."""


def are_many(numbers: Numbers) -> bool:
    """Whether so many decals are better changed in the background."""
    return len(numbers) > MANY


def takes_long(command: Command) -> bool:
    """Whether a command is better done in the background: it asks surfaces, or changes many decals."""
    return isinstance(command, LONG) or (isinstance(command, OfNumbers) and are_many(command.numbers))


def doing(command: Command) -> Step:
    """The step that does a command."""

    def step(session: EditSession) -> str:
        session.do(command)
        return command.label

    return step


class Background:
    """What goes on beside a window: one edit at a time, and one save.

    Parameters
    ----------
    session
        What is edited; its owner asks `look` now and then.
    say
        Told what happened, in plain words.
    settle
        Called before an edit is done that is an entry of its own, whatever hands are at.
    threaded
        Whether there is somebody who looks; without, all is done at once.
    """

    def __init__(
        self,
        session: EditSession,
        say: Callable[[str], None],
        settle: Callable[[], None],
        *,
        threaded: bool,
    ) -> None:
        self._session, self._say, self._settle, self._threaded = session, say, settle, threaded
        self._edits, self._saves = Worker(), Worker(lasting=True)
        self._wish: tuple[str, Step] | None = None
        self._next_save: Job | None = None
        self._making = self._following = False
        self._afterwards: list[Callable[[], None]] = []

    # -- edits ------------------------------------------------------------------------------------------

    def edit(self, label: str, step: Step, done: Callable[[], None] | None = None) -> None:
        """Do something to the session that takes long; ``done`` is called once it is seen.

        Raises
        ------
        InvalidEdit
            Another edit goes on.
        """
        if self._threaded:
            self.wait()
            self._edits.start(self._on_fork(label, step, done))
            return
        text = step(self._session)
        self._seen(text, done)

    def _seen(self, text: str, done: Callable[[], None] | None) -> None:
        """Do what goes with an edit that is seen now."""
        if done is not None:
            done()
        if text:
            self._say(text)

    def make(self, label: str, work: Callable[[Progress, Cancel], Command]) -> None:
        """Make a command out of what stays as it is, which takes long, and do it; errors as for `edit`."""

        def working(tell: Progress, stop: Cancel) -> Outcome:
            command = work(tell, stop)

            def outcome() -> Job:
                self._making = False
                self._settle()
                return self._on_fork(label, doing(command), None)

            return outcome

        if self._threaded:
            self.wait()
            self._making = self._edits.start(Job(label, working))
        else:
            self.edit(label, doing(work(lambda _stage, _fraction: None, lambda: False)))

    def follow(self, label: str, step: Step) -> None:
        """Do what hands ask for again and again: of what comes while one is being done the last one counts.

        Errors as for `edit`.
        """
        if not self._threaded:
            self.edit(label, step)
        elif self._following and self._edits.busy and not self._edits.stopping:
            self._wish = label, step
        else:
            self.wait()
            self._following = True
            self.edit(label, step)

    def afterwards(self, call: Callable[[], None]) -> None:
        """Call something once nothing follows any more, after what was to be called before it."""
        self._afterwards.append(call)
        self._call_waiting()

    def _call_waiting(self) -> None:
        while self._afterwards and not self._following:
            self._afterwards.pop(0)()

    def wait(self, *, making: bool = True) -> None:
        """Refuse what has to come after the edit that goes on.

        Parameters
        ----------
        making
            Whether that also means an edit that is only being made, from what stays as it is.

        Raises
        ------
        InvalidEdit
            There is one.
        """
        if self._edits.busy and (making or not self._making):
            raise InvalidEdit(WAIT)

    def _on_fork(self, label: str, step: Step, done: Callable[[], None] | None) -> Job:
        """The job that does a step to a fork; the session adopts it, or has it done to another one.

        What could not be done to a fork that is behind by then may well be done to the next.
        """

        def work(_tell: Progress, _stop: Cancel) -> Outcome:
            text = ""
            failed: Exception | None = None
            try:
                text = step(fork)
                fork.prepare(surfaces=not following)
            except (DecalsError, BlobTreeError) as error:
                failed = error

            def outcome() -> Job | None:
                if failed is not None and fork.current:
                    raise failed
                if failed is not None or not self._session.adopt(fork):
                    if not self._following:
                        self._settle()
                    return self._on_fork(label, step, done)
                self._seen(text, done)
                return None

            return outcome

        fork, following = self._session.fork(), self._following
        return Job(label, work)

    # -- saves ------------------------------------------------------------------------------------------

    def save(self, path: str | PathLike[str], camera: Camera | None) -> None:
        """Save what there is now; where a save goes on, after that."""
        saving = self._session.saving(path, camera=camera)
        if not self._threaded:
            saving.write()()
            self._say(f"saved to {path}")
        elif not self._saves.start(self._writing(saving, path)):
            self._next_save = self._writing(saving, path)
            self._say("saved once more as soon as the save that goes on is done")

    def _writing(self, saving: Saving, path: str | PathLike[str]) -> Job:
        def work(tell: Progress, _stop: Cancel) -> Outcome:
            note = saving.write(tell)

            def outcome() -> None:
                note()
                self._say(f"saved to {path}")

            return outcome

        return Job("save", work)

    # -- looking after them -----------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """Whether something goes on, or is done and was not looked at."""
        return self.busy_editing or self._saves.busy

    @property
    def following(self) -> bool:
        """Whether what hands asked for again and again is not all seen yet."""
        return self._following

    @property
    def busy_editing(self) -> bool:
        """Whether an edit goes on, or is done and was not looked at."""
        return self._edits.busy

    @property
    def progress(self) -> str:
        """What goes on and how far it is, in plain words."""
        told = (worker.progress for worker in (self._edits, self._saves) if worker.busy)
        return ", ".join(f"{stage}: {100 * part:.0f} %" if part else f"{stage} …" for stage, part in told)

    def look(self, *, dragging: bool = False, timeout: float | None = 0.0) -> bool:
        """Carry out what is done; whether anything came to its end.

        While hands drag something, other edits than what follows them wait for its end. Waits for at most so
        many seconds for each of an edit and a save.
        """
        saved = self._take(self._saves, timeout, self._save_next)
        if dragging and not self._following:
            return saved
        return self._take(self._edits, timeout, self._go_on) or saved

    def _take(self, worker: Worker, timeout: float | None, go_on: Callable[[], None]) -> bool:
        """Carry out what a worker's job came to, if it is done; whatever came of it, what waits goes on."""
        if not worker.busy:
            return False
        again: Job | None = None
        try:
            outcome = worker.take(timeout)
            again = None if outcome is None else outcome()
        except (DecalsError, BlobTreeError) as error:
            self._say(str(error))
        finally:
            if again is not None:
                worker.start(again)
            ended = not worker.busy
            if ended:
                go_on()
        return ended

    def _save_next(self) -> None:
        """Begin with the save that was asked for while another one went on."""
        job, self._next_save = self._next_save, None
        if job is not None:
            self._saves.start(job)

    def _go_on(self) -> None:
        """Begin with the last of what hands asked for meanwhile, or let who waits know that there is none."""
        wish, self._wish = self._wish, None
        self._making = self._following = False
        if wish is not None:
            self.follow(*wish)
        self._call_waiting()

    def cancel(self) -> None:
        """Stop the edit that goes on; saves are not stopped."""
        if self._edits.busy:
            self._edits.cancel()
            self._wish = None
            self._say("stopped")

    def close(self) -> None:
        """Stop the edit, and wait until what is to be saved is saved.

        Raises
        ------
        InvalidScene
            It could not be.
        """
        self.cancel()
        self._edits.take(PATIENCE)
        failed: Exception | None = None
        while self._saves.busy:
            try:
                outcome = self._saves.take(None)
                failed = None
                if outcome is not None:
                    outcome()
            except Exception as error:  # it is raised once the save that waits is done
                failed = error
            self._save_next()
        if failed is not None:
            raise failed
