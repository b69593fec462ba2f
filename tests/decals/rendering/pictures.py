"""Worlds to draw, and the picture of each that the oracle expects."""

from typing import Any

import numpy as np

from decals import Camera, Contact, Decals, ImageMapping, MeshObject
from decals.images.texels import decode_srgb
from decals.record import DEFAULT_CONTACT
from decals.rendering import Buffers, SceneLike
from tests.decals.shapes import Picture, Shape, View
from tests.oracles.decals import decals_at

SIZE = (80, 60)

Color = tuple[float, float, float]

TIE = 1e-4

"""Owners may differ where a relative change of this size decides."""

WHITE = Picture(np.full((4, 4, 4), 255, np.uint8))


def scattered(shape: Shape | MeshObject, count: int, seed: int, *, radii: tuple[float, float]) -> Decals:
    """Decals at random vertices of a shape, random in size and turn."""
    rng = np.random.default_rng(seed)
    corners = shape.vertices[shape.faces[rng.integers(0, len(shape.faces), count)]].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    arrays: dict[str, Any] = {
        "positions": np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], count), corners),
        "normals": normals,
        "tangents": np.cross(normals, rng.normal(size=(count, 3))),
        "radii": np.exp(rng.uniform(np.log(radii[0]), np.log(radii[1]), count)),
        "spill": rng.random(count) < 0.2,
    }
    return Decals(**arrays)


def view_of(decals: Decals, *shapes: Shape) -> View:
    points = np.concatenate([shape.vertices for shape in shapes])
    camera = Camera.fitting(points, direction=(0.5, -0.9, 0.8), up=(0, 0, 1))
    return View(shapes, camera, decals, (WHITE,))


def compare(
    view: SceneLike, buffers: Buffers, mapping: ImageMapping, contact: Contact = DEFAULT_CONTACT
) -> np.ndarray:
    """Owner, field and uv of all covered pixels against brute force; which of them have an owner."""
    seen = buffers.object_id >= 0
    points, normals = buffers.position[seen], buffers.normal[seen]
    reference = decals_at(
        view.decals,
        points,
        normals,
        corrected=mapping is ImageMapping.CORRECTED,
        contact=contact.name.lower(),
    )
    owner, field, uv = buffers.owner[seen], buffers.field[seen], buffers.uv[seen]
    sure = reference.doubt > TIE
    assert sure.mean() > 0.95
    np.testing.assert_array_equal(owner[sure], reference.owner[sure])
    agree = owner == reference.owner
    np.testing.assert_allclose(field[agree], reference.field[agree], atol=5e-4)
    conditioned = agree & (reference.stretch < 20)
    np.testing.assert_allclose(uv[conditioned], reference.uv[conditioned], atol=1e-3)
    assert conditioned.sum() > 0.99 * agree.sum()
    return owner >= 0


def assert_same_surfaces(first: Buffers, second: Buffers) -> None:
    """Surfaces of both backends: rasterisers move corners by up to 1/256 of a pixel."""
    same = first.object_id == second.object_id
    assert same.mean() > 0.995
    seen = same & (first.object_id >= 0)
    away = np.abs(first.position - second.position).max(axis=-1)[seen]
    size = np.ptp(first.position[seen], axis=0).max()
    near = away < 1e-3 * size  # elsewhere another face is seen
    assert near.mean() > 0.99
    assert away[near].mean() < 2e-5 * size
    for name in ("normal", "color"):
        apart = np.abs(getattr(first, name).astype(float) - getattr(second, name))[seen][near].max(axis=-1)
        assert (apart > {"normal": 0.01, "color": 3}[name]).mean() < 0.005, name


def in_layers(decals: Decals, seed: int) -> Decals:
    """The same decals, of all interactions, in a few layers."""
    rng = np.random.default_rng(seed)
    return decals.replace(
        interactions=rng.integers(0, 3, len(decals)), layers=rng.integers(-2, 2, len(decals))
    )


def plain_colors(decals: Decals, numbers: np.ndarray) -> np.ndarray:
    """Premultiplied linear colours of plain decals."""
    tints, opacity = decode_srgb(decals.tints[numbers].astype(float)), decals.opacities[numbers, None]
    return np.column_stack([tints * opacity, opacity])


def wall(picture: np.ndarray, *, color: Color = (0.5, 0.5, 0.5)) -> View:
    """One decal on a wall, seen face on; its rim fills the picture's height."""
    corners = np.array([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], np.float32)
    square = Shape(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), color)
    arrays: dict[str, Any] = {"positions": [[0, 0, 0]], "normals": [[0, 0, 1]], "tangents": [[1, 0, 0]]}
    decals = Decals(**arrays, radii=np.ones(1, np.float32))
    camera = Camera((0, 0, 10), fov=2 * np.degrees(np.arctan(1 / 10)))
    return View((square,), camera, decals, (Picture(picture),))


def quarters() -> np.ndarray:
    """Red upper left, green upper right, blue lower left, transparent lower right."""
    image = np.zeros((64, 64, 4), np.uint8)
    image[:32, :32], image[:32, 32:], image[32:, :32] = (255, 0, 0, 255), (0, 255, 0, 255), (0, 0, 255, 255)
    return image
