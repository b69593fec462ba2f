"""Editing in a notebook, with a reader of the page in place of the notebook."""

from pathlib import Path
from typing import Any
from urllib.request import HTTPCookieProcessor, build_opener

import pytest

import decals
from blobtree import Point
from decals.errors import InvalidScene
from decals.window import notebook, opening

SCENE = decals.Scene(objects=[Point((0, 0, 0), radius=1.0)], camera=decals.Camera((0, 0, 5)))


@pytest.mark.slow
def test_an_interrupt_of_the_kernel_returns_the_scene(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip("trame")
    pages: list[bytes] = []

    def interrupted(url: str) -> None:
        browser = build_opener(HTTPCookieProcessor())
        browser.addheaders = [("Sec-Fetch-Mode", "navigate"), ("Sec-Fetch-Site", "none")]
        pages.append(browser.open(url, timeout=20).read())
        raise KeyboardInterrupt

    monkeypatch.setattr(opening, "in_notebook", lambda: True)
    monkeypatch.setattr(notebook, "_display", interrupted)
    edited = SCENE.edit(path=tmp_path / "mine.json")
    assert b"<html" in pages[0]
    tree: Any = edited.objects[0]
    assert tree.tree.radius == 1.0
    assert [path.name for path in tmp_path.iterdir()] == ["mine.json"]


def test_a_page_that_does_not_begin_tells_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notebook, "COMMAND", ("/bin/sh", "-c", "echo no trame >&2", "sandbox"))
    with pytest.raises(InvalidScene, match="expected a page to edit in, got: no trame"):
        notebook.edit_in_notebook(SCENE, None)
