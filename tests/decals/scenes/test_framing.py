"""`cover`'s camera fits pictures of all aspect ratios, at any angle of view and from any direction."""

import dataclasses
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

import blobtree
import decals
from decals.scenes.cover import fitting_camera
from decals.scenes.script import write_script
from tests.bench.trust_framing import ANGLES, ASPECTS, LEAST, MOST, filled, random_objects


@pytest.mark.parametrize("number", range(5))
def test_models_fill_pictures_of_all_shapes(number: int) -> None:
    rng = np.random.default_rng([9, number])
    objects = random_objects(rng)
    direction = tuple(rng.normal(size=3).tolist())
    for fov in ANGLES:
        camera = fitting_camera(objects, direction=direction, fov=fov, aspect=None)
        for aspect in (*ASPECTS, 1.45, 0.02, 40.0):
            assert LEAST <= filled(camera, objects, aspect) <= MOST


@pytest.fixture(scope="module")
def tower() -> decals.Scene:
    """A tall model beside a flat one."""
    tree = blobtree.Segment((0, -2, 0), (0, 2, 0), radius=0.3) | blobtree.Point((1.5, -1.5, 0), radius=0.5)
    return decals.cover(tree, count=12, fov=50)


@pytest.mark.parametrize("size", [(40, 120), (80, 80), (80, 60), (90, 60), (160, 50)])
def test_a_picture_shows_the_whole_model(tower: decals.Scene, size: Any) -> None:
    picture = np.asarray(decals.render(tower, size=size, background=decals.rendering.TRANSPARENT))
    rows, columns = np.nonzero(picture[..., 3])
    assert tower.camera.fov == 50.0
    assert min(rows.min(), columns.min()) > 0
    assert rows.max() < size[1] - 1
    assert columns.max() < size[0] - 1
    assert max(np.ptp(rows) / size[1], np.ptp(columns) / size[0]) > 0.78


def test_a_camera_stays_while_the_model_fills_the_picture(tower: decals.Scene) -> None:
    camera = tower.camera
    assert camera.at(4 / 3) is camera
    assert camera.at(3 / 2) is camera
    assert camera.at(0.3).distance > 1.5 * camera.distance


def test_a_camera_that_is_placed_otherwise_stays(tower: decals.Scene) -> None:
    camera = tower.camera
    for changes in ({"fov": 20.0}, {"position": (0.0, 0.0, 9.0)}, {"target": (0.0, 1.0, 0.0)}):
        moved = dataclasses.replace(camera, **changes)
        assert moved.fit is None
        assert moved.at(0.3) is moved
    assert decals.Camera.fitting([[-1, 0, 0], [1, 0, 0]]).at(0.3).fit is None


def test_a_turned_camera_shows_as_much_from_left_to_right(tower: decals.Scene) -> None:
    turned = tower.camera.turned(30)
    assert turned.at(4 / 3) is turned
    narrow = turned.at(0.5)
    assert narrow.position == turned.position
    wide, high = (np.tan(np.radians(camera.fov) / 2) for camera in (turned, narrow))
    assert high * 0.5 == pytest.approx(wide * 4 / 3)


def test_files_and_scripts_keep_the_fit(tower: decals.Scene, tmp_path: Path) -> None:
    tower.save(tmp_path / "scene.json")
    read = decals.load_scene(tmp_path / "scene.json").camera
    assert read.fit == tower.camera.fit
    assert len((tmp_path / "scene.json").read_bytes()) < 60_000
    write_script(tower, tmp_path / "scene.py")
    script = runpy.run_path(str(tmp_path / "scene.py"))["scene"]
    assert script.camera.at(0.5).position == pytest.approx(tower.camera.at(0.5).position)


def test_a_window_shows_the_whole_model(tower: decals.Scene) -> None:
    plotter = pv.Plotter(off_screen=True, window_size=[60, 180])
    component: Any = plotter.decals
    component.add_scene(tower, camera=True)
    camera = tower.camera.at(1 / 3)
    assert plotter.camera.position == pytest.approx(camera.position)
    plotter.close()
