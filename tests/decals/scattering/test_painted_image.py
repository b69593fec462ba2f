from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from blobtree._typing import Float32Array
from decals import Relaxation
from decals.errors import InvalidImage, InvalidScattering
from decals.scattering import Cylindrical, PaintedImage, Planar, Spherical, TextureCoordinates
from decals.surfaces import MeshSurface
from tests.decals.meshes import box, plane, sphere

SQUARE = Planar((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def at(*points: tuple[float, float]) -> Float32Array:
    return np.array([[x, y, 0.0] for x, y in points], np.float32)


def test_grey_is_bilinear_between_pixels() -> None:
    rng = np.random.default_rng(0)
    grey = rng.random((4, 5))
    painted = PaintedImage(grey, SQUARE)
    u, v = rng.uniform(0.1, 0.9, 200), rng.uniform(0.125, 0.875, 200)
    columns, rows = (np.arange(5) + 0.5) / 5, 1 - (np.arange(4) + 0.5) / 4
    # separable hat functions around the pixels' centres
    across = np.maximum(1 - 5 * np.abs(u[:, None] - columns), 0)
    down = np.maximum(1 - 4 * np.abs(v[:, None] - rows), 0)
    expected = np.einsum("ni,ij,nj->n", down, grey, across)
    assert painted(at(*zip(u, v, strict=True))) == pytest.approx(expected, abs=1e-6)


def test_edges_continue_or_repeat() -> None:
    grey = np.array([[0.0, 1.0], [0.25, 0.5]])
    assert PaintedImage(grey, SQUARE)(at((-3, 9), (5, 7), (-1, -1))) == pytest.approx([0.0, 1.0, 0.25])
    repeated = PaintedImage(grey, SQUARE, repeat=True)
    assert repeated(at((0.25, 0.75), (1.25, -0.25), (-0.25, 2.25))) == pytest.approx([0.0, 0.0, 0.5])


@pytest.mark.parametrize(
    ("pixel", "grey"),
    [((255, 255, 255), 1.0), ((255, 0, 0), 0.2126), ((0, 255, 0, 255), 0.7152), ((255, 255, 255, 0), 0.0)],
)
def test_grey_is_the_luminance(tmp_path: Path, pixel: tuple[int, ...], grey: float) -> None:
    path = tmp_path / "pixel.png"
    Image.new("RGB" if len(pixel) == 3 else "RGBA", (3, 2), pixel).save(path)
    assert PaintedImage(path, SQUARE)(at((0.5, 0.5))) == pytest.approx([grey])
    array = np.full((2, 3, len(pixel)), pixel, np.uint8)
    assert PaintedImage(array, SQUARE)(at((0.5, 0.5))) == pytest.approx([grey])


def test_planar_projection() -> None:
    right, up = np.array([2.0, 0, 1]), np.array([0.5, 1, 0])
    u, v = np.random.default_rng(1).random((2, 50))
    points = [3, 2, 1] + u[:, None] * right + v[:, None] * up + [[0.7, -0.35, -1.4]]  # and along its normal
    uv = Planar((3, 2, 1), right.tolist(), up.tolist())(points.astype(np.float32))
    assert uv == pytest.approx(np.stack([u, v], axis=1), abs=1e-5)


@pytest.mark.parametrize(("axis", "corners"), [("z", (0, 1)), ("x", (1, 2)), ("y", (2, 0))])
def test_planar_projection_over_a_box(axis: str, corners: tuple[int, int]) -> None:
    model = box((1.0, 2.0, 3.0), center=(5, 6, 7))
    low, high = (corner.copy() for corner in model.bounds)
    assert Planar.over(model, axis)(np.stack([low, high])) == pytest.approx(
        np.array([[0, 0], [1, 1]]), abs=1e-6
    )
    right = low.copy()
    right[corners[0]] = high[corners[0]]
    assert Planar.over([model], axis)(right[None]) == pytest.approx(np.array([[1.0, 0.0]]), abs=1e-6)


def test_cylindrical_projection() -> None:
    uv = Cylindrical((0, 0, 1), (0, 0, 3))(
        np.array([[1, 0, 1], [0, 2, 2], [0, -1, 3], [-1, -1e-6, 2]], np.float32)
    )
    assert uv == pytest.approx(np.array([[0.5, 0], [0.75, 0.5], [0.25, 1], [0, 0.5]]), abs=1e-5)
    around = Cylindrical.over(box((2.0, 2.0, 4.0)), "z")
    assert around(np.array([[1, 0, -2], [0, 1, 2]], np.float32)) == pytest.approx(
        np.array([[0.5, 0], [0.75, 1]])
    )


def test_spherical_projection() -> None:
    uv = Spherical((1, 0, 0))(np.array([[3, 0, 0], [1, 5, 0], [1, 0, 2], [1, 0, -2], [2, 0, 1]], np.float32))
    expected = [[0.5, 0.5], [0.75, 0.5], [0.5, 1], [0.5, 0], [0.5, 0.75]]
    assert uv == pytest.approx(np.array(expected), abs=1e-6)


@pytest.mark.parametrize("by_corner", [False, True])
def test_texture_coordinates(by_corner: bool) -> None:
    ball = sphere(level=3)
    faces = np.concatenate([[[0, 0, 1]], ball.faces])  # a face without area is left out
    mesh = MeshSurface(ball.vertices, faces)
    uv = mesh.vertices[:, :2] * 0.5 + 0.5
    on = TextureCoordinates(mesh, uv[faces] if by_corner else uv)
    points, _ = mesh.sample(500, seed=0)
    assert on(points) == pytest.approx(points[:, :2] * 0.5 + 0.5, abs=1e-5)
    assert on(points[:0]).shape == (0, 2)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_counts_follow_a_painted_image(seed: int) -> None:
    """A chessboard of 4 x 2 fields, 16 pixels each, painted around a ball."""
    fields = np.kron(np.indices((2, 4)).sum(axis=0) % 2, np.ones((16, 16)))
    ball = sphere(level=5)
    painted = PaintedImage(fields, Spherical(), repeat=True)
    density = painted.density(black=1.0, white=4.0)
    relaxation = Relaxation([ball], count=2000, density=density, seed=seed)
    relaxation.run()
    points, _ = ball.sample(400_000, seed=1)

    def fields_of(positions: Float32Array) -> Any:
        u, v = Spherical()(positions).T
        return np.minimum(4 * u, 3).astype(int) + 4 * (v > 0.5)

    weights = density(points)
    expected = 2000 * np.bincount(fields_of(points), weights, minlength=8) / weights.sum()
    counts = np.bincount(fields_of(relaxation.positions), minlength=8)
    white = expected > 250
    assert white.sum() == 4
    assert counts[white] == pytest.approx(expected[white], rel=0.02)
    assert counts[~white].sum() == pytest.approx(expected[~white].sum(), rel=0.02)
    assert relaxation.statistics().rho > 0.8


def test_painted_mask() -> None:
    half = PaintedImage(np.array([[0.0, 1.0]]), Planar.over(plane(2.0)))
    relaxation = Relaxation([plane(2.0)], count=100, mask=half.mask(above=0.5), iterations=20)
    relaxation.run()
    assert (relaxation.positions[:, 0] > 0).all()


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((0, 3)),
        np.zeros(3),
        np.zeros((2, 2, 2)),
        np.full((2, 2), 2.0),
        np.full((2, 2), np.nan),
        np.eye(2, dtype=int),
    ],
)
def test_invalid_images_raise(image: Any) -> None:
    with pytest.raises(InvalidImage, match="image: expected"):
        PaintedImage(image, SQUARE)


def test_invalid_painting_arguments_raise() -> None:
    with pytest.raises(InvalidImage, match="found no file"):
        PaintedImage("missing.png", SQUARE)
    with pytest.raises(InvalidScattering, match="black: expected"):
        PaintedImage(np.eye(2), SQUARE).density(black=0.0)
    with pytest.raises(InvalidScattering, match="projection: expected"):
        PaintedImage(np.eye(2), lambda points: points.astype(float))(at((0, 0)))
    with pytest.raises(InvalidScattering, match="parallel"):
        Planar((0, 0, 0), (1, 0, 0), (2, 0, 0))
    with pytest.raises(InvalidScattering, match="axis: expected"):
        Planar.over(plane(), "w")
    with pytest.raises(InvalidScattering, match="axis with length"):
        Cylindrical((0, 0, 0), (0, 0, 0))
    with pytest.raises(InvalidScattering, match="up, front"):
        Spherical(up=(1, 0, 0))
    with pytest.raises(InvalidScattering, match="uv: expected"):
        TextureCoordinates(plane(), np.zeros((3, 2)))
    with pytest.raises(InvalidScattering, match="at least one"):
        Planar.over([])
