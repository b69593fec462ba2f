"""The rows of figure 14."""

from decals.apps.figure_14 import PAPER_ROWS, Row, as_table, measure
from decals.rendering import Renderer


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
