"""``implicit-decals polygonize``."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

import blobtree
from blobtree import Point
from decals import Camera, MeshObject, Scene, TreeObject, save_scene
from decals.apps.cli import run

Capture = pytest.CaptureFixture[str]


@pytest.mark.parametrize("suffix", ["ply", "PLY", "obj", "OBJ", "stl", "STL", "vtp"])
def test_polygonize(folder: Path, suffix: str) -> None:
    blobtree.save(Point((1, 2, 3), radius=0.5, color=(1.0, 0.5, 0.0)), folder / "ball.json")
    assert run(["polygonize", "ball.json", "--resolution", "32", "-o", f"ball.{suffix}"]) == 0
    mesh = pv.read(folder / f"ball.{suffix}")
    assert np.allclose(np.linalg.norm(mesh.points - [1, 2, 3], axis=1), 0.5, atol=1e-3)
    assert mesh.triangulate().volume == pytest.approx(4 / 3 * np.pi * 0.125, rel=0.02)
    if suffix.lower() in ("ply", "vtp"):
        assert np.asarray(mesh["RGB"])[0].tolist() == [255, 128, 0]
    assert sorted(path.name for path in folder.iterdir()) == sorted(["ball.json", f"ball.{suffix}"])


def test_polygonize_by_cell_size(folder: Path) -> None:
    for cell, name in (("0.4", "coarse"), ("0.1", "fine")):
        assert run(["polygonize", "spheres", "--cell-size", cell, "-o", f"{name}.ply"]) == 0
    assert pv.read(folder / "fine.ply").n_cells > 8 * pv.read(folder / "coarse.ply").n_cells


def test_polygonize_by_chord_error_with_creases(folder: Path) -> None:
    cut = Point((0, 0, 0), radius=1.0) - Point((0.8, 0, 0), radius=0.9)
    blobtree.save(cut, folder / "cut.json")
    command = ["polygonize", "cut.json", "--chord-error", "0.03"]
    assert run([*command, "--creases", "-o", "closed.vtp"]) == 0
    assert run([*command, "--split-normals", "-o", "split.vtp"]) == 0
    assert run(["polygonize", "cut.json", "--cells", "16", "--creases", "-o", "cells.stl"]) == 0
    closed, split = pv.read(folder / "closed.vtp"), pv.read(folder / "split.vtp")
    assert closed.is_manifold
    assert (np.asarray(closed["sheet_counts"]) == 2).sum() > 20
    assert split.n_points > closed.n_points
    assert split.n_cells == closed.n_cells
    assert pv.read(folder / "cells.stl").n_cells > 100


def test_a_chord_error_that_takes_too_many_triangles_is_one_line(folder: Path, capfd: Capture) -> None:
    blobtree.save(Point((0, 0, 0), radius=1.0), folder / "ball.json")
    command = [
        "polygonize",
        "ball.json",
        "--chord-error",
        "1e-5",
        "--max-triangles",
        "50000",
        "-o",
        "ball.ply",
    ]
    assert run(command) != 0
    assert "max_triangles = 50,000" in capfd.readouterr().err
    assert not (folder / "ball.ply").exists()


@pytest.mark.parametrize("stage", ["placing vertices", "writing"])
def test_an_interrupted_polygonize_leaves_no_file(
    folder: Path, stage: str, monkeypatch: pytest.MonkeyPatch, capfd: Capture
) -> None:
    """Control-C while it computes, or while the file is half written."""

    def report(_self: object, _task: object, **_state: object) -> None:
        raise KeyboardInterrupt

    def save(_self: object, path: Path, **_options: object) -> None:
        path.write_bytes(b"half")
        raise KeyboardInterrupt

    if stage == "writing":
        monkeypatch.setattr(pv.PolyData, "save", save)
    else:
        monkeypatch.setenv("TTY_INTERACTIVE", "1")  # as in a terminal
        monkeypatch.setattr("rich.progress.Progress.update", report)
    before = sorted(folder.iterdir())
    assert run(["polygonize", "spheres", "-o", "half.ply"]) == 130
    assert sorted(folder.iterdir()) == before
    assert capfd.readouterr().err.split() == ["interrupted"]


def test_a_tree_without_a_surface_is_refused(folder: Path, capfd: Capture) -> None:
    empty = Point((0, 0, 0), radius=0.1) & Point((9, 9, 9), radius=0.1)
    blobtree.save(empty, folder / "nothing.json")
    assert run(["polygonize", "nothing.json", "-o", "a.ply"]) == 2
    assert capfd.readouterr().err.startswith("error: 'nothing.json': object 'nothing' has no surface")
    assert not (folder / "a.ply").exists()


def test_all_objects_of_a_scene_are_written(folder: Path) -> None:
    ball = TreeObject("ball", Point((0, 0, 0), radius=0.5, color=(1.0, 0.5, 0.0)))
    corner = MeshObject("corner", [[2, 0, 0], [3, 0, 0], [2, 1, 0]], [[0, 1, 2]], color=(0.0, 0.0, 1.0))
    save_scene(Scene(objects=(ball, corner), camera=Camera((0, 0, 5))), folder / "scene.json")
    assert run(["polygonize", "scene.json", "--cells", "16", "-o", "mesh.vtp"]) == 0
    mesh = pv.read(folder / "mesh.vtp")
    right = mesh.points[:, 0] > 1
    assert sorted(map(tuple, mesh.points[right])) == [(2, 0, 0), (2, 1, 0), (3, 0, 0)]
    colors, normals = np.asarray(mesh["RGB"]), np.asarray(mesh.point_data.active_normals)
    assert (colors[right] == [0, 0, 255]).all()
    assert (colors[~right] == [255, 128, 0]).all()
    assert np.allclose(np.linalg.norm(mesh.points[~right], axis=1), 0.5, atol=1e-2)
    assert np.allclose(normals[right], [0, 0, 1])


def test_a_scene_without_objects_is_refused(folder: Path, capfd: Capture) -> None:
    save_scene(Scene(objects=(), camera=Camera((0, 0, 1))), folder / "empty.json")
    assert run(["polygonize", "empty.json", "-o", "mesh.ply"]) == 2
    assert "object" in capfd.readouterr().err
