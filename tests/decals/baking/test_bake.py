"""Baked textures and vertex colours against the decals in float64, and against a picture of the scene."""

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

import decals
from blobtree import Point
from decals import MeshObject, Scene, TreeObject
from decals.baking import atlas as atlas_module
from decals.baking import surface_colors as colors_module
from decals.baking import texture as texture_module
from decals.baking.meshes import bake_mesh
from decals.baking.texture import MAX_OVERSHOOT, Channels, bake_texture
from decals.baking.unwrapped import Unwrapped
from decals.errors import NoGraphics
from decals.images.texels import encode_srgb
from decals.rendering import Lighting
from decals.surfaces import MeshSurface
from tests.decals.baking.evaluated import beside_evaluated, texel_length
from tests.decals.baking.glb import (
    BALL,
    CUBE,
    Array,
    ball_and_cube,
    bilinear,
    expected_colors,
    linear,
    need,
    read_attribute,
    read_glb,
    read_json,
)
from tests.oracles.materials import tilted
from tests.vectors import unit

SIZE = 256


@pytest.fixture(scope="module")
def baked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The ball and the cube with one sample a texel."""
    need("trimesh", "xatlas")
    path = tmp_path_factory.mktemp("baked") / "scene.glb"
    decals.bake(ball_and_cube(), path, size=SIZE, samples=1)
    return path


@pytest.mark.parametrize(("name", "color"), [("ball", BALL), ("cube", CUBE)])
def test_texels_have_the_colours_of_the_surface_below_them(baked: Path, name: str, color: Any) -> None:
    node = read_glb(baked)[name]
    assert node.uv is not None
    assert node.texture is not None
    assert node.texture.shape == (SIZE, SIZE, 3)
    rng = np.random.default_rng(5)
    faces = node.faces[rng.integers(0, len(node.faces), 3000)]
    places = np.stack([node.uv[..., 0], 1 - node.uv[..., 1]], axis=-1) * SIZE
    corners = places[faces]
    weights = rng.dirichlet((1, 1, 1), len(faces))
    texels = np.floor((corners * weights[..., None]).sum(axis=1))
    sides = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    inner = np.linalg.solve(sides, (texels + 0.5 - corners[:, 0])[..., None])[..., 0]
    weights = np.column_stack([1 - inner.sum(axis=1), inner])
    inside = weights.min(axis=1) > 0.01
    assert inside.sum() > 300
    points, normals = (
        (values[faces] * weights[..., None]).sum(axis=1)[inside] for values in (node.vertices, node.normals)
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    want = expected_colors(ball_and_cube(), color, points, normals)
    columns, rows = texels[inside].astype(int).T
    got = linear(node.texture[rows, columns] / 255)
    off = np.abs(got - want).max(axis=1) > 0.006  # half a step of sRGB in the lights, and float32
    assert off.mean() < 0.03  # texels on a rim, a line of contact or a seam
    assert want.std(axis=0).min() > 0.02


@pytest.mark.slow_cases("cube-color1")
@pytest.mark.parametrize(("name", "color"), [("ball", BALL), ("cube", CUBE)])
def test_points_of_the_surface_find_their_colours_through_texture_coordinates(
    tmp_path: Path, name: str, color: Any
) -> None:
    need("trimesh", "xatlas")
    scene = ball_and_cube()
    decals.bake(scene, tmp_path / "fine.glb", size=512)
    node = read_glb(tmp_path / "fine.glb")[name]
    points, normals, uv = node.on_surface(3000)
    assert node.texture is not None
    got = bilinear(linear(node.texture / 255), uv)
    around = neighborhoods(points, normals, 1.5 * texel_length(node))
    samples = decals.evaluate(
        scene.decals,
        around.reshape(-1, 3),
        np.repeat(normals, around.shape[1], axis=0),
        images=[image.pixels for image in scene.images],
    )
    assert samples.color is not None
    want = linear(np.asarray(color)) * (1 - samples.color[:, 3:]) + samples.color[:, :3]
    want = want.reshape(*around.shape)
    errors = np.abs(got - want[:, 0]).max(axis=1)
    assert np.median(errors) < 0.004
    low, high, shown = (255 * encode_srgb(of) for of in (want.min(axis=1), want.max(axis=1), got))
    outside = np.maximum(low - shown, shown - high).max(axis=1)
    assert (outside > MAX_OVERSHOOT + 1).mean() < 0.005  # besides, it is a mean of those within its texels
    assert (np.abs(got - want[:, 0].mean(axis=0)).max(axis=1) > 0.05).mean() > 0.5


def test_baked_colours_differ_from_evaluated_ones_by_filtering_alone(tmp_path: Path) -> None:
    """A texel is a mean, and programs mix four: at lines finer than that, no texture has the exact colour.

    Colours lie between those within 1.5 texels, and are right within 8 of 255 where these are alike. Texels
    half as wide leave about half the points that differ.
    """
    need("trimesh")
    scene = ball_and_cube()
    images = [image.pixels for image in scene.images]
    differing = {}
    for size in (128, 512):
        decals.bake(scene, tmp_path / "a.glb", size=size)
        node = read_glb(tmp_path / "a.glb")["ball"]
        points, normals, uv = node.on_surface(1000, seed=3)
        assert node.texture is not None
        got = 255 * encode_srgb(bilinear(linear(node.texture / 255), uv))
        around = neighborhoods(points, normals, 1.5 * texel_length(node))
        rows = np.repeat(normals, around.shape[1], axis=0)
        over = decals.evaluate(scene.decals, around.reshape(-1, 3), rows, images=images).color
        assert over is not None
        light = linear(np.asarray(BALL)) * (1 - over[:, 3:]) + over[:, :3]
        want = 255 * encode_srgb(light).reshape(around.shape)
        low, high = want.min(axis=1), want.max(axis=1)
        assert np.quantile(np.maximum(low - got, got - high), 0.99) <= 8
        off = np.abs(got - want[:, 0]).max(axis=1)
        even = (high - low).max(axis=1) <= 8
        if size == 512:
            assert even.mean() > 0.3
            assert np.quantile(off[even], 0.99) <= 8
        differing[size] = (off > 8).mean()
    assert differing[512] < 0.4 * differing[128]
    assert differing[512] > 0.0


@pytest.mark.slow
def test_textures_of_the_default_size_have_evaluated_colours(tmp_path: Path) -> None:
    """At 99 % of the points within 14 of 255; beside means over one and a half texels, within 8."""
    need("trimesh")
    point, texels = beside_evaluated(tmp_path / "a.glb", 2048)
    assert point <= 14
    assert texels <= 8


def neighborhoods(points: Array, normals: Array, reach: float) -> Array:
    """Each point, then a grid of points of its tangent plane up to a distance along each axis."""
    across = unit(np.cross(normals, np.where(np.abs(normals[:, :1]) < 0.8, [[1.0, 0, 0]], [[0, 1.0, 0]])))
    frame = np.stack([across, np.cross(normals, across)], axis=1)
    steps = reach * np.stack(np.meshgrid(*[np.linspace(-1, 1, 7)] * 2), axis=-1).reshape(-1, 2)
    around: Array = points[:, None] + np.concatenate([np.zeros((1, 2)), steps]) @ frame
    return around


def test_the_textured_meshes_look_like_the_picture_of_the_scene(baked: Path) -> None:
    """Both without light: decals.render against VTK's own textures."""
    scene, size = ball_and_cube(), (240, 180)
    try:
        picture = decals.render(scene, size=size, samples=2, lights=Lighting(()))
    except NoGraphics as error:
        pytest.skip(str(error))
    plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting=None)
    for node in read_glb(baked).values():
        mesh = pv.PolyData.from_regular_faces(node.vertices, node.faces)
        mesh.active_texture_coordinates = node.uv
        texture = pv.Texture(node.texture)  # type: ignore[no-untyped-call]
        plotter.add_mesh(mesh, texture=texture, lighting=False)
    camera = scene.camera
    plotter.camera_position = [camera.position, camera.target, camera.up]
    plotter.camera.view_angle = camera.fov
    plotter.renderer.set_background("white")
    shown = np.asarray(plotter.screenshot(return_img=True), float)
    plotter.close()
    drawn = np.asarray(picture)[..., :3].astype(float)
    on_both = (shown.min(axis=2) < 250) & (np.abs(drawn - drawn[0, 0]).max(axis=2) > 8)
    assert on_both.mean() > 0.15
    assert np.abs(shown - drawn)[on_both].mean() < 9
    assert np.abs(shown - drawn[:, ::-1])[on_both].mean() > 25  # the measure tells other pictures apart


def border_edges(node: Any) -> Array:
    """Vertices (n, 2) of the edges of one face."""
    edges = np.concatenate([node.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    _, first, counts = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    borders: Array = edges[first[counts == 1]]
    return borders


def border_points(node: Any) -> Array:
    """Texture coordinates along the borders of all charts."""
    ends = node.uv[border_edges(node)]
    share = np.linspace(0, 1, 5)[:, None, None]
    points: Array = (ends[:, 0] * (1 - share) + ends[:, 1] * share).reshape(-1, 2)
    return points


@pytest.mark.parametrize("samples", [1, 2])
def test_seams_show_no_colour_from_outside_their_chart(tmp_path: Path, samples: int) -> None:
    """Two plain colours: filtered at any border of a chart, also on a smaller mip level, each stays pure."""
    need("trimesh", "xatlas")
    plain = ball_and_cube().replace(decals=decals.Decals.empty())
    decals.bake(plain, tmp_path / "plain.glb", size=SIZE, samples=samples)
    nodes = read_glb(tmp_path / "plain.glb")
    for name, color in (("ball", BALL), ("cube", CUBE)):
        texture, points = nodes[name].texture, border_points(nodes[name])
        assert texture is not None
        assert len(points) > 50
        half = texture.reshape(SIZE // 2, 2, SIZE // 2, 2, 3).mean(axis=(1, 3))
        for level in (texture.astype(float), half):
            colors = bilinear(level, points)
            assert np.abs(colors - 255 * np.asarray(color)).max() <= 1.0
    if samples == 1:
        assert texture is not None
        colors = np.unique(texture.reshape(-1, 3), axis=0)
        assert len(colors) == 3  # both colours, and their mean far from all charts


def test_borders_of_charts_continue_the_decals(baked: Path) -> None:
    node = read_glb(baked)["ball"]
    ends = border_edges(node)
    assert node.uv is not None
    assert node.texture is not None
    uv, points, normals = (values[ends].mean(axis=1) for values in (node.uv, node.vertices, node.normals))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    want = expected_colors(ball_and_cube(), BALL, points, normals)
    errors = np.abs(bilinear(linear(node.texture / 255), uv) - want).max(axis=1)
    assert len(errors) > 50
    assert np.median(errors) < 0.02


def test_vertex_colours_are_linear_and_need_no_xatlas(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    need("trimesh")
    monkeypatch.setitem(__import__("sys").modules, "xatlas", None)
    scene, path = ball_and_cube(), tmp_path / "colors.glb"
    decals.bake(scene, path, vertex_colors=True)
    for number, (item, color) in enumerate(zip(scene.objects, (BALL, CUBE), strict=True)):
        points, normals, colors = (
            read_attribute(path, number, name).astype(float) for name in ("POSITION", "NORMAL", "COLOR_0")
        )
        assert isinstance(item, MeshObject)
        assert np.array_equal(points[: len(item.vertices)], item.vertices)
        assert len(points) == (24 if item.name == "cube" else len(item.vertices))
        want = expected_colors(scene, color, points, normals)
        assert (np.abs(colors - want).max(axis=1) > 1e-3).mean() < 0.02
    tree = read_json(path)
    assert "images" not in tree
    assert tree["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] == 0.0


def test_nodes_materials_and_normals(baked: Path) -> None:
    tree = read_json(baked)
    assert {node["name"] for node in tree["nodes"] if "mesh" in node} == {"ball", "cube"}
    assert len(tree["materials"]) == len(tree["textures"]) == len(tree["images"]) == 1
    assert tree["samplers"][tree["textures"][0]["sampler"]]["wrapS"] == 33071
    material = tree["materials"][0]
    assert material["doubleSided"]
    assert material["pbrMetallicRoughness"]["metallicFactor"] == 0.0
    ball = read_glb(baked)["ball"]
    assert np.abs(ball.normals - ball.vertices).max() < 0.02
    surface = ball_and_cube().objects[0].surface
    assert isinstance(surface, MeshSurface)
    expected = np.round(surface.vertices.astype(float), 5)
    assert {tuple(row) for row in np.round(ball.vertices, 5)} == {tuple(row) for row in expected}


@pytest.mark.parametrize("names", [("world", "scene"), ("scene", "scene-"), ("Kürbis 🎃", "a/b")])
def test_any_name_of_an_object_is_kept(tmp_path: Path, names: tuple[str, str]) -> None:
    need("trimesh")
    objects = []
    for name, item in zip(names, ball_and_cube().objects, strict=True):
        assert isinstance(item.surface, MeshSurface)
        objects.append(MeshObject(name, item.surface.vertices, item.surface.faces))
    scene = ball_and_cube().replace(objects=objects)
    decals.bake(scene, tmp_path / "names.glb", vertex_colors=True)
    assert {node["name"] for node in read_json(tmp_path / "names.glb")["nodes"] if "mesh" in node} == set(
        names
    )


@pytest.mark.parametrize("creases", [False, True], ids=["smooth", "creases"])
def test_a_tree_is_polygonized_and_keeps_its_colours(tmp_path: Path, creases: bool) -> None:
    need("trimesh", "xatlas")
    red, blue = (0.9, 0.1, 0.1), (0.1, 0.2, 0.9)
    lens = Point((0, 0, 0), radius=1.0, color=red) | Point((1.2, 0, 0), radius=1.0, color=blue)
    decals.bake(lens, tmp_path / "lens.glb", size=128, resolution=24, creases=creases)
    (node,) = read_glb(tmp_path / "lens.glb").values()
    points, _, uv = node.on_surface(500)
    assert np.abs(lens(points.astype(np.float32)) - 0.5).max() < 0.05
    assert node.texture is not None
    colors = bilinear(node.texture / 255, uv)
    side = np.abs(points[:, 0] - 0.6) > 0.25  # a seam that crosses the line is soft along a few texels
    want = np.where(points[:, :1] < 0.6, red, blue)
    assert np.abs(colors - want)[side].max() < 0.02
    copies = len(node.vertices) - len(np.unique(np.round(node.vertices, 5), axis=0))
    assert copies > 0


@pytest.mark.parametrize("scale", [1e-6, 1e6], ids=["tiny", "huge"])
def test_the_size_of_a_model_does_not_matter(baked: Path, tmp_path: Path, scale: float) -> None:
    decals.bake(ball_and_cube(scale=scale), tmp_path / "scaled.glb", size=SIZE, samples=1)
    same, scaled = read_glb(baked)["ball"], read_glb(tmp_path / "scaled.glb")["ball"]
    assert same.texture is not None
    assert scaled.texture is not None
    assert len(scaled.faces) == len(same.faces)
    assert scaled.texture.std(axis=(0, 1)) == pytest.approx(same.texture.std(axis=(0, 1)), rel=0.2)


def test_degenerate_faces_and_unused_vertices_are_left_out(tmp_path: Path) -> None:
    need("trimesh", "xatlas")
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [9e9, 0, 0], [0.5, 0, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 0, 1], [0, 4, 1], [2, 2, 2]], np.int32)
    scrap = MeshObject("scrap", vertices, faces)
    for vertex_colors in (False, True):
        decals.bake(scrap, tmp_path / "scrap.glb", size=32, vertex_colors=vertex_colors)
        (node,) = read_glb(tmp_path / "scrap.glb").values()
        assert len(node.faces) == 1
        assert node.vertices.max() == 1.0


def square(size: int, samples: int = 2) -> Array:
    """The texture of a square with decals, which covers all of it."""
    return square_texture(size, samples)()


def square_texture(size: int, samples: int = 2) -> Callable[[], Array]:
    """Return what makes the texture of a square with decals, which covers all of it."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    item = MeshObject("square", corners, [[0, 1, 2], [0, 2, 3]], (0.5, 0.5, 0.5))
    scene = decals.cover(item, count=30, images=["scale", "eye"], seed=2)
    mesh = bake_mesh(item, resolution=None, creases=False, report=lambda *_: None)
    places = size * np.column_stack([mesh.vertices[:, 0], 1 - mesh.vertices[:, 1]])
    tiles = np.zeros(len(mesh.faces), np.int32)
    part = Unwrapped(np.arange(len(places)), mesh.faces, places.astype(np.float32), tiles)
    colors = colors_module.SurfaceColors(
        [mesh], scene.objects, scene.decals, list(scene.images), scene.drawing
    )

    def texture() -> Array:
        (made,) = bake_texture([mesh], [part], size, samples, Channels(colors.at), lambda *_: None)
        return made

    return texture


@pytest.mark.slow
def test_blocks_bound_the_memory_and_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    texture = square_texture(256)
    whole = texture()
    for name in ("BLOCK_SAMPLES", "CARD_BLOCK_SAMPLES"):
        monkeypatch.setattr(texture_module, name, 1 << 11)
    tracemalloc.start()
    try:
        parts = texture()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert np.array_equal(parts, whole)
    assert peak < 3 * whole.nbytes


@pytest.fixture(scope="module")
def exact_square() -> Array:
    """The square in linear light, with texels a quarter as wide."""
    light: Array = linear(square(512, 1) / 255)
    return light


def error(texels: Array, exact: Array) -> float:
    """The mean squared difference of pixels three texels wide, as programs show them."""
    places = (np.arange(512) + 0.5) / 512
    uv = np.stack(np.meshgrid(places, 1 - places), axis=-1).reshape(-1, 2)
    apart = (bilinear(linear(texels / 255), uv).reshape(exact.shape) - exact)[:504, :504]
    return float((apart.reshape(42, 12, 42, 12, 3).mean(axis=(1, 3)) ** 2).mean())


@pytest.mark.slow
def test_several_samples_smooth_the_rims(exact_square: Array) -> None:
    assert error(square(128, 4), exact_square) < 0.8 * error(square(128, 1), exact_square)


def test_texels_make_up_for_what_programs_blur(exact_square: Array, monkeypatch: pytest.MonkeyPatch) -> None:
    sharp = square(128)
    monkeypatch.setattr(texture_module, "SHARPENING", 0.0)
    plain = square(128)
    assert error(sharp, exact_square) < 0.9 * error(plain, exact_square)


def test_stages_are_reported_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also while xatlas starts, and its input is larger than the buffer of a pipe."""
    need("trimesh", "xatlas")
    monkeypatch.setattr(atlas_module, "REPORT_SECONDS", 0.01)
    seen: list[tuple[str, float]] = []
    scene = Scene(
        objects=(TreeObject("ball", Point((0, 0, 0), radius=1.0)),), camera=decals.Camera((0, 0, 5))
    )
    decals.bake(
        scene,
        tmp_path / "a.glb",
        size=64,
        resolution=40,
        layout="xatlas",
        progress=lambda *report: seen.append(report),
    )
    stages = list(dict.fromkeys(stage for stage, _ in seen))
    assert stages[-4:] == ["unwrapping the surface", "colouring texels", "matching seams", "writing the file"]
    shares = [share for stage, share in seen if stage == "unwrapping the surface"]
    assert len(shares) > 3
    assert sorted(shares) == shares
    assert 0.0 < shares[-1] < 1.0
    assert seen[-1] == ("writing the file", 1.0)
    assert all(0.0 <= fraction <= 1.0 for _, fraction in seen)


def bumpy_scene() -> decals.Scene:
    """A ball and a cube under two layers of materials with tilted normals."""
    scene = ball_and_cube()
    maps = {"normal": (170, 90, 240), "emission": (0, 90, 30)}
    wide: dict[str, Any] = {name: np.full((8, 8, 3), value, np.uint8) for name, value in maps.items()}
    gold = decals.DecalMaterial(
        "gold",
        np.full((8, 8, 3), (250, 200, 90), np.uint8),
        roughness=0.35,
        metallic=0.9,
        occlusion=0.8,
        **wide,
    )
    images = [gold, *scene.images[1:]]
    return scene.replace(images=images, decals=scene.decals.replace(images=0, opacities=1.0))


def test_materials_at_points_are_the_reference_shaders() -> None:
    scene = bumpy_scene()
    decal = scene.decals
    rng = np.random.default_rng(4)
    owners = rng.integers(0, len(decal), 60)
    normals = unit(decal.normals[owners] + rng.normal(0, 0.2, (60, 3)))
    points = decal.positions[owners] + 0.2 * decal.radii[owners, None] * decal.tangents[owners]
    samples = decals.evaluate(decal, points, normals, images=scene.images, materials=True)
    assert samples.materials is not None
    assert samples.color is not None
    assert (samples.owner >= 0).all()
    maps = samples.materials
    tilt = (np.array([170.0, 90.0]) - 128) / 127
    single = samples.color[:, 3] == 1.0
    assert single.sum() > 30
    for row in np.nonzero(single)[0]:
        number = samples.owner[row]
        expected = tilted(normals[row : row + 1], decal.normals[number], decal.tangents[number], tilt)
        np.testing.assert_allclose(maps.normal[row], expected[0], atol=2e-3)
    for name, value in (("part", 255), ("roughness", 89), ("metallic", 230), ("occlusion", 204)):
        np.testing.assert_allclose(getattr(maps, name)[single], value / 255, atol=1e-4)
    np.testing.assert_allclose(maps.emission[single, 1], ((90 / 255 + 0.055) / 1.055) ** 2.4, atol=1e-4)


def test_materials_are_textures_of_a_file(tmp_path: Path) -> None:
    need("trimesh", "xatlas")
    scene, size, path = bumpy_scene(), 128, tmp_path / "a.glb"
    decals.bake(scene, path, size=size, samples=1)
    names = "metallicRoughnessTexture", "occlusionTexture", "normalTexture", "emissiveTexture"
    numbers = {mesh["name"]: number for number, mesh in enumerate(read_json(path)["meshes"])}
    for name, node in read_glb(path, names).items():
        assert node.uv is not None
        tangents = read_attribute(path, numbers[name], "TANGENT")
        np.testing.assert_allclose(np.linalg.norm(tangents[:, :3], axis=1), 1.0, atol=1e-5)
        corners = node.faces
        sides, turns = (np.diff(values[corners], axis=1) for values in (node.vertices, node.uv))
        over_u, over_v = np.swapaxes(np.linalg.solve(turns, sides), 0, 1)
        across = tangents[:, 3:] * np.cross(node.normals, tangents[:, :3])
        assert ((over_u * tangents[corners[:, 0], :3]).sum(axis=1) > 0).all()
        assert ((over_v * across[corners[:, 0]]).sum(axis=1) > 0).all()
        uv, points, normals, along = (
            values[corners].mean(axis=1) for values in (node.uv, node.vertices, node.normals, tangents)
        )
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        item = next(item for item in scene.objects if item.name == name)
        samples = decals.evaluate(scene.decals, points, normals, images=scene.images, materials=True, on=item)
        maps = samples.materials
        assert maps is not None
        inside = (np.hypot(*(samples.uv - 0.5).T) < 0.35) & (maps.part > 0.99)
        assert inside.sum() > 3
        row, column = ((1 - uv[:, 1]) * size).astype(int), (uv[:, 0] * size).astype(int)
        surface, occlusion, local, emission = (node.maps[key][row, column] for key in names)
        np.testing.assert_array_equal(surface, occlusion)
        expected = np.stack([maps.occlusion, maps.roughness, maps.metallic], axis=1)
        assert np.median(np.abs(surface / 255 - expected)[inside]) < 0.004
        assert np.median(np.abs(linear(emission / 255) - maps.emission)[inside]) < 0.004
        local = (local.astype(float) - 128) / 127
        up = along[:, 3:] * np.cross(normals, along[:, :3])
        bent = local[:, :1] * along[:, :3] + local[:, 1:2] * up + local[:, 2:] * normals
        assert np.median(np.linalg.norm(bent - maps.normal, axis=1)[inside]) < 0.03
    material = read_json(path)["materials"][0]
    assert material["emissiveFactor"] == [1, 1, 1]
    assert material["pbrMetallicRoughness"].get("metallicFactor", 1) == 1
