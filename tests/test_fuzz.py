"""A short run of the fuzzer finds nothing; its stages notice what they look for."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests import fuzz

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="the fuzzer forks")


@pytest.mark.slow
def test_the_fuzzer_finds_nothing() -> None:
    figures = fuzz.fuzz(files=600, structured=800, windings=60, calls=2000, commands=400, kills=20, seed=1)
    assert figures["failures"] == {
        **{
            name: {"crashes": [], "hangs": [], "foreign": []}
            for name in ("files", "structured", "windings", "calls", "commands")
        },
        "torn": [],
    }
    assert figures["not_called"] == []


def test_a_stage_reports_crashes_hangs_and_foreign_exceptions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fuzz, "HANG_SECONDS", 0.2)

    def case(number: int) -> None:
        if number == 2:
            os.kill(os.getpid(), 9)
        if number == 4:
            time.sleep(60.0)
        while number == 6:  # works without an end
            pass
        if number == 7:
            time.sleep(0.5)  # as on a busy machine
        if number == 5:
            raise LookupError("of Python")

    def make(_folder: Path) -> Callable[[int], None]:
        return case

    outcome = fuzz.run_stage(make, 8, tmp_path)
    assert outcome.crashes == [2]
    assert outcome.hangs == [4, 6]
    (line,) = outcome.foreign
    assert line.startswith("5: LookupError: of Python")


@pytest.mark.slow
def test_a_torn_file_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a writer that writes to its target at once."""
    monkeypatch.setattr(fuzz, "write_atomically", lambda path, content: path.write_bytes(content))
    assert [line for line in fuzz.torn_files(tmp_path, 8, seed=0) if "bytes.bin" in line]
