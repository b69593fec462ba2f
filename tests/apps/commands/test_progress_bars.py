"""Progress bars show stages, and kernels that are compiled meanwhile."""

import pytest

import blobtree.kernels as kernels
from decals.apps.commands.progress_bars import progress_bars


def test_compilation_has_a_bar_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bars() as progress:
        progress("spreading particles", 0.5)
        kernels._report(2, 3)
        kernels._report(3, 3)
    shown = capsys.readouterr().err
    assert "Spreading particles" in shown
    assert "Compiling kernels for this machine (once): 3 of 3" in shown


def test_nothing_is_said_of_kernels_that_are_ready(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bars() as progress:
        progress("spreading particles", 0.5)
    assert "Compiling" not in capsys.readouterr().err
