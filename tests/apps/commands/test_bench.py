"""``implicit-decals bench table``."""

import pytest

from decals.apps.cli import BAD_INPUT, run
from decals.apps.commands.bench import parse_counts, parse_models
from decals.apps.errors import UsageError
from decals.rendering import Renderer


def test_lists_are_read() -> None:
    assert parse_counts("100,1000") == [100, 1000]
    assert parse_models("knot,spheres") == ["knot", "spheres"]
    for text in ("", "1,x", "0", "-5", "10000000"):
        with pytest.raises(UsageError, match="--counts"):
            parse_counts(text)
    with pytest.raises(UsageError, match=r"--models: expected samples .*got 'cow'"):
        parse_models("knot,cow")


def test_the_command_prints_a_table(renderer: Renderer, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["bench", "table", "--size", "32x24", "--counts", "100", "--models", "knot"]
    assert run(arguments) == 0
    shown = capsys.readouterr().out
    assert "knot" in shown
    assert "(897)" in shown
    assert run([*arguments[:2], "--size", "0x1"]) == BAD_INPUT
