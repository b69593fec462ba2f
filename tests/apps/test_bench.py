"""``implicit-decals bench table``: its rows, and what it refuses."""

import pytest

from decals.errors import NoGraphics
from decals.render import Renderer
from implicit_decals.apps.cli import BAD_INPUT, run
from implicit_decals.apps.commands.bench import Row, as_table, measure, parse_counts, parse_models
from implicit_decals.apps.errors import UsageError
from implicit_decals.apps.measuring.paper import FIGURE_14


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    try:
        return Renderer()
    except NoGraphics as error:
        pytest.skip(str(error))


def test_rows_hold_what_was_measured(renderer: Renderer) -> None:
    few, many = measure(renderer, "knot", (20, 200), (48, 36))
    assert (few.model, few.decals, many.decals) == ("knot", 20, 200)
    assert 0 < few.nodes < many.nodes
    assert 0 < few.memory < many.memory
    assert 0 < few.build < 10
    assert 0 < few.frame < 10_000
    assert few.paper is None


def test_the_papers_numbers_stand_beside() -> None:
    row = Row("dragon", 1000, 2000, 0.5, 3.25, 200_000)
    assert row.paper == FIGURE_14["dragon", 1000]
    cells = [next(iter(column.cells)) for column in as_table([row], "here").columns]
    assert cells == ["dragon", "1,000", "2,000 (5,753)", "0.500 (0.06)", "3.2 (30)", "195 KB (116 KB)"]


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
