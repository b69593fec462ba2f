"""Receivers and fades: which objects decals lie on, and how they fade, against float64 brute force."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decals import Contact, Decals, evaluate
from decals.errors import InvalidDecals, InvalidScene
from decals.index import DecalEditor
from decals.receivers import MAX_RECEIVERS
from tests.oracles.decals import colors_at, decals_at
from tests.vectors import random_units, unit

TIE = 1e-4


def mixed(seed: int, count: int = 60, *, layered: bool = True) -> tuple[Decals, np.ndarray, np.ndarray]:
    """Decals of all receivers and fades around a ball, and points on it with tilted normals."""
    rng = np.random.default_rng(seed)
    centres = random_units(rng, count)
    arrays: dict[str, Any] = {
        "positions": centres,
        "normals": centres + 0.3 * rng.normal(size=(count, 3)),
        "tangents": np.cross(centres, rng.normal(size=(count, 3))),
        "radii": rng.uniform(0.2, 0.8, count),
        "spill": rng.random(count) < 0.2,
        "interactions": rng.integers(0, 3, count) if layered else np.ones(count, int),
        "layers": rng.integers(-1, 2, count) if layered else np.zeros(count, int),
        "images": np.full(count, -1),
        "tints": rng.random((count, 3)),
        "opacities": rng.uniform(0.3, 1, count),
        "receivers": [["", "hull", "lid", "lid, hull"][i] for i in rng.integers(0, 4, count)],
        "fade_angles": np.where(rng.random(count) < 0.5, rng.uniform(20, 180, count), 0),
        "fade_depths": np.where(rng.random(count) < 0.5, rng.uniform(0.05, 1, count), 0),
        "single_sheets": rng.random(count) < 0.5,
    }
    points = random_units(rng, 800)
    normals = unit(points + 0.5 * rng.normal(size=points.shape))
    return Decals(**arrays), points.astype(np.float32), normals.astype(np.float32)


def painted(decals: Decals, numbers: np.ndarray) -> np.ndarray:
    tints = decals.tints[numbers].astype(float)
    linear = np.where(tints <= 0.04045, tints / 12.92, ((tints + 0.055) / 1.055) ** 2.4)
    opacity = decals.opacities[numbers, None].astype(float)
    return np.column_stack([linear * opacity, opacity])


@pytest.mark.parametrize("contact", list(Contact))
@pytest.mark.parametrize("labels", [None, "hull", ["lid", "other"], "other"])
def test_decals_act_where_they_may(contact: Contact, labels: Any) -> None:
    for seed, layered in ((1, True), (2, False)):
        decals, points, normals = mixed(seed, layered=layered)
        on = None if labels is None else frozenset([labels] if isinstance(labels, str) else labels)
        expected = decals_at(decals, points, normals, contact=contact.name.lower(), on=on)
        for given_decals in (decals, DecalEditor(decals)):
            seen = evaluate(given_decals, points, normals, contact=contact, on=labels, images=[])
            sure = expected.doubt > TIE
            assert sure.mean() > 0.9
            np.testing.assert_array_equal(seen.owner[sure], expected.owner[sure])
            np.testing.assert_allclose(seen.field[sure], expected.field[sure], atol=1e-3)
        colors = colors_at(
            decals,
            points,
            normals,
            lambda i, uv, decals=decals: painted(decals, i),
            contact=contact.name.lower(),
            on=on,
        )
        assert seen.color is not None
        inside = np.hypot(*(seen.uv - 0.5).T) < 0.499
        close = np.abs(seen.color - colors).max(axis=1) < 2e-3
        assert close[sure & (inside | (seen.owner < 0))].mean() > (0.98 if layered else 0.999)


@settings(max_examples=30)
@given(
    angle=st.floats(1, 180),
    depth=st.one_of(st.just(0.0), st.floats(1e-3, 3)),
    radius=st.floats(1e-3, 1e3),
    spill=st.booleans(),
)
def test_fades_are_monotone(angle: float, depth: float, radius: float, spill: bool) -> None:
    """Opacity falls with the angle and with the depth, from 1 at their halves to 0 at their ends."""
    up: dict[str, Any] = {"positions": [[0, 0, 0]], "normals": [[0, 0, 1]], "tangents": [[1, 0, 0]]}
    decal = Decals(**up, radii=radius, images=[-1], spill=[spill], fade_angles=angle, fade_depths=depth)
    tilts = np.radians(np.linspace(0, 180, 361))
    tilted = np.column_stack([np.sin(tilts), np.zeros(361), np.cos(tilts)])
    by_angle = evaluate(decal, np.zeros((361, 3)), tilted, images=[]).color
    assert by_angle is not None
    assert (np.diff(by_angle[:, 3]) <= 0).all()
    degrees = np.degrees(tilts)
    assert (by_angle[degrees <= 0.49 * angle, 3] == 1).all()
    assert (by_angle[degrees > angle + 0.01, 3] == 0).all()
    heights = radius * np.linspace(0, 0.99, 200)
    points = np.column_stack([np.zeros(200), np.zeros(200), heights])
    by_depth = evaluate(decal, points, [[0, 0, 1]] * 200, images=[]).color
    assert by_depth is not None
    assert (np.diff(by_depth[:, 3]) <= 0).all()
    if depth:
        assert (by_depth[heights >= 1.001 * depth * radius, 3] == 0).all()
        assert (by_depth[heights <= 0.49 * depth * radius, 3] == 1).all()


def test_a_decal_keeps_to_its_sheet() -> None:
    """Parallel plates above and below take nothing of it; its own plate, and a wall that rises, do."""
    up: dict[str, Any] = {"positions": [[0, 0, 0]], "normals": [[0, 0, 1]], "tangents": [[1, 0, 0]]}
    decal = Decals(**up, radii=2.0)
    plates = [[0.5, 0, 0], [0.5, 0, -0.4], [0.5, 0, 0.4], [0.5, 0, 0.2], [1, 0, 0.4], [1, 0, 0.4]]
    normals = [*([[0, 0, 1]] * 4), [-1, 0, 0], [1, 0, 0]]
    assert evaluate(decal, plates, normals).owner.tolist() == [0] * 6
    single = decal.replace(single_sheets=True)
    assert evaluate(single, plates, normals).owner.tolist() == [0, -1, -1, 0, 0, -1]


def test_editors_keep_receivers_and_fades() -> None:
    decals, points, normals = mixed(3)
    editor = DecalEditor(
        decals.replace(receivers=None, fade_angles=None, fade_depths=None, single_sheets=None)
    )
    assert not editor.limited
    version = editor.version
    editor.assign(np.arange(len(decals)), decals)
    assert editor.changed_rows(version)["decal_limits"] == [(0, len(decals))]
    for name in ("receivers", "fade_angles", "fade_depths", "single_sheets"):
        assert np.array_equal(getattr(editor.decals, name), getattr(decals, name))
    twin = editor.copy()
    editor.change(5, receivers=["a much longer name than all the others"])
    assert editor[5].receivers.tolist() == ["a much longer name than all the others"]
    assert twin[5].receivers.tolist() == decals[[5]].receivers.tolist()
    seen = evaluate(twin, points, normals, on="hull").owner
    assert np.array_equal(seen, evaluate(decals, points, normals, on="hull").owner)
    crowded = decals[:MAX_RECEIVERS].replace(receivers=[f"object {i}" for i in range(MAX_RECEIVERS)])
    with pytest.raises(InvalidDecals, match="at most 30 different"):
        twin.assign(np.arange(MAX_RECEIVERS), crowded)
    assert np.array_equal(twin.decals.receivers, decals.receivers)
    assert np.array_equal(evaluate(twin, points, normals, on="hull").owner, seen)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("receivers", 7, "expected one text"),
        ("receivers", [1, 2], "expected texts"),
        ("receivers", ["a"], "one for each of 2"),
        ("receivers", ["a\0", ""], "without commas"),
        ("fade_angles", [0.5, 0], "from 1 to 180"),
        ("fade_angles", 181, "from 1 to 180"),
        ("fade_depths", [-1, 0], "from 1e-06"),
        ("fade_depths", [np.nan, 0], "finite"),
    ],
)
def test_invalid_receivers_and_fades(name: str, value: Any, message: str) -> None:
    arrays: dict[str, Any] = {"positions": np.zeros((2, 3)), "normals": [[0, 0, 1]] * 2}
    with pytest.raises(InvalidDecals, match=message):
        Decals(**arrays, tangents=[[1, 0, 0]] * 2, radii=1.0, **{name: value})


def test_too_many_receivers_and_odd_surfaces_are_refused() -> None:
    count = MAX_RECEIVERS + 1
    arrays: dict[str, Any] = {"positions": np.zeros((count, 3)), "normals": [[0, 0, 1]] * count}
    names = [f"object {number}" for number in range(count)]
    with pytest.raises(InvalidDecals, match="at most 30 different ones, got 31"):
        Decals(**arrays, tangents=[[1, 0, 0]] * count, radii=1.0, receivers=names)
    decals, points, normals = mixed(4)
    with pytest.raises(InvalidScene, match="expected labels"):
        evaluate(decals, points, normals, on=7)
