"""Windings of closed parts: outward, also in files with shells inside shells, and by the option."""

import logging
from typing import Any

import numpy as np
import pytest
import pyvista as pv

import decals
from decals.errors import InvalidMesh, InvalidScene
from decals.surfaces import MeshSurface
from tests.bench.trust_windings import is_wrong, looks_wrong
from tests.decals.fault_models import Arrays, joined
from tests.decals.meshes import icosphere
from tests.decals.surfaces.test_topology import mobius
from tests.oracles.windings import KINDS, block, volume


def ball(radius: float, *, inward: bool = False, center: Any = (0.0, 0.0, 0.0), level: int = 2) -> Arrays:
    vertices, faces = icosphere(level)
    return radius * vertices + np.asarray(center), faces[:, ::-1] if inward else faces


def signs(surface: MeshSurface, count: int) -> list[int]:
    """Signs of the volumes of parts of equal size, in their order."""
    return [int(np.sign(volume(surface.vertices, part))) for part in np.split(surface.faces, count)]


@pytest.mark.parametrize("kind", KINDS)
def test_solids_with_turned_parts_are_those_that_were_not_turned(kind: str) -> None:
    for seed in range(6):
        assert not is_wrong(KINDS[kind](np.random.default_rng([7, seed])))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_pictures_of_solids_with_turned_parts(kind: str) -> None:
    assert not looks_wrong(KINDS[kind](np.random.default_rng(8)), 1)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("+-", "+-"),  # a hollow ball
        ("-+", "+-"),
        ("++", "++"),  # a tooth in a head
        ("--", "++"),
        ("+--", "+-+"),  # a cavity in empty space: windings disagree
        ("-++", "+-+"),
        ("+-+-", "+-+-"),
        ("-+-+", "+-+-"),
        ("++-", "++-"),  # a hollow ball in a head
        ("--+", "++-"),
        ("----", "++++"),
    ],
)
def test_windings_that_agree_stay(given: str, expected: str) -> None:
    balls = [ball(0.5**number, inward=sign == "-", level=1) for number, sign in enumerate(given)]
    surface = MeshSurface(*joined(*balls))
    assert signs(surface, len(given)) == [1 if sign == "+" else -1 for sign in expected]


def test_only_a_file_whose_windings_disagree_follows_the_parity_of_nesting() -> None:
    head = [ball(1.0, level=1), ball(0.5, level=1)]
    other = [ball(0.5**n, inward=n > 0, center=(3.0, 0.0, 0.0), level=1) for n in range(3)]
    assert signs(MeshSurface(*joined(*head)), 2) == [1, 1]
    assert signs(MeshSurface(*joined(*head, *other[:2])), 4) == [1, 1, 1, -1]
    assert signs(MeshSurface(*joined(*head, *other)), 5) == [1, -1, 1, -1, 1]


def test_a_right_mesh_is_kept_bit_for_bit() -> None:
    vertices, faces = joined(ball(1.0), ball(0.5, inward=True), ball(0.4, center=(1.0, 0.0, 0.0)))
    surface = MeshSurface(vertices, faces)
    np.testing.assert_array_equal(surface.faces, faces)
    np.testing.assert_array_equal(surface.vertices, vertices.astype(np.float32))


def test_open_sheets_keep_their_winding_beside_closed_parts() -> None:
    vertices, faces = ball(1.0, inward=True)
    sheet = np.array([[2.0, 0, 0], [3, 0, 0], [2, 1, 0]]), np.array([[0, 2, 1]])
    surface = MeshSurface(*joined((vertices, faces), sheet, (vertices + 9.0, faces[: len(faces) // 2])))
    np.testing.assert_array_equal(surface.faces[: len(faces)], faces[:, ::-1])
    np.testing.assert_array_equal(surface.faces[len(faces)], np.array([0, 2, 1]) + len(vertices))
    assert volume(vertices, surface.faces[len(faces) + 1 :] - len(vertices) - 3) < 0


def test_flat_and_tiny_parts() -> None:
    """A pillow without thickness stays, a thin plate and a tiny ball turn."""
    pillow = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 2, 1], [0, 1, 2]])
    plate = block(np.array([3.0, 0, 0]), np.array([4.0, 1.0, 1e-4]))
    small = ball(1e-4, center=(0.0, 3.0, 0.0))
    parts = [pillow, (plate[0], plate[1][:, ::-1]), (small[0], small[1][:, ::-1])]
    surface = MeshSurface(*joined(*parts))
    np.testing.assert_array_equal(surface.faces[:2], pillow[1])
    np.testing.assert_array_equal(surface.faces[2:14], plate[1] + 3)
    np.testing.assert_array_equal(surface.faces[14:], small[1] + 11)


def test_a_seam_with_rounded_vertices_is_closed() -> None:
    """A seam whose two lines differ by rounding, as of surfaces of parameters, leaves no hole."""
    angles = np.linspace(0.0, 2.0 * np.pi, 25)
    rings = [np.stack([np.cos(angles), np.sin(angles), np.full(25, z)], axis=1) for z in (0.0, 1.0)]
    rows = np.arange(24)
    around = [np.stack([rows, rows + 1, rows + 26], axis=1), np.stack([rows, rows + 26, rows + 25], axis=1)]
    lids = [
        np.stack([rows + 1, rows, 0 * rows + 50], axis=1),
        np.stack([rows + 25, rows + 26, 0 * rows + 51], axis=1),
    ]
    vertices = np.concatenate([*rings, [[0.0, 0, 0], [0, 0, 1]]]).astype(np.float32)
    vertices[24, 1] = 1e-7
    faces = np.concatenate([*around, *lids])
    assert volume(vertices, faces) > 3.0
    surface = MeshSurface(vertices, faces[:, ::-1])
    np.testing.assert_array_equal(surface.faces, faces)
    with_hole = MeshSurface(vertices, faces[1:, ::-1])
    np.testing.assert_array_equal(with_hole.faces, faces[1:, ::-1])


def test_touching_boxes_in_one_list_of_vertices() -> None:
    box, next_box = block(np.zeros(3), np.ones(3)), block(np.array([1.0, 0, 0]), np.array([2.0, 1, 1]))
    for turned in range(4):
        parts = [
            (part[0], part[1][:, ::-1] if turned >> number & 1 else part[1])
            for number, part in enumerate((box, next_box))
        ]
        vertices, faces = joined(*parts)
        together, same = np.unique(vertices, axis=0, return_inverse=True)
        surface = MeshSurface(together, same.reshape(-1)[faces])
        assert volume(surface.vertices, surface.faces) == pytest.approx(2.0)
        assert surface.closed
        assert surface.contains([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [2.5, 0.5, 0.5]]).tolist() == [
            True,
            True,
            False,
        ]


def test_a_decal_lies_on_both_of_two_touching_solids() -> None:
    vertices, faces = joined(
        block(np.zeros(3), np.ones(3)), block(np.array([1.0, 0, 0]), np.array([2.0, 1, 1]))
    )
    faces[12:] = faces[12:, ::-1]
    item = decals.MeshObject("boxes", vertices, faces)
    layout = decals.Decals([[1.0, 0.5, 1.0]], [[0, 0, 1]], [[1, 0, 0]], [0.3])
    for x in (0.85, 1.15):
        normal = item.surface.normal([[x, 0.5, 1.0]])
        assert decals.evaluate(layout, [[x, 0.5, 1.0]], normal).owner.tolist() == [0]


@pytest.mark.parametrize("orientation", ["outward", "keep", "flip"])
def test_orientation_overrides(orientation: str) -> None:
    vertices, faces = ball(1.0, inward=True)
    scene = decals.cover((vertices, faces), count=20, orientation=orientation)
    outward = np.einsum("ni,ni->n", scene.decals.positions, scene.decals.normals)
    assert (np.sign(outward) == (-1 if orientation == "keep" else 1)).all()
    assert scene.recipe is not None
    assert scene.recipe.parameters["orientation"] == orientation
    half = decals.MeshObject("sheet", vertices, faces[:100], orientation=orientation)
    np.testing.assert_array_equal(half.faces, faces[:100, ::-1] if orientation == "flip" else faces[:100])


def test_unknown_orientations_are_refused() -> None:
    for error, function in ((InvalidMesh, MeshSurface), (InvalidScene, lambda *a, **o: decals.cover(a, **o))):
        with pytest.raises(
            error, match="orientation: expected one of 'outward', 'keep', 'flip', got 'inside'"
        ):
            function(*ball(1.0), orientation="inside")


def test_scene_files_keep_the_orientation(tmp_path: Any) -> None:
    mesh = pv.Sphere(theta_resolution=8, phi_resolution=8).flip_faces()
    mesh.save(tmp_path / "ball.ply")
    for orientation in ("outward", "keep", "flip"):
        scene = decals.cover(tmp_path / "ball.ply", count=12, orientation=orientation)
        scene.save(tmp_path / "scene.json")
        read = decals.load_scene(tmp_path / "scene.json")
        first, second = scene.objects[0], read.objects[0]
        assert isinstance(first, decals.MeshObject)
        assert isinstance(second, decals.MeshObject)
        np.testing.assert_array_equal(first.faces, second.faces)


def test_files_of_earlier_versions_keep_their_windings(tmp_path: Any) -> None:
    mesh = pv.Sphere(theta_resolution=8, phi_resolution=8).flip_faces()
    mesh.save(tmp_path / "ball.ply")
    decals.cover(tmp_path / "ball.ply", count=12, orientation="keep").save(tmp_path / "scene.json")
    assert (
        "orientation" not in (tmp_path / "scene.json").read_text().split('"recipe"')[0].split('"decals"')[0]
    )


@pytest.mark.parametrize("name", ["scale", "flip_x", "reflect", "flip_faces"])
def test_mirrored_meshes_of_pyvista(name: str) -> None:
    mesh: Any = pv.Sphere(theta_resolution=12, phi_resolution=12)
    arguments: dict[str, tuple[Any, ...]] = {"scale": (-1.0,), "reflect": ((1, 0, 0),)}
    turned = getattr(mesh, name)(*arguments.get(name, ()))
    scene = decals.cover(turned, count=12)
    assert (np.einsum("ni,ni->n", scene.decals.positions, scene.decals.normals) > 0).all()


def test_a_sheet_without_two_sides_is_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        scene = decals.cover(mobius(), count=12)
        decals.displace(
            scene.replace(
                images=(decals.DecalMaterial("m", np.ones((8, 8, 3)), height=np.ones((8, 8)), relief=0.1),)
            ),
            edge_length=0.3,
        )
    assert caplog.text.count("has one side only") == 1
