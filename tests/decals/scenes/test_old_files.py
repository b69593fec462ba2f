"""Files of earlier versions are loaded: their text is written out here."""

import json
from pathlib import Path

import pytest

import blobtree
import decals
from decals import Interaction

TREE = {
    "format": "blobtree",
    "version": 1,
    "nodes": [{"type": "point", "center": [0.0, 0.0, 0.0], "radius": 1.0, "color": [0.8, 0.8, 0.8]}],
}
SCENE = {
    "format": "implicit-decals-scene",
    "version": 1,
    "objects": [
        {
            "type": "mesh",
            "name": "corner",
            "color": [0.5, 0.5, 0.5],
            "data": {
                "vertices": "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA",
                "faces": "AAAAAAEAAAACAAAA",
            },
        }
    ],
    "images": ["scale", "eye"],
    "camera": {"position": [0.0, 0.0, 5.0], "target": [0.0, 0.0, 0.0], "up": [0.0, 1.0, 0.0], "fov": 30.0},
    "decals": [
        {"position": [0.1, 0.1, 0.0], "normal": [0, 0, 1], "tangent": [1, 0, 0], "radius": 0.2},
        {
            "position": [0.2, 0.1, 0.0], "normal": [0, 0, 1], "tangent": [1, 0, 0], "radius": 0.2, "image": 1,
            "spill": True, "interaction": "contact", "layer": 2, "tint": [1.0, 0.5, 0.25], "opacity": 0.5,
        },
        {
            "position": [0.3, 0.1, 0.0], "normal": [0, 0, 1], "tangent": [1, 0, 0], "radius": 0.2,
            "image": -1, "spill": False, "interaction": "overlap",
        },
    ],
}  # fmt: skip


def test_a_scene_of_the_first_version(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(SCENE))
    scene = decals.load_scene(path)
    assert scene.objects[0].surface.area == pytest.approx(0.5)
    assert scene.decals.interactions.tolist() == [Interaction.PUSH, Interaction.PUSH, Interaction.OVERLAP]
    assert scene.decals.layers.tolist() == [0, 2, 0]
    assert scene.decals.images.tolist() == [0, 1, -1]
    decals.save_scene(scene, path)
    again = decals.load_model(path)
    assert isinstance(again, decals.Scene)
    assert again.decals.packed().tobytes() == scene.decals.packed().tobytes()
    assert b'"interaction":"contact"' not in path.read_bytes()
    assert scene.drawing.contact is again.drawing.contact is decals.Contact.PRODUCT


def test_a_tree_of_the_first_version(tmp_path: Path) -> None:
    path = tmp_path / "tree.json"
    path.write_text(json.dumps(TREE))
    loaded = decals.load_model(path)
    assert isinstance(loaded, decals.TreeObject)
    assert loaded.tree == blobtree.Point((0, 0, 0), radius=1.0, color=(0.8, 0.8, 0.8))
