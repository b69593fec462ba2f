"""Numbers of bare places: as all pairs of samples give them, in the memory of the samples."""

import threading

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from decals.scattering import bare_places
from decals.scattering.bare_places import LINK, places_of
from decals.scattering.domain import OrientedPoints
from decals.surfaces import surface
from tests.endurance import resident_megabytes


def spots(seed: int) -> tuple[OrientedPoints, float]:
    """Return samples of round spots on a ball, and their mean distance; heaps and walls are among them."""
    rng = np.random.default_rng(seed)
    middles = rng.normal(size=(rng.integers(1, 12), 3))
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    points = np.concatenate(
        [middle + rng.uniform(0.05, 0.4) * rng.normal(size=(300, 3)) for middle in middles]
    )
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    heap = np.repeat(points[:2], 50, axis=0) + 1e-7 * rng.normal(size=(100, 3))
    outside = np.concatenate([points, heap])
    normals = np.concatenate([outside, -outside]).astype(np.float32)
    both = np.concatenate([outside, 0.999 * outside]).astype(np.float32)
    return OrientedPoints(both, normals, np.zeros(len(both), np.int32)), rng.uniform(0.02, 0.08)


def places_by_all_pairs(samples: OrientedPoints, distance: float) -> int:
    pairs = cKDTree(samples.positions).query_pairs(LINK * distance, output_type="ndarray")
    first, second = pairs[(samples.normals[pairs[:, 0]] * samples.normals[pairs[:, 1]]).sum(axis=1) > 0].T
    shape = (len(samples), len(samples))
    links = coo_array((np.ones(len(first), np.bool_), (first, second)), shape=shape)
    return int(connected_components(links, directed=False, return_labels=False))


@pytest.mark.parametrize("rows", [50, 700, 100_000])
def test_places_are_those_of_all_pairs(rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(surface, "ROW_BLOCK", rows)
    counts = set[int]()
    for seed in range(3 if rows == 50 else 8):
        samples, distance = spots(seed)
        counts.add(places_of(samples, distance))
        assert places_of(samples, distance) == places_by_all_pairs(samples, distance)
    assert len(counts) > 1
    assert places_of(OrientedPoints.empty(), 1.0) == 0


def test_many_samples_in_one_place_take_little_memory() -> None:
    count = 200_000  # twenty thousand million pairs
    positions = np.zeros((count, 3), np.float32)
    positions[: count // 2] = (1, 0, 0)
    positions += np.random.default_rng(0).normal(0.0, 1e-6, (count, 3)).astype(np.float32)
    normals = np.full((count, 3), (0, 0, 1), np.float32)
    samples = OrientedPoints(positions, normals, np.zeros(count, np.int32))
    before, most, ended = resident_megabytes(), [0.0], threading.Event()

    def watch() -> None:
        while not ended.wait(0.002):
            most[0] = max(most[0], resident_megabytes())

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        assert places_of(samples, 0.01) == 2
    finally:
        ended.set()
        thread.join()
    assert most[0] - before < 200.0
    assert bare_places.MAX_HEAP < 100
