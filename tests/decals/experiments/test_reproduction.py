"""Results that are made again in another folder."""

import itertools
import json
import math
from pathlib import Path

import numpy as np

import blobtree
from blobtree import Node, Point
from decals.experiments import Grid, Results, run
from decals.experiments.reproduction import MOST_LINES, reproduce_results
from decals.rendering import Picture

CALLS = itertools.count()


def exact(x: float, name: str | None, many: list[int]) -> dict[str, object]:
    return {
        "root": math.sqrt(x) if x >= 0 else math.nan,
        "name": name,
        "ball": Point((0, 0, 0), radius=x + 3),
    }


def fails(x: float) -> float:
    if x > 1:
        raise RuntimeError("too large")
    return x


def counts(x: int) -> int:
    return next(CALLS)


def drawn(x: int) -> Picture:
    return Picture(np.full((2, 2, 4), x, np.uint8), {"time": next(CALLS)})


def size(tree: Node) -> float:
    return float(blobtree.polygonize(tree, resolution=8).vertices.max())


def test_equal_results(tmp_path: Path) -> None:
    design = Grid(x=[-1.0, 2, 3], name=["a", None], many=[[1, 2], []])
    run(exact, design, tmp_path / "a", workers=0)
    found = reproduce_results(tmp_path / "a", exact, workers=0)
    assert found.equal, found
    run(fails, Grid(x=[1, 2]), tmp_path / "b", workers=0)
    assert reproduce_results(tmp_path / "b", fails, workers=0).equal
    run(drawn, Grid(x=[1, 2]), tmp_path / "c", workers=0)
    assert reproduce_results(tmp_path / "c", drawn, workers=0).equal


def test_differences_are_named(tmp_path: Path) -> None:
    run(counts, Grid(x=range(MOST_LINES + 5)), tmp_path, workers=0)
    found = reproduce_results(tmp_path, counts, workers=0)
    assert found.missing == ()
    assert len(found.differences) == MOST_LINES + 1
    assert found.differences[0].startswith("x = 0: result is ")
    assert found.differences[-1] == "and 5 more"


def test_damaged_provenance_is_left_out(tmp_path: Path) -> None:
    run(fails, Grid(x=[1]), tmp_path, workers=0)
    (row,) = Results(tmp_path).rows
    for shard in (tmp_path / "rows").iterdir():
        shard.unlink()
    for provenance in ("no JSON", "[1]", "3"):
        (tmp_path / "journal.jsonl").write_text(json.dumps(row | {"provenance": provenance}) + "\n")
        found = reproduce_results(tmp_path, fails, workers=0)
        assert found.equal
        assert found.circumstances


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    run(size, Grid(tree=[Point((0, 0, 0), radius=1)]), tmp_path, workers=0)
    assert "digest alone" in reproduce_results(tmp_path).missing[0]
    assert "changed since" in reproduce_results(tmp_path, counts).missing[0]
    assert "parameters of 1 rows" in reproduce_results(tmp_path, size).missing[0]
