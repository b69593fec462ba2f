"""Posed meshes: decals lie on the rest pose, and stretch with the surface."""

from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

import decals
from blobtree import Node, Point, Segment
from decals import Camera, Decals, MeshObject, Scene, TreeObject
from decals.errors import InvalidScene
from decals.rendering import Buffers, Renderer, RenderOptions
from decals.scenes.pose import PosedScene
from tests.decals.shapes import torus

SIZE = (160, 120)
OPTIONS = RenderOptions(size=SIZE, samples=1)
VIEW = Camera(position=(0.0, 0.0, 6.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=40.0)


def sheet(*, side: int = 33) -> MeshObject:
    """Return a square of side 2 in the xy plane."""
    ticks = np.linspace(-1, 1, side)
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    a = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1)
    faces = np.concatenate([np.stack([a, a + side, a + side + 1], 1), np.stack([a, a + side + 1, a + 1], 1)])
    return MeshObject("sheet", np.stack([x, y, 0 * x], -1).reshape(-1, 3), faces)


def covered(item: MeshObject, *, count: int = 40, camera: Camera = VIEW) -> Scene:
    """Return an object under random decals that push each other."""
    positions, normals = item.surface.sample(count, 3)
    rng = np.random.default_rng(1)
    images = (decals.DecalImage.load("tile"),)
    radii = rng.uniform(0.1, 0.35, count)
    scattered = Decals(positions, normals, rng.normal(size=(count, 3)), radii)
    return Scene(objects=(item,), decals=scattered, images=images, camera=camera)


def buffers(renderer: Renderer, scene: Scene | PosedScene, camera: Camera | None = None) -> Buffers:
    return renderer.buffers(scene, OPTIONS, viewpoint=camera)


@pytest.fixture
def renderer(drawer: Renderer) -> Renderer:
    return drawer


def ring() -> MeshObject:
    shape = torus(rows=60, columns=30)
    return MeshObject("ring", shape.vertices, shape.faces)


def test_the_rest_pose_draws_the_scene_itself(renderer: Renderer) -> None:
    item = ring()
    scene = covered(item)
    posed = decals.pose(scene, {"ring": item.vertices})
    one, other = buffers(renderer, scene), buffers(renderer, posed)
    assert (one.owner >= 0).sum() > 1500
    for name in ("owner", "uv", "field", "position", "normal"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    off = np.abs(one.color.astype(int) - other.color).max(axis=2)
    assert (off > 8).mean() < 0.01  # footprints are those of triangles, not of the smooth normal
    assert off.mean() < 0.5


def test_a_moved_model_under_a_moved_camera_looks_the_same(renderer: Renderer) -> None:
    turn = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    shift = np.array([5.0, -2.0, 1.0])
    item = ring()
    scene = covered(item)
    camera = Camera(
        position=tuple(turn @ VIEW.position + shift),
        target=tuple(shift),
        up=tuple(turn @ VIEW.up),
        fov=VIEW.fov,
    )
    posed = decals.pose(scene, {"ring": item.vertices @ turn.T + shift}, camera=camera)
    one, other = buffers(renderer, scene), buffers(renderer, posed)
    same = one.owner == other.owner
    assert same.mean() > 0.998  # coordinates are rounded elsewhere, which moves silhouettes
    assert np.abs(one.uv - other.uv)[same].max() < 2e-3


def test_materials_shine_by_the_normals_of_the_pose(renderer: Renderer) -> None:
    """A sheet that is tilted as one body, under a camera that tilts with it, looks the same."""
    item = sheet(side=3)
    angle = np.radians(65)
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    bumps = np.full((8, 8, 3), (128, 128, 255), np.uint8)
    bumps[2:6, 2:4], bumps[2:6, 4:6] = (60, 128, 230), (128, 190, 230)
    steel = decals.DecalMaterial("steel", np.full((8, 8, 3), 0.6), bumps, roughness=0.4, metallic=1.0)
    scene = covered(item).replace(images=[steel])
    camera = Camera(
        position=tuple(turn @ VIEW.position), target=(0, 0, 0), up=tuple(turn @ VIEW.up), fov=40.0
    )
    posed = decals.pose(scene, {"sheet": item.vertices @ turn.T}, camera=camera)
    one, other = (renderer.render(shown, OPTIONS).astype(int) for shown in (scene, posed))
    assert np.abs(one - other).mean() < 0.2
    assert (np.abs(one - other).max(axis=2) > 8).mean() < 0.01
    still = decals.pose(scene, {"sheet": item.vertices})
    assert np.abs(renderer.render(still, OPTIONS).astype(int) - one).max() <= 2


def test_decals_stretch_with_the_surface(renderer: Renderer) -> None:
    """A stretched and bent sheet shows, at each of its points, what the flat one has there."""
    item = sheet()
    scene = covered(item)
    flat = item.vertices.astype(np.float64)
    x, y = 1.6 * flat[:, 0], 0.7 * flat[:, 1]
    posed = decals.pose(scene, {"sheet": np.column_stack([x, y, 0.0 * x])})
    seen = buffers(renderer, posed)
    shown = seen.object_id >= 0
    rest = seen.position[shown].astype(np.float64) / [1.6, 0.7, 1.0]
    expected = decals.evaluate(scene.decals, rest, np.tile([0.0, 0.0, 1.0], (len(rest), 1)))
    same = expected.owner == seen.owner[shown]
    assert same.mean() > 0.9995
    assert np.abs(expected.uv - seen.uv[shown])[same].max() < 1e-4


def test_owners_do_not_flicker_in_a_bend(renderer: Renderer) -> None:
    """The points of the rest pose keep their decals and image places through a bend."""
    item = sheet()
    scene = covered(item, count=25)
    flat = item.vertices.astype(np.float64)
    up = np.tile([0.0, 0.0, 1.0], (SIZE[0] * SIZE[1], 1))
    for bend in np.linspace(0.01, 1.2, 10):
        vertices = np.column_stack(
            [np.sin(bend * flat[:, 0]) / bend, flat[:, 1], np.cos(bend * flat[:, 0]) / bend]
        )
        vertices[:, 2] -= 1.0 / bend
        seen = buffers(renderer, decals.pose(scene, {"sheet": vertices}))
        shown = (seen.object_id >= 0).reshape(-1)
        points = seen.position.reshape(-1, 3)[shown].astype(np.float64)
        angle = np.arctan2(points[:, 0], points[:, 2] + 1.0 / bend)
        rest = np.column_stack([angle / bend, points[:, 1], 0.0 * angle])
        expected = decals.evaluate(scene.decals, rest, up[: len(rest)])
        drift = np.abs(expected.uv - seen.uv.reshape(-1, 2)[shown])[
            expected.owner == seen.owner.reshape(-1)[shown]
        ]
        pixel = 0.5 * 4.4 / SIZE[1] / scene.decals.radii.min()
        assert np.quantile(drift, 0.999) < 0.5 * pixel  # chords of the mesh, not of the arc


def test_a_footprint_is_that_of_the_rest_pose(renderer: Renderer) -> None:
    """A sheet shrunk to a tenth, seen from a tenth of the distance, has the same picture as the flat one."""
    item = sheet()
    scene = covered(item, count=12)
    near = Camera(position=(0.0, 0.0, 0.6), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=40.0)
    posed = decals.pose(scene, {"sheet": 0.1 * item.vertices}, camera=near)
    one = renderer.buffers(scene, OPTIONS).color.astype(int)
    other = renderer.buffers(posed, OPTIONS).color.astype(int)
    assert (np.abs(one - other).max(axis=2) > 3).mean() < 0.002


def test_objects_that_hide_a_posed_mesh_keep_their_decals(renderer: Renderer) -> None:
    item = sheet()
    ball = TreeObject("ball", Point((0.0, 0.0, 0.6), radius=0.5))
    scene = covered(item).replace(objects=(item, ball))
    posed = decals.pose(scene, {"sheet": item.vertices})
    one, other = buffers(renderer, scene), buffers(renderer, posed)
    assert (one.object_id == 1).sum() > 500
    np.testing.assert_array_equal(one.owner, other.owner)


def test_rigid_decals_move_and_turn_with_their_triangles() -> None:
    item = ring()
    scene = covered(item)
    turn = rotation(0.7)[:3, :3] @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    other = TreeObject("ball", Point((0.0, 0.0, 5.0), radius=0.5))
    alone = Decals([[0.0, 0.0, 5.5]], [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]], [0.2])
    both = scene.replace(objects=(item, other), decals=Decals.concatenate([scene.decals, alone]))
    moved = decals.pose(both, {"ring": item.vertices @ turn.T + [1.0, 2.0, 3.0]}, rigid=True).decals
    np.testing.assert_allclose(
        moved.positions[:-1], scene.decals.positions @ turn.T + [1.0, 2.0, 3.0], atol=2e-5
    )
    np.testing.assert_allclose(moved.normals[:-1], scene.decals.normals @ turn.T, atol=2e-5)
    np.testing.assert_allclose(moved.tangents[:-1], scene.decals.tangents @ turn.T, atol=2e-5)
    np.testing.assert_array_equal(moved.radii, both.decals.radii)
    np.testing.assert_array_equal(moved.positions[-1], alone.positions[0])


def limb(end: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Node:
    return Segment((0, 0, -1), (0, 0, 0), radius=0.4) + Segment((0, 0, 0), end, radius=0.35)


def covered_limb(count: int = 60) -> Scene:
    body = TreeObject("limb", limb())
    positions, normals = body.surface.sample(count, 3)
    radii = np.random.default_rng(1).uniform(0.1, 0.3, count)
    scattered = Decals(positions, normals, np.cross(normals, [0.0, 0.0, 1.0]), radii)
    view = Camera(position=(5.0, 1.0, 1.0), up=(0.0, 0.0, 1.0), fov=30.0)
    return Scene(objects=(body,), decals=scattered, images=(decals.DecalImage.load("tile"),), camera=view)


def untwisted(points: NDArray[np.float64], degrees: float) -> NDArray[np.float64]:
    """Places, or normals at the height of places, before a twist about the z axis."""
    angle = -np.radians(degrees) * points[:, 2]
    x, y = points[:, 0], points[:, 1]
    return np.column_stack(
        [np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y, points[:, 2]]
    )


def check_twist(renderer: Renderer, scene: Scene, degrees: float) -> Buffers:
    """Check that a twisted tree shows, at each pixel, what its own point at rest shows."""
    seen = buffers(renderer, decals.pose(scene, {"limb": limb().twist(degrees)}))
    shown = seen.object_id >= 0
    rest = untwisted(seen.position[shown].astype(np.float64), degrees)
    normals = -limb().gradient(rest)
    expected = decals.evaluate(scene.decals, rest, normals)
    same = expected.owner == seen.owner[shown]
    assert same.mean() > 0.998
    pixel = 0.5 * 2 * 5.2 * np.tan(np.radians(15)) / SIZE[1] / scene.decals.radii.min()
    drift = np.abs(expected.uv - seen.uv[shown])[same].max(axis=1)
    assert np.quantile(drift, 0.999) < 0.5 * pixel
    return seen


def test_decals_stretch_with_a_tree(renderer: Renderer) -> None:
    scene = covered_limb()
    first = check_twist(renderer, scene, 40.0)
    again = check_twist(renderer, scene, 40.0)
    for name in ("owner", "uv", "color"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    raised = buffers(renderer, decals.pose(scene, {"limb": limb((0.0, 0.8, 0.6))}))
    shown = raised.object_id >= 0
    assert (raised.owner[shown] >= 0).mean() > 0.5
    assert (raised.position[shown][:, 1] > 0.6).sum() > 100


@pytest.mark.slow
def test_decals_do_not_flicker_over_100_frames(renderer: Renderer) -> None:
    scene = covered_limb()
    for frame in range(100):
        check_twist(renderer, scene, 60.0 * np.sin(2 * np.pi * frame / 100))


def test_rigid_decals_turn_with_a_tree() -> None:
    scene = covered_limb(20)
    turned = limb().rotate((0, 1, 0), 50).translate((1, 2, 3))
    posed = decals.pose(scene, {"limb": turned}, rigid=True)
    assert isinstance(posed.objects[0], TreeObject)
    assert posed.objects[0].tree is turned
    cosine, sine = np.cos(np.radians(50)), np.sin(np.radians(50))
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    expected = scene.decals.positions @ turn.T + [1, 2, 3]
    np.testing.assert_allclose(posed.decals.positions, expected, atol=2e-3)
    np.testing.assert_allclose(posed.decals.normals, scene.decals.normals @ turn.T, atol=2e-2)
    np.testing.assert_array_equal(posed.decals.radii, scene.decals.radii)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (np.zeros((3, 3)), "expected the posed tree, got array"),
        (
            Point((0, 0, 0), radius=1.0),
            r"rest: expected the leaves of the posed tree \(1: Point\), got 2: Segm",
        ),
    ],
)
def test_invalid_poses_of_trees(given: Any, message: str) -> None:
    with pytest.raises(InvalidScene, match=message):
        decals.pose(covered_limb(3), {"limb": given})
    with pytest.raises(InvalidScene, match="resolution"):
        decals.pose(covered_limb(3), {"limb": limb()}, resolution=0)
    with pytest.raises(InvalidScene, match="expected positions of vertices, got a tree"):
        decals.pose(covered(sheet(), count=3), {"sheet": limb()})


def test_a_posed_scene_is_drawn_only() -> None:
    posed = decals.pose(covered(sheet(), count=3), {"sheet": sheet().vertices})
    with pytest.raises(InvalidScene, match="expected a Scene, got a PosedScene"):
        decals.measure(cast(Any, posed))
    with pytest.raises(InvalidScene, match="expected a Scene, got a PosedScene"):
        decals.save_scene(cast(Any, posed), "scene.json")


@pytest.mark.parametrize(
    ("poses", "message"),
    [
        ({"ball": np.zeros((3, 3))}, "expected names of objects of the scene"),
        ({"sheet": np.zeros((3, 3))}, r"expected shape \[1089, 3\], got \[3, 3\]; a pose has the vertices"),
        ({"sheet": np.full((1089, 3), np.nan)}, "expected finite numbers"),
        ({"sheet": "here"}, "expected numbers of shape"),
        ([("sheet", 1)], "expected positions by the names of objects"),
    ],
)
def test_invalid_poses(poses: Any, message: str) -> None:
    with pytest.raises(InvalidScene, match=message):
        decals.pose(covered(sheet(), count=3), poses)


def rotation(angle: float) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return matrix


def test_skin_blends_the_joints_linearly() -> None:
    rng = np.random.default_rng(2)
    points, weights = rng.normal(size=(50, 3)), rng.dirichlet([1.0, 1.0, 1.0], 50)
    joints = np.stack([rotation(0.3), rotation(-1.1), np.diag([2.0, 1.0, 0.5, 1.0])])
    joints[1, :3, 3] = [1, 2, 3]
    moved = decals.skin(points, weights, joints)
    for i in range(50):
        matrix = sum(weights[i, j] * joints[j] for j in range(3))
        np.testing.assert_allclose(moved[i], (matrix @ [*points[i], 1.0])[:3], atol=1e-12)


@pytest.mark.parametrize(
    ("weights", "transforms", "message"),
    [
        ([[0.5, 0.2]], [np.eye(4)] * 2, r"whose sum is 1 .* at vertex 0; divide each row"),
        ([[1.5, -0.5]], [np.eye(4)] * 2, "expected numbers from 0"),
        ([[1.0]], [np.eye(4)] * 2, r"weights: expected shape \[1, 2\]"),
        ([[1.0]], [np.eye(3)], r"transforms: expected shape \[n, 4, 4\]"),
        ([[np.inf]], [np.eye(4)], "expected finite numbers"),
    ],
)
def test_invalid_skins(weights: Any, transforms: Any, message: str) -> None:
    with pytest.raises(InvalidScene, match=message):
        decals.skin([[0, 0, 0]], weights, transforms)
