"""A scene for each form of the shader of decals, and points on its surface."""

from functools import cache
from typing import Any

import numpy as np

from decals import Camera, DecalImage, DecalMaterial, Decals, MeshObject, Scene
from decals.rendering import Drawing
from decals.rendering.decal_library import Form
from tests.decals.rendering.pictures import in_layers, scattered
from tests.decals.shapes import torus

SIDE = 64
"""Texels along each side of images: a power of two, so they stay as they are."""

LABELS = ("", "ring", "lid")
"""Receivers of limited decals; the points lie on the first that is named."""


def waves(seed: int) -> np.ndarray:
    """Smooth colours of bytes, with alpha, constant along rays outside the disc of the image."""
    y, x = (np.mgrid[:SIDE, :SIDE] + 0.5) / SIDE - 0.5
    shrink = np.minimum(1.0, 0.46 / np.maximum(np.hypot(x, y), 1e-9))
    x, y = x * shrink, y * shrink
    rng = np.random.default_rng(seed)
    phases, turns = rng.uniform(0, 6, 4), rng.uniform(3, 7, (4, 2))
    levels = [0.5 + 0.45 * np.sin(phase + u * x + v * y) for phase, (u, v) in zip(phases, turns, strict=True)]
    levels[3] = 0.4 + 0.6 * levels[3]
    texels: np.ndarray = np.rint(255 * np.stack(levels, axis=-1)).astype(np.uint8)
    return texels


def material(seed: int) -> DecalMaterial:
    """A material all of whose maps vary; its normals are tilted by up to 25 degrees."""
    maps, normal = waves(seed + 10), waves(seed + 20)[..., :3].copy()
    normal[..., :2] = 90 + 0.3 * normal[..., :2]
    return DecalMaterial(
        f"material {seed}",
        waves(seed),
        normal=normal,
        roughness=maps[..., 0],
        metallic=maps[..., 1],
        occlusion=maps[..., 2],
        emission=waves(seed + 30)[..., :3].copy(),
    )


def _apart(decals: Decals, share: float) -> Decals:
    """Those of decals of nearly one size that are farther than a share of their radii from those before."""
    kept: list[int] = []
    for number, position in enumerate(decals.positions):
        distances = np.linalg.norm(decals.positions[kept] - position, axis=1)
        if (distances > share * decals.radii[number]).all():
            kept.append(number)
    return decals[np.array(kept)]


def name_of(form: Form) -> str:
    """The contact mode of a form, and what else it has."""
    words = [name for name in ("layered", "limited", "nested", "materials") if getattr(form, name)]
    return "-".join([form.contact.name.lower(), *words])


@cache
def scene_of(form: Form, seed: int = 0, *, count: int = 60) -> Scene:
    """A ring with random decals that need this form."""
    ring = torus(1.0, 0.4)
    item = MeshObject("ring", ring.vertices, ring.faces, (0.6, 0.5, 0.4))
    rng = np.random.default_rng(seed)
    if form.nested:
        decals = scattered(item, count, seed, radii=(0.08, 0.5))
    else:
        decals = _apart(scattered(item, 2 * count, seed, radii=(0.3, 0.31)), 0.5)
    many = len(decals)
    changes: dict[str, Any] = {
        "images": rng.integers(-1, 2, many),
        "tints": rng.uniform(0.3, 1.0, (many, 3)),
        "opacities": rng.uniform(0.4, 1.0, many),
    }
    if form.limited:
        changes["fade_angles"] = np.where(rng.random(many) < 0.4, rng.uniform(30, 120, many), 0.0)
        changes["fade_depths"] = np.where(rng.random(many) < 0.4, rng.uniform(0.1, 0.6, many), 0.0)
        changes["receivers"] = rng.choice(LABELS, many).tolist()
    decals = decals.replace(**changes)
    if form.layered:
        decals = in_layers(decals, seed)
    images: Any = [material(1), DecalImage("waves", waves(2))]
    if not form.materials:
        images = [DecalImage(f"waves {number}", waves(number)) for number in (1, 2)]
    lid = MeshObject("lid", ring.vertices[:3] + 9.0, [[0, 1, 2]])
    return Scene(
        objects=[item, lid] if form.limited else [item],
        camera=Camera.fitting(ring.vertices, direction=(0.5, -0.9, 0.8), up=(0, 0, 1)),
        decals=decals,
        images=images,
        drawing=Drawing(contact=form.contact),
    )


def points_on(scene: Scene, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Random points of the first object, and normals that are bent a little, float32[count, 3] each."""
    item: Any = scene.objects[0]
    rng = np.random.default_rng(seed)
    corners = item.vertices[item.faces[rng.integers(0, len(item.faces), count)]]
    points = np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], count), corners)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals += rng.normal(0, 0.05, normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return points.astype(np.float32), normals.astype(np.float32)
