"""Long edits and saves in the background of a window.

A thread runs one job at a time, reports progress and can be cancelled. A long edit is done to a fork of the
session, in a thread. The session then adopts the fork, which takes the same time however much was changed. If
the session was edited meanwhile, the long edit is repeated on a new fork, so no edit is lost. While what
it reads has not changed, its result is carried over.
"""

import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count
from os import PathLike
from pathlib import Path

from blobtree.device import core_left_free
from blobtree.progress import Cancel, Progress, reporting
from blobtree.validation import describe
from decals.editing.carrying import CarriedEdit
from decals.editing.inputs import Inputs
from decals.editing.session import Command, EditSession, SaveJob, Step, UndoEntry, step_of
from decals.errors import ImplicitDecalsError, InvalidEdit
from decals.scenes.camera import Camera

BUSY = "another edit is running; wait for it, or press Escape to cancel it"


class Busy(InvalidEdit):
    """The request has to wait for another edit.

    Attributes
    ----------
    label
        What the request does, in a few words.
    """

    def __init__(self, label: str) -> None:
        super().__init__(BUSY)
        self.label = label


Completion = Callable[[], "Job | None"]
"""Applies the result of a job, in the thread of the window. It may return a job to run next."""

_next_number = count(1).__next__
"""Returns the next number of work."""

Work = Callable[[Progress, Cancel], Completion]
"""A long computation, ``work(progress, cancel) -> completion``, in the background thread."""


@dataclass(frozen=True, eq=False)
class Job:
    """A long computation without side effects; its completion applies the result.

    Attributes
    ----------
    label
        What the job does, in a few words.
    work
        The computation.
    number
        Tells it from other jobs.
    """

    label: str
    work: Work
    number: int = field(default_factory=_next_number)


MAX_ENDING = 2
"""Threads of cancelled jobs beside which the next job begins; it waits for the others."""


class _Run:
    """One job in a thread of its own.

    Parameters
    ----------
    job
        The job.
    after
        The thread begins once all but `MAX_ENDING` of these have ended.
    daemon
        If False, Python waits for the thread before it exits.

    Attributes
    ----------
    cancelled
        Set once the job is to stop.
    progress
        Stage and finished fraction.
    thread
        The thread.
    """

    def __init__(self, job: Job, after: Sequence[threading.Thread], *, daemon: bool) -> None:
        self.label, self.number, self.progress = job.label, job.number, (job.label, 0.0)
        self.cancelled = threading.Event()
        self._completion: Completion | None = None
        self._error: Exception | None = None
        self.thread = threading.Thread(
            target=self._work, args=(job.work, tuple(after)), name=job.label, daemon=daemon
        )
        self.thread.start()

    def _work(self, work: Work, after: Sequence[threading.Thread]) -> None:
        for thread in after[: max(len(after) - MAX_ENDING, 0)]:
            thread.join()
        try:
            with core_left_free(), SHORT_SWITCH_INTERVAL, reporting(self._report, self.cancelled.is_set):
                self._completion = work(self._report, self.cancelled.is_set)
        except Exception as error:  # `result` raises it
            if not self.cancelled.is_set():  # else nothing asks for it, and its frames would keep all arrays
                self._error = error

    def _report(self, stage: str, fraction: float) -> None:
        self.progress = stage or self.label, fraction

    def ended(self, timeout: float | None = 0.0) -> bool:
        """Return True if the thread has ended, or ends within so many seconds; None is no limit."""
        self.thread.join(timeout)
        return not self.thread.is_alive()

    def result(self) -> Completion | None:
        """Return the completion of the ended job, or raise its error."""
        if self._error is not None:
            raise self._error
        return self._completion


class Worker:
    """Runs one job at a time in a thread of its own; the owner calls `poll` for the completion.

    A cancelled job is dropped at once, and the next one can start. Its thread ends at the next report of
    progress, or the next launch of a kernel.

    Parameters
    ----------
    finish_at_exit
        If True, Python waits for the thread before it exits.

    Attributes
    ----------
    label
        Label of the last job.
    """

    def __init__(self, *, finish_at_exit: bool = False) -> None:
        self._finish_at_exit = finish_at_exit
        self._run: _Run | None = None
        self._ending: list[threading.Thread] = []
        self.label = ""

    @property
    def number(self) -> int | None:
        """Number of the job that runs; None without one."""
        return None if self._run is None else self._run.number

    @property
    def busy(self) -> bool:
        """True from `start` until `poll` has returned the completion, or until `cancel`."""
        return self._run is not None

    @property
    def stopping(self) -> bool:
        """True while the thread of a cancelled job has not ended."""
        self._ending = [thread for thread in self._ending if thread.is_alive()]
        return bool(self._ending)

    @property
    def progress(self) -> tuple[str, float]:
        """Present stage, in plain words, and its finished fraction from 0 to 1."""
        return (self.label, 0.0) if self._run is None else self._run.progress

    def start(self, job: Job) -> bool:
        """Start a job and return True, or return False while another one runs."""
        if self.busy:
            return False
        self.label = job.label
        after = self._ending if self.stopping else ()
        self._run = _Run(job, after, daemon=not self._finish_at_exit)
        return True

    def cancel(self) -> None:
        """Drop the job, and let its thread end."""
        if self._run is not None:
            self._run.cancelled.set()
            self._ending.append(self._run.thread)
            self._run = None

    def poll(self, timeout: float | None = 0.0) -> Completion | None:
        """Return the completion of a finished job, else None; raise an error of the job.

        Parameters
        ----------
        timeout
            Longest time to wait for the job, in seconds; None for no limit.
        """
        run = self._run
        if run is None or not run.ended(timeout):
            return None
        self._run = None
        return run.result()

    def stop(self, timeout: float) -> bool:
        """Cancel the job, and return True if all threads end within so many seconds."""
        self.cancel()
        last = time.monotonic() + timeout
        for thread in self._ending:
            thread.join(max(last - time.monotonic(), 0.0))
        return not self.stopping


SWITCH_INTERVAL = 0.0005
"""Seconds after which a Python thread releases the interpreter lock; Python's default is 0.005."""


class ShortSwitchInterval:
    """A ``with`` block in which Python's threads switch more often; blocks nest, in any threads.

    Drawing a frame releases the interpreter lock dozens of times, for every call to the driver, and each time
    waits for the lock.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._depth = 0
        self._default = sys.getswitchinterval()

    def __enter__(self) -> None:
        with self._lock:
            if not self._depth:
                self._default = sys.getswitchinterval()
                sys.setswitchinterval(min(SWITCH_INTERVAL, self._default))
            self._depth += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._depth -= 1
            if not self._depth:
                sys.setswitchinterval(self._default)


SHORT_SWITCH_INTERVAL = ShortSwitchInterval()
"""The only instance, because the interval belongs to the interpreter."""


CLOSE_TIMEOUT = 5.0
"""Seconds for which `BackgroundJobs.close` waits for cancelled edits."""

SAVE = "save"
"""Label of a save."""

LEFT_OUT = "what waited for the edit was left out, because the selection changed meanwhile"
MAX_WAITING = 8
"""Most requests that wait for the running edit, and most files that wait to be written."""


def _carried_step(entry: UndoEntry, message: str) -> Step:
    """Return the step that carries an entry of a fork's history over to another state."""

    def step(session: EditSession) -> str:
        session.do(CarriedEdit(entry.edit, entry.label))
        return message

    return step


@dataclass(frozen=True, eq=False)
class _Request:
    """An edit to make.

    Attributes
    ----------
    label
        What it does.
    step
        The edit.
    done
        Called at the moment at which it is visible.
    inputs
        What the step reads, if that is known.
    carried
        Takes over what the step has computed for a former state.
    """

    label: str
    step: Step
    done: Callable[[], None] | None = None
    inputs: Inputs | None = None
    carried: Step | None = None


@dataclass(frozen=True)
class QueuedWork:
    """Work that runs or waits.

    Attributes
    ----------
    number
        Tells it from other work, for `BackgroundJobs.drop`.
    label
        What it does, in a few words.
    running
        True if it runs, False if it waits.
    """

    number: int
    label: str
    running: bool


@dataclass(eq=False)
class _Waiting:
    """A request of the user that waits for the running edit, and what it depends on, then and now."""

    label: str
    repeat: Callable[[], None]
    context: Callable[[], object]
    seen: object
    outdated: bool = False
    number: int = field(default_factory=_next_number)


class BackgroundJobs:
    """Runs at most one edit, one save and one export of a session, in threads.

    Parameters
    ----------
    session
        The edited session.
    show
        Shows a message to the user.
    end_stroke
        Ends the open stroke; called before a background edit becomes an undo entry of its own.
    refuse
        Shows why a job failed.
    threaded
        If False, everything runs at once, in the caller's thread. If True, the owner calls `poll` regularly.

    Attributes
    ----------
    following
        True until all steps of `edit_latest` are adopted.
    """

    def __init__(
        self,
        session: EditSession,
        show: Callable[[str], None],
        end_stroke: Callable[[], None],
        refuse: Callable[[Exception], None],
        *,
        threaded: bool,
    ) -> None:
        self._session, self._show, self._end_stroke, self._refuse = session, show, end_stroke, refuse
        self.threaded = threaded
        self._edits = Worker()
        self._saves, self._exports = Worker(finish_at_exit=True), Worker(finish_at_exit=True)
        self._latest: _Request | None = None
        self._next_files: dict[Worker, list[Job]] = {self._saves: [], self._exports: []}
        self._waiting: list[_Waiting] = []
        self._computing = self.following = False
        self._when_idle: list[Callable[[], None]] = []

    # -- edits ------------------------------------------------------------------------------------------

    def edit(
        self,
        label: str,
        step: Step,
        done: Callable[[], None] | None = None,
        *,
        inputs: Inputs | None = None,
    ) -> None:
        """Edit the session in the background.

        Parameters
        ----------
        label
            What the edit does, in a few words.
        step
            The edit. It may run several times, each time on a new fork.
        done
            Called once the session has adopted the edit.
        inputs
            What the step reads. While only other things change, it does not run again. Default: anything.

        Raises
        ------
        InvalidEdit
            Another edit is running.
        """
        if not self.threaded:
            self._adopted(step(self._session), done)
            return
        self.require_idle(label)
        self._edits.start(self._fork_job(_Request(label, step, done, inputs)))

    def _adopted(self, message: str, done: Callable[[], None] | None) -> None:
        """Call the callback of an edit that the session has adopted, and show its message."""
        if done is not None:
            done()
        if message:
            self._show(message)

    def compute(
        self,
        label: str,
        work: Callable[[Progress, Cancel], Command],
        done: Callable[[], None] | None = None,
    ) -> None:
        """Compute a command in the background without the session, carry it out, then call ``done``.

        Raises
        ------
        InvalidEdit
            Another edit is running.
        """
        if not self.threaded:
            self.edit(label, step_of(work(lambda _stage, _fraction: None, lambda: False)), done)
            return

        def run(progress: Progress, cancel: Cancel) -> Completion:
            command = work(progress, cancel)

            def complete() -> Job:
                self._computing = False
                self._end_stroke()
                return self._fork_job(_Request(label, step_of(command), done))

            return complete

        self.require_idle(label)
        self._computing = self._edits.start(Job(label, run))

    def edit_latest(self, label: str, step: Step) -> None:
        """Edit the session repeatedly, as in a drag: while one step runs, only the latest one is kept.

        Raises
        ------
        InvalidEdit
            Another kind of edit is running.
        """
        if not self.threaded:
            self.edit(label, step)
        elif self.following and self._edits.busy:
            self._latest = _Request(label, step)
        else:
            self.require_idle(label)
            self.following = True
            self.edit(label, step)

    def prepare(self, label: str, call: Callable[[], object]) -> None:
        """Call a function in the background for what it leaves behind, such as compiled kernels.

        Nothing happens while an edit runs.
        """

        def work(_progress: Progress, _cancel: Cancel) -> Completion:
            call()
            return lambda: None

        self._edits.start(Job(label, work))

    def when_followed(self, call: Callable[[], None]) -> None:
        """Call a function once all steps of `edit_latest` are adopted; calls keep their order.

        If it is called later, its errors become the message.
        """
        if not self._when_idle and not self.following:
            call()
        else:
            self._when_idle.append(call)

    def _call_waiting(self) -> None:
        while self._when_idle and not self.following:
            try:
                self._when_idle.pop(0)()
            except ImplicitDecalsError as error:
                self._refuse(error)

    def require_idle(self, label: str, *, computing: bool = True) -> None:
        """Refuse a new edit while another one runs.

        Parameters
        ----------
        label
            What the new edit does, in a few words.
        computing
            If False, an edit that is still being computed without the session does not count.

        Raises
        ------
        Busy
            Another edit is running.
        """
        if self._edits.busy and (computing or not self._computing):
            raise Busy(label)

    def wait(self, label: str, repeat: Callable[[], None], context: Callable[[], object]) -> bool:
        """Call a function once no edit runs, unless ``context`` then returns something else than now.

        What the running edit itself changes does not count. Return False if too many wait already.
        """
        if len(self._waiting) == MAX_WAITING:
            return False
        self._waiting.append(_Waiting(label, repeat, context, context()))
        return True

    def _fork_job(self, request: _Request) -> Job:
        """Return the job that edits a fork; its completion adopts the fork, or repeats the job on a new one.

        A result for a state that had the same inputs is carried over. A step that fails on an outdated fork
        is repeated too: it may succeed on the next one.
        """
        fork, following = self._session.fork(), self.following
        entries, inputs = len(fork.labels), request.inputs
        message, seen = "", None
        failure: Exception | None = None

        def work(_progress: Progress, _cancel: Cancel) -> Completion:
            nonlocal message, seen, failure
            try:
                seen = None if inputs is None else inputs(fork.document)
                message = (request.carried or request.step)(fork)
                fork.prepare(surfaces=not following)
            except ImplicitDecalsError as error:
                failure = error.with_traceback(None)  # its frames would keep the fork in a cycle
            return complete

        def complete() -> Job | None:
            if failure is not None and fork.current and request.carried is None:
                raise failure
            if failure is None and self._session.adopt(fork):
                self._adopted(message, request.done)
                return None
            if not self.following:
                self._end_stroke()
            carried = None
            if failure is None and inputs is not None and len(fork.labels) == entries + 1:
                entry = fork.next_undo
                if entry is not None and inputs(self._session.document) == seen:
                    carried = _carried_step(entry, message)
            return self._fork_job(replace(request, carried=carried))

        return Job(request.label, work)

    # -- saves ------------------------------------------------------------------------------------------

    def save(
        self, path: str | PathLike[str], camera: Camera | None, saved: Callable[[], None] = lambda: None
    ) -> None:
        """Save the present state, then call ``saved``; if another save runs, save after it."""
        job = self._save_job(self._session.begin_save(path, camera=camera), path, saved)
        self._next_files[self._saves].clear()  # the present state is newer
        self._write_in_turn(self._saves, job)

    def _save_job(self, save: SaveJob, path: str | PathLike[str], saved: Callable[[], None]) -> Job:
        def work(progress: Progress, _cancel: Cancel) -> Completion:
            mark_saved = save.write(progress)

            def complete() -> None:
                mark_saved()
                self._show(f"saved to {path}")
                saved()

            return complete

        return Job(SAVE, work)

    def write_copy(self, path: Path, camera: Camera | None, written: Callable[[], None]) -> None:
        """Write the present state to another file, then call ``written``; it does not count as a save."""
        copy = self._session.begin_save(path, camera=camera)

        def work(progress: Progress, _cancel: Cancel) -> Completion:
            copy.write(progress)
            return written

        self._start_writing(self._saves, Job("autosave", work))

    def write(self, label: str, write: Callable[[Progress], None], message: str) -> None:
        """Write a file of another format, then show a message; such files are written in turn.

        `cancel` ends the writing at its next report of progress.

        Raises
        ------
        InvalidEdit
            Too many files wait already.
        """

        def work(progress: Progress, cancel: Cancel) -> Completion:
            with reporting(progress, cancel) as report:
                write(report)
            return lambda: self._show(message)

        self._write_in_turn(self._exports, Job(label, work))

    def _write_in_turn(self, worker: Worker, job: Job) -> None:
        if self._start_writing(worker, job):
            return
        if len(self._next_files[worker]) == MAX_WAITING:
            raise InvalidEdit("other files are being written; wait for them")
        self._next_files[worker].append(job)
        self._show(f"another file is being written; the {job.label} follows")

    def _start_writing(self, worker: Worker, job: Job) -> bool:
        """Start to write a file, and return True, or return False while the worker writes another one."""
        if self.threaded:
            return worker.start(job)
        job.work(lambda _stage, _fraction: None, lambda: False)()
        return True

    @property
    def saving(self) -> bool:
        """True while a save runs, or waits for an autosave."""
        running = self._saves.busy and self._saves.label == SAVE
        return running or bool(self._next_files[self._saves])

    @property
    def writing(self) -> bool:
        """True while a save or an autosave runs."""
        return self._saves.busy

    # -- state ------------------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """True while an edit, a save or an export runs, or waits for `poll`."""
        return self.busy_editing or any(worker.busy for worker in self._next_files)

    @property
    def stopping(self) -> bool:
        """True while the thread of a cancelled edit or export has not ended."""
        return self._edits.stopping or self._exports.stopping

    @property
    def busy_editing(self) -> bool:
        """True while an edit runs, or waits for `poll`."""
        return self._edits.busy

    @property
    def waiting(self) -> int:
        """Number of requests and files that follow the running jobs."""
        return len(self._waiting) + sum(map(len, self._next_files.values()))

    @property
    def progress(self) -> str:
        """Running jobs and their progress, in plain words."""
        stages = (worker.progress for worker in (self._edits, *self._next_files) if worker.busy)
        shown = [f"{stage}: {100 * part:.0f} %" if part else f"{stage} …" for stage, part in stages]
        return ", ".join([*shown, *([f"{self.waiting} more after it"] if self.waiting else [])])

    def poll(self, *, dragging: bool = False, timeout: float | None = 0.0) -> bool:
        """Complete finished jobs, and return True if a job ended.

        Parameters
        ----------
        dragging
            If True, only the steps of `edit_latest` are adopted; other edits wait for the end of the drag.
        timeout
            Longest time to wait for each of the edit and the files, in seconds; None for no limit.
        """
        ended = [
            self._complete(worker, timeout, partial(self._start_next_file, worker))
            for worker in self._next_files
        ]
        if dragging and not self.following:
            return any(ended)
        for one in self._waiting:  # before the edit changes what is selected
            one.outdated |= one.context() != one.seen
        return self._complete(self._edits, timeout, self._start_next_edit) or any(ended)

    def _complete(self, worker: Worker, timeout: float | None, start_next: Callable[[], None]) -> bool:
        """Complete the job of a worker, and start the next one even if this one failed."""
        if not worker.busy:
            return False
        following: Job | None = None
        try:
            completion = worker.poll(timeout)
            following = None if completion is None else completion()
        except ImplicitDecalsError as error:
            self._refuse(error)
        finally:
            if following is not None:
                worker.start(following)
            ended = not worker.busy
            if ended:
                start_next()
        return ended

    def _start_next_file(self, worker: Worker) -> None:
        """Write the next file that was requested while the worker wrote another one."""
        if self._next_files[worker]:
            worker.start(self._next_files[worker].pop(0))

    def _start_next_edit(self) -> None:
        """Start the latest queued step, or run the callbacks that wait for an empty queue, then requests."""
        request, self._latest = self._latest, None
        self._computing = self.following = False
        if request is not None:
            self.edit_latest(request.label, request.step)
        self._call_waiting()
        for one in self._waiting:
            one.seen = one.context()
        while self._waiting and not self._edits.busy:
            one = self._waiting.pop(0)
            if one.outdated:
                self._show(LEFT_OUT)
            else:
                one.repeat()

    @property
    def queue(self) -> list[QueuedWork]:
        """The running edit and what follows it, then the running export and those that follow."""
        waiting: list[tuple[Worker, Sequence[_Waiting | Job]]] = [
            (self._edits, self._waiting),
            (self._exports, self._next_files[self._exports]),
        ]
        work: list[QueuedWork] = []
        for worker, others in waiting:
            if worker.number is not None:
                work.append(QueuedWork(worker.number, worker.label, running=True))
            work += [QueuedWork(one.number, one.label, running=False) for one in others]
        return work

    def drop(self, number: int) -> None:
        """Cancel the running edit or export of a number, or leave out what waits; the others follow.

        Raises
        ------
        InvalidEdit
            No work has this number any more.
        """
        label = next((work.label for work in self.queue if work.number == number), None)
        if label is None:
            raise InvalidEdit(f"expected work of the queue, got number {describe(number)}; it has ended")
        exports = self._next_files[self._exports]
        self._waiting = [one for one in self._waiting if one.number != number]
        exports[:] = [job for job in exports if job.number != number]
        if self._edits.number == number:
            self._cancel_edit()
        elif self._exports.number == number:
            self._exports.cancel()
            self._start_next_file(self._exports)
        self._show(f"cancelled: {label}")

    def cancel(self, *, exports: bool = False) -> None:
        """Cancel the edit and what follows it, else all exports if these are meant, too; saves go on."""
        if self._edits.busy:
            self._waiting = []
            self._cancel_edit()
            self._show("cancelled")
        elif exports and self._exports.busy:
            self._next_files[self._exports].clear()
            self._exports.cancel()
            self._show("cancelled")

    def _cancel_edit(self) -> None:
        self._latest = None
        self._edits.cancel()
        self._start_next_edit()

    def revert_drag(self) -> None:
        """Drop the steps of `edit_latest` that are not adopted, and revert the open stroke."""
        self._latest = None
        if self.following:
            self._edits.cancel()
        self._session.cancel_stroke()
        if self.following:
            self._start_next_edit()

    def close(self) -> None:
        """Cancel the running edit, and finish all files.

        Raises
        ------
        InvalidScene
            The file could not be written.
        """
        self.cancel()
        self._edits.stop(CLOSE_TIMEOUT)
        failures = [self._finish(worker) for worker in self._next_files]
        for failure in filter(None, failures):
            raise failure

    def _finish(self, worker: Worker) -> Exception | None:
        """Write all files of a worker; return why the last one could not be written, else None."""
        failure: Exception | None = None
        while worker.busy:
            try:
                completion = worker.poll(None)
                failure = None
                if completion is not None:
                    completion()
            except Exception as error:
                failure = error
            self._start_next_file(worker)
        return failure
