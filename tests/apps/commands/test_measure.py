"""``implicit-decals measure``."""

import json
from pathlib import Path

import pytest

import decals
from decals.apps.cli import run


def test_a_table_and_json_show_the_measures_of_the_library(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    square = decals.MeshObject("square", [[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    disk = decals.Decals([[1, 1, 0]], [[0, 0, 1]], [[1, 0, 0]], [0.5])
    scene = decals.Scene(objects=[square], camera=decals.Camera((0, 0, 5)), decals=disk, images=["eye"])
    scene.save("scene.json")
    options = ["--samples", "2000", "--contact", "elastic"]
    assert run(["measure", "scene.json", *options, "--json"]) == 0
    expected = decals.measure(decals.load_scene("scene.json"), samples=2000, contact="elastic")
    assert json.loads(capsys.readouterr().out) == expected.to_dict()
    assert run(["measure", "scene.json", *options]) == 0
    table = capsys.readouterr().out
    assert "stretch, largest" in table
    assert "2,000" in table


def test_a_model_is_no_scene(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["measure", "spheres"]) == 2
    assert "expected a saved scene in JSON" in capsys.readouterr().err
