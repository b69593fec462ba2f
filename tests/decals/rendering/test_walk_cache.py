"""Walks that a thread computes: they are those of the last state, and a state cancels the one before."""

import threading
import time
import weakref
from typing import Any

import numpy as np
import pytest

from decals import Camera, Decals, MeshObject, Scene
from decals.editing import EditSession, MoveDecals
from decals.field import Walks, walks
from decals.rendering import walk_cache
from decals.rendering.walk_cache import WalkCache
from tests.decals.editing.scenes import box


@pytest.fixture
def session() -> EditSession:
    """Four decals at the edges of a cube."""
    positions = np.array([[0.8, 0.3, 1], [-0.8, 0.3, 1], [0.3, 0.8, 1], [0.3, -0.8, 1]])
    decals = Decals(positions, [[0, 0, 1]] * 4, [[1, 0, 0]] * 4, [0.4] * 4)
    cube = MeshObject("cube", *box((-1, -1, -1), (1, 1, 1)))
    return EditSession(Scene(objects=(cube,), decals=decals, images=("eye",), camera=Camera((4, 4, 6))))


def compare(cache: WalkCache, session: EditSession) -> None:
    """Make sure that the kept walks lead to the places of new ones."""
    document = session.document
    places = np.random.default_rng(1).uniform(-0.6, 0.6, (4, 50, 2))
    led = Walks.over(document.decals, document.objects).points(places)
    assert np.isfinite(led).any(axis=(1, 2)).all()
    np.testing.assert_array_equal(cache.get(document).points(places), led)


class Gate:
    """Stops computations of walks until it is open, and counts their decals."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.open = threading.Event()
        self.counts: list[int] = []
        self._walk = walks._walk
        monkeypatch.setattr(walks, "_walk", self)
        monkeypatch.setattr(walk_cache, "FIRST_WAIT", 0.0)

    def __call__(self, rows: Any, meshes: Any) -> Any:
        assert self.open.wait(30)
        self.counts.append(len(rows))
        return self._walk(rows, meshes)


def wait_for(cache: WalkCache, session: EditSession) -> None:
    end = time.monotonic() + 30
    while not cache.ready(session.document):
        assert time.monotonic() < end
        time.sleep(0.002)


def test_only_a_moved_decal_walks_again(session: EditSession, monkeypatch: pytest.MonkeyPatch) -> None:
    gate, cache = Gate(monkeypatch), WalkCache()
    gate.open.set()
    compare(cache, session)
    session.do(MoveDecals([1], (-0.75, 0.2, 1), (0, 0, 1)))
    del gate.counts[:]
    wait_for(cache, session)
    assert gate.counts == [1]
    cache.get(session.document)
    assert gate.counts == [1]
    compare(cache, session)


def test_a_new_state_cancels_the_one_before(session: EditSession, monkeypatch: pytest.MonkeyPatch) -> None:
    gate, cache = Gate(monkeypatch), WalkCache()
    assert not cache.ready(session.document)
    session.do(MoveDecals([0], (0.7, 0.1, 1), (0, 0, 1)))
    assert not cache.ready(session.document)
    gate.open.set()
    wait_for(cache, session)
    assert gate.counts == [4, 4]  # the first one did not get to its result
    compare(cache, session)
    session.undo()
    gate.open.clear()
    assert not cache.ready(session.document)
    threading.Timer(0.05, gate.open.set).start()
    compare(cache, session)
    cache.release()


def test_a_failure_is_raised_by_the_picture_and_the_next_state_is_tried(
    session: EditSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate, cache = Gate(monkeypatch), WalkCache()
    gate.open.set()
    monkeypatch.setattr(walks, "_walk", lambda _rows, _meshes: 1 / 0)
    wait_for(cache, session)
    assert cache._error is not None
    assert cache._error.__traceback__ is None  # else its frames would keep the meshes
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            cache.get(session.document)
    monkeypatch.setattr(walks, "_walk", gate)
    session.do(MoveDecals([0], (0.7, 0.1, 1), (0, 0, 1)))
    compare(cache, session)


def test_walks_that_no_picture_needs_are_forgotten(
    session: EditSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate, cache = Gate(monkeypatch), WalkCache()
    gate.open.set()
    kept = weakref.ref(cache.get(session.document))
    cache.sweep()
    assert cache.get(session.document) is kept()
    cache.sweep()
    cache.sweep()
    assert kept() is None


def test_a_sweep_cancels_walks_that_no_picture_needs(
    session: EditSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate, cache = Gate(monkeypatch), WalkCache()
    assert not cache.ready(session.document)
    assert cache._job is not None
    job = weakref.ref(cache._job)
    cache.sweep()
    assert job() is cache._job
    cache.sweep()
    gate.open.set()
    cache.release()
    assert job() is None
    assert gate.counts == [4]
    wait_for(cache, session)
    compare(cache, session)
