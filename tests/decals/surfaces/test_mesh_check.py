"""`check_mesh` against counts by dictionaries, on solids that are broken at random."""

from collections import defaultdict

import numpy as np
import pytest

from decals.surfaces import check_mesh
from tests.decals.baking.glb import Array
from tests.decals.meshes import box, icosphere


def counted(vertices: Array, faces: Array) -> dict[str, int]:
    """The same counts without arrays: faces by their edges, fans by walks from face to face."""
    places = [tuple(vertices[corner]) for corner in range(len(vertices))]
    triangles = [[places[corner] for corner in face] for face in faces]
    sides = defaultdict(list)
    whole = [number for number, face in enumerate(triangles) if len(set(face)) == 3]
    for number in whole:
        for start, end in zip(triangles[number], np.roll(np.arange(3), -1), strict=True):
            stop = triangles[number][end]
            sides[frozenset((start, stop))].append((number, (start, stop)))
    fans = 0
    for place in {place for number in whole for place in triangles[number]}:
        around = {number for number in whole if place in triangles[number]}
        groups = 0
        while around:
            groups += 1
            queue = [around.pop()]
            while queue:
                number = queue.pop()
                for edge, faces_there in sides.items():
                    if place in edge and number in {face for face, _ in faces_there}:
                        near = {face for face, _ in faces_there} & around
                        around -= near
                        queue += near
        fans += groups > 1
    return {
        "borders": sum(len(found) == 1 for found in sides.values()),
        "branching": sum(len(found) > 2 for found in sides.values()),
        "flipped": sum(len(found) == 2 and found[0][1] == found[1][1] for found in sides.values()),
        "copies": len(whole) - len({frozenset(triangles[number]) for number in whole}),
        "pinched": fans,
    }


def broken(seed: int) -> tuple[Array, Array]:
    """A ball or two boxes, of which faces are dropped, turned, copied or flattened."""
    rng = np.random.default_rng(seed)
    if seed % 2:
        vertices, faces = icosphere(1)
    else:  # they meet in a corner, an edge or a face
        move = rng.permutation([1.0, float(rng.integers(0, 2)), float(rng.integers(0, 2))])
        parts = [box((1, 1, 1), (0, 0, 0)), box((1, 1, 1), move)]
        vertices = np.concatenate([part.vertices for part in parts])
        faces = np.concatenate([parts[0].faces, parts[1].faces + len(parts[0].vertices)])
    vertices, faces = np.asarray(vertices, np.float32), np.array(faces)
    for kind in rng.integers(0, 5, rng.integers(0, 4)):
        row = rng.integers(len(faces))
        if kind == 0:
            faces = np.delete(faces, row, axis=0)
        elif kind == 1:
            faces[row] = faces[row, ::-1]
        elif kind == 2:
            faces = np.concatenate([faces, faces[row : row + 1, :: rng.choice([-1, 1])]])
        elif kind == 3:
            faces[row, 0] = faces[row, 1]
        else:  # each corner by itself, as at seams of textures
            vertices, faces = vertices[faces.reshape(-1)], np.arange(3 * len(faces)).reshape(-1, 3)
    return vertices, faces


@pytest.mark.parametrize("seed", range(40))
def test_counts_of_broken_solids(seed: int) -> None:
    vertices, faces = broken(seed)
    check = check_mesh(vertices, faces)
    assert {name: getattr(check, name) for name in counted(vertices, faces)} == counted(vertices, faces)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_ball_of_any_size_is_sound(scale: float) -> None:
    vertices, faces = icosphere(3)
    check = check_mesh(scale * vertices, faces, "ball")
    assert (check.name, check.closed, check.sound, check.parts, check.inward) == ("ball", True, True, 1, 0)
    assert check.area == pytest.approx(4 * np.pi * scale**2, rel=0.02)
    assert check.volume == pytest.approx(4 / 3 * np.pi * scale**3, rel=0.03)
    assert check_mesh(scale * vertices, faces[:, ::-1]).inward == 1


def test_slivers_without_area_are_degenerate() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0.3, 0, 0], [0, 1, 0], [0.3, 1e-4, 0]], np.float32)
    assert check_mesh(vertices, np.array([[0, 1, 3], [0, 2, 1]])).degenerate == 1
    assert check_mesh(vertices, np.array([[0, 1, 3], [0, 4, 1]])).degenerate == 0


def test_float64_far_from_zero_is_not_merged() -> None:
    vertices, faces = icosphere(2)
    check = check_mesh(vertices.astype(np.float64) + 1e9, faces)
    assert (check.closed, check.sound, check.vertices) == (True, True, len(vertices))
    assert check.volume == pytest.approx(4 / 3 * np.pi, rel=0.1)


def test_a_mesh_without_faces_is_not_closed() -> None:
    check = check_mesh(np.zeros((3, 3), np.float32), np.zeros((0, 3), np.int32))
    assert (check.closed, check.parts, check.sound) == (False, 0, True)
