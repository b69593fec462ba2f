"""How a scene is drawn and made: files, pictures, editors and measures follow the scene."""

import json
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import decals
from blobtree import Point
from decals.editing import EditSession, ReplaceScene, ScatterDecals
from decals.errors import InvalidScene
from decals.rendering import Background, Drawing, Environment, Light, Lighting
from decals.scenes.recipe import Recipe
from decals.scenes.script import write_script
from tests.decals.baking.glb import read_numbers

LOOK = Drawing(
    samples=1,
    contact="radial",
    mapping="chord",
    background=Background("white", (0.2, 0.3, 0.4, 0.5)),
    lights=Lighting((Light((1, 0.9, 0.8), (0, 0, -1), (0, 0, 3), (1, 0.1, 0), 40.0, 2.0),)),
    stiffness=3.5,
    filtered=True,
)


def scene(**parts: Any) -> decals.Scene:
    triangle = decals.MeshObject("t", [[-2, -2, 0], [2, -2, 0], [0, 2, 0]], [[0, 1, 2]])
    rows = decals.Decals([[-0.4, 0, 0], [0.4, 0, 0]], [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, 0.6, images=[-1, -1])
    rows = rows.replace(tints=["tomato", "navy"])
    return decals.Scene(objects=[triangle], camera=decals.Camera((0, 0, 4)), decals=rows, **parts)


def test_files_keep_how_a_scene_is_drawn_and_made(tmp_path: Path) -> None:
    recipe = Recipe.of("decals.cover", seed=7, count=12, direction=np.cross, factor=np.float32(0.5))
    kept = scene(drawing=LOOK, recipe=recipe)
    kept.save(tmp_path / "scene.json")
    loaded = decals.load_scene(tmp_path / "scene.json")
    assert loaded.drawing == LOOK
    assert loaded.recipe == recipe
    assert recipe.parameters == {"count": 12, "direction": "cross", "factor": 0.5}
    assert recipe.versions["implicit-decals"] == decals.__version__
    assert scene().drawing == Drawing()
    assert scene().recipe is None


def test_the_contact_mode_is_written_and_files_without_one_had_equation_5(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    scene().save(path)
    content = json.loads(path.read_text())
    assert content["drawing"]["contact"] == Drawing().contact.name.lower()
    del content["drawing"]
    path.write_text(json.dumps(content))
    assert decals.load_scene(path).drawing == Drawing(contact="product")


@pytest.mark.parametrize(
    ("part", "value", "says"),
    [
        ("drawing", {"contact": "round"}, "contact"),
        ("drawing", {"stiffness": 0.5}, "drawing: stiffness: expected a number from 1 to 64, got 0.5"),
        ("drawing", {"samples": 0}, "drawing: samples: expected"),
        ("drawing", {"speed": 1}, "speed"),
        ("drawing", {"filtered": 1}, "filtered"),
        ("drawing", {"lights": {"lights": [], "frame": [1, 2]}}, "expected 16 numbers, got 2"),
        ("drawing", {"background": {"top": [0, 0, 0, 9], "bottom": [0, 0, 0, 1]}}, "drawing: a background's"),
        ("drawing", 5, "drawing"),
        ("recipe", {"function": "f", "parameters": {}, "seed": -1, "versions": {}}, "seed"),
        ("recipe", {"function": 1, "parameters": {}, "seed": 0, "versions": {}}, "function"),
    ],
)
def test_wrong_files_are_refused(tmp_path: Path, part: str, value: Any, says: str) -> None:
    path = tmp_path / "scene.json"
    scene().save(path)
    path.write_text(json.dumps(json.loads(path.read_text()) | {part: value}))
    with pytest.raises(InvalidScene, match=says):
        decals.load_scene(path)


def test_files_and_scripts_keep_environments(tmp_path: Path) -> None:
    light = np.random.default_rng(0).random((4, 8, 3)).astype(np.float32) * 9
    Image.fromarray((20 * light).astype(np.uint8)).save(tmp_path / "sky.png")
    shown = {"rotation": 30.0, "strength": 2.0, "visible": True, "up": (0.0, 0.0, 1.0)}
    path, text = tmp_path / "scene.json", ""
    for picture in (light, str(tmp_path / "sky.png")):
        kept = scene(drawing=Drawing(environment=Environment(picture, **shown)))  # type: ignore[arg-type]
        kept.save(path)
        write_script(kept, tmp_path / "script.py")
        assert decals.load_scene(path).drawing == kept.drawing
        assert runpy.run_path(str(tmp_path / "script.py"))["scene"].drawing == kept.drawing
        text = path.read_text()
    assert json.loads(text)["drawing"]["environment"] == {**shown, "picture": "sky.png", "up": [0, 0, 1]}
    for old, new, says in (
        ('"sky.png"', '"../sky.png"', "in the folder of the scene"),
        ('"sky.png"', '"no.png"', "drawing: environment: expected an image, found no file"),
        ('"strength":2.0', '"strength":-2.0', "strength: expected 0, which is darkness"),
        ('"visible":true', '"visible":3', "environment.visible"),
    ):
        assert old in text
        path.write_text(text.replace(old, new))
        with pytest.raises(InvalidScene, match=says):
            decals.load_scene(path)


def test_pictures_follow_the_scene_and_options_override_it(tmp_path: Path) -> None:
    size = (48, 36)
    scene(drawing=LOOK).save(tmp_path / "scene.json")
    kept = decals.load_scene(tmp_path / "scene.json")
    options = {name: getattr(LOOK, name) for name in vars(LOOK)}
    shown, expected = kept.render(size=size), decals.render(scene(), size=size, **options)
    assert np.array_equal(np.asarray(shown), np.asarray(expected))
    plain = decals.render(kept, size=size, background=decals.rendering.STUDIO)
    assert not np.array_equal(np.asarray(shown), np.asarray(plain))


def test_baking_and_measures_follow_the_scene(tmp_path: Path) -> None:
    unequal = scene().decals.replace(radii=[0.7, 0.5])
    radial, product = (
        scene(drawing=Drawing(contact=mode)).replace(decals=unequal) for mode in ("radial", "product")
    )
    numbers = []
    for number, (baked, contact) in enumerate([(radial, None), (product, "radial"), (product, None)]):
        decals.bake(baked, tmp_path / f"{number}.glb", size=64, contact=contact)
        numbers.append(read_numbers(tmp_path / f"{number}.glb"))
    assert numbers[0] == numbers[1] != numbers[2]
    own, given = decals.measure(radial, samples=500), decals.measure(product, samples=500, contact="radial")
    assert own.to_dict() == given.to_dict()
    assert own.stretch_max != decals.measure(product, samples=500).stretch_max


def test_an_edited_document_keeps_how_it_is_drawn() -> None:
    session = EditSession(scene(drawing=LOOK, images=["eye"]))
    assert session.document.scene.drawing == LOOK
    other = scene(recipe=Recipe.of("decals.scatter", seed=1), images=["eye"])
    session.do(ReplaceScene(other))
    assert session.document.drawing == other.drawing
    assert session.document.recipe == other.recipe
    session.undo()
    assert session.document.drawing == LOOK
    assert session.document.recipe is None
    session.do(ScatterDecals((0,), count=2, seed=9))
    assert session.document.recipe is not None
    assert session.document.recipe.seed == 9
    session.undo()
    assert session.document.scene.recipe is None
    fork = session.document.fork()
    session.document.draw_as(Drawing(contact="min"))
    session.document.adopt(fork)  # the fork drew nothing otherwise
    assert session.document.scene.drawing.contact is decals.Contact.MIN
    fork = session.document.fork()
    fork.draw_as(LOOK)
    session.document.adopt(fork)
    assert session.document.drawing == LOOK


def test_cover_says_how_it_scattered() -> None:
    recipe = decals.cover(Point((0, 0, 0), radius=1), count=3, seed=5, images=["eye"]).recipe
    assert recipe is not None
    assert (recipe.function, recipe.seed) == ("decals.cover", 5)
    assert (recipe.parameters["count"], recipe.parameters["images"]) == (3, ["eye"])


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda: scene(drawing="nice"), "drawing: expected a Drawing, got 'nice'"),
        (lambda: scene(recipe="nice"), "recipe: expected a Recipe, got 'nice'"),
        (lambda: Recipe("f", [], 0, {}), "parameters: expected a mapping"),  # type: ignore[arg-type]
        (lambda: Drawing(contact="round"), "contact: expected one of"),
    ],
)
def test_wrong_values_are_refused(wrong: Any, says: str) -> None:
    with pytest.raises(InvalidScene, match=says):
        wrong()
