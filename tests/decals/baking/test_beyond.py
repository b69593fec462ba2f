"""Texels beyond seams, against the face on the other side turned about the edge, in float64."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from decals.baking.meshes import BakeMesh
from decals.baking.seams import Seams, bilinear_texels
from decals.baking.texture import Channels, bake_texture
from decals.baking.unwrapped import Unwrapped
from tests.decals.baking.glb import Array
from tests.decals.baking.test_texture import color_of

SIZE = 64


def hinge(seed: int) -> tuple[BakeMesh, Unwrapped]:
    """Two faces that share an edge at any angle, each in a half of the texture, turned and mirrored."""
    rng = np.random.default_rng(seed)
    points = np.array([[0.3, 0.4, 0.5], [0.7, 0.5, 0.5], [0.45, 0.75, 0.5], [0.5, 0.1, 0.5]])
    points += rng.uniform(-0.06, 0.06, points.shape)
    points[3] = points[0] + Rotation.from_rotvec(
        rng.uniform(-2, 2) * (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
    ).apply(points[3] - points[0])
    faces = np.array([[0, 1, 2], [1, 0, 3]])
    places = []
    for face, center in zip(faces, [(0.25, 0.4), (0.75, 0.6)], strict=True):
        sides = points[face[1:]] - points[face[0]]
        along = sides[0] / np.linalg.norm(sides[0])
        up = np.cross(np.cross(*sides), along)
        flat = (points[face] - points[face].mean(axis=0)) @ np.stack([along, up / np.linalg.norm(up)], axis=1)
        turn = rng.uniform(0, 2 * np.pi)
        spin = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        places.append(SIZE * (0.5 * flat * [rng.choice([-1, 1]), 1] @ spin + center))
    rows = faces.reshape(-1)
    vertices = points.astype(np.float32)
    normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (4, 1))
    mesh = BakeMesh("hinge", vertices, faces.astype(np.int32), normals, (1, 1, 1), vertices, normals)
    corners = np.arange(6, dtype=np.int32).reshape(2, 3)
    return mesh, Unwrapped(rows, corners, np.concatenate(places).astype(np.float32), np.zeros(2, np.int32))


def turned_points(mesh: BakeMesh, part: Unwrapped, side: int, centers: Array) -> Array:
    """The points of the plane of a face, turned about the edge into the plane of the other one."""
    face, other = part.faces[side], part.faces[1 - side]
    here, there = (mesh.vertices[part.rows[corners]].astype(float) for corners in (face, other))
    sides = np.diff(part.places[face].astype(float), axis=0)
    basis = np.stack([sides[0], sides[0] + sides[1]])
    weights = np.linalg.solve(basis.T, (centers - part.places[face[0]]).T).T
    plane = here[0] + weights @ (here[1:] - here[0])
    axis = (here[1] - here[0]) / np.linalg.norm(here[1] - here[0])
    out, into = (apex - here[0] - ((apex - here[0]) @ axis) * axis for apex in (here[2], there[2]))
    angle = np.arctan2(np.cross(-out, into) @ axis, -out @ into)
    return np.asarray(here[0] + Rotation.from_rotvec(angle * axis).apply(plane - here[0]))


@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize("seed", range(6))
def test_texels_beyond_a_seam_show_the_other_side(seed: int, samples: int) -> None:
    mesh, part = hinge(seed)

    def color_at(number: int, points: Array, units: Array, *_: Any) -> Array:
        return color_of(points).astype(np.float32)

    made = bake_texture([mesh], [part], SIZE, samples, Channels(color_at), lambda *_: None)[0]
    seams = Seams.of([mesh], [part])
    assert len(seams.faces) == 1
    _, places = seams.points()
    for side in (0, 1):
        of = int(seams.faces[0, side])
        texels = bilinear_texels(places[:, side], np.zeros(len(places), np.int64), SIZE)
        texels = np.unique(texels)
        centers = np.stack([texels % SIZE, texels // SIZE], axis=1) + 0.5
        corners = part.places[part.faces[of]].astype(float)
        along, away = np.roll(corners, -1, axis=0) - corners, centers[:, None] - corners
        around = np.sign(along[:, 0] * away[..., 1] - along[:, 1] * away[..., 0])
        beyond = np.abs(around.sum(axis=1)) < 3
        want = 255 * np.clip(turned_points(mesh, part, of, centers), 0, 1)
        off = np.abs(made[texels // SIZE, texels % SIZE] - want).max(axis=1)
        assert beyond.sum() > 10
        # several samples are sharpened, as texels at other borders are
        assert np.median(off[beyond]) < (0.6 if samples == 1 else 1.4)
        assert np.quantile(off[beyond], 0.9) < (1.0 if samples == 1 else 1.8)
