"""Background jobs: a thread that runs one job at a time, reports progress and can be cancelled."""

import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass

from blobtree.device import core_left_free
from blobtree.progress import Cancel, Progress

Completion = Callable[[], "Job | None"]
"""Applies the result of a job, in the thread of the window. It may return a job to run next."""

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
    """

    label: str
    work: Work


class Worker:
    """Runs one job at a time in a thread of its own; the owner calls `poll` for the completion.

    Parameters
    ----------
    finish_at_exit
        If True, Python waits for the thread before it exits.
    """

    def __init__(self, *, finish_at_exit: bool = False) -> None:
        self._finish_at_exit = finish_at_exit
        self._thread: threading.Thread | None = None
        self._cancelled = threading.Event()
        self._label, self._stage, self._fraction = "", "", 0.0
        self._completion: Completion | None = None
        self._error: Exception | None = None

    @property
    def busy(self) -> bool:
        """True from `start` until `poll` has returned the completion."""
        return self._thread is not None

    @property
    def cancelling(self) -> bool:
        """True from `cancel` until `poll` has noticed the end of the job."""
        return self.busy and self._cancelled.is_set()

    @property
    def progress(self) -> tuple[str, float]:
        """Present stage, in plain words, and its finished fraction from 0 to 1."""
        return self._stage or self._label, self._fraction

    def start(self, job: Job) -> bool:
        """Start a job and return True, or return False while another one runs."""
        if self.busy:
            return False
        self._cancelled.clear()
        self._label, self._stage, self._fraction = job.label, "", 0.0
        self._completion = self._error = None
        self._thread = threading.Thread(
            target=self._run, args=(job,), name=job.label, daemon=not self._finish_at_exit
        )
        self._thread.start()
        return True

    def _run(self, job: Job) -> None:
        try:
            with core_left_free(), SHORT_SWITCH_INTERVAL:
                self._completion = job.work(self._report, self._cancelled.is_set)
        except Exception as error:  # `poll` raises it
            self._error = error

    def _report(self, stage: str, fraction: float) -> None:
        self._stage, self._fraction = stage, fraction

    def cancel(self) -> None:
        """Ask the job to stop, and drop its completion."""
        self._cancelled.set()

    def poll(self, timeout: float | None = 0.0) -> Completion | None:
        """Return the completion of a finished job, else None; raise an error of the job.

        Parameters
        ----------
        timeout
            Longest time to wait for the job, in seconds; None for no limit.
        """
        if self._thread is None:
            return None
        self._thread.join(timeout)
        if self._thread.is_alive():
            return None
        self._thread = None
        completion, error = self._completion, self._error
        self._completion = self._error = None
        if self._cancelled.is_set():
            return None
        if error is not None:
            raise error
        return completion


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
