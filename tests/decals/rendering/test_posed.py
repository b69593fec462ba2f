"""Posed meshes: decals lie on the rest pose, and stretch with the surface."""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest
import pyvista as pv
from numpy.typing import NDArray

import decals
from blobtree import Node, Point, Segment
from decals import Camera, Decals, MeshObject, Scene, TreeObject
from decals.editing import Document
from decals.errors import InvalidScene
from decals.rendering import Buffers, Renderer, RenderOptions
from decals.scenes.pose import PosedScene
from decals.scenes.script import write_script
from decals.surfaces import MeshSurface
from decals.surfaces.normals import vertex_normals
from tests.decals.shapes import sheet_faces, torus

SIZE = (160, 120)
OPTIONS = RenderOptions(size=SIZE, samples=1)
VIEW = Camera(position=(0.0, 0.0, 6.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=40.0)


def sheet(*, side: int = 33) -> MeshObject:
    """Return a square of side 2 in the xy plane."""
    ticks = np.linspace(-1, 1, side)
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    return MeshObject("sheet", np.stack([x, y, 0 * x], -1).reshape(-1, 3), sheet_faces(side, side))


def renumbered() -> MeshObject:
    """Return a sheet with as many vertices, in another order."""
    item = sheet()
    order = np.random.default_rng(0).permutation(len(item.vertices))
    return MeshObject("other", item.vertices, order[item.faces])


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
    rounding, doubtful = (0.0, 0.0) if renderer.backend == "fragment" else (1e-5, 0.005)  # posed: rasterised
    for name in ("owner", "position", "normal"):
        apart = np.abs(getattr(one, name) - getattr(other, name)) > rounding
        assert apart.mean() <= doubtful, name
    for name in ("uv", "field"):  # normals at rest are rounded once more
        apart = np.abs(getattr(one, name) - getattr(other, name)) > 1e-6 + 100 * rounding
        assert apart.mean() <= doubtful, name
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


def test_a_pose_may_be_a_mesh_of_the_same_topology() -> None:
    item = sheet()
    points = np.column_stack([item.vertices[:, :2], item.vertices[:, 0] ** 2])
    scene = covered(item, count=3)
    expected = cast(Any, decals.pose(scene, {"sheet": points}).objects[0]).vertices
    other = np.vstack([item.faces[:5, [1, 2, 0]], item.faces[5:]])
    for mesh in (
        pv.PolyData.from_regular_faces(points, item.faces.tolist()),
        MeshObject("other", points, other),
    ):
        posed = decals.pose(scene, {"sheet": mesh}).objects[0]
        np.testing.assert_allclose(cast(Any, posed).vertices, expected, atol=1e-6)


def test_rigid_decals_need_triangles_with_area() -> None:
    item = sheet()
    scene = covered(item)
    half = np.where(item.vertices[:, :1] < 0, item.vertices * [1, 0, 0], item.vertices)
    decals.pose(scene, {"sheet": half})
    with pytest.raises(InvalidScene, match=r"'sheet': expected triangles with area .* leave out rigid"):
        decals.pose(scene, {"sheet": half}, rigid=True)


def limb(end: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Node:
    return Segment((0, 0, -1), (0, 0, 0), radius=0.4) + Segment((0, 0, 0), end, radius=0.35)


def covered_limb(count: int = 60, *, at_rest: Node | None = None) -> Scene:
    body = TreeObject("limb", at_rest or limb())
    positions, normals = body.surface.sample(count, 3)
    radii = np.random.default_rng(1).uniform(0.1, 0.3, count)
    scattered = Decals(positions, normals, np.cross(normals, [0.0, 0.0, 1.0]), radii)
    view = Camera(position=(5.0, 1.0, 1.0), up=(0.0, 0.0, 1.0), fov=30.0)
    return Scene(objects=(body,), decals=scattered, images=(decals.DecalImage.load("tile"),), camera=view)


def bent_limb(phase: float) -> Node:
    """Return the limb in a pose of a walk, twisted and bent."""
    return limb().twist(50.0 * np.sin(phase)).bend(20.0 * np.cos(phase), (-0.8, 0.8))


def check_rest(scene: Scene, seen: Buffers, rest: NDArray[np.float64], normals: NDArray[np.float64]) -> None:
    """Check that each pixel shows the decal, and its image, within half a pixel of its own place at rest."""
    shown = seen.object_id >= 0
    drawn, uv = seen.owner[shown], seen.uv[shown]
    pixel = 2 * 5.2 * np.tan(np.radians(15)) / SIZE[1]
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    expected = decals.evaluate(scene.decals, rest, normals)
    both = (drawn >= 0) & (expected.owner == drawn)
    drift = np.abs(expected.uv - uv)[both].max(axis=1) * 2 * scene.decals.radii[drawn[both]]
    assert drift.max() < 0.5 * pixel
    other = np.flatnonzero(expected.owner != drawn)
    first = np.cross(normals[other], [0.3, 0.5, 0.8])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals[other], first)
    ring = np.exp(1j * np.arange(16) * np.pi / 8)
    steps = 0.5 * pixel * (np.array([0.02, 0.05, 0.1, 0.2, 0.5, 1.0])[:, None] * ring).ravel()
    around = rest[other] + steps.real[:, None, None] * first + steps.imag[:, None, None] * second
    facing = np.broadcast_to(normals[other], around.shape)
    found = decals.evaluate(scene.decals, around.reshape(-1, 3), facing.reshape(-1, 3))
    near = (found.owner.reshape(len(steps), -1) == drawn[other]).any(axis=0)
    assert near.all()
    assert len(other) < 0.002 * len(drawn)


def half_of_100_frames(renderer: Renderer) -> range:
    """Return the frames that a renderer of this kind draws."""
    return range(renderer.backend == "compute", 100, 2)


def check_pose(renderer: Renderer, scene: Scene, at_rest: Node, posed: Node) -> Buffers:
    """Check that a posed tree shows, at each pixel, what its own point at rest shows."""
    seen = buffers(renderer, decals.pose(scene, {"limb": posed}))
    shown = seen.object_id >= 0
    places = posed.rest_coordinates(seen.position[shown], rest=at_rest)
    rest = scene.objects[0].surface.project(places)[0].astype(np.float64)
    check_rest(scene, seen, rest, -at_rest.gradient(rest).astype(np.float64))
    return seen


def test_decals_stretch_with_a_tree(renderer: Renderer) -> None:
    scene = covered_limb()
    first = check_pose(renderer, scene, limb(), bent_limb(0.9))
    again = check_pose(renderer, scene, limb(), bent_limb(0.9))
    for name in ("owner", "uv", "color"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    raised = buffers(renderer, decals.pose(scene, {"limb": limb((0.0, 0.8, 0.6))}))
    shown = raised.object_id >= 0
    assert (raised.owner[shown] >= 0).mean() > 0.5
    assert (raised.position[shown][:, 1] > 0.6).sum() > 100


def test_a_tree_at_rest_may_have_warps(renderer: Renderer) -> None:
    check_pose(renderer, covered_limb(at_rest=bent_limb(0.3)), bent_limb(0.3), bent_limb(2.0))


@pytest.mark.slow
def test_decals_do_not_flicker_over_100_frames(renderer: Renderer) -> None:
    scene = covered_limb()
    for frame in half_of_100_frames(renderer):
        check_pose(renderer, scene, limb(), bent_limb(2 * np.pi * frame / 100))


def check_skinned(renderer: Renderer, scene: Scene, item: MeshObject, phase: float) -> None:
    """Check a ring whose halves turn against each other."""
    share = np.clip(item.vertices[:, :1] + 0.5, 0.0, 1.0)
    joints = np.stack([rotation(0.4 * np.sin(phase)), rotation(-0.5 * np.sin(2 * phase))])
    vertices = decals.skin(item.vertices, np.hstack([share, 1.0 - share]), joints)
    seen = buffers(renderer, decals.pose(scene, {"ring": vertices}))
    shown = seen.object_id >= 0
    faces, weights = MeshSurface(vertices, item.faces).locate(seen.position[shown])
    corners = item.faces[faces]
    rest = np.einsum("nc,nca->na", weights, item.vertices.astype(np.float64)[corners])
    normals = np.einsum("nc,nca->na", weights, vertex_normals(item.vertices, item.faces)[corners])
    check_rest(scene, seen, rest, normals)


def test_decals_stay_on_a_skinned_mesh(renderer: Renderer) -> None:
    item = ring()
    check_skinned(renderer, covered(item), item, 0.8)


@pytest.mark.slow
def test_decals_on_a_skinned_mesh_do_not_flicker_over_100_frames(renderer: Renderer) -> None:
    item = ring()
    scene = covered(item)
    for frame in half_of_100_frames(renderer):
        check_skinned(renderer, scene, item, 2 * np.pi * frame / 100)


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


def test_a_posed_scene_is_drawn_only(vtk_display: None) -> None:
    posed = decals.pose(covered(sheet(), count=3), {"sheet": sheet().vertices})
    np.testing.assert_array_equal(
        posed.render(size=SIZE, samples=1), decals.render(posed, size=SIZE, samples=1)
    )
    uses: dict[str, Callable[[Any], object]] = {
        "measure": decals.measure,
        "save": lambda scene: decals.save_scene(scene, "scene.json"),
        "write": lambda scene: write_script(scene, "scene.py"),
        "pose": lambda scene: decals.pose(scene, {}),
        "edit": Document.from_scene,
    }
    for verb, use in uses.items():
        with pytest.raises(InvalidScene, match=f"at rest, got a posed one; {verb} the scene that was posed"):
            use(posed)
    with pytest.raises(InvalidScene, match="expected a Scene at rest, got a posed one"):
        posed.save("scene.json")
    with pytest.raises(InvalidScene, match="expected a Scene at rest, got a PosedScene"):
        decals.displace(cast(Any, posed))


@pytest.mark.parametrize(
    ("poses", "message"),
    [
        ({"ball": np.zeros((3, 3))}, "expected names of objects of the scene"),
        ({"sheet": np.zeros((3, 3))}, r"expected shape \[1089, 3\], got \[3, 3\]; a pose has the vertices"),
        ({"sheet": np.full((1089, 3), np.nan)}, "expected finite numbers"),
        ({"sheet": "here"}, r"expected numbers of shape \[1089, 3\], got 'here'; a pose has the vertices"),
        ({"sheet": pv.Sphere()}, r"expected shape \[1089, 3\], got \[842, 3\]; a pose has the vertices"),
        ({"sheet": renumbered()}, "expected the faces of the rest pose, got a mesh that has 0% of its edges"),
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
        ([[0.5, 0.5], [1.5, -0.5]], [np.eye(4)] * 2, r"got \[1.5, -0.5\] at vertex 1"),
        ([[1.0]], [np.eye(4)] * 2, r"weights: expected shape \[1, 2\]"),
        ([[1.0]], [np.eye(3)], r"transforms: expected shape \[n, 4, 4\]"),
        ([[np.inf]], [np.eye(4)], "expected finite numbers, .* in row 0; drop or repair it"),
        ([[1.0]], [np.eye(4)[::-1]], r"last row is \[0, 0, 0, 1\], got \[1.0, .* in matrix 0; transpose"),
    ],
)
def test_invalid_skins(weights: Any, transforms: Any, message: str) -> None:
    with pytest.raises(InvalidScene, match=message):
        decals.skin([[0, 0, 0]] * len(weights), weights, transforms)
