"""Decals as data: what is kept, what is repaired, what is refused."""

from typing import Any

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from blobtree import RIM
from decals import Decals, Interaction
from decals.errors import ImplicitDecalsError, InvalidDecals
from decals.model import COLUMNS, LAYER_LIMIT, MAX_COORDINATE, MIN_RADIUS, RECORD


def some(count: int = 5, seed: int = 0, **changes: Any) -> Any:
    rng = np.random.default_rng(seed)
    arrays = {
        "positions": rng.normal(size=(count, 3)),
        "normals": rng.normal(size=(count, 3)),
        "tangents": rng.normal(size=(count, 3)),
        "radii": rng.uniform(0.1, 1.0, count),
        "images": rng.integers(0, 9, count),
        "spill": rng.random(count) < 0.5,
    }
    return Decals(**{**arrays, **changes})


def test_frames_are_orthonormal_and_right_handed() -> None:
    decals = some(200)
    frame = np.stack([decals.tangents, decals.bitangents, decals.normals], axis=1).astype(float)
    assert np.abs(frame @ frame.transpose(0, 2, 1) - np.eye(3)).max() < 5e-7
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=1e-6)


def test_tangent_is_projected_within_the_plane_of_itself_and_the_normal() -> None:
    decals = Decals([[0, 0, 0]], [[0, 0, 2]], [[3, 0, 4]], [1.0])
    assert decals.tangents.tolist() == [[1, 0, 0]]
    assert decals.normals.tolist() == [[0, 0, 1]]


def test_valid_frames_survive_bit_for_bit() -> None:
    decals = some(500)
    again = decals.replace()
    for name in ("positions", "normals", "tangents", "radii", "images", "spill"):
        assert np.array_equal(getattr(again, name), getattr(decals, name))


@settings(max_examples=60)
@given(st.sets(st.sampled_from(COLUMNS)), st.integers(0, 4), st.integers(0, 2**31))
def test_replaced_columns_are_checked_as_those_of_new_decals(names: set[str], count: int, seed: int) -> None:
    """Arrays that stay are not checked again; the result is that of a check of all."""
    before, other = some(count, seed), some(count, seed + 1, receivers="hull", fade_angles=90.0, tints="red")
    rng = np.random.default_rng(seed)
    arrays = {
        name: rng.uniform(0.5, 2.0) * getattr(other, name)
        if name in ("normals", "tangents")
        else getattr(other, name)
        for name in names
    }
    kept = {name: getattr(before, name) for name in COLUMNS}
    expected, replaced = Decals(**{**kept, **arrays}), before.replace(**arrays)
    for name in COLUMNS:
        one, two = getattr(expected, name), getattr(replaced, name)
        assert one.dtype == two.dtype
        assert one.tobytes() == two.tobytes(), name
        assert not two.flags.writeable


def test_replace_takes_another_number_of_decals_with_all_their_columns() -> None:
    more = some(7)
    arrays = {name: getattr(more, name) for name in COLUMNS}
    assert some(5).replace(**arrays) == more
    with pytest.raises(InvalidDecals, match=r"normals: expected shape \[7, 3\], got \[5, 3\]"):
        some(5).replace(positions=more.positions)
    with pytest.raises(InvalidDecals, match=r"radii: expected shape \[5\], got \[7\]"):
        some(5).replace(radii=more.radii)
    with pytest.raises(TypeError, match="radius"):
        some(5).replace(radius=1.0)


def test_arrays_are_float32_copies_that_nobody_can_write() -> None:
    mine = np.ones((1, 3), np.float32)
    decals = Decals(mine, [[0, 0, 1]], [[1, 0, 0]], [1.0])
    mine[:] = 7
    assert decals.positions.tolist() == [[1, 1, 1]]
    assert decals.images.tolist() == [0]
    assert decals.spill.tolist() == [False]
    for name, dtype in (("positions", "f4"), ("radii", "f4"), ("images", "i4"), ("spill", "?")):
        assert getattr(decals, name).dtype == np.dtype(dtype)
        with pytest.raises(ValueError, match="read-only"):
            getattr(decals, name)[:] = 0


def test_influence_puts_the_rim_at_the_radius() -> None:
    decals = some(50)
    assert decals.influence.dtype == np.float32
    assert (1 - (decals.radii.astype(float) / decals.influence) ** 2) ** 3 == pytest.approx(0.5, abs=1e-6)
    assert decals.influence == pytest.approx(decals.radii / RIM)


def test_slices_masks_and_index_arrays() -> None:
    decals = some(6)
    assert np.array_equal(decals[2:4].positions, decals.positions[2:4])
    assert np.array_equal(decals[decals.spill].images, decals.images[decals.spill])
    assert np.array_equal(decals[[4, 0]].radii, decals.radii[[4, 0]])
    assert len(decals[[]]) == 0
    assert np.array_equal(decals[-1].normals, decals.normals[-1:])


def test_rows_are_the_same_bits_and_nobody_can_write_them() -> None:
    decals = some(6)
    for part in (decals[1:4], decals[[4, 0]], Decals.concatenate([decals, decals[:2]])):
        for name in ("positions", "normals", "tangents", "radii", "images", "tints", "opacities"):
            assert not getattr(part, name).flags.writeable, name
    assert decals[[4, 0]].tangents.tobytes() == decals.tangents[[4, 0]].tobytes()
    with pytest.raises(InvalidDecals, match="expected shape"):
        decals[np.zeros((2, 2), int)]


def test_concatenate_keeps_order_and_all_fields() -> None:
    first, second = some(3, 1), some(4, 2)
    both = Decals.concatenate([first, second])
    assert len(both) == 7
    assert np.array_equal(both[:3].tangents, first.tangents)
    assert np.array_equal(both[3:].spill, second.spill)
    assert len(Decals.concatenate([])) == len(Decals.empty()) == 0
    assert Decals.empty().packed().shape == (0, 4)


def test_packed_record() -> None:
    decals = some(3, spill=np.array([False, True, False]))
    record = decals.packed()
    assert record.shape == (3 * RECORD, 4)
    assert record.dtype == np.float32
    assert np.array_equal(record[0::4], np.column_stack([decals.positions, decals.influence]))
    assert np.array_equal(record[1::4, :3], decals.normals)
    rank = 4 * LAYER_LIMIT + 1
    assert record[1::4, 3].tolist() == [rank, rank + 0.5, rank]
    assert np.array_equal(record[2::4], np.column_stack([decals.tangents, decals.images]))
    assert record[3::4].tolist() == [[1, 1, 1, 1]] * 3


@pytest.mark.parametrize("tint", [(1, 0.5, 0.25), [1, 0.5, 0.25], np.array([1, 0.5, 0.25])])
@pytest.mark.parametrize("count", [0, 1, 3])
def test_one_value_stands_for_all(tint: Any, count: int) -> None:
    decals = some(count, tints=tint, images=7, layers=np.int64(-1), interactions=2, spill=True)
    assert decals.tints.tolist() == [[1.0, 0.5, 0.25]] * count
    assert decals.images.tolist() == [7] * count
    assert decals.layers.tolist() == [-1] * count
    assert decals.interactions.tolist() == [2] * count
    assert decals.spill.tolist() == [True] * count


@pytest.mark.parametrize("single", [0.25, np.float32(0.25), np.array(0.25)])
@pytest.mark.parametrize("count", [0, 3])
def test_one_radius_and_one_opacity_stand_for_all(single: Any, count: int) -> None:
    decals = some(count, radii=single, opacities=single)
    assert decals.radii.tolist() == decals.opacities.tolist() == [0.25] * count


def test_ranks_order_layers_first_and_interactions_in_them() -> None:
    layers, kinds = np.repeat([-LAYER_LIMIT, -1, 0, LAYER_LIMIT - 1], 3), np.tile(list(Interaction), 4)
    decals = some(12, layers=layers, interactions=kinds, spill=np.ones(12, bool))
    assert (np.diff(decals.ranks) > 0).all()
    assert decals.packed()[1::4, 3].tolist() == (decals.ranks + 0.5).tolist()


def test_tints_are_packed_as_linear_light() -> None:
    decals = some(2, tints=[[0, 0.5, 1], [0.04, 0.2, 0.9]], opacities=[0.25, 1])
    expected = [[0, 0.21404114, 1, 0.25], [0.0030959752, 0.033104767, 0.7874123, 1]]
    assert decals.packed()[3::4] == pytest.approx(np.array(expected), abs=1e-6)


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("positions", np.zeros((2, 2)), r"shape \[n, 3\], got \[2, 2\]"),
        ("positions", "nonsense", "expected numbers"),
        ("positions", np.full((2, 3), np.nan), "finite"),
        ("positions", np.full((2, 3), -np.inf), "finite"),
        ("positions", np.full((2, 3), 1e20), "rescale"),
        ("normals", np.zeros((3, 3)), r"shape \[2, 3\], got \[3, 3\]"),
        ("normals", [[0, 0, 1], [0, 0, 0]], "zero vector in row 1"),
        ("tangents", [[0, 0, 0], [1, 0, 0]], "zero vector in row 0"),
        ("tangents", [[1, 0, 0], [0, 0, -5]], "along normal .* in row 1"),
        ("radii", [1.0, 0.0], "in row 1"),
        ("radii", [-1.0, 1.0], "in row 0; give positive numbers"),
        ("radii", [1.0, np.nan], "finite"),
        ("radii", [1e-20, 1.0], "got 1e-20"),
        ("radii", [1.0, 1e20], "got 1e[+]20"),
        ("radii", [1.0], "shape"),
        ("radii", 0.0, "in row 0"),
        ("radii", "nonsense", "expected numbers"),
        ("opacities", 1.5, "from 0 to 1"),
        ("images", [0, -2], "got -2 in row 1"),
        ("images", [0, 2**24], "row 1"),
        ("images", [0.5, 1.0], "whole numbers"),
        ("images", [0], "shape"),
        ("spill", [0, 1], "True or False"),
        ("spill", "yes", "expected True or False, got <U3"),
        ("interactions", [0, 3], "got 3 in row 1"),
        ("interactions", [0.0, 1.0], "whole numbers"),
        ("layers", [0, LAYER_LIMIT], "in row 1"),
        ("layers", [-LAYER_LIMIT - 1, 0], "in row 0"),
        ("tints", [[1, 1, 1], [1, 1, 1.1]], "divide .* 255"),
        ("tints", [1, 1], "shape"),
        ("opacities", [-0.1, 1], "from 0 to 1"),
        ("opacities", [np.nan, 1], "finite"),
    ],
)
def test_refuses(name: str, value: Any, says: str) -> None:
    good = {
        "positions": np.zeros((2, 3)),
        "normals": [[0, 0, 1]] * 2,
        "tangents": [[1, 0, 0]] * 2,
        "radii": [1, 1],
    }
    with pytest.raises(InvalidDecals, match=says) as caught:
        Decals(**{**good, name: value})
    assert isinstance(caught.value, ImplicitDecalsError)
    assert isinstance(caught.value, ValueError)
    assert str(caught.value).startswith(name)


def test_limits_are_accepted() -> None:
    radii = [MIN_RADIUS, MAX_COORDINATE]
    decals = Decals([[MAX_COORDINATE] * 3, [-MAX_COORDINATE] * 3], [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, radii)
    assert decals.replace().radii.tolist() == radii


vectors = hnp.arrays(np.float64, (4, 3), elements=st.floats(-1e300, 1e300))


@settings(max_examples=100)
@given(normals=vectors, tangents=vectors)
def test_any_directions_make_an_orthonormal_frame_or_a_clear_error(
    normals: NDArray[Any], tangents: Any
) -> None:
    try:
        decals = Decals(np.zeros((4, 3)), normals, tangents, np.ones(4))
    except InvalidDecals:
        return
    n, u = decals.normals.astype(float), decals.tangents.astype(float)
    assert np.abs((n * n).sum(1) - 1).max() < 3e-6
    assert np.abs((u * u).sum(1) - 1).max() < 3e-6
    assert np.abs((n * u).sum(1)).max() < 3e-6


def test_thousands_of_decals_are_shown_in_one_line() -> None:
    up = np.tile(np.array([0, 0, 1], np.float32), (5000, 1))
    many = Decals(np.zeros((5000, 3)), up, np.roll(up, 1, axis=1), np.linspace(0.1, 0.25, 5000))
    assert repr(many) == "Decals(5000, radii from 0.1 to 0.25)"
    assert repr(Decals.empty()) == "Decals(0)"


def test_interactions_and_tints_by_name() -> None:
    rows = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    decals = Decals(rows, [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, [0.5, 0.5])
    overlap = decals.replace(interactions="Overlap")
    assert overlap.interactions.tolist() == [Interaction.OVERLAP] * 2
    assert overlap.interactions.dtype == np.int32
    mixes: list[Any] = [["push", "INDEPENDENT"], np.array(["push", "independent"]), [1, "independent"]]
    for names in mixes:
        assert decals.replace(interactions=names).interactions.tolist() == [1, 0]
    assert decals.replace(interactions=Interaction.INDEPENDENT).interactions.tolist() == [0, 0]
    with pytest.raises(InvalidDecals, match="interactions: expected one of 'independent', 'push', 'ov"):
        decals.replace(interactions=["push", "pull"])
    np.testing.assert_allclose(decals.replace(tints="red").tints, np.array([[1.0, 0, 0]] * 2))
    mixed = decals.replace(tints=["#336699", "w"]).tints
    np.testing.assert_allclose(mixed, np.array([[0.2, 0.4, 0.6], [1, 1, 1]]), atol=1e-6)
    assert Decals.empty().replace(tints="red", interactions="push").tints.shape == (0, 3)
    with pytest.raises(InvalidDecals, match=r"tints: expected red, .* or a name, got 'reddish'"):
        decals.replace(tints="reddish")


@pytest.mark.parametrize("column", ["images", "layers", "interactions"])
def test_whole_columns_of_another_type_say_how_to_convert_them(column: str) -> None:
    frame = {"positions": [[0, 0, 0]], "normals": [[0, 0, 1]], "tangents": [[1, 0, 0]], "radii": 1.0}
    for values in (np.zeros(1), np.zeros(1, np.float16), np.zeros(1, ">f8"), [0.0], 0.0):
        with pytest.raises(
            InvalidDecals, match=rf"{column}: expected whole numbers, got .*float.* such as 0\.0; "
        ):
            Decals(**frame, **{column: values})  # type: ignore[arg-type]
    for refused in ([True], [0j], np.array(["0"], "S1")):
        with pytest.raises(InvalidDecals, match=f"{column}: expected whole numbers, got .*astype"):
            Decals(**frame, **{column: refused})  # type: ignore[arg-type]
    for kind in (np.int8, np.uint64, ">i8", np.uint16):
        made = Decals(**frame, **{column: np.ones(1, kind)})  # type: ignore[arg-type]
        assert getattr(made, column).tolist() == [1]
