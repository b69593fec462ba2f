"""Where trials run: in this process, in local processes, or on the workers of a Dask cluster.

Each executor is a generator of (number of a trial, row), in the order in which trials end. A trial that ends
its process, or runs past its limit, gives a row too; another worker goes on.
"""

import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from blobtree.device import THREADS_VARIABLE
from blobtree.progress import check_cancelled, displayed
from blobtree.validation import describe
from decals._version import __version__
from decals.errors import InvalidInput, MissingPackage
from decals.experiments.design import Trial
from decals.experiments.outcome import Row, outcome
from decals.experiments.values import light, pickled, stored, unpickled

Rows = Generator[tuple[int, Row], None, None]
"""Numbers of trials, and their rows."""

TICK = 0.2
"""Seconds between two looks at limits and at a cancelled run."""

MEMORY_EXIT = 97
"""Exit code of a worker that used more memory than it may."""

CONNECT_SECONDS = 10.0
"""Seconds to wait for a scheduler."""

AHEAD = 2
"""Trials that a thread of a cluster has, the running one included."""

THREADS = (THREADS_VARIABLE, "LP_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Variables that set the number of threads for kernels, llvmpipe and NumPy."""


@dataclass(frozen=True)
class Work:
    """A function, the folder of the experiment, and the limits of a trial."""

    function: Callable[..., Any]
    folder: Path
    seconds: float | None
    """Clock time after which a trial is ended."""
    megabytes: float
    """Memory of a process after which its trial is ended."""


@dataclass(frozen=True)
class Started:
    """What is known of trials that start in this process."""

    begin: Callable[[int], object]
    """Called before each trial."""
    suspect: int | None
    """Number of a trial in which the last run ended, by its own fault or from outside."""


def here(work: Work, trials: Sequence[Trial], started: Started) -> Rows:
    """Run trials one after the other in this process, but for a suspect one in a process of its own."""
    if started.suspect is not None:
        yield started.suspect, _apart(work, trials[started.suspect])
    for number, trial in enumerate(trials):
        if number != started.suspect:
            check_cancelled("running trials")
            started.begin(number)
            yield number, outcome(work.function, trial, work.folder)


def _apart(work: Work, trial: Trial) -> Row:
    """Return the row of a trial that may end its process; that it did, where no other process can run it."""
    try:
        ((_, row),) = processes(work, [light(trial, work.folder)], 1)
    except InvalidInput:
        return _cut(None, "ended the process in which it ran")
    return row


# -- local processes ------------------------------------------------------------------------------------


def processes(work: Work, trials: Sequence[Trial], count: int) -> Rows:
    """Run trials in local processes, each of which keeps its kernels and its OpenGL context."""
    payload = pickled("function", work)
    waiting = deque(range(len(trials)))
    workers = [_Worker(payload) for _ in range(min(count, len(trials)))]
    try:
        while waiting or any(worker.number is not None for worker in workers):
            check_cancelled("running trials")
            for worker in workers:
                if worker.idle and waiting:
                    worker.start(number := waiting.popleft(), trials[number])
            wait([end for worker in workers for end in worker.ends], timeout=TICK)
            for worker in workers:
                if (ended := worker.poll(work.seconds)) is not None:
                    yield ended
    finally:
        for worker in workers:
            worker.end()


class _Worker:
    """A process that runs one trial at a time; after its end, a new process takes its place."""

    def __init__(self, payload: bytes) -> None:
        self._payload = payload
        self._open()

    def _open(self) -> None:
        self.number: int | None = None
        """Number of the running trial."""
        self.idle = False
        """True while it can start a trial: not before it has read the function."""
        self._began = time.monotonic()
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, self._payload))
        with _one_thread():
            self._process.start()
        theirs.close()

    @property
    def ends(self) -> tuple[Connection, int]:
        """What becomes ready when the trial or the process ends."""
        return self._connection, self._process.sentinel

    def start(self, number: int, trial: Trial) -> None:
        """Send a trial."""
        content = pickled("parameters", trial)
        self.number, self.idle, self._began = number, False, time.monotonic()
        with suppress(OSError):  # the process has ended; `poll` finds it
            self._connection.send_bytes(content)

    def poll(self, limit: float | None) -> tuple[int, Row] | None:
        """Return the row of the trial if it has ended, or end it past its limit."""
        alive = self._process.is_alive()  # asked first: a message that is sent before the end is read below
        seconds = time.monotonic() - self._began
        number, row = self.number, None
        with suppress(EOFError, OSError):
            if self._connection.poll():
                row = self._received(self._connection.recv())
        if row is None and not alive:
            row = _died(seconds, self._code())
            self._replace()
        elif row is None and number is not None and limit is not None and seconds > limit:
            row = _cut(seconds, f"ran past its limit of {limit:g} s")
            self._replace()
        return None if row is None or number is None else (number, row)

    def _received(self, message: Row | str | None) -> Row | None:
        """Return the row that came; a text says why there will be none, None that the worker is ready."""
        if isinstance(message, str):
            raise InvalidInput(message)
        self.number, self.idle = None, True
        return message

    def _code(self) -> int:
        self._process.join()
        return self._process.exitcode or 0

    def _replace(self) -> None:
        """Start another process in place of this one, which ended or is ended in a trial."""
        if self.number is None and not self.idle:
            raise InvalidInput("a worker ended while it read the function; run it in this process to see why")
        self.end()
        self._open()

    def end(self) -> None:
        """End the process, and those that its trial started."""
        if self._process.pid is not None:
            _kill_group(self._process.pid)
        self._process.kill()
        self._process.join()
        self._connection.close()


def _cut(seconds: float | None, reason: str) -> Row:
    return {"status": "ended", "error": reason, "seconds": seconds}


def _died(seconds: float, code: int) -> Row:
    """Return the row of a trial whose process ended."""
    if code == MEMORY_EXIT:
        return _cut(seconds, "used more memory than one worker may; see the option for it")
    names = {number.value: number.name for number in signal.Signals}
    reason = f"signal {names.get(-code, -code)}" if code < 0 else f"exit code {code}"
    return _cut(seconds, f"ended its process ({reason})")


def _serve(connection: Connection, payload: bytes) -> None:
    """Run the trials that come through a connection, until it closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers
    with suppress(AttributeError):  # Windows has no groups of processes
        os.setpgid(0, 0)
    parent = multiprocessing.parent_process()
    assert parent is not None
    try:
        work: Work = pickle.loads(payload)
    except Exception as error:  # of an import in the user's file, whatever it is
        connection.send(f"function: a worker could not read it ({type(error).__name__}: {error})")
        return
    connection.send(None)
    threading.Thread(target=_watch, args=(parent.sentinel, work.megabytes), daemon=True).start()
    with displayed(lambda _stage, _fraction: None), suppress(EOFError):
        while True:
            trial = pickle.loads(connection.recv_bytes())
            connection.send(outcome(work.function, trial, work.folder))


def _watch(parent: int, megabytes: float) -> None:
    """End this process with its parent, or when it uses too much memory."""
    while not wait([parent], timeout=TICK):
        if used_megabytes() > megabytes:
            os._exit(MEMORY_EXIT)
    _kill_group(os.getpid())
    os._exit(1)


def _kill_group(leader: int) -> None:
    """End a process that leads a group, and all others of the group."""
    with suppress(AttributeError, OSError):
        os.killpg(leader, signal.SIGKILL)


def used_megabytes() -> float:
    """Return the memory of this process; 0 where the system does not say."""
    with suppress(OSError, AttributeError):
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20
    return 0.0


@contextmanager
def _one_thread() -> Iterator[None]:
    """Within a ``with`` block, start processes that compute and draw on one thread each."""
    own = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(own, "1"))
    try:
        yield
    finally:
        for name in own:
            del os.environ[name]


# -- Dask -----------------------------------------------------------------------------------------------


@contextmanager
def connected(scheduler: Any) -> Iterator[Any]:
    """Yield the Dask client of an address, or the client itself.

    Raises
    ------
    MissingPackage
        Dask is not installed.
    InvalidInput
        No scheduler answers, or its workers have another version of this package.
    """
    try:
        from dask.distributed import Client
    except ImportError as error:
        raise MissingPackage("Dask is not installed; install implicit-decals[experiments]") from error
    if not isinstance(scheduler, str | Client):
        raise InvalidInput(f"scheduler: expected an address or a Dask client, got {describe(scheduler)}")
    client: Any = scheduler
    if isinstance(scheduler, str):
        try:
            client = Client(scheduler, timeout=CONNECT_SECONDS, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InvalidInput(
                f"no Dask scheduler answers at {scheduler!r}; start one by `dask scheduler`"
            ) from error
    try:
        _check_versions(client)
        yield client
    finally:
        if client is not scheduler:
            client.close()


def _check_versions(client: Any) -> None:
    """Raise an error if a worker lacks this version; one that ends meanwhile does not count."""
    found = client.run(_version, on_error="return").values()
    if errors := [
        error for error in found if isinstance(error, Exception) and not isinstance(error, OSError)
    ]:
        raise InvalidInput(  # workers without the package fail to read the function
            f"the workers of the cluster cannot import this package ({errors[0]}); install it there"
        )
    if others := {version for version in found if isinstance(version, str)} - {__version__}:
        raise InvalidInput(
            f"the workers of the cluster have version {', '.join(sorted(others))} of implicit-decals, "
            f"this process has {__version__}; install the same version"
        )


def _version() -> str:
    return __version__


def cluster(work: Work, trials: Sequence[Trial], client: Any) -> Rows:
    """Run trials on the workers of a Dask cluster; the function lies in the folder, which they all read."""
    from dask.distributed import as_completed

    path = stored(pickled("function", work), work.folder)
    waiting, running = deque(range(len(trials))), dict[str, int]()

    def submit() -> Any:
        number = waiting.popleft()
        future = client.submit(_on_cluster, path, trials[number], pure=False)
        running[future.key] = number
        return future

    ahead = AHEAD * max(1, sum(client.nthreads().values()))
    first = [submit() for _ in range(min(ahead, len(trials)))]
    futures = as_completed(first, loop=client.loop)
    for future in futures:
        check_cancelled("running trials")
        error = future.exception()
        row = future.result() if error is None else _cut(None, f"{type(error).__name__}: {error}")
        yield running.pop(future.key), row
        if waiting:
            futures.add(submit())


def _on_cluster(path: Path, trial: Trial) -> Row:
    """Run a trial on a Dask worker; past its limit the worker ends, and Dask starts another one."""
    if multiprocessing.parent_process() is not None:  # a process of a worker, not that of the user
        for name in THREADS:
            os.environ.setdefault(name, "1")
    work: Work = unpickled(path)
    timer = threading.Timer(work.seconds or 0.0, os._exit, (1,))
    timer.daemon = True
    if work.seconds is not None:
        timer.start()
    try:
        return outcome(work.function, trial, work.folder)
    finally:
        timer.cancel()
