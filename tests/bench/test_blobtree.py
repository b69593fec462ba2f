"""The benchmark's own functions, small: what they claim to measure is what they run."""

import pytest

from blobtree import Sum
from tests.bench.blobtree import blobs, cells_of, cost_of_quality, median_time, mixed, remeshing, surface_of


def test_edits_touch_a_part_and_are_timed_against_a_fresh_mesh() -> None:
    figures = remeshing(resolution=64)
    assert 0.0 < figures["remesh_blocks"] < 0.05
    assert figures["remesh_ms"] > 0.0
    assert figures["remesh_over_fresh"] > 0.0


@pytest.mark.slow
def test_the_cost_of_quality_is_a_ratio_of_times() -> None:
    assert 0.1 < cost_of_quality(resolution=32)["quality_cost"] < 10.0


def test_the_mixed_tree_has_about_as_much_surface_as_the_sum() -> None:
    plain = len(surface_of(Sum(tuple(blobs(1000))), 64).vertices)
    assert 0.7 < len(surface_of(mixed(1000), 64).vertices) / plain < 1.3
    assert len(cells_of(mixed(100), 32).leaves) > 0


def test_the_median_leaves_the_first_run_out() -> None:
    ticks = iter([0.0, 100.0, 0.0, 1.0, 0.0, 3.0, 0.0, 2.0])
    assert median_time(lambda: None, 3, lambda: next(ticks)) == 2.0
