"""The file of results: it names every kind, and another result is seen."""

import copy
import json

from blobtree.nodes.kinds import NODE_KINDS
from tests.bench.results import BENCH_MODELS, FILE, differences, pruned_texels, result_of_kind
from tests.blobtree.tree_sets import SETS

KEPT = json.loads(FILE.read_text(encoding="utf-8"))


def test_the_file_names_all_kinds_sets_and_models() -> None:
    assert set(KEPT["kinds"]) == set(NODE_KINDS)
    assert set(KEPT["sets"]) == set(SETS)
    assert set(KEPT["pruned"]) == set(BENCH_MODELS)


def test_results_are_the_same_each_time() -> None:
    assert result_of_kind("point") == result_of_kind("point")
    assert result_of_kind("point") != result_of_kind("segment")


def test_pruned_tapes_are_those_on_file() -> None:
    """No number of a pruned tape depends on the rounding of one processor."""
    name = "lattice, sum"
    assert pruned_texels(BENCH_MODELS[name](), 64) == KEPT["pruned"][name]


def test_another_result_is_seen() -> None:
    other = copy.deepcopy(KEPT)
    other["kinds"]["point"] = "0"
    del other["sets"]["custom"]
    found = differences(KEPT, other)
    assert len(found) == 2
    assert found[0].startswith("kinds, point: ")
    assert differences(KEPT, KEPT) == []
