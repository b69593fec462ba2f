"""In a terminal each stage has a bar; elsewhere only work that takes long writes lines."""

import pytest

from blobtree.kernels import COMPILING
from blobtree.progress import reporting
from decals.apps.commands.progress_bars import progress_bars


def test_stages_and_compilations_have_bars_in_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TTY_INTERACTIVE", "1")
    with progress_bars() as progress:
        progress("spreading particles", 0.5)
        with reporting() as report:  # as functions do that the command calls
            for done in (1, 2, 3):
                report(f"{COMPILING}: {done} of 3", done / 3)
    shown = capsys.readouterr().err
    assert "Spreading particles" in shown
    last = shown[shown.rindex("Spreading particles") :]
    assert last.count("Compiling kernels for this machine (once): 3 of 3") == 1
    assert "2 of 3" not in last
    assert last.count("100 %") == 2


def test_bars_disappear_after_an_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TTY_INTERACTIVE", "1")

    def interrupted() -> None:
        with progress_bars() as progress:
            progress("spreading particles", 0.5)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert "100 %" not in capsys.readouterr().err


def test_short_work_writes_nothing_to_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bars() as progress:
        progress("spreading particles", 0.5)
    assert capsys.readouterr().err == ""
