"""Actions whose long work goes on in a thread, and what tests let wait there."""

import threading
from typing import Any

import pytest

from decals.editing import Actions, EditSession
from decals.editing.queries import SurfacePick
from decals.editing.session import step_of
from tests.decals.editing.scenes import scene

LONG = 30.0
"""Seconds that a test would wait for a thread; it never takes as long."""


def threaded(**options: Any) -> Any:
    return Actions(EditSession(scene()), threaded=True, **options)


def finish(actions: Any) -> None:
    while actions.state.background.busy:
        actions.state.background.poll(timeout=LONG)


def surface_pick(actions: Any) -> Any:
    item = actions.state.session.document.objects[0]
    positions, normals = item.surface.project([[0.0, 0.3, 1.2]])
    return SurfacePick(0, positions[0], normals[0], -1)


def press(actions: Any, action: Any) -> None:
    actions.perform(action, lambda: surface_pick(actions))


class Held:
    """A step that waits in its thread until it is let go."""

    def __init__(self, command: Any) -> None:
        self.begun, self.go, self.runs = threading.Event(), threading.Event(), 0
        self._step = step_of(command)

    def __call__(self, session: Any) -> Any:
        self.runs += 1
        self.begun.set()
        assert self.go.wait(LONG)
        return self._step(session)


def hold_writing(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Let saves wait until they are let go; the events that say that one has begun, and let it go."""
    from decals.scenes import files

    begun, go, write = threading.Event(), threading.Event(), vars(files)["write_atomically"]

    def slowly(path: Any, content: Any) -> None:
        begun.set()
        assert go.wait(LONG)
        write(path, content)

    monkeypatch.setattr(files, "write_atomically", slowly)
    return begun, go


def hold_export(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Let exports wait until they are let go; the events that say that, as above."""
    from decals.editing import formats

    begun, go, write = threading.Event(), threading.Event(), vars(formats)["export"]

    def slowly(scene: Any, path: Any, *, progress: Any) -> None:
        begun.set()
        while not go.wait(0.01):
            progress("writing", 0.5)
        write(scene, path, progress=progress)

    monkeypatch.setattr(formats, "export", slowly)
    return begun, go
