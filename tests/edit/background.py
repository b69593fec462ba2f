"""Actions whose long work goes on in a thread, and what tests let wait there."""

import threading

from decals.edit import Actions, EditSession, Pick
from decals.edit.background import doing
from tests.edit.scenes import scene

LONG = 30.0
"""Seconds that a test would wait for a thread; it never takes as long."""


def threaded(**options):
    return Actions(EditSession(scene()), threaded=True, **options)


def finish(actions):
    while actions.background.busy:
        actions.background.look(timeout=LONG)


def surface_pick(actions):
    item = actions.session.document.objects[0]
    positions, normals = item.surface.project([[0.0, 0.3, 1.2]])
    return Pick(0, positions[0], normals[0], -1)


def press(actions, action):
    actions.perform(action, lambda: surface_pick(actions))


class Held:
    """A step that waits in its thread until it is let go."""

    def __init__(self, command):
        self.begun, self.go, self.runs = threading.Event(), threading.Event(), 0
        self._step = doing(command)

    def __call__(self, session):
        self.runs += 1
        self.begun.set()
        assert self.go.wait(LONG)
        return self._step(session)


def hold_writing(monkeypatch):
    """Let saves wait until they are let go; the events that say that one has begun, and let it go."""
    from decals.scenes import scene_file

    begun, go, write = threading.Event(), threading.Event(), scene_file.write_atomically

    def slowly(path, content):
        begun.set()
        assert go.wait(LONG)
        write(path, content)

    monkeypatch.setattr(scene_file, "write_atomically", slowly)
    return begun, go
