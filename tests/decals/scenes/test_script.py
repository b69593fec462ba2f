"""Scenes as Python scripts: a script that is run gives the same scene."""

import runpy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import decals
from blobtree import BlendGraph, Extrude, Node, Outline, Point, Polyline, from_sdf
from decals import Camera, DecalImage, DecalMaterial, MeshObject, Scene, TreeObject
from decals.errors import InvalidScene
from decals.model import COLUMNS
from decals.rendering import Drawing
from decals.scenes.script import write_script
from tests.blobtree.custom_kinds import Ring
from tests.decals.editing.scenes import box
from tests.decals.scenes.test_drawing import LOOK

BALL = Point((0.1, 0, 0), radius=1 / 3, color="tomato", attributes={"wet": 0.5})


def rebuilt(scene: Scene, path: Path) -> Any:
    write_script(scene, path)
    return runpy.run_path(str(path))["scene"]


def chain(depth: int) -> Node:
    tree: Node = BALL
    for level in range(depth):
        tree = tree.offset(0.001 * (level + 1))
    return tree


def decals_at_random(count: int) -> decals.Decals:
    rng = np.random.default_rng(3)
    positions, normals, tangents = rng.normal(size=(3, count, 3))
    return decals.Decals(
        positions,
        normals,
        tangents,
        rng.uniform(0.1, 0.2, count),
        images=rng.integers(-1, 2, count),
        layers=rng.integers(-3, 4, count),
        tints=rng.uniform(size=(count, 3)),
        spill=rng.integers(0, 2, count, dtype=bool),
        interactions=rng.integers(0, 3, count),
        opacities=rng.uniform(size=count),
        fade_angles=rng.uniform(1, 180, count),
        fade_depths=rng.uniform(1, 2, count),
        single_sheets=rng.integers(0, 2, count, dtype=bool),
    )


@pytest.mark.parametrize("count", [0, 7, 2500])
def test_the_script_gives_the_same_scene(count: int, tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (4, 5, 4), np.uint8)
    shared = Point((0, 1, 0), radius=0.4)
    trees: list[Node] = [
        chain(300),
        BlendGraph((BALL, shared), names=("a", "b"), pairs=(("a", "b"),)),
        (shared + shared.twist(20.0)) - Polyline(((0, 0, 0), (1, 0, 0.1)), radius=0.1),
        Ring((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0, radius=0.3),
        Extrude(Outline.text("'Ab'"), 0.3),
    ]
    vertices, faces = box((-1, -4, -1), (1, -2, 1))
    given = decals_at_random(count)
    scene = Scene(
        objects=[
            *(TreeObject(f"tree '{number}'", tree) for number, tree in enumerate(trees)),
            MeshObject("crate", vertices, faces, color="red", crease_angle=20.0, labels="metal"),
        ],
        camera=Camera((0, 1 / 3, 8), fov=41.5),
        images=["scale", DecalImage("mine", pixels)],
        decals=given.replace(receivers=[("", "crate, metal")[i % 2] for i in range(count)]),
        drawing=LOOK if count else Drawing(),
    )
    again = rebuilt(scene, tmp_path / "scene.py")
    for item, other in zip(scene.objects, again.objects, strict=True):
        assert (item.name, item.labels, item.named_only) == (other.name, other.labels, other.named_only)
        if isinstance(item, TreeObject):
            assert item.tree == other.tree
        else:
            assert (item.vertices == other.vertices).all()
            assert (item.faces == other.faces).all()
            assert (item.color, item.crease_angle) == (other.color, other.crease_angle)
    assert (again.camera, again.drawing) == (scene.camera, scene.drawing)
    for image, other in zip(scene.images, again.images, strict=True):
        assert (image.pixels == other.pixels).all()
        assert image.source == other.source
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(scene.decals, name), getattr(again.decals, name))


def test_images_with_the_name_of_a_generated_one_keep_their_pixels(tmp_path: Path) -> None:
    red = np.full((2, 2, 4), (255, 0, 0, 255), np.uint8)
    eye = DecalImage.load("eye")
    matte = DecalMaterial("eye", eye.pixels, roughness=np.full((256, 256), 51, np.uint8))
    images = [eye, DecalImage("eye", red), matte, DecalImage("eye", eye.pixels[:, ::-1])]
    assert [image.is_generated for image in images] == [True, False, False, False]
    assert not DecalImage("mine", red).is_generated
    scene = Scene(objects=[], camera=Camera((0, 0, 8)), images=images)
    scene.save(tmp_path / "scene.json")
    for again in (rebuilt(scene, tmp_path / "scene.py"), decals.load_scene(tmp_path / "scene.json")):
        for image, other in zip(images, again.images, strict=True):
            np.testing.assert_array_equal(image.pixels, other.pixels)
            assert (image.source, type(image)) == (other.source, type(other))
        np.testing.assert_array_equal(vars(again.images[2])["roughness"], matte.roughness)


def test_a_script_of_a_tree_needs_no_other_file_and_uses_the_public_api(tmp_path: Path) -> None:
    scene = decals.cover(BALL, count=3, images=["eye"])
    rebuilt(scene, tmp_path / "ball.py")
    assert [path.name for path in tmp_path.iterdir()] == ["ball.py"]
    lines = (tmp_path / "ball.py").read_text().splitlines()
    assert [line for line in lines if "import" in line][1:] == [
        "import numpy as np",
        "import blobtree",
        "import decals",
    ]
    assert "blobtree" in sys.modules


def test_what_no_script_can_hold_is_refused(tmp_path: Path) -> None:
    volume = from_sdf(
        lambda points: np.linalg.norm(points, axis=1) - 1, (-2, -2, -2), (2, 2, 2), spacing=1.0, width=1.0
    )
    scene = Scene(objects=[TreeObject("volume", volume)], camera=Camera((0, 0, 8)))
    with pytest.raises(InvalidScene, match="save the scene as JSON"):
        write_script(scene, tmp_path / "volume.py")
    with pytest.raises(InvalidScene, match="could not write"):
        write_script(decals.cover(BALL, count=3, images=["eye"]), tmp_path / "none" / "ball.py")
