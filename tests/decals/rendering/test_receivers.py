"""Receivers and fades in pictures: every pixel against the oracle, thin walls from all sides, and edits."""

from typing import Any

import numpy as np
import pytest

from decals import Camera, DecalImage, Decals, MeshObject, Scene
from decals.index import DecalEditor
from decals.rendering import Lighting, Renderer, RenderOptions
from tests.decals.rendering.pictures import WHITE, in_layers, plain_colors, scattered
from tests.decals.shapes import sheet_faces, torus
from tests.oracles.decals import colors_at, decals_at

SIZE = (80, 60)
NAMES = ("hull", "lid")
UNLIT = Lighting(())


def two_tori(*, named_only: bool = False) -> tuple[MeshObject, MeshObject]:
    first, second = torus(), torus(0.8, 0.3, shift=(0.7, 0, 0.5))
    return (
        MeshObject("hull", first.vertices, first.faces, color=(0.2, 0.3, 0.4)),
        MeshObject("top", second.vertices, second.faces, labels=("lid",), named_only=named_only),
    )


def limited(seed: int, *, layered: bool) -> Decals:
    rng = np.random.default_rng(seed)
    decals = Decals.concatenate([scattered(item, 60, seed, radii=(0.1, 0.5)) for item in two_tori()])
    decals = in_layers(decals, seed) if layered else decals
    count = len(decals)
    return decals.replace(
        images=np.full(count, -1),
        tints=rng.random((count, 3)),
        opacities=rng.uniform(0.3, 1, count),
        receivers=[["", "hull", "lid", "top, hull"][i] for i in rng.integers(0, 4, count)],
        fade_angles=np.where(rng.random(count) < 0.5, rng.uniform(20, 180, count), 0),
        fade_depths=np.where(rng.random(count) < 0.5, rng.uniform(0.05, 1, count), 0),
    )


def scene_of(decals: Decals, objects: tuple[MeshObject, ...]) -> Scene:
    points = np.concatenate([item.vertices for item in objects])
    camera = Camera.fitting(points, direction=(0.5, -0.9, 0.8), up=(0, 0, 1))
    return Scene(objects=objects, camera=camera, decals=decals, images=[DecalImage("white", WHITE.pixels)])


@pytest.mark.parametrize("layered", [False, True])
def test_every_pixel_shows_what_its_object_takes(drawer: Renderer, layered: bool) -> None:
    objects = two_tori(named_only=True)
    decals = limited(3, layered=layered)
    scene = scene_of(decals, objects)
    buffers = drawer.buffers(scene, RenderOptions(size=SIZE))
    picture = drawer.render(scene, RenderOptions(size=SIZE, samples=1, lights=UNLIT))
    bare = drawer.render(scene.replace(decals=decals[:0]), RenderOptions(size=SIZE, samples=1, lights=UNLIT))
    named = decals.replace(receivers=np.where(decals.receivers == "", "nothing", decals.receivers))
    for number, (item, taken) in enumerate(zip(objects, (decals, named), strict=True)):
        seen = buffers.object_id == number
        assert seen.sum() > 300
        points, normals = buffers.position[seen], buffers.normal[seen]
        on = frozenset((item.name, *item.labels))
        expected = decals_at(taken, points, normals, on=on)
        sure = expected.doubt > 1e-4
        assert sure.mean() > 0.9
        np.testing.assert_array_equal(buffers.owner[seen][sure], expected.owner[sure])
        assert (expected.owner >= 0).mean() > 0.2
        over = colors_at(taken, points, normals, lambda i, uv, taken=taken: plain_colors(taken, i), on=on)
        below = (bare[seen][:, :3] / 255.0 + 0.055) / 1.055
        light = over[:, :3] + (1 - over[:, 3:]) * np.maximum(below, 0) ** 2.4
        srgb = 255 * (1.055 * np.maximum(light, 0.0031308) ** (1 / 2.4) - 0.055)
        wrong = np.abs(picture[seen][:, :3] - srgb).max(axis=1) > 2
        assert wrong[sure].mean() < 0.01


def test_edits_of_receivers_and_fades_are_drawn(renderer: Renderer) -> None:
    decals = limited(4, layered=True)
    objects = two_tori()
    plain = decals.replace(receivers=None, fade_angles=None, fade_depths=None)

    class Edited:
        def __init__(self) -> None:
            self.objects, self.camera = objects, scene_of(plain, objects).camera
            self.images, self.decals = scene_of(plain, objects).images, DecalEditor(plain)

    edited, options = Edited(), RenderOptions(size=SIZE, samples=1)
    before = renderer.render(edited, options)
    np.testing.assert_array_equal(before, renderer.render(scene_of(plain, objects), options))
    for numbers in (np.arange(5), np.arange(len(decals))):
        edited.decals.assign(numbers, decals[numbers])
        seen = renderer.render(edited, options)
        whole = renderer.render(scene_of(edited.decals.decals, objects), options)
        np.testing.assert_array_equal(seen, whole)
        assert (seen != before).any()
    edited.decals.assign(np.arange(len(plain)), plain)
    np.testing.assert_allclose(renderer.render(edited, options).astype(int), before, atol=1)


def bent_plate(thickness: float, bend: float) -> tuple[MeshObject, MeshObject]:
    """The near sheet and the far sheet of a plate in the plane z = 0, on an arc of a radius 1/bend."""
    u, v = np.meshgrid(np.linspace(-3, 3, 25), np.linspace(-3, 3, 9), indexing="ij")
    faces = sheet_faces(25, 9)
    sheets = []
    for height, order in ((0.0, 1), (-thickness, -1)):
        r = 1 / bend
        angle = u * bend
        x, z = (r + height) * np.sin(angle), (r + height) * np.cos(angle) - r
        vertices = np.stack([x, v, z], -1).reshape(-1, 3)
        sheets.append(MeshObject("near" if order > 0 else "far", vertices, faces[:, ::order]))
    return sheets[0], sheets[1]


@pytest.mark.slow
@pytest.mark.parametrize("way", ["facing rule", "fade", "receivers"])
def test_thin_walls_do_not_leak(renderer: Renderer, way: str) -> None:
    """From 360 sides no pixel of the far sheet of walls 0.01 to 0.5 influence radii thick has an owner."""
    rng = np.random.default_rng(0)
    ways: dict[str, dict[str, Any]] = {
        "facing rule": {},
        "fade": {"spill": [True] * 40, "fade_angles": 120.0},
        "receivers": {"spill": [True] * 40, "receivers": "near"},
    }
    scenes: list[Scene] = []
    for share in np.geomspace(0.01, 0.5, 12):
        near, far = bent_plate(share / 0.454202, (1e-3, 0.2, -0.2)[len(scenes) % 3])
        found = scattered(near, 40, int(rng.integers(99)), radii=(0.9, 1.1)).replace(spill=None, radii=1.0)
        scenes.append(scene_of(found.replace(images=np.full(40, -1), **ways[way]), (near, far)))
    far_pixels = 0
    for degrees in range(360):
        scene = scenes[degrees % 12]
        angle = np.radians(degrees)
        direction = (float(np.cos(angle)), 0.3, float(np.sin(angle)))
        camera = Camera.framing(scene.bounds, direction=direction)
        buffers = renderer.buffers(scene.replace(camera=camera), RenderOptions(size=(32, 24)))
        leaked = (buffers.object_id == 1) & (buffers.owner >= 0)
        far_pixels += int((buffers.object_id == 1).sum())
        assert not leaked.any()
        if 30 < degrees < 150:
            assert (buffers.owner[buffers.object_id == 0] >= 0).mean() > 0.3
    assert far_pixels > 10_000
