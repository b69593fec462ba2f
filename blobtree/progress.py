"""Callbacks by which long work reports its progress and is cancelled."""

from collections.abc import Callable

from blobtree.errors import Cancelled, ImplicitDecalsError

Progress = Callable[[str, float], None]
"""A function (stage in plain words, fraction of it that is done, from 0 to 1)."""

Cancel = Callable[[], bool]
"""A function that returns True once the work is to stop; it is called often."""


def watched(progress: Progress | None, cancel: Cancel | None) -> Progress:
    """Return a callback that forwards reports, and raises `Cancelled` after `cancel` returned True."""
    for name, callback in (("progress", progress), ("cancel", cancel)):
        if callback is not None and not callable(callback):
            raise ImplicitDecalsError(f"{name}: expected a function or None, got {callback!r}")

    def report(stage: str, fraction: float) -> None:
        if cancel is not None and cancel():
            raise Cancelled(f"cancelled while {stage}")
        if progress is not None:
            progress(stage, fraction)

    return report
