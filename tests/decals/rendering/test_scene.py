"""Whole scenes: meshes and BlobTrees in one picture, with decals over all of them."""

from typing import Any

import numpy as np
import pytest

import decals
from blobtree import Point, Segment, polygonize
from blobtree.tracing.trace import trace
from decals import Camera, DecalImage, Decals, ImageMapping, MeshObject, Scene, TreeObject, scatter
from decals.errors import InvalidScene
from decals.rendering import STUDIO, TRANSPARENT, Context, Projection, Renderer, RenderOptions
from decals.rendering import viewpoint as tile
from decals.scenes.objects import SceneObject
from tests.decals.rendering.pictures import compare
from tests.decals.shapes import torus
from tests.oracles.pixels import middle_rays
from tests.oracles.raster import edges

SIZE = (96, 72)
TREE = Segment((-0.8, 0, 0), (0.5, 0, 0), radius=0.4, color=(0.8, 0.2, 0.1)) + Point(
    (0.7, 0.3, 0.2), radius=0.45
)
WHITE = DecalImage("white", np.full((4, 4, 4), 255, np.uint8))


def framed(*objects: SceneObject, decals: Decals | None = None) -> Scene:
    scene = Scene(objects=objects, camera=Camera((0, 0, 1)), images=(WHITE,))
    camera = Camera.framing(scene.bounds, direction=(0.4, -0.9, 0.7), up=(0, 0, 1))
    return scene.replace(camera=camera, decals=decals)


@pytest.fixture(scope="module")
def both() -> Scene:
    """A BlobTree and a mesh that touch."""
    ring = torus(0.7, 0.3, shift=(0.2, -0.4, -0.4))
    objects = TreeObject("blob", TREE), MeshObject("ring", ring.vertices, ring.faces)
    return framed(*objects, decals=scatter([item.surface for item in objects], count=120, seed=3))


def test_a_tree_lies_where_its_rays_hit(renderer: Renderer) -> None:
    scene = framed(TreeObject("blob", TREE))
    buffers = renderer.buffers(scene, RenderOptions(size=SIZE))
    width, height = SIZE
    origin, directions = middle_rays(scene.camera, SIZE)
    distance = trace(TREE, np.broadcast_to(origin, directions.shape), directions).reshape(height, width)
    hit = np.isfinite(distance)
    sure = ~edges(hit)
    np.testing.assert_array_equal((buffers.object_id == 0)[sure], hit[sure])
    seen = hit & sure
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    expected = origin + distance[..., None] * unit.reshape(height, width, 3)
    np.testing.assert_allclose(buffers.position[seen], expected[seen], atol=2e-4)
    assert np.abs(TREE(buffers.position[seen]) - 0.5).max() < 1e-3
    gradient = TREE.gradient(buffers.position[seen])
    normal = -gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
    np.testing.assert_allclose(buffers.normal[seen], normal, atol=1e-4)


def test_decals_over_both_kinds_is_the_oracles(renderer: Renderer, both: Scene) -> None:
    buffers = renderer.buffers(both, RenderOptions(size=(320, 240)))
    assert set(np.unique(buffers.object_id)) == {-1, 0, 1}
    assert compare(both, buffers, ImageMapping.CORRECTED).mean() > 0.99
    spans = [set(buffers.owner[buffers.object_id == number]) - {-1} for number in (0, 1)]
    assert spans[0] & spans[1], "some decal lies on both objects"


def test_nearer_objects_hide_farther_ones(renderer: Renderer, both: Scene) -> None:
    """Alone or together, a pixel shows the object that is nearer."""
    alone = [
        renderer.buffers(both.replace(objects=[item]), RenderOptions(size=SIZE)) for item in both.objects
    ]
    eye = np.array(both.camera.position)
    depth = [np.where(b.object_id == 0, np.linalg.norm(b.position - eye, axis=-1), np.inf) for b in alone]
    together = renderer.buffers(both, RenderOptions(size=SIZE)).object_id
    expected = np.where(np.isinf(np.minimum(*depth)), -1, np.argmin(depth, axis=0))
    finite = [np.nan_to_num(d, posinf=1e6) for d in depth]
    clear = (expected == -1) | (np.abs(finite[0] - finite[1]) > 1e-3)
    assert {0, 1} <= set(expected[clear])
    np.testing.assert_array_equal(together[clear], expected[clear])


def test_a_mesh_of_the_tree_shows_the_same_decals(renderer: Renderer, both: Scene) -> None:
    mesh = polygonize(TREE, resolution=96)
    traced = framed(TreeObject("blob", TREE), decals=both.decals)
    meshed = traced.replace(objects=[MeshObject("blob", mesh.vertices, mesh.faces)])
    first, second = (renderer.buffers(scene, RenderOptions(size=(320, 240))) for scene in (traced, meshed))
    assert ((first.object_id == 0) != (second.object_id == 0)).mean() < 1e-3
    inside = (first.object_id == 0) & (second.object_id == 0) & ~edges(first.object_id == 0)
    assert inside.mean() > 0.2
    same = inside & (first.owner == second.owner)
    assert same.sum() > 0.997 * inside.sum()
    error = np.abs(first.uv - second.uv)[same].max(axis=-1)
    assert np.quantile(error, 0.98) < 0.006
    assert np.quantile(error, 0.999) < 0.02


def test_pictures(renderer: Renderer, both: Scene) -> None:
    picture = renderer.render(both, RenderOptions(size=SIZE))
    assert picture.shape == (72, 96, 4)
    assert picture.dtype == np.uint8
    assert (picture[..., 3] == 255).all()
    np.testing.assert_array_equal(picture, renderer.render(both, RenderOptions(size=SIZE)))
    clear = renderer.render(both, RenderOptions(size=SIZE, background=TRANSPARENT))
    seen = renderer.buffers(both, RenderOptions(size=SIZE)).object_id >= 0
    away = edges(seen)
    assert (clear[..., 3][seen & ~away] == 255).all()
    assert (clear[..., 3][~seen & ~away] == 0).all()
    top = np.rint(np.array(STUDIO.top) * 255)
    assert np.abs(picture[0, 0] - top).max() <= 3


def test_colours_of_objects(renderer: Renderer) -> None:
    ring = torus()
    red = framed(MeshObject("ring", ring.vertices, ring.faces, (0.9, 0.1, 0.1)))
    buffers = renderer.buffers(red, RenderOptions(size=SIZE))
    shown = buffers.color[buffers.object_id == 0, :3].astype(int)
    assert (np.median(shown[:, 0]) > 2 * np.median(shown[:, 1:], axis=0)).all()
    tree = renderer.buffers(
        framed(TreeObject("blob", Point((0, 0, 0), radius=1, color=(0.1, 0.1, 0.9)))),
        RenderOptions(size=SIZE),
    )
    shown = tree.color[tree.object_id == 0, :3].astype(int)
    assert np.median(shown[:, 2]) > 2 * np.median(shown[:, 0])


def test_one_call_makes_its_own_context(renderer: Renderer, both: Scene) -> None:
    picture = decals.render(both, size=SIZE, samples=1)
    np.testing.assert_array_equal(picture, renderer.render(both, RenderOptions(size=SIZE, samples=1)))


def test_an_edited_scene_releases_what_it_no_longer_shows(context: Context, both: Scene) -> None:
    with Renderer(context) as own:
        own.render(both, RenderOptions(size=(16, 12)))
        drawable = own._uploads._drawables._entries[(id(both.objects[0]),)][1]
        own.render(both, RenderOptions(size=(16, 12)))
        assert own._uploads._drawables._entries[(id(both.objects[0]),)][1] is drawable
        own.render(both.replace(objects=both.objects[1:]), RenderOptions(size=(16, 12)))
        assert len(own._uploads._drawables._entries) == 1
    assert not own._uploads._drawables._entries


def test_tiles_send_the_same_rays(
    context: Context, renderer: Renderer, both: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = renderer.buffers(both, RenderOptions(size=SIZE))
    monkeypatch.setattr(tile, "TILE_MARGIN", 5)
    with Renderer(context, max_tile=40) as tiled:
        parts = tiled.buffers(both, RenderOptions(size=SIZE))
    seen = (whole.object_id == 0) & (parts.object_id == 0)
    assert (whole.object_id != parts.object_id).mean() < 0.005
    np.testing.assert_allclose(parts.position[seen], whole.position[seen], atol=1e-4)


@pytest.mark.parametrize(("size", "samples"), [((0, 4), 1), ((4, -1), 1), ((4, 4), 0), ((4,), 1)])
def test_impossible_sizes_are_refused(renderer: Renderer, both: Scene, size: Any, samples: int) -> None:
    with pytest.raises(InvalidScene, match=r"(size|samples): expected"):
        renderer.render(both, RenderOptions(size=size, samples=samples))


def parallel_view(scene: Scene) -> Projection:
    """The scene's camera without perspective, near and far planes around everything."""
    low, high = np.array(scene.bounds, np.float64)
    reach = float(np.linalg.norm(high - low))
    distance = scene.camera.distance
    scale = np.diag([1.5 / reach * SIZE[1] / SIZE[0], 1.5 / reach, -1 / reach, 1.0])
    scale[2, 3] = -distance / reach
    return Projection(scale @ scene.camera.view())


def test_a_parallel_projection_shows_the_same_surface(renderer: Renderer, both: Scene) -> None:
    view = parallel_view(both)
    buffers = renderer.buffers(both, RenderOptions(size=SIZE), viewpoint=view)
    assert set(np.unique(buffers.object_id)) == {-1, 0, 1}
    seen = buffers.object_id >= 0
    y, x = np.nonzero(seen)
    clip = np.c_[buffers.position[seen], np.ones(len(x))] @ view.matrix.T
    np.testing.assert_allclose((clip[:, 0] + 1) / 2 * SIZE[0], x + 0.5, atol=0.01)
    np.testing.assert_allclose((clip[:, 1] + 1) / 2 * SIZE[1], SIZE[1] - y - 0.5, atol=0.01)
    on_tree = buffers.object_id == 0
    assert np.abs(TREE(buffers.position[on_tree]) - 0.5).max() < 1e-3
    assert compare(both, buffers, ImageMapping.CORRECTED).mean() > 0.99


def test_a_near_plane_cuts_meshes_and_trees(renderer: Renderer, both: Scene) -> None:
    whole = parallel_view(both)
    cut = whole.matrix.copy()
    cut[2] = 2 * cut[2] - [0, 0, 0, 1]  # the near plane now stands in the middle
    before, after = (
        renderer.buffers(both, RenderOptions(size=SIZE), viewpoint=Projection(m)) for m in (whole.matrix, cut)
    )
    for number in (0, 1):
        depths = [
            buffers.position[buffers.object_id == number] @ cut[2, :3] + cut[2, 3]
            for buffers in (before, after)
        ]
        assert depths[0].min() < -1.1
        assert depths[1].min() > -1.001


def test_one_pixel_alone_is_that_of_the_whole_picture(renderer: Renderer, both: Scene) -> None:
    whole = renderer.buffers(both, RenderOptions(size=SIZE))
    rng = np.random.default_rng(0)
    for x, y in rng.integers(0, SIZE, (40, 2)).tolist():
        one = renderer.buffers_at(both, x, SIZE[1] - 1 - y, RenderOptions(size=SIZE))
        if edges(whole.object_id)[y, x]:
            continue
        assert one.object_id[0, 0] == whole.object_id[y, x]
        np.testing.assert_allclose(one.position[0, 0], whole.position[y, x], atol=2e-4)
        if whole.field[y, x] > 0.52:
            assert one.owner[0, 0] == whole.owner[y, x]
