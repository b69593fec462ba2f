"""Trees in the G-buffer through both entry points: the same pixels, and true depth among all objects."""

from typing import Any

import numpy as np
import pytest

from blobtree import Box, Cylinder, Node, Point, Segment, Torus
from blobtree.sized_cache import SizedCache
from blobtree.tracing import tree_cells
from blobtree.tracing.tree_cells import TracingCells, tracing_cells
from decals import Camera, MeshObject, TreeObject
from decals.rendering import Buffers, Projection, Renderer, RenderOptions, Viewpoint
from decals.rendering.pixel_pass import PassBackend
from decals.rendering.tracing_shader import Kinds, tracing_shader
from decals.rendering.viewpoint import PictureView, covered_rectangle, tiles
from tests.blobtree.trees import random_trees
from tests.decals.rendering.pictures import assert_same_surfaces
from tests.decals.shapes import View, torus
from tests.oracles.raster import edges

SIZE = (160, 120)
BALL = Point((0, 0, 0), radius=0.5, color=(0.9, 0.2, 0.1))
CUT = (
    Segment((-0.6, 0, 0), (0.6, 0, 0), radius=0.4, color=(0.1, 0.4, 0.9)) - Point((0, 0.4, 0), radius=0.4)
).twist(60)


def objects() -> list[TreeObject | MeshObject]:
    """Three trees and a mesh, each of which passes through another."""
    ring = torus(0.7, 0.25, shift=(0.3, 0.1, 0.0))
    trees = BALL, CUT.translate((0.8, 0.3, -0.2)), random_trees(seed=5, count=1)[0].translate((-1.5, 0, 0))
    return [
        TreeObject("ball", trees[0]),
        MeshObject("ring", ring.vertices, ring.faces),
        TreeObject("cut", trees[1]),
        TreeObject("random", trees[2]),
    ]


def framed(things: list[TreeObject | MeshObject], direction: tuple[float, float, float]) -> View:
    boxes = [
        thing.tree.support
        if isinstance(thing, TreeObject)
        else (thing.vertices.min(axis=0), thing.vertices.max(axis=0))
        for thing in things
    ]
    lower, upper = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    return View(tuple(things), Camera.framing((lower, upper), direction=direction))


def assert_same(first: Buffers, second: Buffers) -> None:
    for name in ("object_id", "position", "normal"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name), err_msg=name)
    assert np.abs(first.color.astype(int) - second.color).max() <= 1


@pytest.mark.ordinary_cases("True-direction0")
@pytest.mark.parametrize("direction", [(0.3, 0.5, 1.0), (-0.2, 1.0, 0.3)])
@pytest.mark.parametrize("backwards", [False, True])
def test_both_entry_points_give_the_same_buffers(
    fragment: Renderer, compute: Renderer, direction: tuple[float, float, float], *, backwards: bool
) -> None:
    view = framed(objects()[::-1] if backwards else objects(), direction)
    first, second = (drawing.buffers(view, RenderOptions(size=SIZE)) for drawing in (fragment, compute))
    assert set(np.unique(first.object_id)) == {-1, 0, 1, 2, 3}
    assert_same_surfaces(first, second)


def test_nearer_objects_hide_farther_ones(compute: Renderer) -> None:
    """All together, a pixel shows the object that is nearest alone."""
    view = framed(objects(), (0.3, 0.5, 1.0))
    eye = np.array(view.camera.position)
    alone = [compute.buffers(View((thing,), view.camera), RenderOptions(size=SIZE)) for thing in view.objects]
    depth = np.array(
        [np.where(b.object_id == 0, np.linalg.norm(b.position - eye, axis=-1), np.inf) for b in alone]
    )
    expected = np.where(np.isinf(depth.min(axis=0)), -1, depth.argmin(axis=0))
    together = compute.buffers(view, RenderOptions(size=SIZE))
    np.testing.assert_array_equal(together.object_id, expected)
    for number, single in enumerate(alone):
        shown = expected == number
        assert shown.any()
        np.testing.assert_array_equal(together.position[shown], single.position[shown])
        np.testing.assert_array_equal(together.normal[shown], single.normal[shown])


@pytest.mark.parametrize(
    "camera",
    [
        Camera((0.0, 0.0, 0.9), target=(0.0, 0.3, 0.0)),
        Camera((0.7, 0.7, 0.7), target=(0.7, 0.7, 5.0)),
        Camera((0.0, 0.0, 0.0), target=(0.0, 1.0, 0.1)),
    ],
    ids=["in the box", "looking away", "inside the ball"],
)
def test_an_eye_in_the_box(fragment: Renderer, compute: Renderer, camera: Camera) -> None:
    view = View((TreeObject("ball", BALL),), camera)
    assert_same(*(drawing.buffers(view, RenderOptions(size=(40, 30))) for drawing in (fragment, compute)))


@pytest.mark.parametrize("width", [20.0, 1e3])
def test_a_wide_field_is_drawn_where_its_surface_is(fragment: Renderer, width: float) -> None:
    wide = Point((0, 0, 0), radius=1.0, width=width)
    view = View((TreeObject("ball", wide),), Camera((0.0, 0.0, 3.0)))
    found = fragment.buffers(view, RenderOptions(size=(60, 60)))
    usual = View((TreeObject("ball", Point((0, 0, 0), radius=1.0)),), view.camera)
    expected = fragment.buffers(usual, RenderOptions(size=(60, 60)))
    assert (found.object_id == expected.object_id).mean() > 0.99
    seen = found.object_id == 0
    assert np.abs(np.linalg.norm(found.position[seen], axis=1) - 1.0).max() < 1e-3


def orthographic(scale: float) -> Projection:
    """A look along −z at the square of half side `scale`, from z = 1 to z = −1."""
    return Projection(np.diag([0.75 / scale, 1.0 / scale, -1.0, 1.0]))


def test_parallel_rays(fragment: Renderer, compute: Renderer) -> None:
    view = View((TreeObject("ball", BALL),), Camera((0, 0, 4)))
    first, second = (
        drawing.buffers(view, RenderOptions(size=(40, 30)), viewpoint=orthographic(1.0))
        for drawing in (fragment, compute)
    )
    assert (first.object_id == 0).mean() == pytest.approx(np.pi * 0.5**2 / (4 * 4 / 3), rel=0.05)
    assert_same(first, second)


def test_a_clipping_plane_hides_what_rays_hit_before_it(fragment: Renderer, compute: Renderer) -> None:
    """The near plane lies at z = 0.35 or so: of the ball's front, only a ring is left."""
    camera = Camera((0, 0, 4))
    slab = np.array([-0.5, -0.5, -0.35]), np.array([0.5, 0.5, 0.35])
    viewpoint = Projection(camera.clip_matrix((40, 30), slab))
    view = View((TreeObject("ball", BALL),), camera)
    first, second = (
        drawing.buffers(view, RenderOptions(size=(40, 30)), viewpoint=viewpoint)
        for drawing in (fragment, compute)
    )
    assert first.object_id[15, 20] == -1
    assert (first.object_id == 0).any()
    assert first.position[..., 2].max() < 0.4
    assert_same(first, second)


@pytest.mark.slow_cases("None")
@pytest.mark.parametrize("viewpoint", [None, orthographic(2.0)])
def test_depth_is_whole_where_it_is_asked_for(
    fragment: Renderer, compute: Renderer, viewpoint: Viewpoint | None
) -> None:
    view = framed(objects(), (0.3, 0.5, 1.0))
    depth = []
    for drawing in (fragment, compute):
        with drawing.context.current():
            targets = drawing.draw(view, RenderOptions(size=SIZE, samples=1), viewpoint=viewpoint)
            depth.append(np.frombuffer(targets.gbuffer.depth.read(), np.float32).reshape(SIZE[::-1]))
    assert 0.1 < (depth[0] == 1.0).mean() < 0.9
    apart = np.abs(depth[1] - depth[0])
    assert (apart > 1e-6).mean() < 1e-3  # a rasteriser moves corners by up to 1/256 of a pixel
    assert apart.max() < 1e-4


def test_a_tree_out_of_sight_changes_nothing(fragment: Renderer, compute: Renderer) -> None:
    aside = TreeObject("aside", BALL.translate((50, 0, 0)))
    behind = TreeObject("behind", BALL.translate((0, 0, 50)))
    view = View((TreeObject("ball", BALL), aside, behind), Camera((0, 0, 4)))
    seen = [drawing.buffers(view, RenderOptions(size=(40, 30))) for drawing in (fragment, compute)]
    assert set(np.unique(seen[1].object_id)) == {-1, 0}
    assert_same(*seen)


def test_what_was_drawn_before_is_gone(compute: Renderer) -> None:
    """Targets are kept from picture to picture, and are emptied by a compute shader."""
    first = framed(objects(), (0.3, 0.5, 1.0))
    second = View((TreeObject("ball", BALL),), Camera((0, 0, 8)))
    fresh = compute.buffers(second, RenderOptions(size=(53, 37)))
    compute.buffers(first, RenderOptions(size=(53, 37)))
    again = compute.buffers(second, RenderOptions(size=(53, 37)))
    assert_same(fresh, again)
    background = again.object_id < 0
    assert background.any()
    assert (again.position[background] == 0.0).all()
    assert (again.normal[background] == 0.0).all()


def test_tiles_and_odd_sizes(fragment: Renderer, compute: Renderer) -> None:
    view = framed(objects(), (0.3, 0.5, 1.0))
    whole = compute.buffers(view, RenderOptions(size=(53, 37)))
    with Renderer(compute.context, max_tile=19) as tiled:
        parts = tiled.buffers(view, RenderOptions(size=(53, 37)))
    sure = ~edges(whole.object_id)
    np.testing.assert_array_equal(parts.object_id[sure], whole.object_id[sure])
    assert_same_surfaces(whole, fragment.buffers(view, RenderOptions(size=(53, 37))))


@pytest.mark.parametrize("seed", range(3))
def test_the_rectangle_of_a_box_holds_all_of_it(seed: int) -> None:
    """Against points of the box, cast by the camera; boxes before the eye get no more than a pixel around."""
    rng = np.random.default_rng(seed)
    whole = 0
    for _ in range(60):
        centre, half = rng.uniform(-3, 3, 3), rng.uniform(0.05, 1.0, 3)
        camera = Camera(tuple(rng.uniform(-3, 3, 3)), target=tuple(rng.uniform(-1, 1, 3)), fov=60)
        corners = centre + half * (np.indices((2, 2, 2)).reshape(3, 8).T * 2 - 1)
        picture = PictureView.of(camera, (64, 48), (centre - half, centre + half))
        for tile in tiles(picture, 1, limit=32):
            part = covered_rectangle((centre - half, centre + half), tile)
            assert 0 <= part.x <= part.x + part.width <= tile.width
            assert 0 <= part.y <= part.y + part.height <= tile.height
            points = np.vstack([corners, rng.uniform(centre - half, centre + half, (200, 3))])
            clip = np.column_stack([points, np.ones(len(points))]) @ tile.matrix().T
            ahead = clip[:, 3] > 1e-6
            places = (0.5 * clip[ahead, :2] / clip[ahead, 3:] + 0.5) * (tile.width, tile.height)
            inside = ((places >= 0) & (places < (tile.width, tile.height))).all(axis=1)
            low, high = np.array([part.x, part.y]), np.array([part.x + part.width, part.y + part.height])
            assert ((places[inside] >= low) & (places[inside] <= high)).all()
            if ahead.all() and inside.all():
                assert (high - low <= np.ptp(places, axis=0) + 4).all()
                whole += 1
    assert whole > 3


def test_a_box_around_the_eye_falls_on_the_whole_tile() -> None:
    camera = Camera((0, 0, 0), target=(0, 0, -1))
    box = np.full(3, -1.0), np.full(3, 1.0)
    part = covered_rectangle(box, PictureView.of(camera, (64, 48), box).whole())
    assert (part.x, part.y, part.width, part.height) == (0, 0, 64, 48)


def test_a_tree_of_every_kind_compiles_as_compute_shader(compute: Renderer) -> None:
    trees: list[Node] = random_trees(seed=31, count=4)
    for tree in trees:
        view = View((TreeObject("tree", tree),), Camera.framing(tree.support))
        assert (compute.buffers(view, RenderOptions(size=(24, 18))).object_id == 0).any()


def test_functions_of_many_kinds_are_called() -> None:
    """NVIDIA's compiler takes minutes to copy many kinds into each place that evaluates the field."""
    box, ring = Box((0, 0, 0), (1, 1, 1), radius=0.1), Torus((1, 0, 0), (0, 1, 0), 0.5, radius=0.2)
    solids = box.rotate((0, 0, 1), 30) | ring | Cylinder((0, 0, 0), (0, 2, 0), 0.3, radius=0.05)
    for tree, many in ((BALL, False), (CUT, False), (solids | CUT, True)):
        for backend in PassBackend:
            text = str(tracing_shader(Kinds.of(tree.tape), backend))
            assert ("#define MANY_KINDS" in text) == many
            assert text.index("#pragma optionNV(inline none)") < text.index("vec3 trace_ray(")


def test_cells_of_drawn_trees_are_made_once(fragment: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[object] = []
    build = tree_cells._tracing_cells._function

    def counted(*args: Any) -> TracingCells:
        made.append(args)
        return build(*args)

    monkeypatch.setattr(tree_cells, "_tracing_cells", SizedCache(counted, 1))
    view = framed(objects(), (0.3, 0.5, 1.0))
    fragment.render(view, RenderOptions(size=(40, 30), samples=1))
    assert len(made) == 3
    for item in view.objects:
        if isinstance(item, TreeObject):
            tracing_cells(item.tree)
    assert len(made) == 3
