"""A session that is killed at any moment loses little, and leaves no torn file."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

LIMIT = 5.0
"""Seconds of work that may be missing."""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="forks")
def test_killed_sessions_are_recovered() -> None:
    command = "tests.apps.sandbox.kills", "--count", "8", "--seconds", "1.5", "--autosave", "0.5"
    root = Path(__file__).parents[3]
    ended = subprocess.run(
        [sys.executable, "-m", *command], capture_output=True, text=True, timeout=120, check=False, cwd=root
    )
    assert ended.returncode == 0, ended.stderr[-2000:]
    assert json.loads(ended.stdout)["missing_s"] < LIMIT
