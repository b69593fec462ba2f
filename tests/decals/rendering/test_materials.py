"""Materials in pictures: every pixel against a float64 reference shader; scenes without maps as before."""

import re
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from decals import Camera, DecalImage, DecalMaterial, Decals, MeshObject, Scene, load_scene
from decals.errors import InvalidImage, InvalidScene
from decals.images.texels import decode_srgb, encode_srgb
from decals.rendering import Light, Lighting, Renderer, RenderOptions
from decals.scenes.material import MAP_NAMES
from decals.scenes.script import write_script
from tests.decals.rendering.pictures import scattered
from tests.decals.shapes import sheet_faces, torus
from tests.oracles import materials as reference
from tests.vectors import unit

SIZE = (96, 72)
COLOR = 0.5, 0.4, 0.3
LIGHTS = (
    Light((0.8, 0.7, 0.6), (-0.6, -0.64, -0.48)),
    Light((0.5, 0.6, 0.9), (0, 0, -1), position=(2, 3, 4), attenuation=(1, 0.1, 0.02)),
)


def ball() -> MeshObject:
    """A sphere fine enough that interpolated normals are exact to 1e-4."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 129), np.linspace(0, np.pi, 65), indexing="ij")
    vertices = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], -1).reshape(-1, 3)
    return MeshObject("ball", vertices, sheet_faces(129, 65)[:, ::-1], color=COLOR)


def uniform(name: str, color: Any, tilt: tuple[int, int], emission: Any = (0, 0, 0), **levels: Any) -> Any:
    """A material of one texel's values everywhere."""
    maps = {"normal": np.array([*tilt, 255], np.uint8), "emission": np.array(emission, np.uint8)}
    wide: dict[str, Any] = {key: np.broadcast_to(value, (8, 8, 3)) for key, value in maps.items()}
    pixels = np.broadcast_to(np.array([*color, 255], np.uint8), (8, 8, 4))
    return DecalMaterial(name, pixels.copy(), **wide, **levels)


GOLD = uniform("gold", (250, 200, 90), (170, 90), roughness=0.35, metallic=1.0, occlusion=0.8)
PLASTIC = uniform("plastic", (180, 30, 40), (128, 128), (0, 40, 90), roughness=0.6)
ROUGH = uniform("rough", (90, 120, 60), (100, 150), roughness=1.0, metallic=0.3)


def scene_of(images: list[Any], opacities: list[float]) -> Scene:
    """Large decals over each other on a ball, in layers; the camera looks at them."""
    count = len(images)
    decals = Decals(
        np.tile([0.48, -0.6, 0.64], (count, 1)),
        np.tile([0.48, -0.6, 0.64], (count, 1)),
        np.tile([0.8, 0.6, 0.0], (count, 1)),
        1.3,
        images=np.arange(count),
        layers=np.arange(count),
        opacities=opacities,
    )
    camera = Camera((1.9, -3.1, 2.9), (0, 0, 0), (0, 0, 1), 30.0)
    return Scene(objects=[ball()], camera=camera, decals=decals, images=images)


def expected(scene: Scene, position: np.ndarray, normal: np.ndarray, lights: Any) -> np.ndarray:
    """sRGB bytes of points under all decals, as float64."""
    decals, count = scene.decals, len(position)
    eye = np.array(scene.camera.position)
    toward_eye = (eye - position) / np.linalg.norm(eye - position, axis=1, keepdims=True)
    back = eye / np.linalg.norm(eye)
    right = unit(np.cross([0, 0, 1], back))
    camera = np.stack([right, np.cross(back, right), back], 1)
    albedo = np.tile(decode_srgb(np.array(COLOR)), (count, 1))
    left, part = 1.0, 0.0
    sums: dict[str, Any] = {
        "normal": 0.0,
        "roughness": 0.0,
        "metallic": 0.0,
        "occlusion": 0.0,
        "emission": 0.0,
    }
    for i in reversed(range(len(decals))):
        image, weight = scene.images[i], left * float(decals.opacities[i])
        if isinstance(image, DecalMaterial):
            tilt = (image.normal[0, 0, :2].astype(float) - 128) / 127
            u, n_p = decals.tangents[i].astype(float), decals.normals[i].astype(float)
            sums["normal"] = sums["normal"] + weight * reference.tilted(normal, n_p, u, tilt)
            for name in ("roughness", "metallic", "occlusion"):
                sums[name] += weight * getattr(image, name)[0, 0] / 255
            sums["emission"] = sums["emission"] + weight * decode_srgb(image.emission[0, 0] / 255)
            part += weight
        left -= weight
    albedo *= left
    left = 1.0
    for i in reversed(range(len(decals))):
        weight = left * float(decals.opacities[i])
        albedo += weight * decode_srgb(scene.images[i].pixels[0, 0, :3] / 255)
        left -= weight
    bent: Any = sums["normal"] / np.linalg.norm(sums["normal"], axis=1, keepdims=True)
    bent = unit(bent - np.minimum((bent * toward_eye).sum(axis=1) - 1e-3, 0)[:, None] * toward_eye)
    levels = {name: np.full(count, sums[name] / part) for name in ("roughness", "metallic", "occlusion")}
    emission = np.broadcast_to(sums["emission"] / part, (count, 3))
    base: Any = albedo
    surface = reference.Surface(position, bent, toward_eye, base, emission=emission, **levels)
    if lights is None:
        assert part == 1.0
        return np.asarray(255 * encode_srgb(np.clip(reference.studio(surface, camera), 0, 1)))
    plain = sum(
        np.maximum(_received(light, position, normal), 0)[:, None] * np.array(light.color) for light in lights
    )
    dull = decode_srgb(np.clip(encode_srgb(albedo) * plain, 0, 1))
    light = reference.lamps(surface, lights, camera, decode_srgb)
    return np.asarray(255 * encode_srgb(np.clip(dull + part * (light - dull), 0, 1)))


def _received(light: Light, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
    if light.position is None:
        return np.asarray(-normal @ np.array(light.direction))
    away = np.array(light.position) - position
    far = np.linalg.norm(away, axis=1)
    attenuation = np.array(light.attenuation) @ np.array([far**0, far, far**2])
    return np.asarray((normal * away).sum(axis=1) / far / attenuation)


@pytest.mark.slow_cases("compute-images6-opacities6-lights6-True", "compute-images2-opacities2-None-False")
@pytest.mark.parametrize(
    ("images", "opacities", "lights", "filtered"),
    [
        ([GOLD], [1.0], None, False),
        ([PLASTIC], [1.0], None, False),
        ([ROUGH, GOLD], [1.0, 0.4], None, False),
        ([GOLD], [1.0], LIGHTS, False),
        ([PLASTIC, ROUGH], [0.5, 0.6], LIGHTS, False),
        ([DecalImage("plain", np.full((8, 8, 4), 200, np.uint8)), GOLD], [0.0, 0.7], LIGHTS, False),
        ([PLASTIC, ROUGH], [0.5, 0.6], LIGHTS, True),
    ],
)
def test_every_pixel_is_the_reference_shaders(
    drawer: Renderer, images: list[Any], opacities: list[float], lights: Any, filtered: bool
) -> None:
    scene = scene_of(images, opacities)
    options: dict[str, Any] = {} if lights is None else {"lights": Lighting(lights)}
    picture = drawer.render(scene, RenderOptions(size=SIZE, samples=1, filtered=filtered, **options))
    buffers = drawer.buffers(scene, RenderOptions(size=SIZE, **options))
    rim = 0.44 if filtered else 0.48  # pixels on the rim are mixed
    shown = (buffers.owner == len(images) - 1) & (np.hypot(*np.moveaxis(buffers.uv - 0.5, -1, 0)) < rim)
    assert shown.sum() > 700
    wanted = expected(
        scene, buffers.position[shown].astype(float), buffers.normal[shown].astype(float), lights
    )
    worst = np.abs(picture[shown][:, :3] - wanted).max()
    print(f"{worst:.2f}")
    assert worst <= 2.0


@pytest.mark.slow
def test_filtered_maps_are_nearer_to_many_samples(renderer: Renderer) -> None:
    """Bumps and stripes of four texels, on decals of 10 to 25 pixels."""
    y, x = np.mgrid[:128, :128] * (32 * np.pi / 128)
    tilt = np.stack([0.5 * np.cos(x), 0.4 * np.sin(y)])
    normals = np.stack([*tilt, np.sqrt(1 - (tilt**2).sum(axis=0))], axis=-1)
    colors = np.stack([150 + 80 * np.sin(x), 140 + 60 * np.cos(y), 120 + 0 * x], axis=-1)
    bumps = DecalMaterial(
        "bumps",
        colors.astype(np.uint8),
        normal=(128 + 127 * normals).astype(np.uint8),
        roughness=0.35 + 0.2 * np.sin(y / 2),
        metallic=1.0,
    )
    shape = MeshObject("torus", torus().vertices, torus().faces)
    decals = scattered(shape, 60, 2, radii=(0.15, 0.4))
    camera = Camera.fitting(shape.vertices, direction=(0.5, -0.9, 0.8), up=(0, 0, 1))
    scene = Scene(objects=[shape], camera=camera, decals=decals, images=[bumps])
    wanted = renderer.render(scene, RenderOptions(SIZE, samples=8)).astype(float)
    one, averaged = (
        renderer.render(scene, RenderOptions(SIZE, samples=1, filtered=on)).astype(float)
        for on in (False, True)
    )
    shown = renderer.buffers(scene, RenderOptions(SIZE)).owner >= 0
    noise = [((picture - wanted)[shown] ** 2).mean() for picture in (one, averaged)]
    assert noise[1] < 0.5 * noise[0]


def test_without_maps_pictures_are_as_before(renderer: Renderer) -> None:
    """A material alone changes its own pixels; in a scene without one, the shaders have no maps."""
    shape = MeshObject("torus", torus().vertices, torus().faces)
    decals = scattered(shape, 40, 2, radii=(0.1, 0.4))
    camera = Camera.fitting(shape.vertices, direction=(0.5, -0.9, 0.8), up=(0, 0, 1))
    plain = DecalImage("gold", GOLD.pixels)
    options = RenderOptions(size=SIZE, samples=1)
    scene = Scene(objects=[shape], camera=camera, decals=decals, images=[plain])
    before = renderer.render(scene, options)
    shining = renderer.render(scene.replace(images=[GOLD]), options)
    both = scene.replace(images=[plain, GOLD], decals=decals.replace(images=np.arange(40) % 2))
    mixed, owner = renderer.render(both, options), renderer.buffers(both, RenderOptions(size=SIZE)).owner
    np.testing.assert_array_equal(renderer.render(scene, options), before)
    bare, metal = owner < 0, (owner >= 0) & (owner % 2 == 1)
    assert np.abs(mixed[~metal].astype(int) - before[~metal]).max() <= 1
    assert (np.abs(mixed[metal].astype(int) - shining[metal]).max(axis=1) <= 1).mean() > 0.99
    assert np.abs(shining[bare].astype(int) - before[bare]).max() <= 1
    assert (shining[metal] != before[metal]).any(axis=1).mean() > 0.9


@pytest.mark.parametrize(
    ("maps", "message"),
    [
        ({"normal": np.zeros((4, 8, 3), np.uint8)}, "expected 8 x 8 pixels as the base colour, got 8 x 4"),
        ({"normal": np.zeros((8, 8), np.uint8)}, "expected an image with three channels"),
        ({"emission": np.zeros((8, 8, 1), np.uint8)}, "expected an image with three channels"),
        ({"roughness": 1.5}, "expected a number from 0 to 1"),
        ({"metallic": np.full((8, 8), np.nan)}, "expected bytes, or floats from 0 to 1"),
        ({"height": np.full((8, 8), np.nan)}, "expected finite heights, got nan in row 0"),
        ({"height": np.full((8, 8), 0.6), "relief": 2.0}, "expected heights up to 1 radius, got 1.2"),
        ({"height": np.full((8, 8), 0.6), "relief": np.nan}, "expected a number of radii, got nan"),
        ({"relief": 0.5}, "give a height map"),
        ({"height": np.zeros((8, 9))}, "expected 8 x 8 pixels"),
        ({"occlusion": "no such file.png"}, "found no file"),
    ],
)
def test_invalid_maps_are_refused(maps: Any, message: str) -> None:
    with pytest.raises(InvalidImage, match=message):
        DecalMaterial("bad", GOLD.pixels, **maps)


def picture_file(path: Path, value: Any, size: int = 4) -> None:
    Image.fromarray(np.broadcast_to(np.array(value, np.uint8), (size, size, np.size(value))).squeeze()).save(
        path
    )


def test_folders_of_maps_are_found_by_their_names(tmp_path: Path) -> None:
    values = {
        "Steel_01_BaseColor.png": (200, 100, 50),
        "steel_01-normalGL.png": (100, 150, 250),
        "STEEL_ROUGHNESS.png": 90,
        "steel.metalness.png": 200,
        "steel_AO.png": 180,
        "steel_emissive.png": (1, 2, 3),
        "steel_height.png": 51,
        "readme.png": 7,
    }
    for name, value in values.items():
        picture_file(tmp_path / name, value)
    material = DecalMaterial.load(tmp_path)
    assert material.source == tmp_path.name
    assert material.pixels[0, 0].tolist() == [200, 100, 50, 255]
    assert material.normal[3, 3].tolist() == [100, 150, 250]
    levels = [material.roughness, material.metallic, material.occlusion]
    assert [level[1, 2] for level in levels] == [90, 200, 180]
    assert material.emission[0, 0].tolist() == [1, 2, 3]
    assert material.height is not None
    assert material.height[0, 0] == np.float32(0.2)
    assert (material.relief, DecalMaterial.load(tmp_path, relief=0.3).relief) == (0.0, 0.3)
    picture_file(tmp_path / "other_rough.png", 3)
    with pytest.raises(InvalidImage, match="expected one file for the map 'roughness', got"):
        DecalMaterial.load(tmp_path)
    picture_file(tmp_path / "other_rough.png", 3, size=5)
    (tmp_path / "STEEL_ROUGHNESS.png").unlink()
    with pytest.raises(InvalidImage, match="roughness: expected 4 x 4 pixels as the base colour, got 5 x 5"):
        DecalMaterial.load(tmp_path)
    (tmp_path / "Steel_01_BaseColor.png").unlink()
    with pytest.raises(InvalidImage, match="expected a file of the base colour"):
        DecalMaterial.load(tmp_path)
    with pytest.raises(InvalidImage, match="expected a folder of maps, found none"):
        DecalMaterial.load(tmp_path / "none")


def test_files_and_scripts_keep_materials(tmp_path: Path) -> None:
    heights = np.random.default_rng(1).normal(size=(8, 8)).astype(np.float32)
    rich = DecalMaterial(
        "rich",
        GOLD.pixels,
        GOLD.normal,
        GOLD.roughness,
        emission=PLASTIC.emission,
        height=heights,
        relief=0.2,
    )
    scene = scene_of([rich, "scale", PLASTIC], [1.0, 1.0, 0.5])
    scene.save(tmp_path / "scene.json")
    write_script(scene, tmp_path / "scene.py")
    loaded = load_scene(tmp_path / "scene.json"), runpy.run_path(str(tmp_path / "scene.py"))["scene"]
    for again in loaded:
        assert [type(image) for image in again.images] == [DecalMaterial, DecalImage, DecalMaterial]
        for image, other in zip(scene.images, again.images, strict=True):
            for name in (*MAP_NAMES, "relief") if isinstance(image, DecalMaterial) else ("pixels",):
                np.testing.assert_array_equal(getattr(image, name), getattr(other, name))
    text = (tmp_path / "scene.json").read_text()
    outside = re.sub('"normal": ?"data:[^"]*"', '"normal":"../secret.png"', text, count=1)
    assert outside != text
    (tmp_path / "outside.json").write_text(outside)
    with pytest.raises(InvalidScene, match="expected files in the folder"):
        load_scene(tmp_path / "outside.json")
    (tmp_path / "short.json").write_text(re.sub('"height": ?"[^"]{8}', '"height":"', text, count=1))
    with pytest.raises(InvalidScene, match="material 'rich'"):
        load_scene(tmp_path / "short.json")
