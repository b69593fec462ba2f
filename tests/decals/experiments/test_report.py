"""Reports: one figure, a table of means, and all rows of an experiment."""

import csv
from pathlib import Path

import pytest

from decals.errors import InvalidInput
from decals.experiments import Design, Grid, Results, Seeds, report, run


def grown(count: int, kind: str, seed: int) -> dict[str, float | str]:
    """Measures that are known; `count` has the name that a summary might use too."""
    return {"size": 1000.0 * count if kind == "big" else count + seed, "note": "a, b", "flat": float(count)}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    design = Grid(count=[10, 1000, 20], kind=["big", "small"]) * Seeds(2)
    return run(grown, design, tmp_path_factory.mktemp("report") / "out", workers=0)


def test_means_are_in_rising_order_of_their_parameters(results: Results, tmp_path: Path) -> None:
    report(results, tmp_path / "table.md", measure="size", by=["kind", "count"])
    assert (tmp_path / "table.md").read_text().splitlines() == [
        "| kind | count | size |",
        "| --- | --- | ---: |",
        "| big | 10 | 10,000 |",
        "| big | 20 | 20,000 |",
        "| big | 1,000 | 1,000,000 |",
        "| small | 10 | 10.5 |",
        "| small | 20 | 20.5 |",
        "| small | 1,000 | 1,000 |",
    ]
    assert [group["count"] for group in results.interval("size", by=["count"])] == [10, 20, 1000]


def test_frames_of_polars_and_pandas_are_equal(results: Results) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("polars")
    polars, pandas = results.to_polars(), results.to_pandas()
    assert polars.columns == list(pandas.columns)
    for name in (*results.parameters, *results.measures, "status"):
        assert polars[name].to_list() == pandas[name].tolist()


def test_rows_become_csv_without_times(results: Results, tmp_path: Path) -> None:
    report(results, tmp_path / "rows.csv")
    with (tmp_path / "rows.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert list(rows[0]) == ["count", "kind", "seed", "status", "size", "note", "flat"]
    assert [float(row["size"]) for row in rows] == [row["size"] for row in results.rows]
    assert {row["note"] for row in rows} == {"a, b"}


@pytest.mark.parametrize(("suffix", "begin"), [("svg", b"<?xml"), ("pdf", b"%PDF"), ("png", b"\x89PNG")])
def test_one_figure_has_a_line_for_each_value(
    results: Results, tmp_path: Path, suffix: str, begin: bytes
) -> None:
    pytest.importorskip("matplotlib")
    files = [tmp_path / f"{number}.{suffix}" for number in range(2)]
    for file in files:
        report(results, file, measure="size", by=["count", "kind"])
    assert files[0].read_bytes() == files[1].read_bytes(), "equal results give equal files"
    assert files[0].read_bytes().startswith(begin)
    if suffix == "svg":
        text = files[0].read_text()
        assert all(f"<!-- {name} -->" in text for name in ("big", "small", "kind", "count", "size"))


@pytest.mark.parametrize(
    ("name", "measure", "by", "words"),
    [
        ("figure.svg", None, ["count"], "expected a measure"),
        ("figure.svg", "size", [], "one or two parameters"),
        ("figure.svg", "size", ["count", "kind", "seed"], "one or two parameters"),
        ("figure.svg", "sise", ["count"], "expected one of"),
        ("figure.gif", "size", ["count"], "expected a file that ends in"),
    ],
)
def test_wrong_figures_are_refused(
    results: Results, tmp_path: Path, name: str, measure: str | None, by: list[str], words: str
) -> None:
    pytest.importorskip("matplotlib")
    with pytest.raises(InvalidInput, match=words):
        report(results, tmp_path / name, measure=measure, by=by)
    assert not (tmp_path / name).exists()


def test_a_parameter_with_the_name_of_a_summary_is_refused(tmp_path: Path) -> None:
    found = run(lambda mean: mean, Design([{"mean": 1.0}]), tmp_path / "out", workers=0)
    with pytest.raises(InvalidInput, match="rename it"):
        found.interval("result", by=["mean"])


def test_measures_without_numbers_and_texts_with_bars_are_written(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    found = run(lambda kind: float("nan"), Grid(kind=["a|b", "c"]), tmp_path / "out", workers=0)
    for name in ("page.html", "figure.svg", "table.md"):
        report(found, tmp_path / name, measure="result", by=["kind"])
    assert (tmp_path / "table.md").read_text().splitlines()[2:] == ["| a\\|b | nan |", "| c | nan |"]
