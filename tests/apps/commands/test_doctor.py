"""``implicit-decals doctor``: what it looks at, and what it says."""

import io

import pytest
from rich.console import Console

from decals.apps.commands import doctor
from decals.apps.doctor import software
from decals.apps.doctor.finding import Finding, Status


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
    assert {"Python", "Platform", "Warp devices", "Sample meshes", *software.PACKAGES} <= set(findings)
