"""How long work reports itself and is stopped: two callback types, used by every room."""

from collections.abc import Callable

from blobtree.errors import BlobTreeError, Cancelled

Progress = Callable[[str, float], None]
"""Called with the stage in plain words and the fraction of it that is done, from 0 to 1."""

Cancel = Callable[[], bool]
"""Asked again and again whether to stop."""


def watched(progress: Progress | None, cancel: Cancel | None) -> Progress:
    """A callback that passes reports on and raises `Cancelled` at the first one after `cancel` says so."""
    for name, callback in (("progress", progress), ("cancel", cancel)):
        if callback is not None and not callable(callback):
            raise BlobTreeError(f"{name}: expected a function or None, got {callback!r}")

    def report(stage: str, fraction: float) -> None:
        if cancel is not None and cancel():
            raise Cancelled(f"cancelled while {stage}")
        if progress is not None:
            progress(stage, fraction)

    return report
