"""Sessions that are killed while they edit and save, and opened again.

    python -m tests.apps.sandbox.kills --count 50
    python -m tests.apps.sandbox.kills --count 50 --server

Each round is a process of its own. It renames an object all the time, so that its name counts the edits. With
``--server``, it is the sandbox's server, with a window; otherwise a session without one.
"""

import argparse
import asyncio
import json
import os
import random
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import decals
from blobtree import Point
from decals import load_scene
from decals.editing import Actions, EditSession, RenameObject, recovery

PAUSE = 0.01
"""Seconds between two edits."""


def first_scene(count: int = 2000) -> decals.Scene:
    """A scene that takes a while to write."""
    angles = np.linspace(0.0, 2.0 * np.pi, count)
    rim = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    covering = decals.Decals(positions=rim, normals=rim, tangents=np.cross(rim, (0, 0, 1)), radii=0.01)
    ball = decals.TreeObject("edit 0", Point((0, 0, 0), radius=1.0))
    return decals.Scene(objects=[ball], decals=covering, camera=decals.Camera((0, 0, 5)), images=["tile"])


def edit_for_ever(path: Path, report: int) -> None:
    """Open a scene as a window does, edit it, and report the time of each edit."""
    actions = Actions(EditSession(load_scene(path)), path=path, threaded=True)
    actions.files.recover(load_scene)
    number = last_edit(actions.state.session)
    while True:
        number += 1
        actions.state.run(RenameObject(0, f"edit {number}"))
        os.write(report, f"{number} {time.time()}\n".encode())
        if number % 40 == 0:
            actions.perform("save", lambda: None)
        actions.state.background.poll()
        actions.files.update()
        time.sleep(PAUSE)


def serve_for_ever(path: Path, report: int) -> None:
    """Serve a scene as the sandbox does, edit it on the page, and report the time of each edit."""
    from trame.app import get_server

    from decals.apps.sandbox.page import Page
    from decals.window import EditWindow

    async def edit(page: Any, session: EditSession) -> None:
        number = last_edit(session)
        while True:
            number += 1
            page.sandbox.change_row("object 0", "rename", f"edit {number}")
            while last_edit(session) < number:
                await asyncio.sleep(PAUSE)
            os.write(report, f"{number} {time.time()}\n".encode())
            if number % 40 == 0:
                page.sandbox.perform("save")
            await asyncio.sleep(PAUSE)

    async def run() -> None:
        window = EditWindow(load_scene(path), path=path, recover=load_scene, off_screen=True, size=(80, 60))
        window.show()
        server = get_server("kills", client_type="vue3")
        page = Page(server, window, folder=path.parent)
        options: dict[str, Any] = {"exec_mode": "task", "port": 0, "timeout": 0, "open_browser": False}
        server.start(host="127.0.0.1", show_connection_info=False, **options)
        await server.ready
        await edit(page, window.session)

    asyncio.run(run())


def last_edit(session: EditSession) -> int:
    """The number of the last edit that a session has."""
    return int(session.document.objects[0].name.split()[1])


def kill_once(path: Path, seconds: float, work: Callable[[Path, int], None]) -> float:
    """Work in a process, kill it, and return the seconds of work that the next start misses."""
    receive, send = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            work(path, send)
        finally:
            os._exit(1)
    os.close(send)
    with os.fdopen(receive) as lines:
        begun = [lines.readline()]
        time.sleep(seconds)
        os.kill(child, signal.SIGKILL)
        killed = time.time()
        assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL  # not an error before
        edits = [line.split() for line in begun + lines.readlines() if line.endswith("\n")]
    actions = Actions(EditSession(load_scene(path)), path=path)
    actions.files.recover(load_scene)
    found = last_edit(actions.state.session)
    actions.files.recovery.release()
    missing = [float(when) for number, when in edits if int(number) > found]
    return killed - missing[0] if missing else 0.0


def measure(
    count: int, seconds: float, autosave: float, work: Callable[[Path, int], None], seed: int = 1
) -> dict[str, Any]:
    """Kill sessions at random moments, and return the longest missing work in seconds."""
    rng = random.Random(seed)
    recovery.AUTOSAVE_SECONDS = autosave
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.json"
        first_scene().save(path)
        missing = [kill_once(path, rng.uniform(0.0, seconds), work) for _ in range(count)]
    return {"kills": count, "missing_s": max(missing)}


def main() -> None:
    """Print the figures as JSON; an unreadable file ends the program with an error."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=8.0, help="longest life of a session")
    parser.add_argument("--autosave", type=float, default=recovery.AUTOSAVE_SECONDS)
    parser.add_argument("--server", action="store_true", help="kill the sandbox's server")
    options = parser.parse_args()
    work = serve_for_ever if options.server else edit_for_ever
    print(json.dumps(measure(options.count, options.seconds, options.autosave, work)))


if __name__ == "__main__":
    main()
