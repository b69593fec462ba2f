"""Warm-up: slow first-time work, such as compiling shaders, as tasks that run before a frame needs them."""

import threading
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass

SHADERS, SHAPES, DECALS, IMAGES = "shaders", "shapes", "decals", "images"
"""Names of groups of tasks, for status messages."""


@dataclass(frozen=True, eq=False)
class WarmupTask:
    """Work whose result is kept: a later request for the same takes no time.

    Attributes
    ----------
    group
        One of the names above.
    run
        The work. The context must be current.
    threaded
        True if the work needs no graphics, so that it may run in another thread.
    """

    group: str
    run: Callable[[], object]
    threaded: bool = False


@dataclass(frozen=True, eq=False)
class WarmupPlan:
    """The slow first-time work of drawing an object or a scene.

    Attributes
    ----------
    key
        Plans of the same key need the same programs.
    tasks
        The tasks in the order in which they must run, each as short as possible.
    """

    key: Hashable
    tasks: Sequence[WarmupTask]


def with_status(tasks: Sequence[WarmupTask]) -> Iterator[tuple[WarmupTask, str]]:
    """Yield each task and the status once it is done, such as ``"shaders 3 of 7"``."""
    groups = [task.group for task in tasks]
    for number, task in enumerate(tasks, 1):
        done, count = groups[:number].count(task.group), groups.count(task.group)
        yield task, f"{task.group} {done} of {count}" if count > 1 else task.group


class WarmupThread:
    """Runs, in a thread, those of some tasks that may run there.

    Attributes
    ----------
    status
        Group of the current task.
    """

    def __init__(self, tasks: Sequence[WarmupTask]) -> None:
        self._error: Exception | None = None
        self.status = ""
        threaded = [task for task in tasks if task.threaded]
        self._thread = threading.Thread(target=self._run, args=(threaded,), name="warm-up", daemon=True)
        self._thread.start()

    def _run(self, tasks: list[WarmupTask]) -> None:
        try:
            for task in tasks:
                self.status = task.group
                task.run()
        except Exception as error:  # raised by `done`
            self._error = error

    def end(self) -> None:
        """Wait until the thread has ended; its error is ignored."""
        self._thread.join()

    def done(self, seconds: float) -> bool:
        """Wait at most so long; return True if all tasks are done.

        An error of a task is raised here, once. Later users of its result compute it themselves: another
        scene may not need it.
        """
        self._thread.join(seconds)
        error, self._error = self._error, None
        if error is not None:
            raise error
        return not self._thread.is_alive()
