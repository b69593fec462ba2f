"""``implicit-decals measure``."""

import json
from pathlib import Path

import numpy as np
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


def test_the_table_tells_a_lattice_from_blue_noise(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [(i + 0.5 * (j % 2), 0.866 * j, 0) for i in range(12) for j in range(14)]
    square = decals.MeshObject(
        "square", [[0, 0, 0], [12, 0, 0], [12, 12, 0], [0, 12, 0]], [[0, 1, 2], [0, 2, 3]]
    )
    for name, shift in (("lattice", 0.0), ("uneven", 0.3)):
        places = np.array(rows) + np.random.default_rng(1).uniform(-shift, shift, (len(rows), 3)) * [1, 1, 0]
        disks = decals.Decals(places, [[0, 0, 1]] * len(rows), [[1, 0, 0]] * len(rows), 0.5)
        scene = decals.Scene(objects=[square], camera=decals.Camera((0, 0, 5)), decals=disks, images=["eye"])
        scene.save(f"{name}.json")
        assert run(["measure", f"{name}.json", "--samples", "2000"]) == 0
        assert ("as in a lattice" in capsys.readouterr().out) == (name == "lattice")


def test_a_model_is_no_scene(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["measure", "spheres"]) == 2
    assert "expected a saved scene in JSON" in capsys.readouterr().err
