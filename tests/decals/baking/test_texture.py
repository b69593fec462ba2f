"""Texels of baked textures against the surface below them, in float64: charts, means, slivers, gutters."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import distance_transform_edt

import decals
from decals.baking.meshes import BakeMesh
from decals.baking.seams import Mixed, match_seams
from decals.baking.texture import Channels, bake_texture
from decals.baking.unwrapped import Unwrapped
from decals.field.evaluate import ColorEvaluator
from decals.field.rules import PictureRules
from tests.decals.baking.glb import Array, ball_and_cube, bilinear, linear, need, read_glb
from tests.decals.baking.seam_steps import seam_steps
from tests.decals.baking.seam_steps import srgb as srgb_levels

SIZE = 64
STEP = 255 / SIZE
"""Colour of one texel's width, of 255."""


def sheet(seed: int, cells: int = 4, smallest: float = 0.2) -> tuple[BakeMesh, Unwrapped]:
    """One triangle in each cell of a grid on the texture; the surface is that texture, 1 wide, in z = 0.4."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0.05, 0.95, (cells**2, 3, 2))
    middles = corners.mean(axis=1, keepdims=True)
    corners = middles + (corners - middles) * rng.uniform(smallest, 1.0, (cells**2, 1, 1))
    corners += np.stack(np.meshgrid(np.arange(cells), np.arange(cells)), axis=-1).reshape(-1, 1, 2)
    places = (corners * (SIZE / cells)).reshape(-1, 2).astype(np.float32)
    faces = np.arange(len(places), dtype=np.int32).reshape(-1, 3)
    points = np.column_stack([places / SIZE, np.full(len(places), 0.4)]).astype(np.float32)
    normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(points), 1))
    mesh = BakeMesh("sheet", points, faces, normals, (1.0, 1.0, 1.0), points, normals)
    return mesh, Unwrapped(np.arange(len(points)), faces, places, np.zeros(len(faces), np.int32))


def color_of(points: Array) -> Array:
    """The light at points of the surface: sRGB levels that rise with x and y."""
    return np.asarray(linear(np.clip(points, 0.0, 1.0)))


def baked(seed: int, samples: int = 1, **options: Any) -> Array:
    mesh, part = sheet(seed, **options)
    channels = Channels(lambda number, points, *_: color_of(points).astype(np.float32))
    return np.asarray(bake_texture([mesh], [part], SIZE, samples, channels, lambda *_: None)[0])


def distances_to_faces(part: Unwrapped, points: Array) -> Array:
    """Distance of points of the texture to the closest triangle, in float64."""
    best = np.full(len(points), np.inf)
    for corners in part.places.astype(float)[part.faces]:
        inside = np.ones(len(points), bool)
        turned = np.sign(np.linalg.det(corners[1:] - corners[0]))
        for begin, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            side, off = end - begin, points - begin
            inside &= turned * (side[0] * off[:, 1] - side[1] * off[:, 0]) >= 0
            share = np.clip(off @ side / (side @ side), 0, 1)
            best = np.minimum(best, np.linalg.norm(off - share[:, None] * side, axis=1))
        best[inside] = 0
    return best


CENTERS = np.stack(np.meshgrid(np.arange(SIZE), np.arange(SIZE)), axis=-1).reshape(-1, 2) + 0.5


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("samples", [1, 3])
def test_texels_of_charts_are_the_surface_at_their_centers(seed: int, samples: int) -> None:
    _, part = sheet(seed)
    texture = baked(seed, samples).reshape(-1, 3).astype(float)
    within = distances_to_faces(part, CENTERS) == 0
    assert within.sum() > 50
    off = np.abs(texture[:, :2] - 255 / SIZE * CENTERS)[within]
    assert off.max() <= (0.51 if samples == 1 else 0.51 + 0.5 * STEP)  # partly covered ones lean inward
    assert (texture[within, 2] == 102).all()


@pytest.mark.parametrize("seed", range(4))
def test_every_texel_that_a_chart_touches_has_a_color_of_its_own(seed: int) -> None:
    """Also triangles far smaller than a texel, and thinner."""
    mesh, part = sheet(seed, cells=8, smallest=0.001)
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet((1, 1, 1), (len(part.faces), 50))
    points = np.einsum("fkc,fcd->fkd", weights, part.places[part.faces].astype(float)).reshape(-1, 2)
    columns, rows = points.astype(int).T
    texture = baked(seed, samples=2, cells=8, smallest=0.001).astype(float)
    off = np.abs(texture[rows, columns, :2] - 255 / SIZE * points).max(axis=1)
    assert off.max() <= 1.5 * STEP  # within a texel, and half a step of rounding
    assert len(mesh.faces) == 64


@pytest.mark.parametrize("seed", range(3))
def test_gutters_repeat_the_nearest_texel_of_a_chart_and_the_rest_is_their_mean(seed: int) -> None:
    _, part = sheet(seed)
    texture = baked(seed)
    # with one sample, texels have a colour of their own if their centre or a border lies in them
    own = distances_to_faces(part, CENTERS).reshape(SIZE, SIZE) == 0
    steps = np.linspace(0, 1, 400)[:, None]
    for corners in part.places.astype(float)[part.faces]:
        for begin, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            columns, rows = (begin + steps * (end - begin)).astype(int).T
            own[rows, columns] = True
    distances, (rows, columns) = distance_transform_edt(~own, return_indices=True)
    gutter = (distances > 0) & (distances <= 3)
    assert gutter.sum() > 100
    same = (texture == texture[rows, columns]).all(axis=2)
    # of several nearest texels any may be repeated; and points of the borders are half a texel apart
    assert same[gutter].mean() > 0.8
    ys, xs = np.nonzero(gutter)
    place = texture[ys, xs, :2] / 255 * SIZE
    assert np.abs(np.hypot(*(place - np.stack([xs, ys], axis=1) - 0.5).T) - distances[ys, xs]).max() < 1.5
    beyond = distances > 6
    assert beyond.any()
    assert len(np.unique(texture[beyond], axis=0)) == 1


def test_colours_alone_are_those_of_evaluate() -> None:
    """With layers, so that several decals lie over each other, and half transparent ones."""
    scene = ball_and_cube()
    count = len(scene.decals)
    rows = scene.decals.replace(layers=np.arange(count) % 3, opacities=0.6)
    rng = np.random.default_rng(8)
    owners = rng.integers(0, count, 2000)
    points = (rows.positions[owners] + rng.normal(0, 0.1, (2000, 3))).astype(np.float32)
    for contact in decals.Contact:
        images = [image.pixels for image in scene.images]
        want = decals.evaluate(rows, points, rows.normals[owners], images=images, contact=contact).color
        assert want is not None
        got = ColorEvaluator(rows, images, PictureRules(contact=contact)).at(points, rows.normals[owners])
        assert np.array_equal(got, want)
        assert (want[:, 3] > 0.61).any()


@pytest.mark.slow_cases("knot", "cube")
@pytest.mark.parametrize("name", ["ball", "cube", "knot"])
def test_both_sides_of_seams_agree_where_the_surface_has_no_step(tmp_path: Path, name: str) -> None:
    need("trimesh", "xatlas")
    if name == "knot":
        knot = pv.ParametricTorus(u_res=40, v_res=20).triangulate().clean()
        scene = decals.cover(knot, count=60, images=["scale", "eye"], seed=2)
    else:
        scene = ball_and_cube()
    decals.bake(scene, tmp_path / "a.glb", size=512)
    nodes = read_glb(tmp_path / "a.glb")
    item = scene.objects[0] if name == "knot" else next(one for one in scene.objects if one.name == name)
    node = nodes[item.name]
    assert isinstance(item, decals.MeshObject)

    def colors_at(points: Array, normals: Array) -> Array:
        over = decals.evaluate(
            scene.decals, points, normals, images=[image.pixels for image in scene.images], on=item
        ).color
        assert over is not None
        return np.asarray(linear(np.asarray(item.color)) * (1 - over[:, 3:]) + over[:, :3])

    steps = seam_steps(node, colors_at)
    assert len(steps) > 500
    assert steps.max() <= 4.0
    assert node.texture is not None
    assert node.texture.std() > 10


def seams(seed: int, count: int = 40) -> tuple[Array, Array]:
    """Places on both sides of straight seams, in one texture, and the texture of noise."""
    rng = np.random.default_rng(seed)
    ends = rng.uniform(4, SIZE - 4, (2, 2, 2))
    share = np.linspace(0, 1, count)[:, None, None]
    return ends[:, 0] * (1 - share) + ends[:, 1] * share, rng.integers(0, 256, (1, SIZE, SIZE, 1))


def match(
    image: Array, places: Array, tiles: Array, smooth: Array, srgb: list[bool], report: Any = lambda _: None
) -> Array:
    """Change the texels of images along seams, and return the numbers of these."""
    mixed = Mixed.of(places, tiles, SIZE)
    texels = image.reshape(-1, len(srgb))
    texels[mixed.texels] = match_seams(texels[mixed.texels], mixed, smooth, srgb, report)
    return mixed.texels


@pytest.mark.parametrize("srgb", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_random_texels_along_a_seam_come_to_agree_and_no_others_change(seed: int, srgb: bool) -> None:
    """Noise is the worst case: black and white texels beside each other, on both sides others."""
    places, before = seams(seed)
    image = before.astype(np.uint8)
    tiles = np.zeros((len(places), 2), np.int64)
    used = match(image, places, tiles, np.ones((len(places), 1), bool), [srgb])
    decode, encode = (linear, srgb_levels) if srgb else (np.asarray, np.asarray)
    levels = []
    for side in (0, 1):
        uv = places[:, side] / SIZE
        uv[:, 1] = 1 - uv[:, 1]
        levels.append(255 * encode(bilinear(decode(image[0] / 255.0), uv)))
    assert np.abs(levels[0] - levels[1]).max() <= 4.0
    changed = (image != before).reshape(-1)
    assert changed.any()
    assert np.isin(np.flatnonzero(changed), used).all()
    assert len(used) < 0.2 * SIZE**2


@pytest.mark.parametrize("wide", [False, True])
def test_seams_at_edges_of_textures_mix_a_texel_twice(wide: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("decals.baking.seam_system.MAX_WIDTH", 0 if wide else 64)
    rng = np.random.default_rng(3)
    along = np.linspace(0.0, SIZE, 10 * SIZE)
    places = np.stack([np.column_stack([np.full_like(along, edge), along]) for edge in (0.0, SIZE)], axis=1)
    smoother = np.sin(np.arange(SIZE)[:, None] / 5.0 + rng.uniform(0, 6, (1, SIZE))) * 60 + 128
    image = smoother.reshape(1, SIZE, SIZE, 1).astype(np.uint8)
    before = image.astype(int)
    match(image, places, np.zeros((len(places), 2), np.int64), np.ones((len(places), 1), bool), [True])
    sides = image[0, :, [0, -1], 0].astype(int)
    assert np.abs(sides[0] - sides[1]).max() <= 4
    assert np.abs(before[0, :, 0, 0] - before[0, :, -1, 0]).max() > 20
    means = before[0, :, [0, -1], 0].mean(axis=0)
    assert np.abs(sides - means).max() < 40  # both sides meet between
    assert np.array_equal(image[0, :, 1:-1, 0], before[0, :, 1:-1, 0])


def test_channels_are_matched_each_by_itself_and_wide_parts_as_narrow_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Parts without common texels, of all channels together, are solved in envelopes or by SuperLU."""
    rng = np.random.default_rng(8)
    before = rng.integers(0, 256, (3, SIZE, SIZE, 3)).astype(np.uint8)
    places = np.concatenate([seams(seed)[0] for seed in range(3)])
    tiles = np.repeat(np.arange(3), len(places) // 3)[:, None] * np.ones(2, np.int64)
    smooth = rng.uniform(size=(len(places), 3)) > 0.1
    srgb = [True, False, True]
    together, alone = before.copy(), before.copy()
    for channel in range(3):
        own = slice(channel, channel + 1)
        image = alone[..., own].copy()
        match(image, places, tiles, smooth[:, own], srgb[own])
        alone[..., own] = image
    match(together, places, tiles, smooth, srgb)
    assert (together != before).any(axis=(1, 2)).all()
    assert np.array_equal(together, alone)
    monkeypatch.setattr("decals.baking.seam_system.MAX_WIDTH", 0)
    match(other := before.copy(), places, tiles, smooth, srgb)
    assert np.array_equal(together, other)


def test_points_at_which_the_surface_has_a_step_keep_it() -> None:
    places, before = seams(1)
    image = before.astype(np.uint8)
    tiles = np.zeros((len(places), 2), np.int64)
    match(image, places, tiles, np.zeros((len(places), 1), bool), [True])
    assert np.array_equal(image, before)


@pytest.mark.parametrize("calls", [1, 2])
def test_a_match_of_seams_can_be_cancelled(calls: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("decals.baking.seams.REPORT_SECONDS", 0.0)
    places, before = seams(3, 50_000)
    image = before.astype(np.uint8)
    tiles = np.zeros((len(places), 2), np.int64)
    shares = []

    def report(share: float) -> None:
        shares.append(share)
        if len(shares) == calls:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        match(image, places, tiles, np.ones((len(places), 1), bool), [True], report)
    assert np.array_equal(image, before)
