"""What a stage shows is what the batch renderer draws, and what it says lies there."""

import gc
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import pyvista as pv

from blobtree import Point
from decals import Contact, ImageMapping, TreeObject
from decals.errors import InvalidPoints, InvalidScene, NoGraphics
from decals.index import DecalEditor
from decals.rendering import TRANSPARENT, Drawing, RenderOptions
from decals.vtk import SubplotRenderer
from tests.decals.vtk.conftest import Factory, Plotter
from tests.decals.vtk.scenes import both, mesh_object, shot
from tests.oracles.raster import edges


@pytest.mark.parametrize("samples", [1, 2])
def test_the_window_shows_the_batch_renderers_pixels(plotter: Factory, samples: int) -> None:
    pl = plotter()
    pl.set_background("black")
    pl.decals.add_scene(both(), camera=True)
    subplot = pl.decals.subplot
    subplot.samples = samples
    seen = shot(pl)
    with subplot.current():
        batch = subplot.renderer.render(
            both(), RenderOptions(size=(160, 120), samples=samples, background=TRANSPARENT)
        )
        object_id = subplot.renderer.buffers(both(), RenderOptions(size=(160, 120))).object_id
    sure = ~edges(object_id)
    inside = sure & (object_id >= 0)
    assert inside.mean() > 0.2
    assert np.abs(seen - batch[..., :3])[inside].max() <= 1
    assert (seen[sure & (object_id < 0)] == 0).all()


def test_a_camera_in_front_of_the_whole_scene_shows_nothing(plotter: Factory) -> None:
    pl = plotter()
    pl.set_background("black")
    pl.decals.add_scene(both(), camera=True)
    shown: Any = pl.camera
    before, camera = shot(pl), shown.copy()
    eye, target = np.array(pl.camera.position), np.array(pl.camera.focal_point)
    pl.camera.position, pl.camera.focal_point = tuple(2.0 * target - eye), tuple(3.0 * target - 2.0 * eye)
    pl.renderer.ResetCameraClippingRange()
    planes = pl.camera.clipping_range
    assert planes[1] < 1e-9  # VTK has no depths to choose from
    assert not shot(pl).any()
    assert pl.decals.subplot.viewpoint().rays(160, 120).directions(80, 60).shape == (3,)
    assert pl.camera.clipping_range == planes
    pl.camera.DeepCopy(camera)
    np.testing.assert_array_equal(shot(pl), before)


def test_one_place_in_the_window(pl: Plotter) -> None:
    subplot = pl.decals.subplot
    shot(pl)
    with subplot.current():
        buffers = subplot.renderer.buffers(
            both(), RenderOptions(size=(160, 120)), viewpoint=subplot.viewpoint()
        )
    sure = ~edges(buffers.object_id)
    rng = np.random.default_rng(1)
    for x, y in rng.integers(0, (160, 120), (30, 2)).tolist():
        if not sure[y, x]:
            continue
        hit = subplot.at(x, 119 - y)
        if hit is None:
            assert buffers.object_id[y, x] == -1
            continue
        assert hit.object_id == buffers.object_id[y, x]
        np.testing.assert_allclose(hit.position, buffers.position[y, x], atol=1e-4)
        if hit.field > 0.52:
            assert hit.owner == buffers.owner[y, x]
            np.testing.assert_allclose(hit.uv, buffers.uv[y, x], atol=1e-2)
    assert subplot.at(-1, 5) is None
    assert subplot.at(5, 120) is None


def test_before_the_first_frame_there_is_no_graphics(pl: Plotter) -> None:
    with pytest.raises(NoGraphics, match="render it first"):
        pl.decals.subplot.at(80, 60)


def test_what_did_not_change_is_not_drawn_again(pl: Plotter) -> None:
    subplot = pl.decals.subplot
    first = shot(pl)
    np.testing.assert_array_equal(shot(pl), first)
    assert not subplot.drawn_fraction
    ball = pl.add_mesh(pv.Sphere(radius=0.2, center=both().camera.target), reset_camera=False)
    ball.position = 0.5 * (np.array(both().camera.position) - both().camera.target)
    with_ball = shot(pl)
    assert not subplot.drawn_fraction
    assert (with_ball != first).any()
    assert (with_ball == first).mean() > 0.8


@pytest.mark.ordinary_cases("<lambda>1", "<lambda>2", "<lambda>3", "<lambda>8")
@pytest.mark.parametrize(
    "change",
    [
        lambda pl: setattr(pl.camera, "position", np.array(pl.camera.position) + 0.1),
        lambda pl: setattr(pl.decals.subplot, "samples", 1),
        lambda pl: setattr(pl.decals.subplot, "draw_scale", 0.5),
        lambda pl: setattr(pl.decals.subplot, "mapping", ImageMapping.CHORD),
        lambda pl: setattr(pl.decals.subplot, "contact", Contact.MIN),
        lambda pl: pl.decals.add_scene(both().replace(drawing=Drawing(contact="radial"))),
        lambda pl: setattr(pl.decals, "scene", both().replace(decals=both().decals[:60])),
        lambda pl: setattr(pl.decals, "scene", both().replace(objects=both().objects[:1])),
        lambda pl: setattr(pl, "window_size", (150, 120)),
    ],
)
def test_whatever_changes_is_drawn(pl: Plotter, change: Callable[[Plotter], None]) -> None:
    first = shot(pl)
    change(pl)
    seen = shot(pl)
    assert seen.shape != first.shape or (seen != first).any()


def test_a_hidden_scene_takes_no_work_and_keeps_no_former_state(pl: Plotter) -> None:
    subplot = pl.decals.subplot
    first = shot(pl)
    subplot.actor.visibility = False
    stand_in = pl.add_mesh(pv.Sphere(), reset_camera=False)
    pl.decals.apply(stand_in)
    former: list[weakref.ref[object]] = []
    for count in (20, 30, 40):
        item = TreeObject("ball", Point((0, 0, 0), radius=0.5))
        state = both().replace(objects=(item,), decals=both().decals[:count])
        former += [weakref.ref(item), weakref.ref(state.decals)]
        subplot.scene = state
        shot(pl)
        assert (subplot.prepare(1, 1.0), subplot.warm(1.0)) == (0.0, None)
    shot(pl)
    gc.collect()
    assert [ref() is not None for ref in former] == [False] * 4 + [True] * 2
    pl.remove_actor(stand_in)
    subplot.scene = both()
    subplot.actor.visibility = True
    np.testing.assert_array_equal(shot(pl), first)


def test_the_stages_renderer_may_draw_other_things_in_between(pl: Plotter) -> None:
    subplot = pl.decals.subplot
    first = shot(pl)
    other = both().replace(objects=both().objects[:1])
    for size in ((160, 120), (320, 240), (50, 40)):
        with subplot.current():
            subplot.renderer.render(other, RenderOptions(size=size, samples=1))
            subplot.renderer.draw(other, RenderOptions(size=size, samples=1))
        np.testing.assert_array_equal(shot(pl), first)


def prepared(subplot: SubplotRenderer, samples: int) -> int:
    """Prepare a frame by the smallest parts; how many there were."""
    for shortest_rotations in range(1, 10_000):
        shown = subplot.prepare(samples, 0.0)
        if shown is not None:
            assert shown > 0
            return shortest_rotations
    raise AssertionError("the frame is never done")


@pytest.mark.slow_cases("2")
def test_other_objects_are_drawn_in_place_of_the_scenes_while_picks_meet_its_own(plotter: Factory) -> None:
    pl = plotter()
    scene = both()
    pl.decals.add_scene(scene, camera=True)
    subplot = pl.decals.subplot
    own, pick = shot(pl), subplot.at(80, 60)
    subplot.drawn_objects = scene.objects[:1]
    assert subplot.work_fraction(subplot.samples) == 1.0
    drawn = shot(pl)
    assert subplot.at(80, 60).position.tolist() == pick.position.tolist()
    subplot.scene = scene.replace(objects=scene.objects[:1])
    assert subplot.drawn_objects is None  # another scene has its own
    np.testing.assert_array_equal(drawn, shot(pl))
    assert np.abs(drawn - own).max() > 50
    subplot.drawn_objects = scene.objects
    np.testing.assert_array_equal(shot(pl), own)
    subplot.drawn_objects = None
    np.testing.assert_array_equal(shot(pl), drawn)
    subplot.scene = None
    subplot.drawn_objects = scene.objects
    assert subplot.drawn_objects is None


@pytest.mark.parametrize("samples", [1, 2])
def test_a_frame_prepared_part_by_part_is_the_one_drawn_at_once(plotter: Factory, samples: int) -> None:
    other, pl = plotter(), plotter()
    for one in (other, pl):
        one.decals.add_scene(both(), camera=True)
    other.decals.subplot.samples = samples
    whole = shot(other)
    subplot = pl.decals.subplot
    subplot.samples, subplot.draw_scale = samples, 0.5
    small = shot(pl)
    assert subplot.prepare(samples, 0.0) is None
    np.testing.assert_array_equal(shot(pl), small)
    assert not subplot.drawn_fraction
    assert prepared(subplot, samples) > 100
    assert subplot.prepare(samples, 0.0) == 0.0
    subplot.draw_scale = 1.0
    np.testing.assert_array_equal(shot(pl), whole)
    assert not subplot.drawn_fraction


def test_what_changes_while_a_frame_is_prepared_is_in_it(pl: Plotter) -> None:
    subplot = pl.decals.subplot
    subplot.draw_scale = 0.5
    shot(pl)
    for _ in range(100):
        subplot.prepare(2, 0.0)
    pl.camera.position = np.array(pl.camera.position) + 0.1
    pl.decals.scene = both().replace(decals=both().decals[:60])
    shot(pl)
    prepared(subplot, 2)
    subplot.draw_scale = 1.0
    seen = shot(pl)
    assert not subplot.drawn_fraction
    subplot.draw_scale = 0.5
    shot(pl)
    subplot.draw_scale = 1.0
    np.testing.assert_array_equal(shot(pl), seen)
    assert not subplot.drawn_fraction


def test_an_editors_changes_are_drawn(plotter: Factory) -> None:
    """Decals and objects that change in place, in a scene that stays the same thing."""

    class Document:
        camera, images = both().camera, both().images
        objects, decals = both().objects, DecalEditor(both().decals)

    document = Document()
    pl = plotter()
    pl.decals.add_scene(both(), camera=True)
    first = shot(pl)
    pl.decals.scene = document
    np.testing.assert_array_equal(shot(pl), first)
    document.decals.delete(int(pl.decals.subplot.at(80, 60).owner))
    share = pl.decals.subplot.work_fraction(pl.decals.subplot.samples)
    without = shot(pl)
    assert 0.0 < pl.decals.subplot.drawn_fraction == share < 0.5
    assert (without != first).any()
    np.testing.assert_array_equal(shot(pl), without)
    document.objects = (*both().objects, mesh_object("ball", pv.Sphere(center=(0, 0, 4))))
    shot(pl)
    assert pl.bounds.z_max > 4.2


@pytest.mark.ordinary_cases("<lambda>1", "<lambda>2")
@pytest.mark.parametrize(
    "change",
    [
        lambda pl: pl.enable_parallel_projection(),
        lambda pl: setattr(pl.decals.subplot, "lights", "vtk"),
        lambda pl: setattr(pl.decals.subplot, "draw_scale", 0.5),
        lambda pl: setattr(pl.decals.subplot, "contact", Contact.RADIAL),
        lambda pl: pl.add_mesh(pv.Sphere(radius=0.2, center=(0.2, -0.4, 0.4))),
        lambda pl: setattr(pl.decals.subplot.actor, "position", (0.1, 0.2, 0.1)),
    ],
)
def test_frames_drawn_in_part_are_those_drawn_whole(
    plotter: Factory, change: Callable[[Plotter], None]
) -> None:
    """In two subplots of one window, each with a document of its own, seen and lit in VTK's ways."""
    pl = plotter(shape=(1, 2), window_size=(240, 120))
    rng, documents = np.random.default_rng(1), []
    for column in range(2):
        pl.subplot(0, column)
        pl.decals.add_scene(both(), camera=True)
        pl.decals.subplot.scene = document = Edited()
        change(pl)
        documents.append(document)
    subplots = pl.decals.subplots
    shot(pl)
    for step in range(4):
        editor = documents[step % 2].decals
        number = int(rng.choice(editor.numbers))
        editor.change(number, positions=editor[number].positions + np.float32(0.1), tints=[(1.0, 0.3, 0.2)])
        seen = shot(pl)
        assert subplots[step % 2].drawn_fraction < 0.6
        for subplot in subplots:
            subplot.renderer._targets.forget()
        np.testing.assert_array_equal(seen, shot(pl))
        assert [subplot.drawn_fraction for subplot in subplots] == [1.0, 1.0]


class Edited:
    """A scene whose decals are edited."""

    def __init__(self) -> None:
        scene = both()
        self.camera, self.images, self.objects = scene.camera, scene.images, scene.objects
        self.decals = DecalEditor(scene.decals)


def test_a_window_of_another_kind_is_refused(plotter: Factory, monkeypatch: pytest.MonkeyPatch) -> None:
    def none() -> None:
        raise RuntimeError("Cannot detect window with OpenGL support")

    pl = plotter()
    pl.add_mesh(pv.Sphere())
    shot(pl)
    monkeypatch.setattr("decals.vtk.frame._idle", {})
    monkeypatch.setattr("decals.vtk.frame.DefaultLoader", none)
    pl.decals.subplot.scene = both()
    with pytest.raises(NoGraphics, match=r"EGL, GLX, WGL or macOS, got a vtk\w+Window"):
        pl.decals.subplot.at(80, 60)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[("samples", wrong) for wrong in (0, 1.5, "2", True, 10**9, None)],
        *[("draw_scale", wrong) for wrong in (0.0, 1.5, "x", None, float("nan"))],
        ("contact", 7),
        ("mapping", "chords"),
        ("scene", 5),
        ("scene", "knot"),
    ],
)
def test_what_a_stage_cannot_be_set_to_is_said_at_once(plotter: Factory, name: str, value: object) -> None:
    subplot = plotter().decals.subplot
    before = getattr(subplot, name)
    with pytest.raises(InvalidScene, match=f"{name}( must be|: expected).* got {value!r}"):
        setattr(subplot, name, value)
    assert getattr(subplot, name) == before


@pytest.mark.ordinary_cases("place0", "place4")
@pytest.mark.parametrize("place", [(float("nan"), 0), (0, float("inf")), ("x", 0), (0, None), ([1], 2)])
def test_a_place_that_is_none_is_refused(pl: Plotter, place: tuple[float, float]) -> None:
    shot(pl)
    with pytest.raises(InvalidPoints, match=r"[xy]: expected a finite number"):
        pl.decals.subplot.at(*place)


def test_places_within_a_pixel_are_that_pixel_and_far_ones_none(pl: Plotter) -> None:
    shot(pl)
    subplot = pl.decals.subplot
    whole, part = subplot.at(80, 60), subplot.at(80.9, 60.2)
    assert whole is not None
    assert part is not None
    np.testing.assert_array_equal(whole.position, part.position)
    assert subplot.at(1e300, -1e300) is None
    assert subplot.at(-0.1, 60) is None


def test_more_samples_than_targets_can_have_are_refused(pl: Plotter) -> None:
    shot(pl)
    subplot = pl.decals.subplot
    with subplot.current(), pytest.raises(InvalidScene, match="take fewer a pixel"):
        subplot.renderer.draw(both(), RenderOptions(size=(160, 120), samples=1000))
