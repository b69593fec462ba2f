"""The walks of a scene's decals, computed in a thread while frames show the corrected mapping."""

import threading
from functools import partial

from blobtree._typing import Float32Array
from blobtree.device import core_left_free
from blobtree.progress import reporting
from decals.field.walks import Walks, walk_rows, with_surface
from decals.index.editor import DecalEditor
from decals.rendering.data_texture import DataTexture
from decals.rendering.effect import Effect, SceneUploads
from decals.rendering.options import Drawing, SceneLike, drawn_objects
from decals.rendering.warmup import DECALS, WarmupTask

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
        self.cancelled = threading.Event()
        self.thread = threading.Thread(target=self._run, args=(rows, previous), name="walks", daemon=True)
        self.thread.start()

    def _run(self, rows: Float32Array, previous: Walks | None) -> None:
        try:
            with core_left_free(), reporting(lambda *_: None, self.cancelled.is_set):
                self.walks = _walks_of(self.key, rows, previous)
        except Exception as error:  # raised by `WalkCache.get`
            self.error = error.with_traceback(None)  # its frames would keep meshes and relays


class WalkCache:
    """The walks of the last state of a scene; after an edit, only decals that changed walk again."""

    def __init__(self) -> None:
        self._key: Key | None = None
        self._walks: Walks | None = None
        self._error: Exception | None = None
        self._job: _Job | None = None
        self._cancelled: threading.Thread | None = None
        self._used = False

    def ready(self, scene: SceneLike) -> bool:
        """Return True if `get` takes no time; otherwise the walks are being computed in a thread.

        A new state of the scene cancels those of the state before.
        """
        self._used = True
        key = _key(scene)
        if _same(self._key, key):
            return True
        if self._job is not None and _same(self._job.key, key):
            return self._take(self._job, 0.0)
        self._cancel()
        if not self._ended(0.0):
            return False
        self._job = _Job(key, walk_rows(scene.decals), self._walks)
        return self._take(self._job, FIRST_WAIT)

    def get(self, scene: SceneLike) -> Walks:
        """Return the walks of a scene; compute them or wait for them if necessary."""
        self._used = True
        key = _key(scene)
        if not _same(self._key, key):
            if self._job is not None and _same(self._job.key, key):
                self._take(self._job, None)
            else:
                self._cancel()
                self._ended(None)
                self._walks = _walks_of(key, walk_rows(scene.decals), self._walks)
                self._key, self._error = key, None
        if self._error is not None:
            raise self._error
        assert self._walks is not None
        return self._walks

    def _take(self, job: _Job, wait: float | None) -> bool:
        """Wait at most so long for a thread, and take its result; return True if it has ended."""
        job.thread.join(wait)
        if job.thread.is_alive():
            return False
        self._key, self._job, self._error = job.key, None, job.error
        self._walks = job.walks or self._walks
        return True

    def _cancel(self) -> None:
        """Cancel the thread; of its work, nothing is kept."""
        if self._job is not None:
            self._job.cancelled.set()
            self._cancelled, self._job = self._job.thread, None

    def _ended(self, wait: float | None) -> bool:
        """Wait at most so long, None for no limit; return True if the cancelled thread has ended."""
        if self._cancelled is not None:
            self._cancelled.join(wait)
            if self._cancelled.is_alive():
                return False
        self._cancelled = None
        return True

    def sweep(self) -> None:
        """Forget all walks, and cancel the thread, if no walks were needed since the last sweep."""
        if not self._used:
            self._forget()
        self._used = False

    def _forget(self) -> None:
        self._cancel()
        self._key = self._walks = self._error = None

    def release(self) -> None:
        """Cancel the thread, wait for its end, and forget all walks."""
        self._forget()
        self._ended(None)


class WalkEffect(Effect):
    """The walks of a scene's decals in the mapping WALKED."""

    def __init__(self, uploads: SceneUploads) -> None:
        super().__init__(uploads)
        self._walks = WalkCache()

    def of(self, scene: SceneLike, drawing: Drawing) -> DataTexture:
        """Return the walks."""
        walks = self._walks.get(scene)
        texture: DataTexture = self._cache.get(
            lambda: DataTexture(self._uploads.context, walks.texels), walks
        )
        return texture

    def tasks(self, scene: SceneLike, drawing: Drawing) -> list[WarmupTask]:
        """Return the computation of the walks."""
        return [WarmupTask(DECALS, partial(self.of, scene, drawing))]

    def ready(self, scene: SceneLike) -> bool:
        """Return True if pictures in the mapping WALKED need not wait."""
        return not len(scene.decals) or self._walks.ready(scene)

    def sweep(self) -> None:
        """Release everything that was not used since the last sweep."""
        super().sweep()
        self._walks.sweep()

    def release(self) -> None:
        """Release everything."""
        super().release()
        self._walks.release()
