"""OpenGL's libraries and contexts, whatever the driver does."""

import sys

import pytest

from decals.apps.doctor import graphics
from decals.apps.doctor.finding import Status
from decals.rendering.gl_libraries import missing_gl_libraries

CONTEXT: dict[str, str | int] = {
    "code": 330,
    "glsl": 330,
    "vendor": "Mesa",
    "renderer": "llvmpipe",
    "version": "3.3 (Core Profile) Mesa",
}


def test_missing_libraries_have_advice() -> None:
    assert graphics.library_finding([]).status is Status.GOOD
    finding = graphics.library_finding(["libEGL.so.1"])
    assert finding.status is Status.MISSING
    assert "apt-get install --no-install-recommends libegl1" in finding.advice


@pytest.mark.parametrize(
    ("code", "glsl", "status", "value"),
    [
        (330, 330, Status.GOOD, "OpenGL 3.3, GLSL 3.30"),
        (460, 460, Status.GOOD, "OpenGL 4.6, GLSL 4.60"),
        (320, 330, Status.MISSING, "OpenGL 3.2, GLSL 3.30"),
        (330, 0, Status.MISSING, "OpenGL 3.3, GLSL older than 3.30"),
    ],
)
def test_opengl_3_3_is_required(code: int, glsl: int, status: Status, value: str) -> None:
    driver, verdict = graphics.describe_context({**CONTEXT, "code": code, "glsl": glsl})
    assert driver.status is Status.GOOD
    assert "llvmpipe" in driver.value
    assert (verdict.status, verdict.value) == (status, value)
    assert bool(verdict.advice) == (status is Status.MISSING)


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "crashed (signal 9)"),
        ("import sys; sys.exit('cannot create context')", "cannot create context"),
        ("import sys; sys.exit(3)", "no output"),
        ("print('not JSON')", "unreadable answer 'not JSON'"),
        ("print('[1, 2]')", "unreadable answer '[1, 2]'"),
        ("", "unreadable answer"),
    ],
)
def test_a_failing_probe_is_a_finding(program: str, said: str) -> None:
    (finding,) = graphics.context_findings([sys.executable, "-I", "-S", "-c", program])
    assert finding.status is Status.MISSING
    assert said in finding.value
    assert finding.advice


def test_a_hanging_probe_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(graphics, "PROBE_SECONDS", 0.2)
    (finding,) = graphics.context_findings([sys.executable, "-S", "-c", "import time; time.sleep(30)"])
    assert finding.status is Status.MISSING
    assert "timed out" in finding.value


@pytest.mark.skipif(bool(missing_gl_libraries()), reason="OpenGL libraries are not installed")
def test_the_probe_finds_the_driver() -> None:
    driver, verdict = graphics.context_findings()
    assert driver.name == "OpenGL driver"
    assert verdict.status is Status.GOOD
