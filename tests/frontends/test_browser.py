"""Decals in real browsers, and in a live notebook: run by name, ``pytest -m browser``.

Each check is a program of its own: servers and kernels come and go with it.
"""

from importlib.metadata import version
from importlib.util import find_spec

import pytest

from blobtree.graphics import install_advice, missing_gl_libraries
from tests.display import display
from tests.programs import run_module

__all__ = ["display"]

pytestmark = pytest.mark.browser

NEEDED = ("playwright", "axe_playwright_python", "trame_pyvista")
HTML_CHECKS = "picture", "sizes", "use", "mounts", "address", "losses", "drags", "refusals"
FIREFOX_CHECKS = (
    *(f"in_html_page {check}" for check in HTML_CHECKS),
    *(f"in_browser {check}" for check in ("sandbox", "keyboard", "copies", "access")),
    "in_lesson_page",
)
FIREFOX_DRIVER = 1, 60
"""The newest version of playwright that is known to start Firefox of Debian; 1.65 waits for ever."""
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
        "copies",
        "access",
        "zone",
        "snowman",
        "shared",
        "keyboard",
        "touch",
    ],
)
def test_in_a_browser(check: str) -> None:
    require(*NEEDED)
    assert "done" in run_module("tests.frontends.in_browser", check)


@pytest.mark.parametrize("check", [*HTML_CHECKS, "touch"])
def test_html_pages(check: str) -> None:
    require("playwright", "axe_playwright_python")
    assert "done" in run_module("tests.frontends.in_html_page", check)


@pytest.mark.parametrize("check", [(), ("class",)])
def test_lesson_pages(check: tuple[str, ...]) -> None:
    require("playwright", "axe_playwright_python")
    assert "done" in run_module("tests.frontends.in_lesson_page", *check)


@pytest.mark.parametrize("check", [*FIREFOX_CHECKS])
def test_pages_in_firefox(display: str, check: str) -> None:
    require(*NEEDED)
    from tests.frontends.browsing import firefox_path

    if firefox_path() is None:
        pytest.skip("no Firefox here (on Debian: apt-get install --no-install-recommends firefox-esr)")
    numbers = tuple(map(int, version("playwright").split(".")[:2]))
    if numbers > FIREFOX_DRIVER:
        pytest.skip("newer versions of playwright do not start this Firefox: pip install playwright==1.60")
    module, *rest = check.split()
    assert "done" in run_module(f"tests.frontends.{module}", *rest, "firefox", DISPLAY=display)


def test_in_a_live_notebook() -> None:
    require(*NEEDED, *FOR_NOTEBOOKS)
    assert "done" in run_module("tests.frontends.in_notebook")
