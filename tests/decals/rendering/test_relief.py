"""Relief in pictures: parallax, normals and shadows against float64 and against moved triangles."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import decals
from decals import Camera, DecalMaterial, Decals, Scene
from decals.index import DecalEditor
from decals.rendering import Buffers, Light, Lighting, Renderer, RenderOptions
from decals.rendering.options import has_relief
from tests.decals.relief import expected_heights
from tests.decals.rendering.test_edited import EditedScene
from tests.decals.rendering.test_posed import sheet

VIEW = Camera(position=(0.5, -3.0, 2.2), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), fov=38.0)
OPTIONS = RenderOptions(size=(96, 64), samples=1)
UP = np.array([0.0, 0.0, 1.0])

Array = NDArray[Any]


@pytest.fixture(scope="module")
def renderers(fragment: Renderer, compute: Renderer) -> dict[str, Renderer]:
    return {"fragment": fragment, "compute": compute}


def waves(seed: int, *, relief: float) -> DecalMaterial:
    """A material with stripes and smooth heights from 0 to 1."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[-1:1:16j, -1:1:16j]
    heights = 0.5 + 0.5 * np.sin(5 * x + rng.normal()) * np.cos(3 * y + rng.normal())
    colors = 0.6 + 0.3 * np.stack([np.sin(6 * x), np.cos(5 * y), np.sin(4 * (x + y))], axis=-1)
    return DecalMaterial(f"waves {seed}", colors, height=heights, relief=relief)


def hilly(*, layers: int = 1) -> Scene:
    """A square under decals that push each other, with hills and hollows."""
    rng = np.random.default_rng(4)
    places = np.column_stack([rng.uniform(-0.9, 0.9, (14, 2)), np.zeros(14)])
    rows = Decals(
        places,
        np.tile(UP, (14, 1)),
        rng.normal(size=(14, 3)),
        rng.uniform(0.25, 0.4, 14),
        images=rng.integers(0, 2, 14),
        layers=rng.integers(0, layers, 14),
        opacities=rng.uniform(0.7, 1.0, 14),
    )
    images = [waves(1, relief=0.5), waves(2, relief=-0.3)]
    return Scene(objects=[sheet(side=3)], decals=rows, images=images, camera=VIEW)


def slant_of(directions: Array) -> Array:
    """Movement over the square per height; grazing directions are steepened, as in the shader."""
    slants: Array = (directions - directions[:, 2:] * UP) / np.maximum(directions[:, 2:], 0.08)
    return slants


def met_by_rays(scene: Scene, points: Array, *, steps: int = 200) -> tuple[Array, Array]:
    """Follow rays of the camera to the relief in float64; return the points below, and the heights there."""
    away = np.asarray(scene.camera.position) - points
    slant = slant_of(away / np.linalg.norm(away, axis=1, keepdims=True))
    levels = np.linspace(0.2, -0.12, steps)
    above = np.ones(len(points), np.bool_)
    high, low = np.full(len(points), levels[0]), np.full(len(points), levels[-1])
    for level in levels:
        below = above & (
            expected_heights(scene, points + level * slant, np.tile(UP, (len(points), 1))) >= level
        )
        low[below] = level
        above &= ~below
        high[above] = level
    z = 0.5 * (high + low)
    return points + z[:, None] * slant, z


def seen(renderer: Renderer, scene: Scene) -> tuple[Buffers, Array]:
    """The buffers of a picture, and the pixels of the square away from its border."""
    buffers = renderer.buffers(scene, OPTIONS)
    inner = (buffers.object_id == 0) & (np.abs(buffers.position[..., :2]).max(axis=2) < 0.7)
    assert inner.sum() > 700
    return buffers, inner


@pytest.mark.slow_cases("compute-2")
@pytest.mark.parametrize(("backend", "layers"), [("fragment", 1), ("compute", 2)])
def test_rays_meet_the_relief_where_they_do_in_float64(
    renderers: dict[str, Renderer], backend: str, layers: int
) -> None:
    scene = hilly(layers=layers)
    buffers, inner = seen(renderers[backend], scene)
    rows = np.flatnonzero(inner.reshape(-1))[::5]
    points = buffers.position.reshape(-1, 3)[rows].astype(float)
    met, _ = met_by_rays(scene, points)
    expected = decals.evaluate(scene.decals, met, np.tile(UP, (len(met), 1)))
    same = expected.owner == buffers.owner.reshape(-1)[rows]
    off = np.abs(expected.uv - buffers.uv.reshape(-1, 2)[rows]).max(axis=1)[same]
    assert same.mean() > 0.97
    assert np.quantile(off, 0.95) < 4e-3
    flat = decals.evaluate(scene.decals, points, np.tile(UP, (len(met), 1)))
    assert np.quantile(np.abs(flat.uv - expected.uv)[same & (expected.owner >= 0)], 0.7) > 0.04


def test_a_picture_is_that_of_the_displaced_mesh(renderers: dict[str, Renderer]) -> None:
    """Light from the eye casts no shadows that the eye sees."""
    scene, renderer = hilly(), renderers["fragment"]
    lights = Lighting((Light((1, 1, 1), (0, 0, -1), position=VIEW.position),))
    options = RenderOptions(size=OPTIONS.size, samples=2, lights=lights)
    _, inner = seen(renderer, scene)
    moved = decals.displace(scene, edge_length=0.02)
    assert has_relief(scene)
    assert not has_relief(moved)
    flat = scene.replace(
        images=[DecalMaterial("flat", image.pixels, height=np.zeros((16, 16))) for image in scene.images]
    )
    one, other, plain = (renderer.render(shown, options).astype(int)[inner] for shown in (scene, moved, flat))
    assert np.abs(one - other).mean() < 2.0
    assert np.abs(plain - other).mean() > 8.0
    assert plain[:, :3].max(axis=1).min() > 20  # a light at the eye leaves no pixel black


def test_filtered_relief_is_drawn_with_plain_samples_and_a_warning(renderers: dict[str, Renderer]) -> None:
    plain = RenderOptions(size=(24, 16), samples=1)
    drawer = renderers["fragment"]
    with pytest.warns(UserWarning, match="no effect on decals with relief") as warned:
        filtered = drawer.render(hilly(), replace(plain, filtered=True))
    assert [each.filename for each in warned] == [__file__]
    np.testing.assert_array_equal(filtered, drawer.render(hilly(), plain))


def test_the_inside_of_a_surface_is_flat(renderers: dict[str, Renderer]) -> None:
    scene = hilly()
    below = Camera(position=(0.4, -2.0, -3.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), fov=40.0)
    buffers = renderers["fragment"].buffers(scene, OPTIONS, viewpoint=below)
    seen = buffers.owner >= 0
    expected = decals.evaluate(scene.decals, buffers.position[seen], np.tile(UP, (int(seen.sum()), 1)))
    assert (expected.owner == buffers.owner[seen]).mean() > 0.995
    assert np.quantile(np.abs(expected.uv - buffers.uv[seen]), 0.99) < 1e-3


def test_an_edit_draws_all_that_it_changes(renderers: dict[str, Renderer]) -> None:
    """A raised decal hides surface far from it at a grazing angle; lights cast other shadows."""
    scene, renderer = hilly(), renderers["fragment"]
    editor = DecalEditor(scene.decals)
    edited = EditedScene(scene.objects, editor, scene.images, scene.camera)
    renderer.render(edited, OPTIONS)
    editor.change(3, positions=[[0.2, 0.1, 0.0]])
    drawn = renderer.render(edited, OPTIONS)
    whole = renderers["compute"].render(scene.replace(decals=editor.decals), OPTIONS)
    assert (np.abs(drawn.astype(int) - whole).max(axis=2) > 3).mean() < 0.005


@pytest.mark.parametrize(("height", "tilt"), [(0.8, 0.0), (-0.05, 0.6)])
def test_relief_shadows_itself(renderers: dict[str, Renderer], height: float, tilt: float) -> None:
    """Without the light a shadow is as dark as with it; elsewhere it shows where mapped normals face it."""
    renderer = renderers["fragment"]
    x = np.linspace(-1, 1, 48)
    tower = np.clip((0.4 - np.hypot(x, x[:, None])) / 0.08, 0, 1)
    normals = np.tile(0.5 + 0.5 * np.array([tilt, 0, np.sqrt(1 - tilt**2)]), (48, 48, 1))
    white = DecalMaterial(
        "tower", np.ones((48, 48, 3)), height=tower, relief=0.5, occlusion=0.5, normal=normals
    )
    one = Decals([[0.0, 0, 0]], [UP], [[1.0, 0, 0]], [0.8])
    camera = Camera(position=(0.0, -0.01, 4.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=28.0)
    scene = Scene(objects=[sheet(side=3)], decals=one, images=white, camera=camera)
    toward = np.array([1.0, 0.3, height]) / np.linalg.norm([1.0, 0.3, height])
    lit, dark = (
        renderer.render(
            scene,
            RenderOptions(
                size=(64, 64), samples=1, lights=Lighting((Light((k, k, k), tuple((-toward).tolist())),))
            ),
        )[..., :3].astype(int)
        for k in (1.0, 0.0)
    )
    buffers = renderer.buffers(scene, RenderOptions(size=(64, 64)))
    points = buffers.position.reshape(-1, 3).astype(float)
    ground = (np.hypot(*points[:, :2].T) < 0.7) & (np.hypot(*points[:, :2].T) > 0.38)
    slant = slant_of(toward[None])
    rises = np.linspace(0.0, 0.4, 40)
    hidden = np.max(
        [expected_heights(scene, points + r * slant, np.tile(UP, (len(points), 1))) - r for r in rises],
        axis=0,
    )
    change = np.abs(lit - dark).reshape(-1, 3).max(axis=1)
    deep, open_ = ground & (hidden > 0.06), ground & (hidden < 1e-3)
    assert deep.sum() > 60
    assert change[deep].max() <= 3
    assert open_.sum() > 200
    assert np.quantile(change[open_], 0.02) > 60
