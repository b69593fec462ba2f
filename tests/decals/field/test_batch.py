"""`evaluate_batch` equals a loop of `evaluate`, bit for bit, for ragged sets in all modes."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import decals
from decals import Contact, DecalMaterial, Decals, evaluate, evaluate_batch
from decals.errors import InvalidDecals, InvalidDevice, InvalidImage, InvalidPoints, InvalidScene
from decals.field import MaterialSamples, Neighbors, Samples, Walks, batch
from decals.index import DecalBatch, DecalIndex
from decals.index.build import build_index, build_indices, starts_of
from decals.index.index import device_arrays
from tests.decals.meshes import plane

ARRAYS = "owner", "uv", "field", "color", "height", "jacobian"
UP = [[0.0, 0.0, 1.0]]


def same_bits(first: Any, second: Any) -> bool:
    """Return True if two arrays, or what holds arrays, are the same bit for bit."""
    if first is None or second is None:
        return first is second
    if isinstance(first, Samples | Neighbors | MaterialSamples):
        return all(same_bits(getattr(first, name), getattr(second, name)) for name in vars(first))
    of_first, of_second = ((array.dtype, array.shape, array.tobytes()) for array in (first, second))
    return of_first == of_second


def random_set(seed: int, count: int, spread: float, kind: str) -> Decals:
    """Return decals near a wavy square: of equal or unlike sizes, in layers, with limits, or on one point."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-1, 1, (count, 3)) * ([0, 0, 0] if kind == "nested" else [1, 1, 0.1])
    radii = 0.3 * 10.0 ** (spread * rng.uniform(-1, 0.2, count))
    more: dict[str, Any] = {"images": rng.integers(-1, 2, count)}
    if kind == "layered":
        more |= {"layers": rng.integers(-1, 2, count), "interactions": rng.integers(0, 3, count)}
    if kind == "limited":
        more |= {"receivers": [("", "hull", "lid")[code] for code in rng.integers(0, 3, count)]}
        more |= {"fade_angles": rng.choice([0, 60], count), "fade_depths": rng.choice([0.0, 0.5], count)}
    normals = UP + 0.3 * rng.normal(size=(count, 3))
    tangents = np.cross(normals, rng.normal(size=(count, 3)))
    return Decals(positions, normals, tangents, radii, **more)


KINDS = "plain", "layered", "limited", "nested"
SETS = st.lists(
    st.builds(
        random_set,
        st.integers(0, 1000),
        st.sampled_from([0, 1, 2, 30, 200]),
        st.sampled_from([0.0, 1.0, 3.0]),
        st.sampled_from(KINDS),
    ),
    max_size=6,
)


def places(seed: int, count: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return points near the decals with normals; some are not finite, some normals are 0."""
    rng = np.random.default_rng(seed)
    points = (rng.uniform(-1.2, 1.2, (count, 3)) * [1, 1, 0.1]).astype(np.float32)
    normals = (UP + 0.5 * rng.normal(size=(count, 3))).astype(np.float32)
    points[3::50], normals[5::50] = np.nan, 0.0
    points[7::50] = np.inf
    return points, normals


IMAGES = [np.random.default_rng(5).integers(0, 256, (4, 5, 4)).astype(np.uint8)] * 2


@given(SETS, st.integers(0, 100), st.sampled_from(list(Contact)), st.sampled_from(["chord", "corrected"]))
@settings(max_examples=8)
def test_shared_points_give_the_loop(sets: list[Decals], seed: int, contact: Contact, mapping: str) -> None:
    points, normals = places(seed, 80)
    options: dict[str, Any] = {"contact": contact, "mapping": mapping, "images": IMAGES, "on": "hull"}
    found = evaluate_batch(sets, points, normals, **options)
    assert len(found) == len(sets)
    assert found.owner.shape == (80 * len(sets),)
    for part, samples in zip(sets, found, strict=True):
        assert same_bits(samples, evaluate(part, points, normals, **options))


@given(SETS, st.integers(0, 100), st.lists(st.sampled_from([0, 1, 2, 60]), min_size=6, max_size=6))
@settings(max_examples=5)
def test_ragged_points_give_the_loop(sets: list[Decals], seed: int, counts: list[int]) -> None:
    pairs = [places(seed + number, count) for number, count in enumerate(counts[: len(sets)])]
    options: dict[str, Any] = {"jacobian": True, "neighbors": True, "images": IMAGES, "stiffness": 3.0}
    found = evaluate_batch(
        sets, [points for points, _ in pairs], [normals for _, normals in pairs], **options
    )
    assert found.offsets.tolist() == starts_of(counts[: len(sets)]).tolist()
    for part, pair, samples in zip(sets, pairs, found, strict=True):
        assert same_bits(samples, evaluate(part, *pair, **options))


def test_an_array_with_three_axes_has_points_of_each_set() -> None:
    sets = [random_set(seed, 20, 1.0, "plain") for seed in range(3)]
    points, normals = (
        np.stack(arrays) for arrays in zip(*(places(seed, 9) for seed in range(3)), strict=True)
    )
    found = evaluate_batch(sets, points, normals)
    lists = evaluate_batch(sets, points.tolist(), normals.tolist())
    for number, part in enumerate(sets):
        alone = evaluate(part, points[number], normals[number])
        assert same_bits(found[number], alone)
        assert same_bits(lists[number], alone)
    assert same_bits(found[-1], found[2])
    assert len(found[:2]) == 2
    with pytest.raises(IndexError):
        found[3]


def test_materials_reliefs_and_derivatives_of_normals_give_the_loop() -> None:
    rng = np.random.default_rng(3)
    pixels = rng.integers(0, 256, (8, 8, 3)).astype(np.uint8)
    material = DecalMaterial("studs", pixels, pixels, height=pixels, relief=0.5, roughness=0.4)
    sets = [
        random_set(seed, count, 1.0, "layered").replace(images=0) for seed, count in enumerate([40, 0, 7])
    ]
    points, normals = places(1, 50)
    turns = rng.normal(size=(50, 3, 3))
    options: dict[str, Any] = {"images": [material], "materials": True, "jacobian": True}
    found = evaluate_batch(sets, points, normals, normal_derivatives=turns, **options)
    assert found.height is not None
    assert found.materials is not None
    for part, samples in zip(sets, found, strict=True):
        assert same_bits(samples, evaluate(part, points, normals, normal_derivatives=turns, **options))


def test_contact_laws_and_walks_give_the_loop() -> None:
    sets = [random_set(seed, 25, 1.0, "plain") for seed in range(3)]
    points, normals = places(1, 60)
    law = decals.define_contact("gaussian", combine="min")
    for part, samples in zip(sets, evaluate_batch(sets, points, normals, contact=law), strict=True):
        assert same_bits(samples, evaluate(part, points, normals, contact=law))
    surface = plane()
    walks = [Walks.over(part, [surface]) for part in sets]
    found = evaluate_batch(sets, points, normals, mapping="walked", walks=walks)
    for part, walk, samples in zip(sets, walks, found, strict=True):
        assert same_bits(samples, evaluate(part, points, normals, mapping="walked", walks=walk))


def test_chunks_give_the_same_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    sets = [random_set(seed, count, 2.0, "layered") for seed, count in enumerate([5, 0, 30, 12, 1, 40])]
    points, normals = places(1, 33)
    options: dict[str, Any] = {"jacobian": True, "neighbors": True, "images": IMAGES}
    whole = evaluate_batch(sets, points, normals, **options)
    monkeypatch.setattr(batch, "MAX_DECALS", 31)
    divided = evaluate_batch(sets, points, normals, **options)
    monkeypatch.setattr(batch, "MAX_ROWS", 40)
    single = evaluate_batch(sets, points, normals, **options)
    assert all(same_bits(a, b) and same_bits(a, c) for a, b, c in zip(whole, divided, single, strict=True))
    assert same_bits(whole.neighbors, divided.neighbors)
    assert same_bits(whole.color, single.color)


@given(SETS)
@settings(max_examples=8)
def test_indices_are_those_of_each_set_alone(sets: list[Decals]) -> None:
    joined = Decals.concatenate(sets)
    starts = starts_of([len(part) for part in sets])
    centres, reaches, ranks = device_arrays(joined.positions, joined.influence, joined.ranks, "cpu")
    found = build_indices(centres, reaches, ranks, starts)
    ids = found.ids.numpy()
    for number, part in enumerate(sets):
        alone = DecalIndex.of(part)
        levels = found.levels.numpy()[slice(*found.level_starts[number : number + 2])]
        table = found.table.numpy()[slice(*found.table_starts[number : number + 2])]
        assert np.array_equal(levels, alone.levels)
        assert len(table) == len(alone.table)
        assert (found.parities[number], found.floors[number]) == (alone.parity, alone.floor)
        assert lists_of(table, ids) == lists_of(alone.table, alone.ids)


def lists_of(table: NDArray[np.int32], ids: NDArray[np.int32]) -> dict[tuple[int, ...], list[int]]:
    """Return the list of each cell of an index."""
    cells = table[table[:, 0] >= 0].tolist()
    return {(x, y, z): ids[head + 1 : head + 1 + ids[head]].tolist() for x, y, z, head in cells}


def test_sets_that_are_indexed_before_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    sets = [
        random_set(seed, count, 2.0, kind)
        for seed, count, kind in [(0, 5, "plain"), (1, 0, "plain"), (2, 30, "layered"), (3, 40, "limited")]
    ]
    indexed = DecalBatch(sets, "cpu")
    points, normals = places(1, 33)
    for options in (
        {"contact": "radial", "on": "hull", "neighbors": True},
        {"stiffness": 4.0, "images": IMAGES, "jacobian": True},
        {"contact": "min", "mapping": "chord"},
    ):
        given: dict[str, Any] = options
        for _ in range(2):
            found = evaluate_batch(indexed, points, normals, **given)
            for part, samples in zip(sets, found, strict=True):
                assert same_bits(samples, evaluate(part, points, normals, **given))
            monkeypatch.setattr(batch, "MAX_ROWS", 40)
    with pytest.raises(InvalidDevice, match="device: expected"):
        evaluate_batch(indexed, points, normals, device="cuda:99")
    with pytest.raises(InvalidDecals, match=r"sets\[0\]: expected Decals"):
        DecalBatch([3])  # type: ignore[list-item]


def test_no_sets_and_no_points_give_empty_samples() -> None:
    points, normals = places(0, 4)
    assert len(evaluate_batch([], points, normals)) == 0
    assert len(evaluate_batch([], [], [])) == 0
    none = np.zeros((0, 3))
    found = evaluate_batch([Decals.empty(), random_set(1, 3, 0.0, "plain")], none, none, jacobian=True)
    assert len(found) == 2
    assert found.owner.shape == (0,)
    assert found[1].uv.shape == (0, 2)


SET = random_set(1, 3, 0.0, "plain")


@pytest.mark.parametrize(
    ("arguments", "options", "error", "words"),
    [
        ((SET, [[0, 0, 0]], UP), {}, InvalidDecals, "sets: expected several Decals.*evaluate takes one set"),
        (([SET, 3], [[0, 0, 0]], UP), {}, InvalidDecals, r"sets\[1\]: expected Decals"),
        ((3, [[0, 0, 0]], UP), {}, InvalidDecals, "sets: expected several Decals"),
        (([SET], 3.0, UP), {}, InvalidPoints, "points: expected"),
        (([SET], [[0, 0]], UP), {}, InvalidPoints, r"points: expected shape \[m, 3\], got \[1, 2\]"),
        (
            ([SET], [[0, 0, 0]], UP * 2),
            {},
            InvalidPoints,
            "normals: expected one for each of 1 points",
        ),
        (([SET] * 2, [[[0, 0, 0]]] * 3, [UP] * 3), {}, InvalidPoints, "points: .*each of 2 sets.*got 3"),
        (([SET] * 2, [[[0, 0, 0]]] * 2, UP), {}, InvalidPoints, "normals: .*each of 2 sets.*got 1"),
        (([SET] * 2, [[[0, 0, 0]]] * 2, [UP, UP * 2]), {}, InvalidPoints, "normals: expected one for each"),
        (([SET], [["a", 0, 0]], UP), {}, InvalidPoints, "points: expected numbers"),
        (([SET], [[0, 0, 0]], UP), {"contact": "soft"}, InvalidScene, "contact: expected"),
        (([SET], [[0, 0, 0]], UP), {"jacobian": 1}, InvalidScene, "jacobian: expected True or False"),
        (([SET], [[0, 0, 0]], UP), {"mapping": "walked"}, InvalidScene, "walks: expected those of each of 1"),
        (([SET], [[0, 0, 0]], UP), {"images": []}, InvalidImage, "images: expected"),
        (([SET], [[0, 0, 0]], UP), {"device": "cuda:99"}, InvalidDevice, "device: expected"),
        (([SET], [[0, 0, 0]], UP), {"on": 3}, InvalidScene, "on: expected"),
        (
            ([SET], [[0, 0, 0]], UP),
            {"jacobian": True, "normal_derivatives": [[0, 0, 0]]},
            InvalidPoints,
            "normal_derivatives: expected shape",
        ),
    ],
)
def test_errors_say_what_to_do(
    arguments: tuple[Any, ...], options: dict[str, Any], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        evaluate_batch(*arguments, **options)


@pytest.mark.gpu
def test_on_a_card_batches_give_the_loop_to_rounding() -> None:
    sets = [random_set(seed, count, 2.0, "layered") for seed, count in enumerate([5, 0, 30, 12, 1, 40])]
    points, normals = places(1, 200)
    found = evaluate_batch(sets, points, normals, images=IMAGES, device="cuda:0")
    for part, samples in zip(sets, found, strict=True):
        alone = evaluate(part, points, normals, images=IMAGES, device="cuda:0")
        assert (samples.owner != alone.owner).mean() < 0.01
        same = samples.owner == alone.owner
        assert np.allclose(samples.uv[same], alone.uv[same], atol=1e-4)


def test_one_index_is_a_batch_of_one() -> None:
    part = random_set(3, 100, 2.0, "layered")
    arrays = device_arrays(part.positions, part.influence, part.ranks, "cpu")
    single = build_index(*arrays)
    alone = DecalIndex.of(part)
    assert np.array_equal(single.table.numpy(), alone.table)
    assert np.array_equal(single.ids.numpy(), alone.ids)
