"""What users type: objects, decals and images of a plotter, and what they get back."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import PIL.Image
import pytest
import pyvista as pv

from blobtree import Point
from decals import NO_IMAGE, DecalImage, Decals, MeshObject, TreeObject
from decals.errors import InvalidDecals, InvalidImage, InvalidScene, NoGraphics
from decals.index import DecalEditor
from decals.vtk import DecalsComponent
from tests.decals.shapes import View
from tests.decals.vtk.conftest import Factory, Plotter
from tests.decals.vtk.scenes import both, shot

TREE = Point((0, 0, 0), radius=1.0)


def decals_at(*images: int) -> Decals:
    count = len(images)
    along = np.linspace(-0.5, 0.5, count)
    return Decals(
        positions=np.column_stack([along, np.zeros(count), np.ones(count)]),
        normals=[[0, 0, 1]] * count,
        tangents=[[1, 0, 0]] * count,
        radii=np.full(count, 0.2),
        images=list(images),
    )


def test_objects_get_names_of_their_own(plotter: Factory) -> None:
    pl = plotter()
    first = pl.decals.add_implicit(TREE)
    second = pl.decals.add_mesh(pv.Cube(), color=(1, 0, 0))
    third = pl.decals.add_implicit(TREE.translate((3, 0, 0)), name="moved")
    assert isinstance(first, TreeObject)
    assert isinstance(second, MeshObject)
    assert pl.decals.scene.objects == (first, second, third)
    assert len({thing.name for thing in pl.decals.scene.objects}) == 3
    assert second.color == (1.0, 0.0, 0.0)
    with pytest.raises(InvalidScene, match="'moved' twice"):
        pl.decals.add_implicit(TREE, name="moved")
    assert len(pl.decals.scene.objects) == 3


def test_a_mesh_is_any_dataset_with_a_surface(plotter: Factory) -> None:
    pl = plotter()
    quads = pl.decals.add_mesh(pv.Cube())
    assert len(quads.faces) == 12
    solid = pv.ImageData(dimensions=(3, 3, 3)).cast_to_unstructured_grid()
    assert len(pl.decals.add_mesh(solid).faces) == 48
    own = MeshObject("own", quads.vertices, quads.faces)
    assert pl.decals.add_mesh(own) is own


def test_decals_are_added_to_those_that_are_there(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add(decals_at(0, 1, NO_IMAGE), images=["scale", "rock"])
    together = pl.decals.add(decals_at(0), images=[np.full((4, 4, 4), 9, np.uint8)])
    assert together.images.tolist() == [0, 1, NO_IMAGE, 2]
    again = pl.decals.add(decals_at(1))  # without images of their own they count those of before
    assert again.images.tolist() == [0, 1, NO_IMAGE, 2, 1]
    assert [image.source for image in pl.decals.scene.images[:2]] == ["scale", "rock"]
    known = DecalImage.load("tile")
    assert pl.decals.add(decals_at(0), images=[known]).images.tolist()[-1] == 3
    assert pl.decals.scene.images[3] is known


def test_bad_input_changes_nothing(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add(decals_at(0), images=["scale"])
    before = pl.decals.scene
    with pytest.raises(InvalidScene, match="shows image 7"):
        pl.decals.add(decals_at(7))
    with pytest.raises(InvalidImage):
        pl.decals.add(decals_at(0), images=["nowhere/at all.png"])
    with pytest.raises(InvalidImage, match=r"image 0: expected an image of shape"):
        pl.decals.add(decals_at(0), images=[np.zeros((4, 4, 7), np.uint8)])
    with pytest.raises(InvalidDecals):
        pl.decals.add(decals_at(0).replace(radii=[-1.0]))
    assert pl.decals.scene is before


def test_what_changes_in_place_is_not_added_to(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.scene = View(both().objects, both().camera)
    with pytest.raises(InvalidScene, match="the subplot shows a View"):
        pl.decals.add_implicit(TREE)


def test_a_scene_leaves_the_camera_of_the_plotter_alone(plotter: Factory) -> None:
    view = [(5.0, 5.0, 5.0), (0.1, 0.0, 0.0), (0.0, 0.0, 1.0)]
    pl, fresh, stock = plotter(), plotter(), plotter()
    pl.camera_position = view
    pl.decals.add_scene(both())
    np.testing.assert_allclose(tuple(pl.camera_position), np.array(view))
    shot(pl)
    np.testing.assert_allclose(tuple(pl.camera_position), np.array(view))
    fresh.decals.add_scene(both())
    stock.add_mesh(pv.Sphere())
    fresh.show(auto_close=False)
    stock.show(auto_close=False)
    assert fresh.camera.up == stock.camera.up == (0.0, 0.0, 1.0)
    np.testing.assert_allclose(fresh.camera.direction, stock.camera.direction, atol=1e-6)


def test_the_camera_of_a_scene_is_the_plotters_on_request(plotter: Factory) -> None:
    pl = plotter()
    pl.enable_parallel_projection()
    pl.decals.add_scene(both(), camera=True)
    camera = both().camera
    np.testing.assert_allclose(pl.camera.position, camera.position)
    np.testing.assert_allclose(pl.camera.focal_point, camera.target)
    assert pl.camera.view_angle == pytest.approx(camera.fov)
    assert not pl.camera.parallel_projection
    other = plotter()
    other.camera_position = [(5, 5, 5), (0, 0, 0), (0, 0, 1)]
    other.decals.add_scene(both(), camera=False)
    np.testing.assert_allclose(other.camera.position, (5, 5, 5))


def test_bounds_and_camera_know_of_our_objects(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add_implicit(TREE)
    np.testing.assert_allclose(pl.bounds, (-1, 1, -1, 1, -1, 1), atol=0.05)
    seen = shot(pl)
    covered = (seen != seen[0, 0]).any(axis=-1)
    assert 0.15 < covered.mean() < 0.8
    assert not covered[[0, -1]].any()


def test_a_scaled_plotter_scales_us(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add_implicit(TREE)
    pl.view_xz()
    shot(pl)
    pl.set_scale(zscale=0.5, reset_camera=False)
    seen = shot(pl)
    covered = (seen != seen[0, 0]).any(axis=-1)
    high, wide = np.ptp(np.flatnonzero(covered.any(axis=1))), np.ptp(np.flatnonzero(covered.any(axis=0)))
    assert high == pytest.approx(0.5 * wide, abs=3)


WIPES = ["clear", "clear_actors"]


@pytest.mark.parametrize("wipe", WIPES)
def test_a_plotter_that_was_cleared_shows_what_was_added_since_alone(pl: Plotter, wipe: str) -> None:
    shot(pl)
    getattr(pl, wipe)()
    empty = shot(pl)
    assert (empty == empty[0, 0]).all()
    assert pl.decals.scene.objects == ()
    assert pl.decals.subplot.scene is None
    thing = pl.decals.add_mesh(pv.Cube(), name="blob")  # a name that was taken before
    assert pl.decals.scene.objects == (thing,)
    assert len(pl.decals.scene.decals) == 0
    assert (shot(pl) != empty).any()


@pytest.mark.slow_cases("clear_actors")
@pytest.mark.parametrize("wipe", WIPES)
def test_a_cleared_plotter_takes_the_same_scene_again(pl: Plotter, wipe: str) -> None:
    first = shot(pl)
    getattr(pl, wipe)()
    assert (shot(pl) != first).any()
    pl.decals.add_scene(both(), camera=True)
    np.testing.assert_array_equal(shot(pl), first)
    pl.decals.clear()
    assert (shot(pl) != first).any()
    pl.decals.add_scene(both(), camera=True)
    np.testing.assert_array_equal(shot(pl), first)


@pytest.mark.parametrize("wipe", WIPES)
def test_clearing_takes_decals_off_actors_too(plotter: Factory, wipe: str) -> None:
    pl = plotter()
    actor = pl.add_mesh(pv.Sphere(), color="tan")
    bare = shot(pl)
    pl.decals.add(decals_at(0).replace(positions=[[0, 0, 0.5]]), images=["rivet"])
    pl.decals.apply(actor)
    pl.view_xy()
    pl.decals.subplot.samples = 1
    assert (shot(pl) != bare).any()
    getattr(pl, wipe)()
    if wipe == "clear":
        pl.enable_lightkit()
    pl.add_actor(actor)
    without = shot(pl)
    pl.decals.add(decals_at(0).replace(positions=[[0, 0, 0.5]]), images=["rivet"])
    np.testing.assert_array_equal(shot(pl), without)
    pl.decals.apply(actor)
    assert (shot(pl) != without).any()


def test_what_changes_in_place_does_not_come_back_by_itself(plotter: Factory) -> None:
    document = SimpleNamespace(
        objects=both().objects, decals=DecalEditor(both().decals), images=both().images
    )
    pl = plotter()
    pl.decals.scene = document
    shot(pl)
    pl.clear_actors()
    document.objects = both().objects[:1]
    empty = shot(pl)
    assert (empty == empty[0, 0]).all()
    assert pl.decals.subplot.scene is None


def test_one_cleared_subplot_leaves_the_others(plotter: Factory) -> None:
    pl = plotter(shape=(1, 2))
    for column in range(2):
        pl.subplot(0, column)
        pl.decals.add_implicit(TREE)
    pl.renderer.clear_actors()
    assert [subplot.scene is None for subplot in pl.decals.subplots] == [False, True]


def test_decals_may_be_applied_before_there_are_any(plotter: Factory) -> None:
    pl = plotter()
    actor = pl.add_mesh(pv.Sphere(), color="tan")
    pl.decals.apply(actor)
    pl.view_xy()
    bare = shot(pl)
    pl.decals.add(decals_at(0).replace(positions=[[0, 0, 0.5]]), images=["rivet"])
    assert (shot(pl) != bare).any()
    assert tuple(pl.bounds) == tuple(actor.bounds)


def test_an_actor_of_the_name_that_we_had_is_the_users(plotter: Factory) -> None:
    pl = plotter()
    pl.add_mesh(pv.Cube(), name="decals")
    pl.decals.add_implicit(TREE)
    assert "decals" in pl.renderer.actors
    assert len(pl.decals.scene.objects) == 1


def test_a_closed_plotter_says_so(pl: Plotter) -> None:
    shot(pl)
    component, subplot = pl.decals, pl.decals.subplot
    pl.close()
    for ask in (
        lambda: component.scene,
        lambda: component.add_implicit(TREE),
        component.clear,
        subplot.viewport,
    ):
        with pytest.raises(NoGraphics, match="was closed"):
            ask()


def test_colours_have_names_and_images_paths(plotter: Factory, tmp_path: Path) -> None:
    pl = plotter()
    assert pl.decals.add_mesh(pv.Cube(), color="red").color == (1.0, 0.0, 0.0)
    PIL.Image.new("RGB", (4, 4), "blue").save(tmp_path / "blue.png")
    pl.decals.add(decals_at(0), images=[tmp_path / "blue.png"])
    assert pl.decals.scene.images[0].pixels[0, 0].tolist() == [0, 0, 255, 255]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda it: it.add_mesh(pv.Cube(), color="reddish"), "colour: expected .* a name, got 'reddish'"),
        (lambda it: it.add_mesh("cube.ply"), "found no file 'cube.ply'"),
        (lambda it: it.add([decals_at(0)], images=["scale"]), "expected Decals to add, got list"),
        (lambda it: it.add(decals_at(0), images=[None]), "image 0: expected an image of shape .*, got None"),
        (lambda it: it.add(decals_at(0), images=5), "expected an image or a list of images, got 5"),
        (lambda it: it.add_implicit(TREE, name=5), "name: expected a str, got 5"),
        (lambda it: it.add_implicit("knot"), "found no file 'knot'"),
        (lambda it: it.add_mesh(pv.Cube(), name=["a"]), "name: expected a str"),
        (lambda it: it.add_mesh(pv.Cube(), color=10**400), "colour: expected red, green, blue"),
        (lambda it: it.add_mesh(pv.Cube(), color={}), "colour: expected red, green, blue"),
        (lambda it: it.add_scene(None), "expected a model, got None"),
        (lambda it: setattr(it, "scene", [both()]), "scene: expected a Scene"),
        (lambda it: it.apply(None), "expected an actor to lay decals on, got NoneType"),
        (lambda it: it.apply(pv.Cube()), "expected an actor to lay decals on, got PolyData"),
    ],
)
def test_what_does_not_fit_is_refused_in_plain_words(
    plotter: Factory, wrong: Callable[[DecalsComponent], object], message: str
) -> None:
    pl = plotter()
    pl.decals.add_implicit(TREE)
    before = pl.decals.scene
    with pytest.raises((InvalidScene, InvalidImage), match=message):
        wrong(pl.decals)
    assert pl.decals.scene is before
