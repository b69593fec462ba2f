"""Baked scenes to test with, and GLB files read back: texels, nodes and colours."""

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import decals
from decals import DecalImage, Decals, Interaction, MeshObject, Scene
from tests.decals.meshes import box, icosphere
from tests.oracles.decals import colors_at

Array = NDArray[Any]

BALL, CUBE = (0.2, 0.5, 0.8), (0.9, 0.4, 0.1)
"""Colours of the objects."""


def need(*packages: str) -> None:
    """Skip a test where a package of the extra is absent."""
    for package in packages:
        pytest.importorskip(package, reason=f"{package} is not installed; it is in the extra `bake`")


def gradient(seed: int) -> Array:
    """A small smooth image, opaque in the middle."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:12, 0:12] / 11
    colors = [a * x + b * y + (1 - a - b) * x * y for a, b in rng.uniform(0, 0.5, (3, 2))]
    alpha = np.clip(1.6 - 1.2 * np.hypot(x - 0.5, y - 0.5), 0, 1)
    pixels: Array = np.rint(255 * np.stack([*colors, alpha], axis=-1)).astype(np.uint8)
    return pixels


def ball_and_cube(*, count: int = 60, scale: float = 1.0) -> Scene:
    """A ball and a cube that touch, with decals of all interactions in two layers, tints and opacities."""
    rng = np.random.default_rng(3)
    vertices, faces = icosphere(3)
    cube = box((1.2, 1.2, 1.2), (1.5, 0.0, 0.0))
    objects = (
        MeshObject("ball", scale * vertices, faces, BALL),
        MeshObject("cube", scale * cube.vertices, cube.faces, CUBE),
    )
    positions, normals = (
        np.concatenate(parts)
        for parts in zip(*(item.surface.sample(count // 2, seed=1) for item in objects), strict=True)
    )
    images = (DecalImage("a", gradient(1)), DecalImage("b", gradient(2)))
    there = Decals(
        positions,
        normals,
        rng.normal(size=positions.shape),
        scale * rng.uniform(0.15, 0.45, len(positions)),
        images=rng.integers(-1, 2, len(positions)),
        tints=rng.uniform(0.3, 1.0, (len(positions), 3)),
        opacities=rng.uniform(0.6, 1.0, len(positions)),
        interactions=rng.choice(list(Interaction), len(positions)),
        layers=rng.integers(0, 2, len(positions)),
    )
    camera = decals.Camera((2.0 * scale, 3.0 * scale, 5.0 * scale), target=(0.7 * scale, 0, 0))
    return Scene(objects=objects, camera=camera, decals=there, images=images)


def linear(srgb: Array) -> Array:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def expected_colors(scene: Scene, base: Any, points: Array, normals: Array) -> Array:
    """Linear colours by brute force in float64: all decals over the object's colour."""
    rows = scene.decals

    def color_of(numbers: Any, uv: Any) -> Any:
        paint = np.ones((len(numbers), 4))
        for number, image in enumerate(scene.images):
            mine = rows.images[numbers] == number
            paint[mine] = bilinear(premultiplied(image.pixels), uv[mine])
        tints = linear(rows.tints[numbers].astype(float))
        return paint * np.column_stack([tints, np.ones(len(tints))]) * rows.opacities[numbers, None]

    over = colors_at(rows, points, normals, color_of)
    colors: Array = linear(np.asarray(base, float)) * (1 - over[:, 3:]) + over[:, :3]
    return colors


def premultiplied(pixels: Array) -> Array:
    colors = pixels / 255.0
    return np.concatenate([linear(colors[..., :3]) * colors[..., 3:], colors[..., 3:]], axis=-1)


def bilinear(image: Array, uv: Array) -> Array:
    """Sample an image whose first row lies at v = 1."""
    height, width = image.shape[:2]
    x, y = uv[:, 0] * width - 0.5, (1 - uv[:, 1]) * height - 0.5
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    s, t = (x - i)[:, None], (y - j)[:, None]
    columns, lines = ([np.clip(k + step, 0, n - 1) for step in (0, 1)] for k, n in ((i, width), (j, height)))
    upper = image[lines[0], columns[0]] * (1 - s) + image[lines[0], columns[1]] * s
    lower = image[lines[1], columns[0]] * (1 - s) + image[lines[1], columns[1]] * s
    mixed: Array = upper * (1 - t) + lower * t
    return mixed


@dataclass(frozen=True, eq=False)
class ReadMesh:
    """A node of a GLB file: arrays, and its texture, first row at the top."""

    vertices: Array
    faces: Array
    normals: Array
    uv: Array | None
    texture: Array | None
    maps: dict[str, Array]

    def on_surface(self, count: int, seed: int = 0) -> tuple[Array, Array, Array]:
        """Random points on the triangles, their unit normals and texture coordinates."""
        rng = np.random.default_rng(seed)
        faces = self.faces[rng.integers(0, len(self.faces), count)]
        weights = rng.dirichlet((1, 1, 1), count)[:, :, None]
        assert self.uv is not None
        points, normals, uv = (
            (values[faces] * weights).sum(axis=1) for values in (self.vertices, self.normals, self.uv)
        )
        return points, normals / np.linalg.norm(normals, axis=1, keepdims=True), uv


def read_glb(path: Path, maps: Sequence[str] = ()) -> dict[str, ReadMesh]:
    """Nodes of a file by name, as trimesh reads them, with textures by their names."""
    import trimesh

    scene: Any = trimesh.load(path)
    nodes = {}
    for name in scene.graph.nodes_geometry:
        transform, geometry = scene.graph[name]
        assert np.array_equal(transform, np.eye(4))
        mesh = scene.geometry[geometry]
        uv, image = mesh.visual.uv, mesh.visual.material.baseColorTexture
        nodes[name] = ReadMesh(
            np.asarray(mesh.vertices, float),
            np.asarray(mesh.faces),
            np.asarray(mesh.vertex_normals, float),
            None if uv is None else np.asarray(uv, float),
            None if image is None else np.asarray(image.convert("RGB")),
            {key: np.asarray(getattr(mesh.visual.material, key).convert("RGB")) for key in maps},
        )
    return nodes


def read_json(path: Path) -> Any:
    """The JSON part of a file."""
    content = path.read_bytes()
    magic, version, length, json_length, kind = struct.unpack("<4sIII4s", content[:20])
    assert (magic, version, length, kind) == (b"glTF", 2, len(content), b"JSON")
    return json.loads(content[20 : 20 + json_length])


def read_attribute(path: Path, mesh: int, name: str) -> Array:
    """An attribute of float32 vectors, read without any library."""
    tree = read_json(path)
    accessor = tree["accessors"][tree["meshes"][mesh]["primitives"][0]["attributes"][name]]
    view = tree["bufferViews"][accessor["bufferView"]]
    assert accessor["componentType"] == 5126
    columns = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    start = 28 + len(json_bytes(path)) + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    flat = np.frombuffer(path.read_bytes(), "<f4", accessor["count"] * columns, start)
    return flat.reshape(-1, columns)


def json_bytes(path: Path) -> bytes:
    content = path.read_bytes()
    return content[20 : 20 + struct.unpack("<I", content[12:16])[0]]


def read_numbers(path: Path) -> bytes:
    """The binary part of a file: vertices, faces, colours and images."""
    content = path.read_bytes()
    return content[20 + struct.unpack("<I", content[12:16])[0] :]
