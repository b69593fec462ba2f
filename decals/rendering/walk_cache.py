"""The walks of a scene's decals, computed in a thread while frames show the corrected mapping."""

import threading

from blobtree._typing import Float32Array
from blobtree.device import core_left_free
from blobtree.errors import Cancelled
from blobtree.progress import reporting
from decals.field.walks import Walks, walk_rows, with_surface
from decals.index.editor import DecalEditor
from decals.rendering.options import SceneLike, drawn_objects

FIRST_WAIT = 0.02
"""Seconds to wait for walks that were just begun: those of a few decals are done by then."""

Key = tuple[tuple[object, ...], int]
"""Decals and objects, which are compared by identity, and the version of the decals."""


def _key(scene: SceneLike) -> Key:
    version = scene.decals.version if isinstance(scene.decals, DecalEditor) else 0
    return (scene.decals, *drawn_objects(scene)), version


def _same(one: Key | None, other: Key) -> bool:
    return (
        one is not None
        and one[1] == other[1]
        and len(one[0]) == len(other[0])
        and all(a is b for a, b in zip(one[0], other[0], strict=True))
    )


def _walks_of(key: Key, rows: Float32Array, previous: Walks | None) -> Walks:
    return Walks.of_rows(rows, with_surface(key[0][1:]), previous=previous)


class _Job:
    """Walks of one state of a scene, in a thread; the rows are those of `walk_rows`."""

    def __init__(self, key: Key, rows: Float32Array, previous: Walks | None) -> None:
        self.key = key
        self.walks: Walks | None = None
        self.error: Exception | None = None
        self._rows, self._previous = rows, previous
        self.cancelled = threading.Event()
        self._thread = threading.Thread(target=self._run, name="walks", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            with core_left_free(), reporting(self._report):
                self.walks = _walks_of(self.key, self._rows, self._previous)
        except Exception as error:  # raised by `WalkCache.get`
            self.error = error.with_traceback(None)  # its frames would keep meshes and relays

    def _report(self, stage: str, _fraction: float) -> None:
        if self.cancelled.is_set():
            raise Cancelled(f"cancelled while {stage}")

    def is_for(self, key: Key) -> bool:
        """Return True if the thread goes on to compute the walks of a state."""
        return not self.cancelled.is_set() and _same(self.key, key)

    def ended(self, seconds: float | None) -> bool:
        """Wait at most so long, None for no limit; return True if the thread has ended."""
        self._thread.join(seconds)
        return not self._thread.is_alive()


class WalkCache:
    """The walks of the last state of a scene; after an edit, only decals that changed walk again."""

    def __init__(self) -> None:
        self._key: Key | None = None
        self._walks: Walks | None = None
        self._error: Exception | None = None
        self._job: _Job | None = None

    def ready(self, scene: SceneLike) -> bool:
        """Return True if `get` takes no time; otherwise the walks are being computed in a thread.

        A new state of the scene cancels those of the state before.
        """
        key = _key(scene)
        if _same(self._key, key):
            return True
        job = self._job
        if job is not None and job.is_for(key):
            return self._take(job, 0.0)
        if job is not None:
            job.cancelled.set()
            if not job.ended(0.0):
                return False
        self._job = job = _Job(key, walk_rows(scene.decals), self._walks)
        return self._take(job, FIRST_WAIT)

    def get(self, scene: SceneLike) -> Walks:
        """Return the walks of a scene; compute them or wait for them if necessary."""
        key = _key(scene)
        if not _same(self._key, key):
            if self._job is None or not self._job.is_for(key):
                self._cancel()
                self._walks = _walks_of(key, walk_rows(scene.decals), self._walks)
                self._key, self._error = key, None
            else:
                self._take(self._job, None)
        if self._error is not None:
            raise self._error
        assert self._walks is not None
        return self._walks

    def _take(self, job: _Job, wait: float | None) -> bool:
        """Wait at most so long for a thread, and take its result; return True if it has ended."""
        if not job.ended(wait):
            return False
        self._key, self._job, self._error = job.key, None, job.error
        self._walks = job.walks or self._walks
        return True

    def _cancel(self) -> None:
        """Cancel the thread and wait for its end."""
        if self._job is not None:
            self._job.cancelled.set()
            self._job.ended(None)
        self._job = None

    def release(self) -> None:
        """Cancel the thread, wait for its end, and forget all walks."""
        self._cancel()
        self._key = self._walks = self._error = None
