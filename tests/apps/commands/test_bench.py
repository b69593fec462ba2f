"""``implicit-decals bench table``: its arguments, its measurements and its table."""

import pytest

from decals.apps.cli import BAD_INPUT, run
from decals.apps.commands.bench import as_table, parse_counts, parse_models
from decals.apps.models import figure_14
from decals.apps.models.figure_14 import PAPER_ROWS, Row, measure
from decals.apps.models.samples import sample
from decals.errors import InvalidInput
from decals.rendering import Renderer
from decals.scenes.objects import SceneObject


def test_lists_are_read() -> None:
    assert parse_counts("100,1000") == [100, 1000]
    assert parse_models("knot,spheres") == ["knot", "spheres"]
    for text in ("", "1,x", "0", "-5", "10000000"):
        with pytest.raises(InvalidInput, match="--counts"):
            parse_counts(text)
    with pytest.raises(InvalidInput, match=r"--models: expected samples .*got 'cow'"):
        parse_models("knot,cow")


def test_the_command_prints_a_table(renderer: Renderer, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["bench", "table", "--size", "32x24", "--counts", "100", "--models", "knot"]
    assert run(arguments) == 0
    shown = capsys.readouterr().out
    assert "knot" in shown
    assert "(897)" in shown
    assert run([*arguments[:2], "--size", "0x1"]) == BAD_INPUT


def test_samples_that_cannot_be_downloaded_are_left_out(
    renderer: Renderer, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the default table goes on without them: a wheel holds no downloaded meshes."""

    def sample_without_network(name: str) -> SceneObject:
        if name in ("dragon", "horse"):
            raise InvalidInput(f"the sample {name!r} is downloaded by pyvista on first use, and that failed")
        return sample(name)

    monkeypatch.setattr(figure_14, "sample", sample_without_network)
    arguments = ["bench", "table", "--size", "32x24", "--counts", "100"]
    assert run(arguments) == 0
    shown = capsys.readouterr()
    assert "(897)" in shown.out
    assert "(921)" in shown.out
    assert "(697)" not in shown.out
    assert shown.err.count("is left out: the sample") == 2
    assert run([*arguments, "--models", "knot,dragon"]) == BAD_INPUT
    assert "'dragon' is downloaded" in capsys.readouterr().err


def test_rows_of_a_measurement(renderer: Renderer) -> None:
    few, many = measure(renderer, "knot", (20, 200), (48, 36))
    assert (few.model, few.decals, many.decals) == ("knot", 20, 200)
    assert 0 < few.cells < many.cells
    assert 0 < few.memory < many.memory
    assert 0 < few.build < 10
    assert 0 < few.frame < 10_000
    assert few.paper is None


def test_the_table_shows_the_papers_numbers() -> None:
    row = Row("dragon", 1000, 2000, 0.5, 3.25, 200_000)
    assert row.paper == PAPER_ROWS["dragon", 1000]
    cells = [next(iter(column.cells)) for column in as_table([row], "here").columns]
    assert cells == ["dragon", "1,000", "2,000 (5,753)", "0.500 (0.06)", "3.2 (30)", "195 KB (116 KB)"]
