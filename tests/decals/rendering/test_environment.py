"""Pictures as light: prefiltering against sums over the sphere, pixels against a float64 reference shader."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

import decals
from decals import Camera, Scene
from decals.errors import ImplicitDecalsError, InvalidImage, InvalidScene
from decals.images.texels import decode_srgb, encode_srgb
from decals.rendering import Drawing, Environment, Lighting, Renderer, RenderOptions
from decals.rendering.prefiltering import (
    GRID_ROWS,
    TABLE_SHAPE,
    level_alpha,
    lobe_means,
    panorama_cells,
    reflection_table,
)
from tests.decals.rendering.test_materials import LIGHTS, ball, scene_of, uniform
from tests.oracles import environment as reference
from tests.oracles.materials import Surface, direct, tone_mapped
from tests.vectors import unit

SIZE = (64, 48)


def sky(rows: int = 64) -> np.ndarray:
    """A blue sky over brown ground, with a lamp that is wider than a few cells."""
    towards = reference.directions(rows)
    up = towards[..., 1:2]
    air = np.where(up > 0, np.array([0.3, 0.5, 0.9]) * (1 - 0.5 * up), np.array([0.3, 0.25, 0.2]))
    lamp = np.array([2, 3, 4]) / np.sqrt(29)
    return np.asarray(air + 6 * np.exp(40 * (towards @ lamp - 1))[..., None] * np.array([1, 0.8, 0.6]))


@pytest.fixture(scope="module")
def environment() -> Environment:
    return Environment(sky())


def bytes_of(light: np.ndarray) -> np.ndarray:
    """Pixels of linear light."""
    return np.asarray(255 * encode_srgb(np.clip(tone_mapped(np.atleast_2d(light)), 0, 1)))


@pytest.mark.parametrize("alpha", [0.05, 0.3, 1.0])
def test_means_in_lobes_are_sums_over_the_sphere(alpha: float) -> None:
    rows = 32
    cells = np.random.default_rng(1).random((rows, 2 * rows, 3)) ** 6
    grid = lobe_means(cells.astype(np.float32), alpha)
    for row, column in ((0, 3), (1, 5), (16, 0), (20, 41), (31, 63), (32, 9)):
        polar, turn = row * np.pi / rows, column * np.pi / rows - np.pi
        axis = np.array([np.sin(polar) * np.sin(turn), np.cos(polar), -np.sin(polar) * np.cos(turn)])
        np.testing.assert_allclose(grid[row, column], reference.lobe_mean(cells, axis, alpha), rtol=1e-5)
    np.testing.assert_array_equal(grid[:, 0], grid[:, -1])
    turned = lobe_means(np.roll(cells, 8, axis=1).astype(np.float32), alpha)
    np.testing.assert_allclose(turned[:, 8:], grid[:, :-8], rtol=1e-5)
    even = np.full((rows, 2 * rows, 3), 0.7, np.float32)
    np.testing.assert_allclose(lobe_means(even, alpha), 0.7, rtol=1e-6)


def test_the_table_is_the_integral_of_the_model() -> None:
    table = np.stack(reflection_table(), axis=-1)
    for row, column in ((16, 63), (22, 2), (31, 20)):
        roughness, seen = row / (TABLE_SHAPE[0] - 1), column / (TABLE_SHAPE[1] - 1)
        wanted = reference.reflected_parts(seen, roughness, 120)
        np.testing.assert_allclose(table[row, column], wanted, atol=0.004)
    np.testing.assert_allclose(table[0, 1:, :2].sum(axis=-1), 1.0, atol=1e-6)  # mirrors keep all light


def test_another_size_keeps_the_light_of_all_parts_of_the_sphere() -> None:
    light = sky(24).astype(np.float32)
    for rows in (8, 12, 36):
        cells = panorama_cells(light, rows)
        assert cells.shape == (rows, 2 * rows, 3)
        before, after = (
            (part * reference.areas(len(part))[:, None, None]).sum(axis=(0, 1)) for part in (light, cells)
        )
        np.testing.assert_allclose(before, after, rtol=1e-5)
    np.testing.assert_allclose(panorama_cells(light, 48)[::2, ::2], light, rtol=1e-6)


def split_sum(
    cells: np.ndarray,
    normal: np.ndarray,
    eye: np.ndarray,
    *,
    albedo: np.ndarray,
    roughness: float,
    metallic: float,
) -> np.ndarray:
    """Reflected light, from exact means in the lobes, and from the table between its entries."""
    alpha, seen = roughness**2, max(float(normal @ eye), 1e-3)
    axis = unit(
        normal + (2 * (normal @ eye) * normal - eye - normal) * (1 - alpha) * (np.sqrt(1 - alpha) + alpha)
    )
    level = np.log2(1 + alpha * (2.0 ** (len(GRID_ROWS) - 1) - 1))
    below = min(int(level), len(GRID_ROWS) - 2)
    near, far = (reference.lobe_mean(cells, axis, level_alpha(below + i)) for i in (0, 1))
    radiance = near + (far - near) * (level - below)
    row, column = roughness * (TABLE_SHAPE[0] - 1), seen * (TABLE_SHAPE[1] - 1)
    i, j = min(int(row), TABLE_SHAPE[0] - 2), min(int(column), TABLE_SHAPE[1] - 2)
    weights = np.outer([1 - row + i, row - i], [1 - column + j, column - j])
    factor, added, grazing = ((weights * table[i : i + 2, j : j + 2]).sum() for table in reflection_table())
    base = 0.04 + (albedo - 0.04) * metallic
    ambient = (1 - base) * (1 - grazing) * (1 - metallic) * albedo * reference.lobe_mean(cells, normal, 1.0)
    return np.asarray(ambient + (base * factor + added) * radiance)


CASES = [(0.35, 1.0, 0.0), (0.6, 0.0, 60.0), (1.0, 0.5, 0.0)]


@pytest.mark.ordinary_cases("fragment-0.6-0.0-60.0")
@pytest.mark.parametrize(("roughness", "metallic", "rotation"), CASES)
def test_pixels_are_the_split_sum_and_near_the_integral(
    drawer: Renderer, environment: Environment, roughness: float, metallic: float, rotation: float
) -> None:
    color = (230, 190, 120)
    scene = scene_of([uniform("m", color, (128, 128), roughness=roughness, metallic=metallic)], [1.0])
    turned = Environment(environment.picture, rotation=rotation, strength=0.8, up=(0, 0, 1))
    options = RenderOptions(size=SIZE, samples=1, environment=turned)
    picture, buffers = drawer.render(scene, options), drawer.buffers(scene, options)
    shown = (buffers.owner == 0) & (np.hypot(*np.moveaxis(buffers.uv - 0.5, -1, 0)) < 0.45)
    cosine, sine = np.cos(np.radians(rotation)), np.sin(np.radians(rotation))
    frame = np.array([[cosine, sine, 0], [0, 0, 1], [sine, -cosine, 0]])  # right, up, front
    surface: dict[str, Any] = {"albedo": decode_srgb(np.array(color) / 255)}
    surface |= {"roughness": round(255 * roughness) / 255, "metallic": round(255 * metallic) / 255}
    cells, off = 0.8 * sky(), list[float]()
    far = list[float]()
    for row, column in np.argwhere(shown)[::89]:
        normal = frame @ buffers.normal[row, column].astype(float)
        eye = frame @ (np.array(scene.camera.position) - buffers.position[row, column])
        normal, eye = normal / np.linalg.norm(normal), eye / np.linalg.norm(eye)
        pixel = picture[row, column, :3].astype(float)
        for errors, model in ((off, split_sum), (far, reference.reflected)):
            errors.append(np.abs(pixel - bytes_of(model(cells, normal, eye, **surface))).max())
    print(f"{len(off)} pixels: {max(off):.2f}; {max(far):.2f}, mean {np.mean(far):.2f}")
    assert len(off) >= 10
    assert max(off) <= 1.5
    assert max(far) <= 9.0
    assert np.mean(far) <= 3.0


EVEN = Environment(np.full((2, 4, 3), 0.6))


@pytest.mark.ordinary_cases("255-0.6-1.0")
@pytest.mark.parametrize(
    ("color", "roughness", "metallic"), [(255, 0.5, 0.0), (255, 0.6, 1.0), (200, 1.0, 0.5)]
)
def test_even_light_keeps_the_energy_of_the_model(
    renderer: Renderer, color: int, roughness: float, metallic: float
) -> None:
    """A white furnace: of even light, each point reflects what the integral of the model says."""
    scene = scene_of([uniform("m", (color,) * 3, (128, 128), roughness=roughness, metallic=metallic)], [1.0])
    options = RenderOptions(size=SIZE, samples=1, environment=EVEN)
    picture, buffers = renderer.render(scene, options), renderer.buffers(scene, options)
    shown = (buffers.owner == 0) & (np.hypot(*np.moveaxis(buffers.uv - 0.5, -1, 0)) < 0.45)
    albedo, metal = float(decode_srgb(np.array(color / 255))), round(255 * metallic) / 255
    base = 0.04 + (albedo - 0.04) * metal
    for row, column in np.argwhere(shown)[::397]:
        eye = np.array(scene.camera.position) - buffers.position[row, column]
        seen = float(buffers.normal[row, column] @ eye / np.linalg.norm(eye))
        factor, added, grazing = reference.reflected_parts(seen, round(255 * roughness) / 255, 200)
        light = base * factor + added + (1 - base) * (1 - grazing) * (1 - metal) * albedo
        assert np.abs(picture[row, column, :3] - bytes_of(np.full(3, 0.6 * light))).max() <= 1.5


def bare(camera: Camera) -> Scene:
    """The ball without decals."""
    return Scene(objects=[ball()], camera=camera)


@pytest.mark.slow
def test_a_turned_picture_has_its_columns_moved(renderer: Renderer, environment: Environment) -> None:
    turned = Environment(environment.picture, rotation=90)
    rolled = Environment(np.roll(sky(), -32, axis=1))  # a quarter to the left, seen from within
    pictures = [
        renderer.render(bare(Camera((0, 1, 5))), RenderOptions(size=SIZE, samples=1, environment=one)).astype(
            int
        )
        for one in (turned, rolled)
    ]
    assert np.abs(pictures[1] - pictures[0]).max() <= 1


def test_a_turned_picture_is_a_turned_scene(renderer: Renderer, environment: Environment) -> None:
    def drawn(camera: Camera, environment: Environment) -> np.ndarray:
        options = RenderOptions(size=SIZE, samples=1, environment=environment)
        return renderer.render(bare(camera), options).astype(int)

    turned = drawn(Camera((0, 1, 5)), Environment(environment.picture, rotation=90))
    assert np.abs(turned - drawn(Camera((-5, 1, 0)), environment)).max() <= 3  # the ball has facets
    assert np.abs(turned - drawn(Camera((0, 1, 5)), environment)).max() > 40
    upright = Environment(environment.picture, up=(0, 0, 1))
    assert (
        np.abs(drawn(Camera((0, -5, 1), up=(0, 0, 1)), upright) - drawn(Camera((0, 1, 5)), environment)).max()
        <= 3
    )


def test_a_visible_environment_is_the_background(renderer: Renderer, environment: Environment) -> None:
    camera = Camera((0, 0, 0.1), (0.3, 0.2, -1), fov=100)
    shown = Environment(environment.picture, visible=True, strength=0.5)
    empty = Scene(
        objects=[decals.MeshObject("far", [[0, 0, 9], [1, 0, 9], [0, 1, 9]], [[0, 1, 2]])], camera=camera
    )
    picture = renderer.render(empty, RenderOptions(size=SIZE, samples=1, environment=shown))
    assert (picture[..., 3] == 255).all()
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, SIZE[1] - np.arange(SIZE[1]) - 0.5)
    rays = unit(camera.rays(*SIZE).directions(x, y))
    rows = np.arccos(rays[..., 1]) / np.pi * 64 - 0.5
    columns = (0.5 + np.arctan2(rays[..., 0], -rays[..., 2]) / (2 * np.pi)) * 128 - 0.5
    padded = np.pad(sky(), ((0, 0), (1, 1), (0, 0)), "wrap")
    light = [map_coordinates(padded[..., i], [rows, columns + 1], order=1, mode="nearest") for i in range(3)]
    wanted = bytes_of(0.5 * np.stack(light, axis=-1).reshape(-1, 3)).reshape(picture[..., :3].shape)
    assert np.abs(picture[..., :3] - wanted).max() <= 1.0
    assert np.ptp(rows) > 32


def test_lights_are_added_to_an_environment(renderer: Renderer, environment: Environment) -> None:
    scene = scene_of([uniform("m", (200, 150, 90), (128, 128), roughness=0.5, metallic=1.0)], [1.0])
    dark = Environment(environment.picture, strength=0.0)
    options = RenderOptions(size=SIZE, samples=1, environment=dark, lights=Lighting(LIGHTS))
    picture, buffers = renderer.render(scene, options), renderer.buffers(scene, options)
    shown = (buffers.owner == 0) & (np.hypot(*np.moveaxis(buffers.uv - 0.5, -1, 0)) < 0.45)
    position, normal = (part[shown].astype(float) for part in (buffers.position, buffers.normal))
    eye = np.array(scene.camera.position) - position
    levels: Any = [np.full(len(eye), value) for value in (128 / 255, 1.0, 1.0)] + [None]
    albedo: Any = np.tile(decode_srgb(np.array([200, 150, 90]) / 255), (len(eye), 1))
    toward_eye = eye / np.linalg.norm(eye, axis=1)[:, None]
    surface = Surface(position, normal, toward_eye, albedo, *levels)
    sun, lamp = LIGHTS
    away = np.array(lamp.position) - position
    far = np.linalg.norm(away, axis=1)
    strength = 1 / (np.array(lamp.attenuation) @ np.array([far**0, far, far**2]))
    towards = np.broadcast_to(-np.array(sun.direction), normal.shape)
    colors: Any = decode_srgb(np.array(sun.color)), decode_srgb(np.outer(strength, lamp.color))
    light = direct(surface, towards, colors[0]) + direct(surface, away / far[:, None], colors[1])
    assert np.abs(picture[shown][:, :3] - bytes_of(light)).max() <= 2.0


BROKEN = np.ones((4, 8, 3))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.where(np.arange(96).reshape(4, 8, 3) == 30, np.nan, BROKEN),), "got nan in row 1, column 2"),
        ((-BROKEN,), "at least 0, got -1 in row 0, column 0"),
        ((BROKEN * np.inf,), "got inf in row 0"),
        ((np.ones((1, 1, 3)),), "twice as wide as high, got 1 x 1"),
        ((np.ones((64, 64, 3), np.uint8),), "twice as wide as high, got 64 x 64"),
        ((np.ones((4, 8, 2)),), r"environment: expected an image of shape .*\[4, 8, 2\]"),
        ((np.ones((0, 8, 3)),), r"environment: expected an image .*\[0, 8, 3\]"),
        (("no such sky.hdr",), r"environment: .*found no file 'no such sky.hdr'; .* Radiance \(.hdr\)"),
        (("scale",), "environment: .*found no file 'scale'; give an equirectangular picture"),
        ((__file__,), r"environment: .*is not a picture; .*, such as OpenEXR, to \.hdr"),
        ((5,), "environment: expected"),
        ((BROKEN, np.nan), "rotation"),
        ((BROKEN, 0.0, -1.0), "strength: expected 0, which is darkness, to 65504, got -1"),
        ((BROKEN, 0.0, 1e39), "strength: .* got 1e\\+39"),
        ((BROKEN, 0.0, 1.0, 1), "visible"),
        ((BROKEN, 0.0, 1.0, True, (0, 0, 0)), "up: expected a direction"),
    ],
)
def test_invalid_environments_are_refused(arguments: Any, message: str) -> None:
    with pytest.raises((InvalidImage, InvalidScene), match=message):
        Environment(*arguments)
    if len(arguments) == 1:
        with pytest.raises(ImplicitDecalsError, match=message):
            Drawing(environment=arguments[0])


def test_pictures_of_all_kinds_are_linear_light(tmp_path: Path) -> None:
    assert Environment(np.full((2, 4, 3), 1e9)).picture.light.max() == 65504
    for kind in (np.array, np.ndarray.tolist):
        half, grey = kind(np.full((2, 4, 3), 0.5)), kind(np.full((2, 4), 3.0))
        np.testing.assert_array_equal(Environment(half).picture.light, 0.5)
        np.testing.assert_array_equal(Environment(grey).picture.light, np.full((2, 4, 3), 3.0))
    np.testing.assert_allclose(
        Environment(np.full((2, 4, 3), 128, np.uint8)).picture.light,
        decode_srgb(np.array(128 / 255)),
        rtol=1e-6,
    )
    pixels = b"".join(bytes((128, 64, 0, 130)) for _ in range(8))
    (tmp_path / "sky.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n" + pixels)
    loaded = Environment(str(tmp_path / "sky.hdr"))
    np.testing.assert_allclose(loaded.picture.light[1, 3], [2, 1, 0])
    same = Environment(loaded.picture.light)
    assert loaded == same
    assert hash(loaded) == hash(same)
    assert loaded != Environment(loaded.picture, rotation=1)
    assert loaded != EVEN
    assert repr(loaded).startswith(f"Environment(picture={str(tmp_path / 'sky.hdr')!r}, rotation=0.0")
    assert repr(same).startswith("Environment(picture=<4 x 2 pixels>, rotation=0.0")
    kept = same.picture.kept_at("light.hdr")
    assert (kept.source, same.picture.source, kept) == ("light.hdr", "", same.picture)
