"""Editing in a notebook: the page of the sandbox, served by a process of its own, below the cell."""

import json
import secrets
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import reduce
from html import escape
from importlib import import_module
from pathlib import Path
from typing import Any

from blobtree.files import exists
from decals.editing.recovery import recovery_path
from decals.errors import InvalidScene
from decals.scenes.files import load_scene, save_scene
from decals.scenes.scene import Scene

COMMAND = (sys.executable, "-m", "decals", "sandbox")
"""Begins the page as a program, because `decals` does not import the apps."""
OPTIONS = ("--port", "0", "--no-browser", "--trust", "--done")

HEIGHT = 720
"""Height of the page below the cell, in pixels."""

SCRIPT = """
(async () => {
  const place = document.getElementById($name), link = place.querySelector("a");
  let url = new URL($url);
  const data = document.getElementById("jupyter-config-data");
  if (data) {  // a proxy of Jupyter reaches the page from other machines, too
    const near = new URL(`${JSON.parse(data.textContent).baseUrl}proxy/${url.port}/`, location.href);
    const answer = await fetch(near, {method: "HEAD"}).catch(() => null);
    if (answer && answer.status !== 404) {
      near.search = url.search;
      url = near;
    }
  }
  link.href = url.href;
  const origins = [location.origin, ...(location.ancestorOrigins || [])];
  url.searchParams.set("frame", origins.filter((one) => one !== "null").join(" "));
  const frame = document.createElement("iframe");
  Object.assign(frame, {src: url.href, width: "100%", height: $height});
  frame.style.border = "0";
  place.prepend(frame);
})();
"""
"""Shows the page in a frame; without scripts, the link alone shows."""

STOP_SECONDS = 15.0
"""Time in which an interrupted page must have kept its changes."""


def edit_in_notebook(scene: Scene, path: Path | None) -> Scene:
    """Show the page below the cell until its Done is pressed, and return the edited scene.

    Parameters
    ----------
    scene
        The scene.
    path
        File to save to; None for a temporary one.

    Raises
    ------
    InvalidScene
        The page ended with an error.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.json" if path is None else path
        save_scene(scene, file)
        with _served(file) as (process, url):
            shown = _display(url)
            process.wait()
            shown.update({"text/plain": "The edited scene was returned."}, raw=True)
        unsaved = recovery_path(file)
        return load_scene(unsaved if exists(unsaved) else file, trust=True)


@contextmanager
def _served(file: Path) -> Iterator[tuple[Any, str]]:
    """Yield a process that serves the page, and its URL; an interrupt of the kernel ends it."""
    with (
        tempfile.TemporaryFile("w+") as errors,
        subprocess.Popen(
            [*COMMAND, file.name, *OPTIONS], cwd=file.parent, stdout=subprocess.PIPE, stderr=errors, text=True
        ) as process,
    ):
        assert process.stdout is not None
        try:
            url = next((line.strip() for line in process.stdout if line.startswith("http://")), "")
            if not url:
                process.wait()
                errors.seek(0)
                raise InvalidScene(f"expected a page to edit in, got: {errors.read().strip()[-500:]}")
            with suppress(KeyboardInterrupt):  # the recovery file keeps the changes
                yield process, url
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            try:
                process.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                process.kill()


def _display(url: str) -> Any:
    """Show the page, and return the handle by which something else takes its place."""
    shown: Any = import_module("IPython.display")  # a notebook has it
    return shown.display(shown.HTML(frame_html(url)), display_id=True)


def frame_html(url: str) -> str:
    """Return HTML that shows the page of a URL with a token in a frame, which gets the notebook's origin."""
    name = f"decals-{secrets.token_hex(8)}"
    values = {"name": json.dumps(name), "url": json.dumps(url).replace("<", "\\u003c"), "height": str(HEIGHT)}
    script = reduce(lambda text, item: text.replace(f"${item[0]}", item[1]), values.items(), SCRIPT)
    link = f'<a href="{escape(url)}" target="_blank" rel="noopener noreferrer">Open the page in a tab</a>'
    return f'<div id="{name}">{link}</div><script>{script}</script>'
