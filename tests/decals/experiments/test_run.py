"""Runs: rows of good and bad trials, in this process and in others; resumed, repeated and refused."""

import errno
import json
import math
import os
import pickle
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

import decals
from blobtree import load
from blobtree.errors import UnusableFile
from blobtree.file_lock import FileLock
from blobtree.files import PREFIX
from decals.apps.experiments.blends import blends
from decals.apps.experiments.pressed_solids import pressed_solids
from decals.errors import Cancelled, InvalidInput
from decals.experiments import Design, Grid, Results, Seeds, report, run
from decals.experiments import store as stores
from decals.experiments.fingerprint import fingerprint
from decals.experiments.values import stored, unpickled
from tests.decals.experiments import functions

DESIGN = Grid(x=[3, 1, 2]) * Seeds(2)


def values(results: Results) -> list[dict[str, Any]]:
    """Parameters and measures of all rows."""
    return [
        {name: row.get(name) for name in (*results.parameters, *results.measures)} for row in results.rows
    ]


@pytest.mark.parametrize("workers", [0, pytest.param(2, marks=pytest.mark.slow)])
def test_each_trial_has_the_row_of_its_call(tmp_path: Path, workers: int) -> None:
    results = run(functions.measured, DESIGN, tmp_path / "out", workers=workers)
    expected = sorted((trial["seed"], trial["x"]) for trial in DESIGN)
    assert values(results) == [{"seed": seed, "x": x, **functions.measured(x, seed)} for seed, x in expected]
    for row in results.rows:
        assert row["status"] == "done"
        assert row["error"] is None
        assert 0 <= row["seconds"] < 60
        found = json.loads(row["provenance"])
        assert found["implicit-decals"] == decals.__version__
        assert found["device"].startswith(("cpu (", "cuda:"))
        assert found.get("commit", "0" * 40).isalnum()
    assert len(list((tmp_path / "out" / "rows").iterdir())) == 1
    assert repr(results) == "Results(measured: 6 rows, 0 failed)"


@pytest.mark.slow
def test_bad_trials_become_rows_and_the_others_go_on(tmp_path: Path) -> None:
    results = run(functions.with_faults, Grid(x=range(9)), tmp_path, workers=2, limit=6, memory=0.5)
    found = {row["x"]: (row["status"], row["error"]) for row in results.rows}
    assert found == {
        0: ("done", None),
        1: ("ended", "ended its process (signal SIGSEGV)"),
        2: ("failed", found[2][1]),
        3: ("ended", "ran past its limit of 6 s"),
        4: ("ended", "ended its process (exit code 3)"),
        5: ("done", None),
        6: ("ended", "used more memory than one worker may; see the option for it"),
        7: ("done", None),
        8: ("done", None),
    }
    assert str(found[2][1]).startswith("ValueError: two is wrong (line ")
    assert np.isnan(next(row["y"] for row in results.rows if row["x"] == 5))
    (all_,) = results.interval("y")
    assert (all_["trials"], all_["left_out"], all_["mean"]) == (3, 6, 5.0)


def test_a_resumed_run_leaves_out_what_has_a_row(tmp_path: Path) -> None:
    function = partial(functions.noted, folder=str(tmp_path))
    function.__qualname__ = "noted"  # type: ignore[attr-defined]
    out = tmp_path / "out"
    run(function, Grid(x=[1, 2]), out, workers=0)
    results = run(function, Grid(x=[1, 2, 3]), out, workers=0)
    assert (tmp_path / "calls").read_text().split() == ["1", "2", "3"]
    assert [row["result"] for row in results.rows] == [1, 2, 3]


def test_equal_trials_run_once(tmp_path: Path) -> None:
    assert len(run(functions.measured, DESIGN + DESIGN, tmp_path, workers=0)) == len(DESIGN)


def defined(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The function `f` of a file with some text."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "of_a_file", raising=False)
    (tmp_path / "of_a_file.py").write_text(text)
    import importlib
    import linecache

    importlib.invalidate_caches()
    linecache.checkcache(str(tmp_path / "of_a_file.py"))
    return importlib.import_module("of_a_file").f


def test_a_changed_function_runs_again_but_not_for_a_comment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    helper = "def helper(x):\n    return x + {}\n\nONE = {}\n\ndef f(x):\n    return helper(x) * ONE\n"
    results = run(
        defined(helper.format(1, 1), tmp_path, monkeypatch), Grid(x=[1, 2]), tmp_path / "out", workers=0
    )
    assert [row["result"] for row in results.rows] == [2, 3]
    started = [row["started"] for row in results.rows]
    commented = "# a comment\n" + helper.format(1, 1).replace("x + 1", "x  +  1  # again")
    results = run(defined(commented, tmp_path, monkeypatch), Grid(x=[1, 2]), tmp_path / "out", workers=0)
    assert [row["started"] for row in results.rows] == started
    table = "TABLE = {'a': %s, 'b': [%s]}\n\ndef f(x):\n    return TABLE['a'](x) + TABLE['b'][0](x)\n"
    kinds = [("lambda x: x", "lambda x: 2 * x"), ("lambda x: 2 * x", "lambda x: x"), ("abs", "lambda x: x")]
    digests = {fingerprint(defined(table % kind, tmp_path, monkeypatch)) for kind in kinds}
    assert len(digests) == 3, "functions in a table count, each at its place"
    for plus, times in ((5, 1), (5, 7)):
        function = defined(helper.format(plus, times), tmp_path, monkeypatch)
        results = run(function, Grid(x=[1, 2]), tmp_path / "out", workers=0)
        assert [row["result"] for row in results.rows] == [(1 + plus) * times, (2 + plus) * times]


def test_functions_of_an_installed_module_count_for_that_of_the_same_module() -> None:
    assert fingerprint(blends) != fingerprint(pressed_solids)
    assert fingerprint(blends) == fingerprint(blends)


def test_functions_of_one_line_are_different_ones() -> None:
    plus, times, again = (lambda x: x + 1), (lambda x: x * 5), (lambda x: x + 1)
    assert fingerprint(plus) == fingerprint(again) != fingerprint(times)
    without_source: dict[str, Any] = {}
    exec("def f(x): return abs(x)\ndef g(x): return len(x)", without_source)
    assert fingerprint(without_source["f"]) != fingerprint(without_source["g"])


def test_failed_trials_run_again_on_request(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = run(functions.with_faults, Grid(x=[0, 2]), tmp_path, workers=0)
    assert [row["x"] for row in first.failed] == [2]
    assert len(run(functions.with_faults, Grid(x=[0, 2]), tmp_path, workers=0).failed) == 1
    ran: list[Any] = []
    run(functions.with_faults, Grid(x=[0, 2]), tmp_path, workers=0, retry=True, on_row=ran.append)
    assert [row["x"] for row in ran] == [2]
    assert len(Results(tmp_path)) == 2


def test_a_trial_that_ended_this_process_has_a_row_after_a_resume(tmp_path: Path) -> None:
    child = os.fork()
    if child == 0:
        run(functions.with_faults, Grid(x=[0, 4, 7]), tmp_path, workers=0)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 3
    assert [row["x"] for row in Results(tmp_path).rows] == [0]
    results = run(functions.with_faults, Grid(x=[0, 4, 7]), tmp_path, workers=0)
    assert [(row["x"], row["status"]) for row in results.rows] == [(0, "done"), (4, "ended"), (7, "done")]


def test_a_cancelled_run_keeps_its_rows(tmp_path: Path) -> None:
    seen: list[Any] = []
    with pytest.raises(Cancelled):
        run(
            functions.measured, DESIGN, tmp_path, workers=0, on_row=seen.append, cancel=lambda: len(seen) == 4
        )
    assert len(Results(tmp_path)) == 4
    assert len(run(functions.measured, DESIGN, tmp_path, workers=0)) == 6


def test_a_cut_line_of_the_journal_is_run_again(tmp_path: Path) -> None:
    expected = values(run(functions.measured, DESIGN, tmp_path / "whole", workers=0))
    run(functions.measured, DESIGN[:2], tmp_path / "cut", workers=0)
    row = Results(tmp_path / "whole").rows[3]
    (tmp_path / "cut" / stores.JOURNAL).write_text(json.dumps(row)[:-7])
    assert len(Results(tmp_path / "cut")) == 2
    assert values(run(functions.measured, DESIGN, tmp_path / "cut", workers=0)) == expected


def test_many_rows_become_shards(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stores, "SHARD_ROWS", 10)
    results = run(functions.measured, Grid(x=range(35)), tmp_path, workers=0)
    assert [row["x2"] for row in results.rows] == [x * x for x in range(35)]
    assert len(list((tmp_path / "rows").iterdir())) == 4
    assert (tmp_path / stores.JOURNAL).read_bytes() == b""


def odd(x: Any) -> Any:
    """Measures of several types and none."""
    return {"m": [1, 'text, with "quotes"', "12", "", True, None, 2.5, [1, "a"]][x]}


def test_rows_are_the_same_without_pyarrow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    design = Grid(x=range(8))
    expected = [odd(x)["m"] for x in range(8)]
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert [row["m"] for row in run(odd, design, tmp_path, workers=0).rows] == expected
    assert [path.suffix for path in (tmp_path / "rows").iterdir()] == [".csv"]


def test_columns_of_numbers_and_texts_are_kept_in_parquet(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    design = Grid(x=range(8))
    expected = [odd(x)["m"] for x in range(8)]
    assert [row["m"] for row in run(odd, design, tmp_path, workers=0).rows] == expected
    assert [path.suffix for path in (tmp_path / "rows").iterdir()] == [".parquet"]


def huge(x: int) -> Any:
    """Measures that float64 and Parquet do not hold."""
    return {"n": [10**400, 1, "\ud800"][x]}


def test_huge_numbers_and_odd_texts_are_kept(tmp_path: Path) -> None:
    results = run(huge, Grid(x=range(3)), tmp_path, workers=0)
    assert [row["n"] for row in results.rows] == [10**400, 1, "\ud800"]
    (all_,) = results.interval("n")
    assert (all_["mean"], all_["trials"], all_["left_out"]) == (1.0, 1, 2)


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_damaged_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str) -> None:
    if suffix == ".csv":
        monkeypatch.setitem(sys.modules, "pyarrow", None)
    run(functions.measured, DESIGN, tmp_path, workers=0)
    (shard,) = (tmp_path / "rows").iterdir()
    assert shard.suffix == suffix
    whole = shard.read_bytes()
    for content in (b"", whole[:-20]) if suffix == ".parquet" else (b"a,b\n1,2\n", b"\xff\xfe" + whole[2:]):
        shard.write_bytes(content)
        with pytest.raises(InvalidInput, match="damaged"):
            print(Results(tmp_path).rows)
    shard.write_bytes(whole)
    for line in ("[]", "{}", "{", '{"trial": 3, "status": "done"}'):
        (tmp_path / stores.JOURNAL).write_text(line + "\n")
        with pytest.raises(InvalidInput, match="damaged"):
            print(Results(tmp_path).rows)
    (tmp_path / stores.JOURNAL).write_text("")
    for about in (
        '{"format": 1}',
        '{"format": "1"}',
        "[]",
        '{"format": 1, "name": 3, "function": "", "parameters": 1}',
    ):
        (tmp_path / stores.EXPERIMENT).write_text(about)
        with pytest.raises(InvalidInput, match="damaged"):
            Results(tmp_path)


def test_files_of_killed_writers_do_no_harm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither a new folder is refused, nor a shard replaced once such a file is gone."""
    monkeypatch.setattr(stores, "SHARD_ROWS", 2)
    (tmp_path / f"{PREFIX}left.json").write_text("")
    (tmp_path / "rows").mkdir()
    left = tmp_path / "rows" / f"{PREFIX}left.parquet"
    left.write_text("half a shard")
    run(functions.measured, Grid(x=[0, 1, 2]), tmp_path, workers=0)
    left.unlink(missing_ok=True)
    assert len(run(functions.measured, Grid(x=range(9)), tmp_path, workers=0)) == 9


def test_a_changed_pickle_is_not_read(tmp_path: Path) -> None:
    path = stored(pickle.dumps([1, 2]), tmp_path)
    assert unpickled(path) == [1, 2]
    unpickled.cache_clear()
    path.write_bytes(pickle.dumps(print))
    with pytest.raises(InvalidInput, match="its content was changed"):
        unpickled(path)


def test_a_function_that_exits_fails_alone(tmp_path: Path) -> None:
    results = run(lambda x: sys.exit(x), Grid(x=[3]), tmp_path, workers=0)
    assert results.rows[0]["error"].startswith("SystemExit: 3")


@pytest.mark.slow
def test_functions_are_parameters_of_workers(tmp_path: Path) -> None:
    pytest.importorskip("cloudpickle")
    results = run(functions.called, Grid(f=[lambda x: x + 1, lambda x: x * 5]), tmp_path / "out", workers=1)
    assert sorted(row["result"] for row in results.rows) == [4, 15]


def test_values_become_files_by_their_content(tmp_path: Path) -> None:
    results = run(functions.files, Grid(x=[1, 2, 3]), tmp_path, workers=0)
    assert results.failed == []
    expected = functions.files(2)
    row = results.rows[1]
    assert decals.load_scene(tmp_path / row["scene"]) == expected["scene"]
    assert pv.read(tmp_path / row["mesh"]).n_points == len(expected["mesh"].vertices)
    assert load(tmp_path / row["tree"]) == expected["tree"]
    np.testing.assert_array_equal(np.load(tmp_path / row["array"]), [0, 1])
    np.testing.assert_array_equal(np.load(tmp_path / row["decals"])["radii"], expected["decals"].radii)
    assert len({row["tree"] for row in results.rows}) == 1, "equal trees are one file"


@pytest.mark.slow
def test_large_parameters_travel_as_files(tmp_path: Path) -> None:
    arrays = [np.full(100_000, value) for value in (1.0, 2.0)]
    results = run(functions.summed, Grid(array=arrays), tmp_path, workers=1)
    assert sorted(row["result"] for row in results.rows) == [1e5, 2e5]
    assert len(list((tmp_path / "values").iterdir())) == 2


def test_values_become_the_types_that_the_function_declares(tmp_path: Path) -> None:
    results = run(functions.measured, Grid(x=[1e2, 2]), tmp_path, workers=0)
    assert [(row["x"], type(row["x"])) for row in results.rows] == [(2, int), (100, int)]


def test_a_dataclass_and_a_number_are_measures(tmp_path: Path) -> None:
    def found(x: int) -> functions.Found:
        return functions.Found(x * x, x**0.5)

    assert run(found, Grid(x=[4]), tmp_path / "a", workers=0).rows[0]["root"] == 2.0
    assert run(lambda x: x, Grid(x=[4]), tmp_path / "b", workers=0).rows[0]["result"] == 4


def test_wrong_measures_fail_alone(tmp_path: Path) -> None:
    wrong = {0: {"x": 1}, 1: {"status": 1}, 2: {"m": object()}, 3: {4: 1}}
    results = run(lambda x: wrong[x], Grid(x=range(4)), tmp_path, workers=0)
    assert [row["status"] for row in results.rows] == ["failed"] * 4
    assert "measure 'x': expected a text that is no parameter" in results.rows[0]["error"]
    assert "measure 'm': expected a number" in results.rows[2]["error"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((functions.measured, Grid(y=[1])), r"the design gives y, but the function takes \(x: int"),
        ((functions.measured, Grid(x=["many"])), "parameter 'x': expected int, got 'many'"),
        (
            (functions.chosen, Grid(kind=["big", "tall"])),
            "parameter 'kind': expected one of 'big', 'small', got",
        ),
        ((functions.measured, [1]), "design: expected a design"),
        ((3, DESIGN), "function: expected a function"),
        ((lambda status: 1, Grid(status=[1])), "parameter 'status': the name of a column"),
        ((functions.summed, Design([{"array": object()}])), "content hash"),
    ],
)
def test_wrong_arguments_are_refused(tmp_path: Path, arguments: Any, words: str) -> None:
    function, design = arguments
    with pytest.raises(InvalidInput, match=words):
        run(function, design, tmp_path / "out", workers=0)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"workers": -1}, "workers: expected a whole number"),
        ({"limit": 0}, "limit: expected seconds above 0"),
        ({"memory": -1}, "memory: expected gigabytes above 0"),
        ({"limit": 5, "workers": 0}, "limit: expected processes"),
        ({"scheduler": "tcp://127.0.0.1:1", "workers": 2}, "workers: expected none beside a scheduler"),
    ],
)
def test_wrong_options_are_refused(tmp_path: Path, options: Any, words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        run(functions.measured, DESIGN, tmp_path / "out", **options)


def test_unpicklable_functions_are_refused(tmp_path: Path) -> None:
    lock = open(tmp_path / "file", "w")  # noqa: PTH123, SIM115 - any object that cannot be pickled
    with lock, pytest.raises(InvalidInput, match="function: expected what other processes can read"):
        run(lambda x: lock.write(str(x)), Grid(x=[1]), tmp_path / "out", workers=1)


def test_folders_of_others_are_refused(tmp_path: Path) -> None:
    run(functions.measured, DESIGN, tmp_path / "one", workers=0)
    with pytest.raises(InvalidInput, match="holds the experiment measured"):
        run(functions.slow, Grid(x=[1]), tmp_path / "one", workers=0)
    (tmp_path / "two").mkdir()
    (tmp_path / "two" / "thesis.txt").write_text("text")
    with pytest.raises(InvalidInput, match=r"expected an empty folder, but it holds thesis\.txt"):
        run(functions.measured, DESIGN, tmp_path / "two", workers=0)
    about = tmp_path / "one" / stores.EXPERIMENT
    about.write_text(about.read_text().replace('"format": 1', '"format": 2'))
    with pytest.raises(InvalidInput, match="newer version"):
        run(functions.measured, DESIGN, tmp_path / "one", workers=0)
    about.write_text("{")
    with pytest.raises(InvalidInput, match="damaged"):
        Results(tmp_path / "one")
    with pytest.raises(InvalidInput, match="folder of an experiment"):
        Results(tmp_path / "two")


def test_two_runs_in_one_folder_are_refused(tmp_path: Path) -> None:
    run(functions.measured, DESIGN[:1], tmp_path, workers=0)
    lock = FileLock.acquire(tmp_path / stores.LOCK)
    assert lock is not None
    with pytest.raises(InvalidInput, match="another run writes into this folder"):
        run(functions.measured, DESIGN, tmp_path, workers=0)
    lock.release()
    assert len(run(functions.measured, DESIGN, tmp_path, workers=0)) == 6


def test_parameters_that_are_not_finite_stay_numbers(tmp_path: Path) -> None:
    choices = [math.nan, 1.0, math.inf, -math.inf, float("nan")]
    results = run(lambda x: float(x > 0), Grid(x=choices), tmp_path, workers=0)
    found = [row["x"] for row in Results(tmp_path).rows]
    assert found[:3] == [-math.inf, 1.0, math.inf]
    assert len(found) == 4
    assert math.isnan(found[3])
    assert [group["trials"] for group in results.interval("result", by="x")] == [1, 1, 1, 1]
    assert results.to_pandas().x.dtype == float
    report(results, tmp_path / "report.html")


def test_what_measure_returns_is_a_result(tmp_path: Path) -> None:
    (row,) = run(functions.summary, Grid(count=[5]), tmp_path, workers=0).rows
    expected = decals.measure(functions.covered(5), samples=1000)
    assert (row["coverage"], row["zero"]) == (expected.coverage, 3.5)
    with np.load(tmp_path / row["decals"]) as found:
        np.testing.assert_array_equal(found["kept"], expected.decals.kept)


def test_a_figure_of_texts_is_refused(tmp_path: Path) -> None:
    results = run(functions.named, Grid(text=["a", "b"]), tmp_path / "out", workers=0)
    with pytest.raises(InvalidInput, match="expected a measure that is a number, got 'path'"):
        report(results, tmp_path / "a.svg", measure="path", by=["text"])


def test_a_full_disk_stops_the_run_and_keeps_its_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows: list[Any] = []

    def write(self: stores.Store, row: Any, kept: Any = stores.Store.add) -> None:
        if len(rows) == 3:
            self._guarded(lambda: (_ for _ in ()).throw(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))))
        kept(self, row)

    with monkeypatch.context() as patch:
        patch.setattr(stores.Store, "add", write)
        with pytest.raises(UnusableFile, match="free space on the disk"):
            run(functions.measured, DESIGN, tmp_path, workers=0, on_row=rows.append)
    assert len(Results(tmp_path)) == 3
    assert len(run(functions.measured, DESIGN, tmp_path, workers=0)) == 6
