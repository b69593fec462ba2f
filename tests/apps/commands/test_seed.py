"""``implicit-decals seed``."""

import json
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from implicit_decals.apps.cli import run

Capture = pytest.CaptureFixture[str]


def test_seeds_as_rows_and_as_arrays(folder: Path) -> None:
    wish = ["seed", "spheres", "--count", "25", "--images", "3", "--seed", "4"]
    assert run([*wish, "-o", "seeds.json"]) == 0
    assert run([*wish, "-o", "seeds.csv"]) == 0
    arrays = json.loads((folder / "seeds.json").read_text())
    assert [len(arrays[name]) for name in ("positions", "normals", "tangents", "radii", "images")] == [25] * 5
    header, *rows = (folder / "seeds.csv").read_text().splitlines()
    assert header == "x,y,z,nx,ny,nz,tx,ty,tz,radius,image"
    table = np.array([row.split(",") for row in rows], float)
    assert np.allclose(table[:, :3], arrays["positions"], rtol=1e-6)
    assert table[:, 10].tolist() == arrays["images"]


def test_seeds_by_spacing_and_rule(folder: Path) -> None:
    pv.Sphere(radius=0.5).save(folder / "ball.ply")
    rules = ["--spacing", "0.2", "--sizing", "touching", "--along", "cross", "--factor", "0.5"]
    assert run(["seed", "ball.ply", *rules, "-o", "seeds.json"]) == 0
    radii = np.array(json.loads((folder / "seeds.json").read_text())["radii"])
    assert len(radii) == pytest.approx(np.pi / (0.2**2 * np.sqrt(0.75)), abs=3)
    assert np.median(radii) == pytest.approx(0.25 * 0.2, rel=0.15)


def test_seeds_follow_a_painted_image(folder: Path) -> None:
    pv.Sphere(radius=0.5).save(folder / "ball.ply")
    Image.fromarray(np.uint8([[0, 255]]).repeat(8, axis=1)).save(folder / "half.png")
    wish = ["--count", "200", "--painted", "half.png", "--painted-along", "y", "--black", "0.25"]
    assert (
        run(["seed", "ball.ply", *wish, "--choice", "curvature", "--regularity", "0.6", "-o", "seeds.json"])
        == 0
    )
    places = np.array(json.loads((folder / "seeds.json").read_text())["positions"])
    assert (places[:, 2] < 0).sum() == pytest.approx(40, abs=4)  # seen from +y, z runs to the right


@pytest.mark.parametrize(
    ("wish", "says"),
    [
        (["--regularity", "2", "-o", "a.json"], "regularity: expected a number from 0 to 1"),
        (["--painted", "none.png", "-o", "a.json"], "found no file"),
        (["--count", "5", "--spacing", "0.1", "-o", "a.json"], "--count or --spacing"),
        (["--count", "-1", "-o", "a.json"], "--count: expected"),
        (["--spacing", "0", "-o", "a.json"], "spacing: expected a length above 0"),
        (["-o", "a.png"], "expected an output file"),
    ],
)
def test_seeds_that_cannot_be(folder: Path, capsys: Capture, wish: list[str], says: str) -> None:
    assert run(["seed", "spheres", *wish]) == 2
    assert says in capsys.readouterr().err
