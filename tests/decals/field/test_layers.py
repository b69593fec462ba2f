"""Layers and interactions: who shows, and the colours of any number of decals over each other."""

from typing import Any

import numpy as np
import pytest

from decals import Contact, Decals, Interaction, evaluate
from decals.errors import InvalidImage
from decals.images.texels import decode_srgb
from tests.oracles.contact import RIM
from tests.oracles.decals import colors_at, decals_at
from tests.vectors import random_units, unit

TIE = 1e-4
CUT_ERROR = 1e-4
MODES = list(Contact)


def mixed(
    rng: np.random.Generator,
    count: int,
    *,
    radii: tuple[float, float] = (0.05, 0.4),
    layers: int = 3,
    images: int = 3,
) -> Any:
    """Decals of all kinds on the unit sphere, and points there."""
    positions = random_units(rng, count)
    decals = Decals(
        positions,
        positions,
        rng.normal(size=(count, 3)),
        np.exp(rng.uniform(np.log(radii[0]), np.log(radii[1]), count)),
        images=rng.integers(-1, images, count),
        spill=rng.random(count) < 0.1,
        interactions=rng.integers(0, 3, count),
        layers=rng.integers(-layers, layers, count),
        tints=rng.random((count, 3)),
        opacities=rng.random(count),
    )
    points = np.float32(random_units(rng, 1500))
    return decals, points


IMAGES = [np.full((1, 1, 4), c, np.uint8) for c in ((255, 0, 0, 255), (10, 200, 99, 128), (7, 7, 7, 0))]


def constant(decals: Decals) -> Any:
    """Colours of decals whose images have one colour each."""

    def color_of(numbers: Any, uv: Any) -> Any:
        bytes_ = np.array([image[0, 0] for image in IMAGES] + [(255, 255, 255, 255)]) / 255.0
        srgb = bytes_[decals.images[numbers], :3]
        linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
        alpha = bytes_[decals.images[numbers], 3:] * decals.opacities[numbers, None]
        return np.column_stack([linear * decode_srgb(decals.tints[numbers].astype(float)) * alpha, alpha])

    return color_of


@pytest.mark.slow_cases("2-3")
@pytest.mark.parametrize("contact", MODES)
@pytest.mark.parametrize("seed", range(3))
def test_owner_place_field_and_colour_are_the_oracles(contact: Contact, seed: int) -> None:
    decals, points = mixed(np.random.default_rng(seed), (60, 200, 400)[seed])
    normals = unit(points.astype(float))
    got = evaluate(decals, points, points, contact=contact, images=IMAGES)
    want = decals_at(decals, points, normals, contact=contact.name.lower())
    clear = want.doubt > TIE
    assert clear.mean() > 0.9
    assert np.array_equal(got.owner[clear], want.owner[clear])
    assert np.abs(got.field - want.field)[clear].max() < CUT_ERROR
    assert (np.abs(got.uv - want.uv).max(axis=1) / want.stretch)[clear].max() < CUT_ERROR
    colors = colors_at(decals, points, normals, constant(decals), contact=contact.name.lower())
    off = np.abs(got.color - colors).max(axis=1) > 2e-4
    assert off.mean() < 0.02  # points on the rim of a lower one
    assert len(np.unique(got.owner)) > 30


def frame(count: int) -> Any:
    return {"normals": [[0, 0, 1]] * count, "tangents": [[1, 0, 0]] * count, "radii": [1.0] * count}


UP = [[0.0, 0.0, 1.0]]


def test_the_stack_of_one_layer_is_independent_contact_overlap() -> None:
    kinds = [Interaction.OVERLAP, Interaction.PUSH, Interaction.INDEPENDENT]
    decals = Decals([[0, 0, 0]] * 3, **frame(3), interactions=kinds)
    point = [[0.3, 0, 0]]
    assert evaluate(decals, point, UP).owner.tolist() == [0]
    assert evaluate(decals[1:], point, UP).owner.tolist() == [0]
    under = decals.replace(layers=[-1, 0, 1])
    assert evaluate(under, point, UP).owner.tolist() == [2]


def test_only_contact_decals_of_one_layer_push_each_other() -> None:
    one = evaluate(Decals([[0, 0, 0]], **frame(1)), [[0.3, 0, 0]], UP)
    two = Decals([[0, 0, 0], [1, 0, 0]], **frame(2))
    for contact in MODES:
        pushed = evaluate(two, [[0.3, 0, 0]], UP, contact=contact)
        assert pushed.uv[0, 0] > one.uv[0, 0] + 0.002
        for other in (
            two.replace(layers=[0, 1]),
            two.replace(interactions=[1, 2]),
            two.replace(interactions=[1, 0]),
        ):
            seen = evaluate(other, [[-0.3, 0, 0]], UP, contact=contact)
            assert seen.owner.tolist() == [0]
            assert seen.uv[0, 0] == pytest.approx(0.35, abs=1e-6)


@pytest.mark.parametrize("overlap", [1.5, 2.0])
def test_images_are_stretched_where_three_meet_in_the_papers_mode_alone(overlap: Any) -> None:
    """From a centre of a hexagonal tiling straight to a corner: least image per way, 1 if undeformed."""
    angles = np.radians(np.arange(30, 390, 60))
    around = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(6)])
    radius = overlap * RIM
    decals = Decals(np.vstack([np.zeros(3), around]), **frame(7)).replace(radii=[radius] * 7)
    way = np.linspace(0, 0.577, 1000)
    points = way[:, None] * np.array([1.0, 0, 0])
    least = {}
    for contact in MODES:
        samples = evaluate(decals, points, UP * 1000, contact=contact)
        assert (samples.owner == 0).all()
        rims = 2 * np.linalg.norm(samples.uv - 0.5, axis=1)
        least[contact] = np.diff(rims).min() / (way[1] / radius)
    assert least[Contact.PRODUCT] < 0.05
    assert min(least[Contact.MIN], least[Contact.RADIAL]) > 0.95


def test_overlapping_decals_show_whole() -> None:
    """An eye on a scale: undeformed to its rim, though the scale's field is higher at places."""
    decals = Decals([[0.0, 0, 0], [0.8, 0, 0]], **frame(2), interactions=[1, 2]).replace(radii=[1, 0.5])
    samples = evaluate(decals, [[0.31, 0, 0], [0.29, 0, 0]], UP * 2)
    assert samples.owner.tolist() == [1, 0]
    assert samples.uv[0, 0] == pytest.approx(0.5 - 0.49, abs=1e-5)


def test_ties_go_to_the_higher_number_on_top() -> None:
    decals = Decals([[0, 0, 0]] * 4, **frame(4), interactions=[2] * 4, layers=[0, 1, 1, 0])
    assert evaluate(decals, [[0.1, 0, 0]], UP).owner.tolist() == [2]


@pytest.mark.parametrize("count", [64, 500])
@pytest.mark.parametrize("kind", [Interaction.OVERLAP, Interaction.INDEPENDENT])
def test_any_number_on_one_point(count: int, kind: Any) -> None:
    """Every one of them is in the colour, in order: none fades out before the last."""
    rng = np.random.default_rng(count)
    decals = Decals(
        np.zeros((count, 3)),
        np.tile(UP, (count, 1)),
        rng.normal(size=(count, 3)),
        rng.uniform(0.9, 1.1, count),
        interactions=[kind] * count,
        layers=rng.integers(-20, 20, count),
        images=[-1] * count,
        tints=rng.random((count, 3)),
        opacities=np.full(count, 4 / count),
    )
    points = np.zeros((3, 3))
    points[:, 0] = [0, 0.2, -0.5]
    got = evaluate(decals, points, UP * 3, images=())
    want = colors_at(decals, points, np.tile(UP, (3, 1)), constant(decals))
    assert got.color == pytest.approx(want, abs=1e-4)
    assert (got.color[:, 3] > 0.97).all()


def test_an_image_is_read_upright_and_smoothly() -> None:
    image = np.zeros((2, 2, 4), np.uint8)
    image[..., 3] = 255
    image[0, 1, :3] = 255  # upper right
    decals = Decals([[0, 0, 0]], **frame(1))
    at = [[0.5, 0.5, 0], [-0.5, 0.5, 0], [0.5, -0.5, 0], [0, 0.5, 0]]
    color = evaluate(decals, at, UP * 4, images=[image]).color
    assert color is not None
    assert color[:, 0] == pytest.approx([1, 0, 0, 0.5], abs=1e-5)
    assert color[:, 3] == pytest.approx(1)


def test_one_sheet_needs_no_ranks() -> None:
    """What is left out for scenes of one layer changes nothing."""
    decals, points = mixed(np.random.default_rng(4), 200)
    plain = decals.replace(interactions=np.ones(200, int), layers=np.full(200, 7))
    above = Decals([[9, 9, 9]], **frame(1), layers=[8])
    assert not plain.layered
    assert decals.layered
    assert not Decals.empty().layered
    for contact in MODES:
        one = evaluate(plain, points, points, contact=contact, images=IMAGES)
        other = evaluate(Decals.concatenate([plain, above]), points, points, contact=contact, images=IMAGES)
        for name in ("owner", "uv", "field", "color"):
            assert np.array_equal(getattr(one, name), getattr(other, name))


def test_without_images_no_colour_and_too_few_are_refused() -> None:
    decals = Decals([[0, 0, 0]], **frame(1), images=[2])
    assert evaluate(decals, [[0, 0, 0]], UP).color is None
    with pytest.raises(InvalidImage, match="expected 3 or more, got 1"):
        evaluate(decals, [[0, 0, 0]], UP, images=IMAGES[:1])
    with pytest.raises(InvalidImage, match="expected bytes, or floats from 0 to 1"):
        evaluate(decals, [[0, 0, 0]], UP, images=[np.full((2, 2, 4), 2.0)] * 3)
