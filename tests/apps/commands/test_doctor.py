"""``implicit-decals doctor``: the checks of software, OpenGL and sample meshes, and the report."""

import errno
import io
import os
import sys
from importlib import metadata
from pathlib import Path

import pytest
import warp as wp
from rich.console import Console

from blobtree.device import start_warp
from blobtree.errors import UnusableCache
from blobtree.graphics import missing_gl_libraries
from decals.apps.commands import doctor
from decals.apps.commands.doctor import Finding, Status


def shown(findings: list[Finding]) -> tuple[int, str]:
    text = io.StringIO()
    code = doctor.report(findings, Console(file=text, width=200))
    return code, text.getvalue()


def test_a_note_does_not_fail() -> None:
    code, text = shown([Finding("a", "1"), Finding("b", "2", Status.NOTE, "look here")])
    assert code == 0
    assert "b: look here" in text
    assert "Everything that drawing needs is installed." in text


def test_missing_software_fails_and_is_named_last() -> None:
    code, text = shown([Finding("a", "1"), Finding("b", "[2]", Status.MISSING, "do [this]")])
    assert code == 1
    assert "[2]" in text
    assert "b: do [this]" in text
    assert text.endswith("Missing: b.\n")


def test_without_libraries_no_context_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    def forbidden() -> list[Finding]:
        raise AssertionError("the probe was run")

    monkeypatch.setattr(doctor, "missing_gl_libraries", lambda: ["libGL.so.1"])
    monkeypatch.setattr(doctor, "context_findings", forbidden)
    findings = {finding.name: finding for finding in doctor.examine()}
    assert findings["OpenGL libraries"].status is Status.MISSING
    assert {"Python", "Platform", "Warp devices", "Sample meshes", *doctor.PACKAGES} <= set(findings)


def test_an_old_python_is_missing() -> None:
    assert doctor.python_finding((3, 11, 0)).status is Status.GOOD
    old = doctor.python_finding((3, 10, 12))
    assert old.status is Status.MISSING
    assert old.value == "3.10.12"
    assert "3.11" in old.advice


def test_all_packages_are_checked_and_a_missing_one_has_advice() -> None:
    def version(name: str) -> str:
        if name == "vtk":
            raise metadata.PackageNotFoundError(name)
        return "1.2"

    found = {finding.name: finding for finding in doctor.package_findings(version)}
    assert set(found) == set(doctor.PACKAGES)
    assert found["vtk"].status is Status.MISSING
    assert found["vtk"].advice.endswith("-m pip install vtk")
    assert found["numpy"] == Finding("numpy", "1.2")


def test_a_broken_warp_is_a_finding() -> None:
    def broken() -> list[str]:
        raise RuntimeError("first\nno such library")

    finding = doctor.warp_finding(broken)
    assert finding.status is Status.MISSING
    assert finding.value == "none: no such library"
    assert doctor.warp_finding(lambda: ["cpu (CPU)"]) == Finding("Warp devices", "cpu (CPU)")


def test_an_unusable_kernel_cache_is_no_broken_warp() -> None:
    def refuse() -> list[str]:
        raise UnusableCache("kernels cannot be kept; set the environment variable WARP_CACHE_PATH")

    finding = doctor.warp_finding(refuse)
    assert finding.status is Status.MISSING
    assert "WARP_CACHE_PATH" in finding.advice
    assert "install" not in finding.advice


def test_the_kernel_cache_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    start_warp()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    assert doctor.cache_finding() == Finding("Kernel cache", str(tmp_path))
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path / "absent"))
    finding = doctor.cache_finding()
    assert finding.status is Status.MISSING
    assert finding.value == f"{tmp_path / 'absent'}: it cannot be written"
    assert "WARP_CACHE_PATH" in finding.advice


def test_a_full_disk_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(**_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    start_warp()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    monkeypatch.setattr(doctor, "TemporaryFile", full)
    finding = doctor.cache_finding()
    assert (finding.status, finding.value) == (Status.MISSING, f"{tmp_path}: the disk is full")
    assert finding.advice.startswith("Free space there, or set the environment variable WARP_CACHE_PATH to")


CONTEXT: dict[str, str | int] = {
    "code": 330,
    "glsl": 330,
    "vendor": "Mesa",
    "renderer": "llvmpipe",
    "version": "3.3 (Core Profile) Mesa",
}


def test_missing_libraries_have_advice() -> None:
    assert doctor.library_finding([]).status is Status.GOOD
    finding = doctor.library_finding(["libEGL.so.1"])
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
    driver, verdict = doctor.describe_context({**CONTEXT, "code": code, "glsl": glsl})
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
    (finding,) = doctor.context_findings([sys.executable, "-I", "-S", "-c", program])
    assert finding.status is Status.MISSING
    assert said in finding.value
    assert finding.advice


def test_a_hanging_probe_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "PROBE_SECONDS", 0.2)
    (finding,) = doctor.context_findings([sys.executable, "-S", "-c", "import time; time.sleep(30)"])
    assert finding.status is Status.MISSING
    assert "timed out" in finding.value


@pytest.mark.skipif(bool(missing_gl_libraries()), reason="OpenGL libraries are not installed")
def test_the_probe_finds_the_driver() -> None:
    driver, verdict = doctor.context_findings()
    assert driver.name == "OpenGL driver"
    assert verdict.status is Status.GOOD


def test_samples_in_the_folder_that_pyvista_reads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_download_folder", lambda: [tmp_path / "downloads"])
    data = tmp_path / "Data"
    data.mkdir()
    (data / "dragon.ply").touch()
    incomplete = doctor.sample_finding({"PYVISTA_DATA": str(tmp_path)})
    assert incomplete.status is Status.NOTE
    assert incomplete.value.endswith("lacks horse.vtp")
    assert incomplete.advice
    (data / "horse.vtp").touch()
    for folder in (tmp_path, data):
        assert doctor.sample_finding({"PYVISTA_DATA": str(folder)}).status is Status.GOOD
    unset = doctor.sample_finding({})
    assert unset.status is Status.NOTE
    assert unset.value.startswith("not downloaded yet")


def test_downloaded_samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_download_folder", lambda: [tmp_path])
    for name in doctor.SAMPLES:
        (tmp_path / name).touch()
    assert doctor.sample_finding({}) == Finding("Sample meshes", "dragon.ply, horse.vtp")
