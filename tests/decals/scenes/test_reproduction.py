"""Recipes identify a run, and scenes are made again from them."""

import json
import subprocess
from dataclasses import replace
from functools import cache
from importlib.metadata import requires, version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import decals
from blobtree import Point, Segment
from decals import Scene, reproduce
from decals.editing import EditSession, ScatterDecals
from decals.errors import InvalidScene
from decals.rendering.picture import picture_recipe
from decals.scattering import Jitter
from decals.scenes import provenance
from decals.scenes.recipe import Recipe, is_plain, plain, shape_hash

BLEND = Point((0, 0, 0), radius=1.0) + Segment((0, 0, 0), (2, 0, 0), radius=0.5)


@cache
def plainly_covered() -> Scene:
    return decals.cover(BLEND, count=6, seed=3)


def covered(**options: Any) -> Scene:
    return decals.cover(BLEND, count=6, seed=3, **options) if options else plainly_covered()


def scattered(**options: Any) -> Scene:
    scene = decals.cover(BLEND, count=1)
    found = decals.scatter(BLEND, seed=4, **options)
    recipe = Recipe.of("decals.scatter", seed=4, models=["model 1"], **options)
    return scene.replace(decals=found, images=["eye"] * 3, recipe=recipe.giving(found, scene.objects))


def test_a_recipe_names_versions_device_time_and_checkout() -> None:
    recipe = covered().recipe
    assert recipe is not None
    assert recipe.versions["implicit-decals"] == version("implicit-decals")
    needed = [line for line in requires("implicit-decals") or () if "extra" not in line]
    assert len(recipe.versions) == 2 + len(needed)
    assert recipe.versions["numpy"] == np.__version__
    assert {"time", "platform", "device"} <= recipe.made.keys()
    assert str(recipe.made["device"]).startswith("cpu (")
    assert recipe.result == decals.cover(BLEND, count=6, seed=3).decals.content_hash
    assert recipe.inputs == {"model 1": shape_hash(covered().objects[0])}
    json.dumps(recipe.record)


def test_a_checkout_has_its_commit_and_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def git(*words: str) -> str:
        command = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b.c", *words]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    module = tmp_path / "decals" / "scenes" / "provenance.py"
    module.parent.mkdir(parents=True)
    monkeypatch.setattr(provenance, "__file__", str(module))
    look = provenance.checkout.__wrapped__
    assert look() == {}
    (tmp_path / "pyproject.toml").write_text("")
    assert look() == {}
    git("init", "-q")
    assert look() == {}  # without a commit
    git("add", ".")
    git("commit", "-q", "-m", "first")
    assert look() == {"commit": git("rev-parse", "HEAD"), "dirty": False}
    (tmp_path / "pyproject.toml").write_text("changed")
    assert look()["dirty"] is True
    monkeypatch.setenv("PATH", "")
    assert look() == {}


def test_a_recipe_stays_in_a_file(tmp_path: Path) -> None:
    scene = covered(direction=lambda points: points)
    scene.save(tmp_path / "scene.json")
    again = decals.load_scene(tmp_path / "scene.json")
    assert again.recipe == scene.recipe
    assert again.recipe is not None
    assert again.recipe.missing == ("direction",)


@pytest.mark.slow_cases("painted along a vector", "rule of sizes")
@pytest.mark.parametrize(
    "options",
    [
        pytest.param({"count": 5}, id="count"),
        pytest.param({"spacing": 1.2, "regularity": 0.5, "images": 3}, id="spacing and images"),
        pytest.param({"count": 5, "direction": np.array([0.0, 0.0, 1.0])}, id="painted along a vector"),
        pytest.param({"count": 5, "sizing": decals.Sizing.TOUCHING, "factor": 0.75}, id="rule of sizes"),
        pytest.param(
            {"count": 5, "jitter": Jitter(size=0.25, angle=10.0), "images": 2, "weights": [1, 3]}, id="jitter"
        ),
    ],
)
def test_scattered_decals_are_made_again(options: dict[str, Any], tmp_path: Path) -> None:
    scene = scattered(**options)
    assert scene.recipe is not None
    assert scene.recipe.missing == ()
    decals.save_scene(scene, tmp_path / "scene.json")
    found = reproduce(decals.load_scene(tmp_path / "scene.json"))
    assert found.missing == found.differences == found.circumstances == ()
    assert found.equal
    assert found.decals == scene.decals


def test_a_covered_scene_is_made_again(tmp_path: Path) -> None:
    scene = covered(images=["eye", "tile"], sizing="touching", up="z", direction=(1, 0, 0))
    assert reproduce(scene).equal


def test_what_is_missing_is_listed() -> None:
    scene = covered()
    recipe = scene.recipe
    assert recipe is not None
    cases = {
        "a recipe": replace(scene, recipe=None),
        "edits by hand": scene.replace(decals=scene.decals.replace(tints="red")),
        "the value of 'direction', which the recipe only describes: <lambda>|test_": covered(
            direction=lambda p: p
        ),
        "the model 'model 1' as it was": scene.replace(
            objects=[decals.TreeObject("model 1", BLEND.scale(1.5))]
        ),
        "the model 'other', which the scene does not have": replace(
            scene, recipe=replace(recipe, parameters={**recipe.parameters, "models": ["other"]})
        ),
        "the function 'mine'": replace(scene, recipe=replace(recipe, function="mine")),
        "the names of its models": replace(scene, recipe=replace(recipe, parameters={"count": 6})),
        "parameters that this version takes": replace(
            scene, recipe=replace(recipe, parameters={**recipe.parameters, "wish": 1})
        ),
    }
    for words, one in cases.items():
        found = reproduce(one)
        assert any(word in line for line in found.missing for word in words.split("|")), (
            words,
            found.missing,
        )
        assert not found.equal
        assert found.decals is None


def test_differences_are_said_with_figures() -> None:
    scene = covered()
    recipe = scene.recipe
    assert recipe is not None
    moved = scene.decals.replace(positions=scene.decals.positions + np.array([0, 0, 0.01]))
    found = reproduce(replace(scene, decals=moved, recipe=replace(recipe, result="")))
    assert found.missing == ()
    assert "positions: 6 of 6 decals differ" in found.differences
    assert any(line.startswith("positions: up to 0.0") for line in found.differences)
    fewer = reproduce(replace(scene, decals=scene.decals[1:], recipe=replace(recipe, result="")))
    assert fewer.differences == ("number of decals: 5 in the scene, 6 made again",)


def test_circumstances_that_differ_are_said() -> None:
    scene = covered()
    recipe = scene.recipe
    assert recipe is not None
    other = replace(
        recipe,
        versions={**recipe.versions, "numpy": "1.0", "gone": "2"},
        made={**recipe.made, "device": "cuda:0 (card)", "time": "yesterday"},
    )
    found = reproduce(replace(scene, recipe=other))
    assert found.equal
    assert f"numpy: 1.0 then, {np.__version__} now" in found.circumstances
    assert "gone: 2 then, none now" in found.circumstances
    assert any(line.startswith("device: cuda:0 (card) then, cpu") for line in found.circumstances)
    assert not any("time" in line or "yesterday" in line for line in found.circumstances)


def test_edits_of_a_session_are_seen() -> None:
    session = EditSession(decals.cover(BLEND, count=3, images=["eye"]))
    session.do(ScatterDecals((0,), count=5, seed=2))
    scattered_scene = session.document.scene
    assert reproduce(scattered_scene).equal
    session.do(ScatterDecals((0,), count=4, seed=2))
    assert reproduce(session.document.scene).equal
    kept = session.document.scene
    assert "edits by hand" in reproduce(kept.replace(decals=kept.decals[:2])).missing[0]


def test_a_posed_scene_is_refused() -> None:
    with pytest.raises(InvalidScene, match="scene: expected a Scene"):
        reproduce(BLEND)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("value", "expected", "kept"),
    [
        (np.arange(3), [0, 1, 2], True),
        (np.zeros(2000), "an array", False),
        ({"a": [1, None, "x"]}, {"a": [1, None, "x"]}, True),
        (Jitter(size=0.5), {"position": 0.0, "size": 0.5, "angle": 0.0}, True),
        (decals.Contact.MIN, 1, True),
        (decals.rendering.TRANSPARENT, {"top": [0.0] * 4, "bottom": [0.0] * 4}, True),
        (np.cross, "cross", False),
        ([np.cross], ["cross"], False),
    ],
)
def test_plain_values(value: Any, expected: Any, kept: bool) -> None:
    assert is_plain(value) is kept
    if kept or isinstance(expected, list) or expected == "cross":
        assert plain(value) == expected


def test_a_picture_keeps_how_it_was_made(tmp_path: Path) -> None:
    scene = covered()
    picture = decals.render(scene, size=(32, 24), contact="min", samples=1)
    picture.save(tmp_path / "a.png")
    recipe = picture_recipe(tmp_path / "a.png")
    assert recipe is not None
    assert recipe["function"] == "decals.render"
    assert recipe["parameters"] == {"size": [32, 24], "samples": 1, "contact": "min"}
    assert recipe["missing"] == []
    assert recipe["scene"]["decals"] == scene.decals.content_hash
    assert scene.recipe is not None
    assert recipe["recipe"] == json.loads(json.dumps(scene.recipe.record))
    assert "OpenGL" in recipe["made"]["device"]
    picture.save(tmp_path / "a.jpg")
    decals.render(BLEND, size=(32, 24)).save(tmp_path / "b.png")
    assert picture_recipe(tmp_path / "b.png") is not None
    (tmp_path / "c.png").write_bytes(b"none")
    with pytest.raises(InvalidScene, match="expected a PNG file"):
        picture_recipe(tmp_path / "c.png")
