"""Decals in a real browser, and in a live notebook: run by name, ``pytest -m browser``.

Each check is a program of its own: servers and kernels come and go with it.
"""

from importlib.util import find_spec

import pytest

from blobtree.graphics import install_advice, missing_gl_libraries
from tests.display import run_module

pytestmark = pytest.mark.browser

NEEDED = ("playwright", "axe_playwright_python", "trame_pyvista")
FOR_NOTEBOOKS = ("nbclient", "ipykernel", "ipywidgets", "nest_asyncio2")


def require(*modules: str) -> None:
    """Skip where something is missing, and say what to install."""
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        names = ", ".join(missing)
        packages = "'implicit-decals[browser]' playwright axe-playwright-python nbclient ipykernel"
        pytest.skip(f"missing: {names}; pip install {packages}")
    from tests.frontends.browsing import browser_path

    if browser_path() is None:
        pytest.skip("no Chromium here (on Debian: apt-get install --no-install-recommends chromium)")
    if libraries := missing_gl_libraries():
        pytest.skip(f"no OpenGL here: {install_advice(libraries)}")


@pytest.mark.parametrize(
    "check",
    [
        "page",
        "user",
        "streamed",
        "sandbox",
        "start",
        "creature",
        "lab",
        "ended",
        "panels",
        "fields",
        "filled",
        "shared",
    ],
)
def test_in_a_browser(check: str) -> None:
    require(*NEEDED)
    assert "done" in run_module("tests.frontends.in_browser", check)


@pytest.mark.parametrize("check", ["picture", "use", "touch", "mounts", "losses", "drags", "refusals"])
def test_html_pages(check: str) -> None:
    require("playwright", "axe_playwright_python")
    assert "done" in run_module("tests.frontends.in_html_page", check)


def test_in_a_live_notebook() -> None:
    require(*NEEDED, *FOR_NOTEBOOKS)
    assert "done" in run_module("tests.frontends.in_notebook")
