"""What users have is accepted by all functions alike: models and images of every kind."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
import trimesh
from numpy.typing import NDArray
from PIL import Image

import blobtree
import decals
from blobtree import Point
from decals import scattering
from decals.errors import InvalidImage, InvalidInput, InvalidScene
from decals.images import generate_image, image_pixels
from decals.surfaces import MeshSurface, as_surface

SIZE = (48, 36)
BALL = Point((0, 0, 0), radius=1.0)
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])


def models(folder: Path) -> dict[str, Any]:
    """One model of each kind, and files of two."""
    pv.Plane().triangulate().save(folder / "plane.ply")
    blobtree.save(BALL, folder / "ball.json")
    return {
        "tree": BALL,
        "pyvista": pv.Plane(),
        "trimesh": trimesh.Trimesh(*SQUARE),
        "trimesh scene": trimesh.Scene([trimesh.Trimesh(*SQUARE), trimesh.Trimesh(SQUARE[0] + 2, SQUARE[1])]),
        "arrays": SQUARE,
        "mesh file": folder / "plane.ply",
        "tree file": str(folder / "ball.json"),
        "object": decals.MeshObject("square", *SQUARE),
    }


KINDS = ("tree", "pyvista", "trimesh", "trimesh scene", "arrays", "mesh file", "tree file", "object")


@pytest.mark.parametrize("kind", KINDS)
def test_a_model_of_each_kind_is_accepted(kind: str, tmp_path: Path) -> None:
    model = models(tmp_path)[kind]
    assert len(decals.cover(model, count=1, images="eye").decals) == 1
    assert len(decals.scatter(model, count=8)) == 8
    decals.bake(model, tmp_path / "model.glb", size=16, vertex_colors=True, resolution=8)
    assert (tmp_path / "model.glb").stat().st_size > 500
    picture = np.asarray(decals.render(model, size=SIZE, samples=1))
    assert len(np.unique(picture.reshape(-1, 4), axis=0)) > 10
    plotter = pv.Plotter(off_screen=True, window_size=list(SIZE))
    shown = plotter.decals.add_scene(model)
    assert len(shown.objects) == 1
    plotter.close()
    scene = decals.Scene(objects=[model], camera=decals.Camera((0, 0, 5)))
    assert scene.objects[0].surface.area > 0.5


def test_several_models_become_one_scene() -> None:
    together = decals.scenes.cover.as_scene([BALL, pv.Plane(), SQUARE])
    assert len({item.name for item in together.objects}) == 3
    assert len(decals.cover([BALL, pv.Plane()], count=2).objects) == 2


@pytest.mark.parametrize("wrong", [None, 5, [], {}, ["x.ply"], pv.Sphere])
def test_what_is_no_model_is_refused_alike(wrong: Any, tmp_path: Path) -> None:
    for call in (decals.render, decals.show, decals.edit):
        with pytest.raises(InvalidInput, match="expected"):
            call(wrong)
    with pytest.raises(InvalidInput, match="expected"):
        decals.bake(wrong, tmp_path / "a.glb")


def pictures(folder: Path) -> dict[str, tuple[Any, NDArray[Any]]]:
    """One image of each kind, and its pixels."""
    rgb = np.random.default_rng(0).integers(0, 256, (4, 6, 3), np.uint8)
    grey = rgb[..., 0]
    rgba = np.dstack([rgb, grey])
    opaque = np.dstack([rgb, np.full((4, 6), 255, np.uint8)])
    greys = np.dstack([grey, grey, grey, np.full((4, 6), 255, np.uint8)])
    Image.fromarray(rgba).save(folder / "picture.png")
    return {
        "name": ("eye", generate_image("eye")),
        "path": (folder / "picture.png", rgba),
        "text path": (str(folder / "picture.png"), rgba),
        "PIL": (Image.fromarray(rgb), opaque),
        "PIL grey": (Image.fromarray(grey), greys),
        "rgba": (rgba, rgba),
        "rgb": (rgb, opaque),
        "grey": (grey, greys),
        "grey plane": (grey[..., None], greys),
        "floats": (rgba / np.float32(255), rgba),
        "float greys": (grey / 255.0, greys),
        "16 bit": (grey.astype(np.uint16) * 257, greys.astype(np.uint16) * 257),
        "texture": (pv.Texture(rgb), opaque),  # type: ignore[no-untyped-call]
        "decal image": (decals.DecalImage("mine", rgba), rgba),
    }


@pytest.mark.parametrize(
    "kind",
    ["name", "path", "text path", "PIL", "PIL grey", "rgba", "rgb", "grey", "grey plane", "floats",
     "float greys", "16 bit", "texture", "decal image"],
)  # fmt: skip
def test_an_image_of_each_kind_is_accepted(kind: str, tmp_path: Path) -> None:
    image, pixels = pictures(tmp_path)[kind]
    np.testing.assert_array_equal(image_pixels(image), pixels)
    for images in (image, [image], (image,)) if kind in ("name", "rgb") else (image,):
        scene = decals.cover(pv.Plane(), count=1, images=images)
        assert len(scene.images) == 1
        np.testing.assert_array_equal(scene.images[0].pixels, pixels)
    np.testing.assert_array_equal(scene.replace(images=image).images[0].pixels, pixels)
    flat = decals.Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], [1])
    samples = decals.evaluate(flat, [[0.1, 0.1, 0]], [[0, 0, 1]], images=image)
    expected = decals.evaluate(flat, [[0.1, 0.1, 0]], [[0, 0, 1]], images=[pixels])
    assert samples.color is not None
    np.testing.assert_array_equal(samples.color, expected.color)


def test_a_stack_of_arrays_is_several_images() -> None:
    scene = decals.cover(pv.Plane(), count=1, images=np.zeros((2, 4, 4, 3), np.uint8))
    assert [image.source for image in scene.images] == ["image 0", "image 1"]


@pytest.mark.parametrize(
    "wrong",
    [
        pytest.param(None, id="none"),
        pytest.param(5, id="number"),
        pytest.param(b"x", id="bytes"),
        pytest.param({}, id="table"),
        pytest.param("nowhere.png", id="no file"),
        pytest.param(np.zeros((2, 2, 5), np.uint8), id="five channels"),
        pytest.param(np.zeros((0, 2), np.uint8), id="empty"),
        pytest.param(np.full((2, 2), 2.0), id="bright"),
        pytest.param(np.full((2, 2), np.nan), id="nan"),
        pytest.param(np.full((2, 2), -3), id="negative"),
        pytest.param(np.zeros((1, 17000), np.uint8), id="long"),
        pytest.param(Image.new("L", (17000, 1)), id="long picture"),
    ],
)
def test_what_is_no_image_is_refused(wrong: Any) -> None:
    with pytest.raises(InvalidImage, match="image"):
        decals.cover(pv.Plane(), count=3, images=wrong)


def test_decals_without_images_show_the_default_image() -> None:
    plotter = pv.Plotter(off_screen=True, window_size=list(SIZE))
    plotter.decals.add_mesh(pv.Plane(), color="tomato")
    spots = decals.scatter(pv.Plane(), count=5)
    plotter.decals.add(spots)
    plotter.decals.add(spots)
    assert [image.source for image in plotter.decals.scene.images] == ["scale"]
    assert len(plotter.decals.scene.decals) == 10
    plotter.decals.clear()
    plotter.decals.add(spots.replace(images=[decals.NO_IMAGE] * 5, tints="red"))
    assert plotter.decals.scene.images == ()
    plotter.close()


def test_the_component_takes_files_of_trees(tmp_path: Path) -> None:
    blobtree.save(BALL, tmp_path / "ball.json")
    plotter = pv.Plotter(off_screen=True, window_size=list(SIZE))
    assert plotter.decals.add_implicit(tmp_path / "ball.json").tree == BALL
    with pytest.raises(InvalidScene, match="expected a BlobTree, got a mesh; `add_mesh` adds it"):
        plotter.decals.add_implicit(pv.Plane())
    plotter.close()


def test_a_scene_has_the_functions_as_methods(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = decals.cover(pv.Plane(), count=5)
    scene.save(tmp_path / "plane.json")
    assert len(decals.load_scene(tmp_path / "plane.json").decals) == 5
    np.testing.assert_array_equal(
        np.asarray(scene.render(size=SIZE, samples=1)),
        np.asarray(decals.render(scene, size=SIZE, samples=1)),
    )
    calls: list[tuple[Any, ...]] = []
    for name in ("show", "edit"):
        monkeypatch.setattr(
            decals, name, lambda *args, name=name, **options: calls.append((name, *args, options))
        )
        getattr(scene, name)(size=SIZE)
    assert calls == [("show", scene, {"size": SIZE}), ("edit", scene, {"size": SIZE})]


def test_a_scene_file_holds_images_that_have_no_file(tmp_path: Path) -> None:
    """Also after the second save, and beside images that have a name or a path."""
    images = [pictures(tmp_path)[kind][0] for kind in ("rgb", "name", "PIL", "path")]
    first = decals.cover(pv.Plane(), count=4, images=images)
    first.save(tmp_path / "first.json")
    second = decals.load_scene(tmp_path / "first.json")
    second.save(tmp_path / "second.json")
    third = decals.load_scene(tmp_path / "second.json")
    assert [image.source for image in third.images[:3]] == ["image 0", "eye", "image 2"]
    assert '"eye"' in (tmp_path / "second.json").read_text()
    assert '"picture.png"' in (tmp_path / "second.json").read_text()
    for one, other in zip(first.images, third.images, strict=True):
        np.testing.assert_array_equal(one.pixels, other.pixels)
    text = (tmp_path / "first.json").read_text()
    for damage in ("*", "AAAA"):
        start = text.index("base64,") + len("base64,")
        (tmp_path / "bad.json").write_text(text[:start] + damage + text[start + 40 :])
        with pytest.raises(InvalidImage, match="an image within the file"):
            decals.load_scene(tmp_path / "bad.json")


def test_the_advice_about_pixels_without_alpha_works() -> None:
    pixels = np.full((4, 4, 3), 9, np.uint8)
    with pytest.raises(InvalidScene, match=r"got uint8\[4, 4, 3\]; use decals\.DecalImage\.load"):
        decals.DecalImage("grey", pixels)
    assert decals.DecalImage.load(pixels).pixels.tolist() == [[[9, 9, 9, 255]] * 4] * 4


@pytest.mark.parametrize("kind", ["pyvista", "trimesh", "arrays", "mesh file", "object"])
def test_values_of_vertices_go_with_a_mesh_of_each_kind(kind: str, tmp_path: Path) -> None:
    mesh = models(tmp_path)[kind]
    surface = as_surface(mesh)
    assert isinstance(surface, MeshSurface)
    points, _ = surface.sample(200, seed=0)
    across = surface.vertices[:, 0] - surface.vertices[:, 0].min()
    low = surface.vertices[:, 0].min()
    density = scattering.vertex_density(mesh, 1.0 + across)
    np.testing.assert_allclose(density(points), 1.0 + points[:, 0] - low, atol=1e-5)
    half = scattering.region_mask(mesh, across > 0.5)
    np.testing.assert_array_equal(half(points), scattering.region_mask(surface, across > 0.5)(points))
    assert 0 < half(points).sum() < len(points)
    image = scattering.TextureCoordinates(mesh, surface.vertices[:, :2])
    np.testing.assert_allclose(image(points), points[:, :2], atol=1e-5)
    assert scattering.Creases(mesh).length == pytest.approx(4.0)
    for call in (scattering.vertex_density, scattering.region_mask):
        with pytest.raises(
            InvalidInput, match=r"expected a mesh, got .*; for a tree, give a function of points"
        ):
            call(BALL, [1.0])


def test_two_points_as_a_tuple_are_points() -> None:
    density = scattering.vertex_density(([0, 0, 0], [1, 0, 0]), [1.0, 4.0])
    assert density(np.array([[0.5, 0, 0]], np.float32)) == pytest.approx(2.5)


def test_a_model_without_vertices_has_no_remesh() -> None:
    with pytest.raises(InvalidInput, match=r"surface: expected a mesh, got .*; polygonize a tree first"):
        scattering.remeshed_points(BALL, 50)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: decals.cover(Point((0, 0, 0), radius=1, weight=0.499), count=5), "tree with a surface"),
        (lambda: decals.cover((SQUARE[0], 1.0 * SQUARE[1]), count=5), r"whole numbers, .*\.astype\(int\)"),
        (lambda: MeshSurface(SQUARE[0], 1.0 * SQUARE[1]), r"whole numbers, .*\.astype\(int\)"),
        (lambda: decals.cover("/", count=5), "expected a model, '/' is a folder"),
        (lambda: decals.cover(BALL, count=1, images="/"), "expected an image, '/' is a folder"),
        (lambda: decals.render(BALL, size=SIZE).save(""), "path of a file, got an empty text"),
        (lambda: decals.load_scene(""), "path: expected the path of a file, got an empty text"),
        (lambda: decals.cover(BALL, count=1).save(""), "path of a file, got an empty text"),
    ],
)  # fmt: skip
def test_messages_say_what_is_wrong(call: Any, says: str) -> None:
    with pytest.raises(InvalidInput, match=says):
        call()


def test_an_unknown_option_of_a_page_names_the_function_that_was_called(tmp_path: Path) -> None:
    scene = decals.cover(BALL, count=1)
    with pytest.raises(TypeError, match=r"^save_html\(\) got an unexpected keyword argument 'bogus'$"):
        scene.save_html(tmp_path / "a.html", bogus=1)
    assert not list(tmp_path.iterdir())
