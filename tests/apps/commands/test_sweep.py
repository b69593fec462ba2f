"""``implicit-decals sweep`` and ``report``: an experiment from a file, its table and its page."""

from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from decals.apps.cli import run
from decals.apps.commands.sweep import _Table
from decals.experiments import Results

FILE = """
from decals.experiments import Grid

design = Grid(x=[1, 2, 3])

def experiment(x: int):
    if x == 2:
        raise ValueError("two")
    return {"square": x * x}
"""


@pytest.mark.parametrize("workers", ["0", pytest.param("1", marks=pytest.mark.slow)])
def test_a_file_is_swept_and_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, workers: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("squares.py").write_text(FILE)
    assert run(["sweep", "squares.py", "--out", "out", "--workers", workers]) == 1
    assert "Results(experiment: 3 rows, 1 failed)" in capsys.readouterr().out
    assert [row.get("square") for row in Results("out").rows] == [1, None, 9]
    assert run(["report", "out", "-o", "page.html"]) == 0
    assert "ValueError: two" in Path("page.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["sweep", "empty.py"], "expected a function `experiment` and a design `design`"),
        (["sweep", "none.py"], "found no file"),
        (["report", "empty"], "expected the folder of an experiment"),
        (["report", "empty", "-o", "page.txt"], "expected an output file that ends in .html"),
    ],
)
def test_wrong_files_are_refused(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty.py").write_text("")
    Path("empty").mkdir()
    assert run(arguments) == 2
    assert words in " ".join(capsys.readouterr().err.split())


def test_the_table_shows_texts_as_they_are_in_one_line_each() -> None:
    table = _Table()
    for x, error in enumerate([None, "ValueError: [bold] " + "long " * 40]):
        table.add({"x": x, "status": "failed" if error else "done", "error": error, "seconds": 0.5})
    table.advance("running trials", 0.5)
    text = Console(width=60, file=StringIO(), record=True)
    text.print(table)
    lines = text.export_text().splitlines()
    assert len(lines) == 4
    assert "[bold] long" in lines[2]
    assert "1 done, 1 failed, 50%" in lines[3]
    table.advance("running trials", 1.0)
    text.print(table)
    assert text.export_text().splitlines()[-1].strip() == "1 done, 1 failed"
