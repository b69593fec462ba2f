"""Contact lines and rims against closed forms: circles, bisectors, radical lines, arcs on a sphere."""

import math
from typing import Any

import numpy as np
import pytest

import decals
from blobtree import Point
from decals import LineKind, SurfaceLine
from decals.errors import InvalidScene
from decals.scenes.outlines import chains
from tests.decals.meshes import icosphere
from tests.decals.scenes.test_evenness import flat, scene_of, square
from tests.decals.thin_models import THIN_MODELS

CELLS = ("radial", "elastic")


def of_kind(lines: list[SurfaceLine], kind: LineKind) -> list[SurfaceLine]:
    return [line for line in lines if line.kind is kind]


@pytest.mark.parametrize("contact", ["product", "min", *CELLS])
@pytest.mark.parametrize(("apart", "radii"), [(1.2, (1.0, 1.0)), (1.0, (1.0, 0.5)), (0.7, (0.4, 0.5))])
def test_two_decals_on_a_plane(contact: str, apart: float, radii: tuple[float, float]) -> None:
    """Product: the points of equal ratio |q − p|/r; cells: the radical line; bisectors for equal radii."""
    centers = np.array([[-apart / 2, 0.1, 0], [apart / 2, 0.1, 0]])
    lines = decals.outlines(scene_of(square(4.0), flat(centers, radii)), contact=contact)
    (line,) = of_kind(lines, LineKind.CONTACT)
    assert line.decals in ((0, 1), (1, 0))
    distances = [np.linalg.norm(line.points - center, axis=1) for center in centers]
    if contact in CELLS:
        powers = [d**2 - r**2 for d, r in zip(distances, radii, strict=True)]
        np.testing.assert_allclose(powers[0], powers[1], atol=3e-5)
    else:
        np.testing.assert_allclose(distances[0] / radii[0], distances[1] / radii[1], atol=3e-5)
    along = (apart**2 + radii[0] ** 2 - radii[1] ** 2) / (2 * apart)
    height = math.sqrt(radii[0] ** 2 - along**2)
    ends = line.points[[0, -1]][np.argsort(line.points[[0, -1], 1])]
    corners = [[along - apart / 2, 0.1 - height, 0], [along - apart / 2, 0.1 + height, 0]]
    np.testing.assert_allclose(ends, corners, atol=2e-4)
    rims = of_kind(lines, LineKind.RIM)
    assert [rim.decals for rim in rims] == [(0, -1), (1, -1)]
    for rim, center, radius in zip(rims, centers, radii, strict=True):
        np.testing.assert_allclose(np.linalg.norm(rim.points - center, axis=1), radius, atol=2e-4)
        assert not rim.closed
        np.testing.assert_allclose(np.sort(rim.points[[0, -1], 1]), [row[1] for row in corners], atol=3e-4)


def test_a_rim_alone_is_closed() -> None:
    (rim,) = decals.outlines(scene_of(square(4.0), flat([[0.1, 0, 0]], 0.9)))
    assert rim.closed
    assert rim.length == pytest.approx(1.8 * math.pi, rel=1e-3)
    assert repr(rim) == f"SurfaceLine(rim, decals=(0, -1), {len(rim.points)} points)"
    coarse, fine = (
        decals.outlines(scene_of(square(4.0), flat([[0.1, 0, 0]], 0.9)), step=step)[0] for step in (0.2, 0.02)
    )
    assert len(coarse.points) < len(rim.points) < len(fine.points)
    assert abs(fine.length - 1.8 * math.pi) < abs(coarse.length - 1.8 * math.pi) / 20


def test_upper_layers_have_rims_over_lower_ones() -> None:
    layout = flat([[0, 0, 0], [0.2, 0, 0], [0.9, 0, 0]], [1.0, 0.3, 0.3], layers=[0, 1, 1])
    lines = decals.outlines(scene_of(square(4.0), layout))
    assert {line.kind for line in lines} == {LineKind.RIM}
    assert sorted({line.decals for line in lines}) == [(0, -1), (1, 0), (2, -1), (2, 0)]
    (whole,) = (line for line in lines if line.decals == (1, 0))
    assert whole.closed


@pytest.mark.parametrize("mesh", [False, True])
def test_equal_decals_on_a_ball_meet_on_a_great_circle(mesh: bool) -> None:
    angle, radius = 0.4, 0.6
    normals = np.array([[math.sin(a), 0, math.cos(a)] for a in (angle, -angle)])
    layout = decals.Decals(normals, normals, [[0, 1, 0]] * 2, radius)
    tree = decals.TreeObject("ball", Point((0, 0, 0), radius=1.0))
    item = decals.MeshObject("ball", *icosphere(4)) if mesh else tree
    scene = decals.Scene(objects=[item], camera=decals.Camera((0, 0, 5)), decals=layout, images=["eye"])
    for contact in ("product", "elastic"):
        lines = decals.outlines(scene, contact=contact, mapping="chord")
        (line,) = of_kind(lines, LineKind.CONTACT)
        np.testing.assert_allclose(line.points[:, 0], 0, atol=3e-5)
        off = 3e-3 if mesh else 2e-6
        np.testing.assert_allclose(np.linalg.norm(line.points, axis=1), 1, atol=off)
        half = math.acos((1 - radius**2 / 2) / math.cos(angle))  # from the chord to the angle of the arc
        assert line.length == pytest.approx(2 * half, rel=0.01)
        for rim in of_kind(lines, LineKind.RIM):
            away = np.linalg.norm(rim.points - normals[rim.decals[0]], axis=1)
            np.testing.assert_allclose(away, radius, atol=2e-4)


def test_images_of_the_corrected_mapping_end_along_the_surface() -> None:
    ball = decals.TreeObject("ball", Point((0, 0, 0), radius=1.0))
    disk = decals.Decals([[0, 0, 1]], [[0, 0, 1]], [[1, 0, 0]], 0.8)
    scene = decals.Scene(objects=[ball], camera=decals.Camera((0, 0, 5)), decals=disk, images=["eye"])
    (rim,) = decals.outlines(scene)
    np.testing.assert_allclose(np.arccos(rim.points[:, 2]), 0.8, atol=1e-3)


@pytest.mark.ordinary_cases("elastic-1")
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("contact", ["product", "radial", "elastic"])
def test_lengths_of_random_sets_are_those_of_the_estimate(contact: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    layout = flat(rng.uniform(-1.5, 1.5, (14, 3)) * [1, 1, 0], rng.uniform(0.15, 0.6, 14))
    scene = scene_of(square(4.0), layout)
    lines = decals.outlines(scene, contact=contact)
    found = sum(line.length for line in of_kind(lines, LineKind.CONTACT))
    assert found == pytest.approx(scene.measure(contact=contact, samples=100_000).contact_length, rel=0.05)
    for line in lines:
        assert np.abs(line.points[:, 2]).max() == 0
        steps = np.linalg.norm(np.diff(line.points, axis=0), axis=1)
        assert steps.max() <= 0.06 * layout.radii.max()


@pytest.mark.parametrize("name", ["plate", "leaf"])
def test_lines_of_thin_models_stay_on_their_sides(name: str) -> None:
    """A decal above a thin plate has a rim above it, and none below."""
    mesh = THIN_MODELS[name](0.02)
    up = decals.Decals([[0.3, 0, 0.01]], [[0, 0, 1]], [[1, 0, 0]], 0.2)
    if name == "plate":
        (rim,) = decals.outlines(scene_of(mesh, up))
        np.testing.assert_allclose(rim.points[:, 2], 0.01, atol=1e-6)
    layout = decals.scatter(scene_of(mesh, up).objects[0].surface, count=30, seed=1)
    lines = decals.outlines(scene_of(mesh, layout))
    assert {number for line in lines for number in line.decals} - {-1} <= set(range(30))
    assert all(len(line.points) > 1 for line in lines)


@pytest.mark.slow_cases("3", "4", "5")
@pytest.mark.parametrize("seed", range(6))
def test_lines_end_where_three_labels_meet(seed: int) -> None:
    """A ring of discs: where a contact line meets two rims, the powers of both discs are 0."""
    rng = np.random.default_rng(seed)
    angles = np.arange(5) * 2 * np.pi / 5 + rng.uniform(-0.2, 0.2, 5)
    centers = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1) * rng.uniform(0.45, 0.7, (5, 1))
    layout = flat(centers, rng.uniform(0.45, 0.6, 5))
    found = decals.outlines(scene_of(square(4.0), layout), contact="radial", mapping="chord")
    off = []
    for line in of_kind(found, LineKind.CONTACT):
        first, second = (
            np.linalg.norm(line.points[[0, -1]] - layout.positions[n], axis=1) ** 2 - layout.radii[n] ** 2
            for n in line.decals
        )
        off.extend(np.abs(first - second))
    assert np.median(off) < 1e-5
    assert max(off) < 2e-3


def test_chains_of_segments() -> None:
    found = list(chains([(3, 4), (1, 2), (2, 3), (7, 8), (8, 9), (9, 7), (5, 11), (11, 6), (11, 12)]))
    assert found == [[1, 2, 3, 4], [5, 11], [6, 11], [11, 12], [7, 8, 9, 7]]
    assert list(chains([])) == []


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"scene": 5}, "scene: expected a Scene, got 5"),
        ({"step": 0}, "step: expected a number above 0"),
        ({"step": "fine"}, "step: expected a number above 0"),
        ({"contact": "round"}, "contact: expected one of"),
    ],
)
def test_refuses(wrong: dict[str, Any], says: str) -> None:
    with pytest.raises(InvalidScene, match=says):
        decals.outlines(**{"scene": scene_of(square(4.0), flat([[0, 0, 0]], 1.0))} | wrong)


def test_no_decals_have_no_lines() -> None:
    assert decals.outlines(scene_of(square(4.0), decals.Decals.empty())) == []
