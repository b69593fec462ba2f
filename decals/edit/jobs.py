"""Long work beside the window: one job at a time, with progress, and a way to stop it."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

from blobtree.progress import Progress
from decals.edit.session import Command

Work = Callable[[Progress, Callable[[], bool]], Command]
"""Given where to tell progress and whom to ask whether to stop, makes a command that is quick."""


@dataclass(frozen=True, eq=False)
class Job:
    """Work that takes long; it reads immutable things only, and what it makes is carried out afterwards."""

    label: str
    work: Work


class Worker:
    """Does one job at a time in a thread of its own.

    Nothing is changed from that thread: who owns the document asks `take` for the command now and then.
    """

    def __init__(self) -> None:
        self._thread: threading.Thread | None = None
        self._cancelled = threading.Event()
        self._label, self._stage, self._fraction = "", "", 0.0
        self._result: Command | None = None
        self._error: Exception | None = None

    @property
    def busy(self) -> bool:
        """Whether there is a job whose result nobody took."""
        return self._thread is not None

    @property
    def progress(self) -> tuple[str, float]:
        """What is being done, in plain words, and the part that is done."""
        return self._stage or self._label, self._fraction

    def start(self, job: Job) -> bool:
        """Begin a job; False where another one is not done."""
        if self.busy:
            return False
        self._cancelled.clear()
        self._label, self._stage, self._fraction = job.label, "", 0.0
        self._result = self._error = None
        self._thread = threading.Thread(target=self._run, args=(job,), name=job.label, daemon=True)
        self._thread.start()
        return True

    def _run(self, job: Job) -> None:
        try:
            self._result = job.work(self._tell, self._cancelled.is_set)
        except Exception as error:  # it is raised where the result is asked for
            self._error = error

    def _tell(self, stage: str, fraction: float) -> None:
        self._stage, self._fraction = stage, fraction

    def cancel(self) -> None:
        """Ask the job to stop; what it would have made is dropped."""
        self._cancelled.set()

    def take(self, timeout: float = 0.0) -> Command | None:
        """Give the job's command once it is done, else None; raises what the job raised."""
        if self._thread is None:
            return None
        self._thread.join(timeout)
        if self._thread.is_alive():
            return None
        self._thread = None
        if self._error is not None and not self._cancelled.is_set():
            raise self._error
        return None if self._cancelled.is_set() else self._result
