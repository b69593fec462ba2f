"""Overlays on planes and balls, where owners, stretch and contact lines are known."""

import numpy as np

import decals
from blobtree import Point
from decals import Camera, MeshObject, Scene, TreeObject
from decals.editing import Document
from decals.editing.overlays import contact_lines, sample_surface
from decals.editing.slicing import SlicePlane
from decals.scenes.meshes import as_polydata
from decals.window.view_modes import CUTS, DisplayOptions, shown_data
from tests.oracles.contact import RIM, falloff


def plane(count: int = 81) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a square of side 4 as vertices, normals and faces."""
    x, y = np.meshgrid(np.linspace(-2, 2, count), np.linspace(-2, 2, count))
    vertices = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    quads = [(0, 1, count + 1), (0, count + 1, count)]
    faces = np.concatenate([corner[:, None] + np.array(quad) for quad in quads]).astype(np.int32)
    return vertices, np.tile(np.array([0, 0, 1], np.float32), (len(vertices), 1)), faces


def document(positions: object, turn: float = 0.0) -> Document:
    count = len(np.asarray(positions))
    tangents = [[np.cos(turn), np.sin(turn), 0.0]] * count
    disks = decals.Decals(positions, [[0, 0, 1]] * count, tangents, [1.0] * count)  # type: ignore[arg-type]
    ball = TreeObject("ball", Point((0, 0, -9), radius=1.0))
    return Document.from_scene(Scene(objects=[ball], camera=Camera((0, 0, 5)), decals=disks, images=["eye"]))


def test_a_decal_alone_is_not_stretched() -> None:
    vertices, normals, faces = plane()
    samples = sample_surface(document([[0, 0, 0]], turn=0.7), vertices, normals, faces)
    distances = np.linalg.norm(vertices, axis=1)
    inside = samples.owners == 0
    assert inside[distances < 0.999].all()
    assert not inside[distances > 1.001].any()
    stretch = samples.stretch[np.isfinite(samples.stretch)]
    np.testing.assert_allclose(stretch, 1.0, atol=1e-3)
    assert len(stretch) == inside[faces].all(axis=1).sum()
    assert not samples.folds.any()
    backwards = sample_surface(document([[0, 0, 0]]), vertices, normals, faces[:, ::-1])
    np.testing.assert_array_equal(backwards.folds, np.isfinite(backwards.stretch))  # seen from below


def test_two_decals_meet_on_their_bisector_and_stretch_there() -> None:
    vertices, normals, faces = plane()
    two = document([[-0.6, 0, 0], [0.625, 0, 0]])
    samples = sample_surface(two, vertices, normals, faces)
    lines = contact_lines(two, vertices, normals, faces, lift=0.25)
    assert len(lines) > 20
    inner = lines[np.abs(lines[..., 1]).max(axis=1) < 0.75]  # beside the ends, where the rims part
    np.testing.assert_allclose(inner[..., 0], 0.0125, atol=0.05 / 2**5)  # squares have sides of 0.05
    np.testing.assert_allclose(lines[..., 0], 0.0125, atol=0.05)
    np.testing.assert_array_equal(lines[..., 2], 0.25)
    assert np.abs(lines[..., 1]).max() < np.sqrt(1 - 0.6125**2) + 0.05
    middles = vertices[faces].mean(axis=1)
    near = (np.abs(middles[:, 0]) < 0.1) & np.isfinite(samples.stretch)
    assert np.median(samples.stretch[near]) > 1.5


def test_three_decals_in_one_triangle_give_three_spokes() -> None:
    corners, face = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0]], np.float32), np.array([[0, 1, 2]], np.int32)
    up = np.tile(np.array([0, 0, 1], np.float32), (3, 1))
    lines = contact_lines(document([[-0.1, -0.1, 0], [1.9, 0, 0], [0, 1.9, 0]]), corners, up, face)
    middle = lines[:, 0].mean(axis=0)
    np.testing.assert_allclose(lines[:, 1], [middle] * 3, atol=1e-6)
    bare = document([[0, 0, 0], [1.5, 0, 0]])  # the third corner has no decal
    assert len(contact_lines(bare, corners, up, face)) == 0
    assert len(contact_lines(document([[0, 0, 0]]), corners / np.float32(9), up, face)) == 0


def test_a_slice_of_meshes_shows_the_fields_of_decals_and_leaves_the_scene() -> None:
    vertices, _, faces = plane(5)
    plate = MeshObject("plate", vertices, faces)
    one = decals.Decals([[0.2, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], [0.8])
    scene = Scene(objects=[plate], camera=Camera((0, 0, 5)), decals=one, images=["eye"])
    options = DisplayOptions(slice=SlicePlane.across((0, 0.3, 0), (0, 1, 0)))
    shown, message = shown_data(Document.from_scene(scene), [as_polydata([plate])], options)
    (_, outline, _), (_, field, _) = shown  # and no mesh in place of the scene
    assert message == ""
    np.testing.assert_allclose(outline.bounds, (-2, 2, 0.3, 0.3, -2, 2), atol=1e-6)
    distances = np.linalg.norm(np.asarray(field.points) - [0.2, 0, 0], axis=1)
    inside = np.asarray(field["field"]) > 0.4  # the others lie on the edges of cells, next to the rim
    expected = falloff(distances / (0.8 / RIM))
    np.testing.assert_allclose(np.asarray(field["field"])[inside], expected[inside], atol=1e-5)
    np.testing.assert_allclose(distances[~inside], 0.8, atol=4.0 / CUTS)
    assert inside.mean() > 0.9
