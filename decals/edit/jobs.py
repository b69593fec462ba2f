"""Long work beside the window: a thread that does one job at a time, with progress, and a way to stop it."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

from blobtree.launch import leaving_room
from blobtree.progress import Cancel, Progress
from decals.edit.sharing import SHORT_TURNS

Outcome = Callable[[], "Job | None"]
"""Carries out, in the thread of the window, what a job came to; it may give a job to go on with."""

Work = Callable[[Progress, Cancel], Outcome]
"""Given where to tell progress and whom to ask whether to stop, does what takes long."""


@dataclass(frozen=True, eq=False)
class Job:
    """Work that takes long. It changes nothing that others see: its outcome is carried out afterwards."""

    label: str
    work: Work


class Worker:
    """Does one job at a time in a thread of its own.

    Nothing that others see is changed from that thread: who owns it asks `take` for the outcome now and then.

    Parameters
    ----------
    lasting
        Whether Python waits for the thread before it ends.
    """

    def __init__(self, *, lasting: bool = False) -> None:
        self._lasting = lasting
        self._thread: threading.Thread | None = None
        self._cancelled = threading.Event()
        self._label, self._stage, self._fraction = "", "", 0.0
        self._outcome: Outcome | None = None
        self._error: Exception | None = None

    @property
    def busy(self) -> bool:
        """Whether there is a job whose outcome nobody took."""
        return self._thread is not None

    @property
    def stopping(self) -> bool:
        """Whether the job was asked to stop, and nobody took note yet that it did."""
        return self.busy and self._cancelled.is_set()

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
        self._outcome = self._error = None
        self._thread = threading.Thread(
            target=self._run, args=(job,), name=job.label, daemon=not self._lasting
        )
        self._thread.start()
        return True

    def _run(self, job: Job) -> None:
        try:
            with leaving_room(), SHORT_TURNS:
                self._outcome = job.work(self._tell, self._cancelled.is_set)
        except Exception as error:  # it is raised where the outcome is asked for
            self._error = error

    def _tell(self, stage: str, fraction: float) -> None:
        self._stage, self._fraction = stage, fraction

    def cancel(self) -> None:
        """Ask the job to stop; what it would have come to is dropped."""
        self._cancelled.set()

    def take(self, timeout: float | None = 0.0) -> Outcome | None:
        """Give the job's outcome once it is done, else None; raises what the job raised.

        Waits for at most so many seconds, without a limit for None.
        """
        if self._thread is None:
            return None
        self._thread.join(timeout)
        if self._thread.is_alive():
            return None
        self._thread = None
        outcome, error = self._outcome, self._error
        self._outcome = self._error = None
        if self._cancelled.is_set():
            return None
        if error is not None:
            raise error
        return outcome
