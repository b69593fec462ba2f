"""Points of other libraries: they are read without a copy, stay on their device, or get a clear error."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from blobtree.device import start_warp
from decals import evaluate, evaluate_batch
from decals.errors import InvalidDevice, InvalidPoints
from decals.field.points import checked_rows, rows_on
from tests.decals.field.test_batch import IMAGES, places, random_set, same_bits

start_warp()

SET = random_set(1, 30, 1.0, "layered")
OPTIONS: dict[str, Any] = {"images": IMAGES, "jacobian": True, "neighbors": True}
GPU = pytest.mark.gpu


class Foreign:
    """An array of another library, which offers DLPack alone."""

    def __init__(
        self, values: NDArray[Any], device: tuple[int, int] = (1, 0), error: Exception | None = None
    ) -> None:
        self.values, self.device, self.error = values, device, error

    def __dlpack_device__(self) -> tuple[int, int]:
        return self.device

    def __dlpack__(self, **options: Any) -> Any:
        if self.error is not None:
            raise self.error
        return self.values.__dlpack__(**options)


def on_host(values: Any) -> Any:
    """Return results with all arrays of Warp as those of NumPy."""
    if isinstance(values, wp.array):
        return values.numpy()
    if hasattr(values, "__dataclass_fields__"):
        names = values.__dataclass_fields__
        return type(values)(**{name: on_host(getattr(values, name)) for name in names})
    return values


def arrays_of(values: Any) -> list[Any]:
    """Return all arrays in results."""
    if hasattr(values, "__dataclass_fields__"):
        return [array for name in values.__dataclass_fields__ for array in arrays_of(getattr(values, name))]
    return [] if values is None else [values]


def warp_rows(values: NDArray[Any], device: str = "cpu") -> Any:
    return wp.array(values, dtype=wp.vec3, device=device)


def test_the_processor_reads_the_memory_of_arrays() -> None:
    points, normals = places(1, 9)
    found = rows_on("cpu", checked_rows(points, normals))
    assert found.points.ptr == points.ctypes.data
    shared = checked_rows(Foreign(points), Foreign(normals))  # type: ignore[arg-type]
    assert np.shares_memory(shared.points, points)
    assert np.shares_memory(shared.normals, normals)
    own = warp_rows(points)
    assert checked_rows(own, warp_rows(normals)).points.ptr == own.ptr


def test_arrays_with_dlpack_alone_give_the_same() -> None:
    points, normals = places(1, 60)
    expected = evaluate(SET, points, normals, **OPTIONS)
    assert same_bits(evaluate(SET, Foreign(points), Foreign(normals), **OPTIONS), expected)  # type: ignore[arg-type]
    wide = evaluate(SET, Foreign(points.astype(np.float64)), normals, **OPTIONS)  # type: ignore[arg-type]
    assert same_bits(wide, expected)


def test_points_of_warp_stay_arrays_of_warp() -> None:
    points, normals = places(1, 60)
    options = {**OPTIONS, "materials": True}
    found: Any = evaluate(SET, warp_rows(points), warp_rows(normals), **options)
    assert all(isinstance(array, wp.array) for array in arrays_of(found))
    assert (found.owner.dtype, found.uv.dtype, found.color.dtype) == (wp.int32, wp.vec2, wp.vec4)
    assert same_bits(on_host(found), evaluate(SET, points, normals, **options))


def test_results_travel_by_dlpack_without_a_copy() -> None:
    points, normals = places(1, 9)
    for rows in ((points, normals), (warp_rows(points), warp_rows(normals))):
        found: Any = evaluate(SET, *rows, images=IMAGES)
        for array, width in ((found.owner, 9), (found.uv, 18), (found.color, 36)):
            shared = np.from_dlpack(array)
            assert shared.size == width
            assert shared.ctypes.data == (array.ptr if isinstance(array, wp.array) else array.ctypes.data)


def test_rows_may_lie_apart_but_their_numbers_not() -> None:
    points, normals = places(1, 20)
    every_second = warp_rows(points)[::2], warp_rows(normals)[::2]
    found = on_host(evaluate(SET, *every_second))
    assert same_bits(found, evaluate(SET, points[::2], normals[::2]))
    wide: Any = wp.array(np.hstack([points, points]), dtype=wp.float32, device="cpu")
    assert same_bits(on_host(evaluate(SET, wide[:, :3], warp_rows(normals))), evaluate(SET, points, normals))
    with pytest.raises(InvalidPoints, match="points: expected rows of three adjacent numbers on cpu"):
        evaluate(SET, wide[:, ::2], warp_rows(normals))


def test_batches_of_warp_arrays_give_the_loop() -> None:
    sets = [random_set(seed, count, 1.0, "plain") for seed, count in enumerate([20, 0, 5])]
    pairs = [places(seed, count) for seed, count in enumerate([9, 4, 0])]
    lists = [[warp_rows(pair[side]) for pair in pairs] for side in (0, 1)]
    ragged: Any = evaluate_batch(sets, *lists, **OPTIONS)
    assert isinstance(ragged.owner, wp.array)
    for part, pair, samples in zip(sets, pairs, ragged, strict=True):
        assert same_bits(on_host(samples), evaluate(part, *pair, **OPTIONS))
    points, normals = (
        np.stack(arrays) for arrays in zip(*(places(seed, 6) for seed in range(3)), strict=True)
    )
    forms: list[Any] = [
        (warp_rows(points), warp_rows(normals)),
        (wp.array(points, dtype=wp.float32, device="cpu"), wp.array(normals, dtype=wp.float32, device="cpu")),
    ]
    for rows in forms:
        stacked: Any = evaluate_batch(sets, *rows)
        for number, part in enumerate(sets):
            alone = evaluate(part, points[number], normals[number])
            assert same_bits(on_host(stacked[number]), alone)
    shared: Any = evaluate_batch(sets, warp_rows(points[0]), warp_rows(normals[0]), images=IMAGES)
    for part, samples in zip(sets, shared, strict=True):
        assert same_bits(on_host(samples), evaluate(part, points[0], normals[0], images=IMAGES))


def test_chunks_of_warp_arrays_are_joined(monkeypatch: pytest.MonkeyPatch) -> None:
    sets = [random_set(seed, 20, 1.0, "plain") for seed in range(3)]
    rows = [warp_rows(array) for array in places(1, 6)]
    whole: Any = evaluate_batch(sets, *rows, **OPTIONS)
    monkeypatch.setattr("decals.field.batch.MAX_DECALS", 21)
    divided: Any = evaluate_batch(sets, *rows, **OPTIONS)
    assert same_bits(on_host(divided.neighbors), on_host(whole.neighbors))
    assert same_bits(on_host(divided.uv), on_host(whole.uv))


POINTS, NORMALS = places(1, 4)


@pytest.mark.parametrize(
    ("points", "normals", "words"),
    [
        (wp.array(POINTS, dtype=wp.vec3d, device="cpu"), warp_rows(NORMALS), "float32 on cpu, got float64"),
        (
            wp.zeros((4, 2), dtype=wp.float32, device="cpu"),
            warp_rows(NORMALS),
            r"shape \[m, 3\], got \[4, 2\]",
        ),
        (wp.zeros(4, dtype=wp.float32, device="cpu"), warp_rows(NORMALS), r"shape \[m, 3\], got \[4\]"),
        (wp.zeros(4, dtype=wp.int32, device="cpu"), warp_rows(NORMALS), "float32 on cpu, got int32"),
        (warp_rows(POINTS), warp_rows(NORMALS[:3]), "normals: expected one for each of 4 points, got 3"),
        (warp_rows(POINTS), NORMALS, "normals: expected an array on cpu like the points, got one of NumPy"),
        (Foreign(POINTS, (8, 0)), NORMALS, "points: .*device of type 8"),
        (
            Foreign(POINTS, error=BufferError("it requires a gradient")),
            NORMALS,
            "points: .*requires a gradient",
        ),
        (Foreign(POINTS, (2, 99)), NORMALS, "points: expected an array that DLPack can share"),
        (Foreign(POINTS[:, :2]), NORMALS, r"points: expected shape \[m, 3\], got \[4, 2\]"),
    ],
)
def test_arrays_that_do_not_fit_get_one_clear_sentence(points: Any, normals: Any, words: str) -> None:
    with pytest.raises(InvalidPoints, match=words) as caught:
        evaluate(SET, points, normals)
    assert "\n" not in str(caught.value)
    with pytest.raises(InvalidPoints, match=words):
        evaluate_batch([SET], points, normals)


def test_sets_on_several_devices_are_refused() -> None:
    with pytest.raises(InvalidPoints, match=r"points\[1\]: expected an array on cpu .* got one of NumPy"):
        evaluate_batch([SET] * 2, [warp_rows(POINTS), POINTS], [warp_rows(NORMALS), NORMALS])


def test_torch_tensors_are_read_without_a_copy() -> None:
    torch = pytest.importorskip("torch", reason="torch is no dependency of the tests")
    points, normals = torch.from_numpy(POINTS.copy()), torch.from_numpy(NORMALS.copy())
    assert checked_rows(points, normals).points.ctypes.data == points.data_ptr()
    found = evaluate(SET, points, normals)
    assert same_bits(found, evaluate(SET, POINTS, NORMALS))
    assert torch.from_dlpack(found.uv).shape == (4, 2)
    with pytest.raises(InvalidPoints, match=r"points: .*grad"):
        evaluate(SET, points.requires_grad_(), normals)


@GPU
def test_points_on_a_card_stay_there() -> None:
    points, normals = places(1, 200)
    there = [warp_rows(array, "cuda:0") for array in (points, normals)]
    found: Any = evaluate(SET, *there, **OPTIONS)
    assert all(str(array.device) == "cuda:0" for array in arrays_of(found))
    assert same_bits(on_host(found), evaluate(SET, points, normals, device="cuda:0", **OPTIONS))
    batch: Any = evaluate_batch([SET, SET], *there)
    assert str(batch.owner.device) == str(batch[1].uv.device) == "cuda:0"
    with pytest.raises(InvalidDevice, match="device: expected 'cuda:0', where the points lie, got 'cpu'"):
        evaluate(SET, *there, device="cpu")
    with pytest.raises(InvalidPoints, match="normals: expected an array on cuda:0 like the points"):
        evaluate(SET, there[0], normals)


@GPU
@pytest.mark.parametrize("library", ["torch", "cupy"])
def test_arrays_of_other_libraries_stay_on_a_card(library: str) -> None:
    module = pytest.importorskip(library, reason=f"{library} is no dependency of the tests")
    points, normals = places(1, 200)
    there = [module.from_dlpack(warp_rows(array, "cuda:0")) for array in (points, normals)]
    found: Any = evaluate(SET, *there, images=IMAGES)
    assert str(found.color.device) == "cuda:0"
    assert module.from_dlpack(found.color).shape == (200, 4)
    assert same_bits(on_host(found), evaluate(SET, points, normals, images=IMAGES, device="cuda:0"))
    with pytest.raises(InvalidPoints, match="points: expected float32 on cuda:0, got float64"):
        evaluate(SET, module.from_dlpack(wp.array(points, dtype=wp.vec3d, device="cuda:0")), there[1])
