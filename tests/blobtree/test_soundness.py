"""Random trees of all classes of nodes: meshes and rays against dense evaluation."""

import numpy as np
import pytest

from tests.soundness import failures_of, random_tree


@pytest.mark.ordinary_cases("11-4")
@pytest.mark.parametrize(("seed", "count"), [(11, 4), *((seed, 10) for seed in range(8))])
def test_random_trees_of_all_nodes_are_sound(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    trees = [random_tree(rng) for _ in range(count)]
    found = {repr(tree): failures_of(tree, rng) for tree in trees}
    assert {text: failures for text, failures in found.items() if failures} == {}
