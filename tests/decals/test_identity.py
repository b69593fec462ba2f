"""Scenes, objects, decals, images and meshes as values: equal contents, whatever objects hold them."""

import copy
import pickle
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

import decals
from blobtree import Mesh, Point, Segment, content_hash, polygonize
from blobtree.errors import InvalidInput
from blobtree.identity import Value
from decals import Camera, DecalImage, DecalMaterial, Decals, MeshObject, Scene, TreeObject
from decals.rendering import Background, Drawing, Environment, Light, Lighting
from decals.rendering.environment import Panorama
from decals.rendering.prefiltering import prefiltered
from decals.scenes.files import from_json, to_json
from decals.scenes.objects import flagged
from decals.surfaces import BaseColor, BaseTexture, MeshSurface
from tests.blobtree.trees import random_trees, trees
from tests.programs import output_of

TREE = Point((0, 0, 0), radius=1.0) + Segment((0, 0, 0), (2, 0, 0), radius=0.25)
CORNERS, FACES = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
PIXELS = np.arange(4 * 6 * 4, dtype=np.uint8).reshape(4, 6, 4)


def random_decals(seed: int, count: int, images: int = 2) -> Decals:
    rng = np.random.default_rng(seed)
    return Decals(
        rng.standard_normal((count, 3)),
        rng.standard_normal((count, 3)),
        rng.standard_normal((count, 3)),
        rng.uniform(0.01, 1.0, count),
        images=rng.integers(-1, images, count),
        spill=rng.random(count) < 0.5,
        interactions=rng.integers(0, 3, count),
        layers=rng.integers(-3, 3, count),
        tints=rng.random((count, 3)),
        opacities=rng.random(count),
        receivers=rng.choice(["", "ball", "corner, ball"], count).tolist(),
        fade_angles=rng.choice([0.0, 30.0, 80.0], count),
        fade_depths=rng.choice([0.0, 0.5], count),
        single_sheets=rng.random(count) < 0.5,
    )


def test_plain_decals_keep_the_hash_of_earlier_versions() -> None:
    plain = Decals([[0, 0, 1.0]], [[0, 0, 1.0]], [[1.0, 0, 0]], [0.5])
    assert plain.content_hash == "69072d0a73a43570a474eae7068bc6865da990b9"
    assert plain.replace(single_sheets=True).content_hash != plain.content_hash


def painted() -> BaseColor:
    texture = BaseTexture(PIXELS, ("repeat", "mirror"))
    rows = np.linspace(0, 1, 8).reshape(4, 2)
    return BaseColor(np.linspace(0, 1, 12).reshape(4, 3), rows, (texture,), [0, 0, -1, 0])


def scene(seed: int = 0) -> Scene:
    sky = np.random.default_rng(seed).random((4, 8, 4)).astype(np.float32)
    return Scene(
        objects=[
            TreeObject("ball", TREE, labels=("smooth",), hidden=((1,),), names={(0,): "head"}),
            MeshObject("corner", CORNERS, FACES, painted(), crease_angle=20.0, named_only=True),
        ],
        camera=Camera.fitting([[-1, 0, 0], [2, 0, 0]], aspect=None),
        decals=random_decals(seed, 20),
        images=[
            "tile#b0413e",
            DecalMaterial("steel", PIXELS, roughness=0.25, height=np.eye(4, 6), relief=0.1),
        ],
        drawing=Drawing(
            samples=3,
            contact="min",
            background=Background("white", "black"),
            lights=Lighting((Light("red", (0, 0, -1)),)),
            environment=Environment(sky, rotation=20.0),
        ),
        hidden_decals=random_decals(seed + 1, 3),
        locked_layers=[2],
        layer_names={1: "rust"},
    )


VALUES: dict[str, Callable[[], Any]] = {
    "scene": scene,
    "tree object": lambda: scene().objects[0],
    "mesh object": lambda: scene().objects[1],
    "decals": lambda: random_decals(3, 50),
    "no decals": Decals.empty,
    "image": lambda: DecalImage("a", PIXELS),
    "deep image": lambda: DecalImage("a", PIXELS.astype(np.uint16)),
    "material": lambda: scene().images[1],
    "base color": painted,
    "texture": lambda: BaseTexture(PIXELS),
    "surface": lambda: MeshSurface(CORNERS, FACES),
    "mesh": lambda: polygonize(TREE, resolution=12),
    "drawing": lambda: scene().drawing,
    "camera": lambda: scene().camera,
    "law": lambda: decals.define_contact("gaussian", combine="min"),
}


@pytest.mark.parametrize("name", VALUES)
def test_equal_contents_are_equal(name: str) -> None:
    first, second = VALUES[name](), VALUES[name]()
    assert first == second
    assert hash(first) == hash(second)
    assert content_hash(first) == content_hash(second)
    for again in (pickle.loads(pickle.dumps(first)), copy.copy(first), copy.deepcopy(first)):
        assert again == first
        assert hash(again) == hash(first)
        assert content_hash(again) == content_hash(first)


def test_values_of_different_kinds_differ() -> None:
    hashes = [content_hash(make()) for make in VALUES.values()]
    assert len(set(hashes)) == len(hashes)


@pytest.mark.parametrize("seed", range(3))
def test_a_scene_is_equal_after_a_file(seed: int, tmp_path: Path) -> None:
    first = scene(seed)
    decals.save_scene(first, tmp_path / "scene.json")
    again = decals.load_scene(tmp_path / "scene.json")
    for part in fields(Scene):
        if part.compare:
            assert getattr(again, part.name) == getattr(first, part.name), part.name
    assert again == first
    assert hash(again) == hash(first)
    assert content_hash(again) == content_hash(first)


@given(trees(), st.integers(0, 2**30), st.integers(0, 12))
@settings(max_examples=25)
def test_any_tree_and_decals_are_equal_after_a_file(tree: Any, seed: int, count: int) -> None:
    first = Scene(
        objects=[TreeObject("ball", tree), TreeObject("corner", TREE, origin=(0, 0, 0))],
        camera=Camera((0, 0, 5)),
        decals=random_decals(seed, count),
        images=["scale", "tile"],
    )
    again = from_json(to_json(first, folder=Path()), folder=Path())
    assert again == first
    assert again.content_hash == pickle.loads(pickle.dumps(first)).content_hash == first.content_hash


@pytest.mark.parametrize("turned", [False, True])
def test_meshes_of_files_are_equal_after_a_file(turned: bool, tmp_path: Path) -> None:
    ball = pv.Sphere(theta_resolution=8, phi_resolution=8)
    (ball.flip_faces() if turned else ball).save(tmp_path / "ball.ply")
    first = decals.cover(tmp_path / "ball.ply", count=5)
    decals.save_scene(first, tmp_path / "scene.json")
    assert decals.load_scene(tmp_path / "scene.json") == first
    item: Any = first.objects[0]
    inline = first.replace(objects=[replace(item, source=None)])
    assert inline == first
    decals.save_scene(inline, tmp_path / "inline.json")
    assert decals.load_scene(tmp_path / "inline.json") == first


def test_paths_recipes_and_names_of_images_do_not_count(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        Image.fromarray(PIXELS).save(tmp_path / name)
    assert (
        DecalImage.load(tmp_path / "a.png") == DecalImage.load(tmp_path / "b.png") == DecalImage("c", PIXELS)
    )
    covered = decals.cover(TREE, count=12, images=["scale", "tile#b0413e"], seed=4)
    assert covered.recipe is not None
    other = replace(covered, recipe=None)
    assert other == covered
    assert other.content_hash == covered.content_hash
    assert replace(painted(), source="somewhere.glb") == painted()


def changed_decals(start: Decals, name: str) -> Decals:
    array = getattr(start, name).copy()
    row = array[-1]
    if name == "receivers":
        array[-1] = "ball" if row != "ball" else ""
    elif array.dtype == bool:
        array[-1] = not row
    elif name == "interactions":
        array[-1] = (row + 1) % 3
    elif name == "images":
        array[-1] = 1 if row < 1 else 0
    elif name in ("normals", "tangents"):
        array[-1] = -row
    elif name in ("tints", "opacities"):
        array[-1] = np.where(row > 0.5, row / 2, 1.0 - row / 2)
    elif name == "fade_angles":
        array[-1] = 40.0
    else:
        array[-1] = row + 1
    return start.replace(**{name: array})


@pytest.mark.parametrize("name", [field.name for field in fields(Decals)])
def test_one_changed_value_of_decals_counts(name: str) -> None:
    start = random_decals(1, 6)
    other = changed_decals(start, name)
    assert other != start
    assert other.content_hash != start.content_hash
    holder = scene().replace(decals=start)
    assert holder.replace(decals=other) != holder


FIRST = scene()
BALL, CORNER = (cast(Any, item) for item in FIRST.objects)
STEEL, LOOK = cast(Any, FIRST.images[1]), cast(Any, FIRST.drawing)
CHANGES: dict[str, Callable[[], Any]] = {
    "objects": lambda: FIRST.objects[::-1],
    "tree": lambda: [replace(BALL, tree=TREE + Point((0, 0, 0), radius=1e-3)), CORNER],
    "labels": lambda: [replace(BALL, labels=()), CORNER],
    "hidden": lambda: [replace(BALL, hidden=()), CORNER],
    "names": lambda: [replace(BALL, names={}), CORNER],
    "vertices": lambda: [
        BALL,
        replace(CORNER, vertices=np.multiply(CORNERS, 1.0001)),
    ],
    "faces": lambda: [
        BALL,
        replace(CORNER, faces=np.roll(FACES, 1, axis=1)),
    ],
    "color": lambda: [BALL, replace(CORNER, color=(1, 0, 0))],
    "crease_angle": lambda: [BALL, replace(CORNER, crease_angle=21.0)],
    "named_only": lambda: [BALL, replace(CORNER, named_only=False)],
}
PARTS: dict[str, Callable[[], dict[str, Any]]] = {
    "camera": lambda: {"camera": replace(FIRST.camera, fov=31.0)},
    "fit": lambda: {"camera": replace(FIRST.camera, fit=None)},
    "decals": lambda: {"decals": FIRST.decals[1:]},
    "order of decals": lambda: {"decals": FIRST.decals[::-1]},
    "images": lambda: {"images": FIRST.images[::-1]},
    "pixels": lambda: {"images": ["tile#b0413f", STEEL]},
    "relief": lambda: {"images": [FIRST.images[0], replace(STEEL, relief=0.2)]},
    "samples": lambda: {"drawing": replace(LOOK, samples=2)},
    "contact": lambda: {"drawing": replace(LOOK, contact="product")},
    "lights": lambda: {"drawing": replace(LOOK, lights=None)},
    "environment": lambda: {"drawing": replace(LOOK, environment=None)},
    "hidden_decals": lambda: {"hidden_decals": FIRST.hidden_decals[:-1]},
    "locked_layers": lambda: {"locked_layers": [3]},
    "layer_names": lambda: {"layer_names": {1: "dust"}},
}


@pytest.mark.parametrize("change", [*CHANGES, *PARTS])
def test_one_changed_value_of_a_scene_counts(change: str) -> None:
    parts = {"objects": CHANGES[change]()} if change in CHANGES else PARTS[change]()
    other = replace(FIRST, **parts)
    assert other != FIRST
    assert other != FIRST
    assert content_hash(other) != content_hash(FIRST)


@pytest.mark.parametrize("item", FIRST.objects, ids=["tree", "mesh"])
def test_the_origin_of_an_object_counts(item: Any) -> None:
    assert replace(item, origin=(0, 0, 1)) != item


def test_an_object_under_another_name_is_another_value() -> None:
    item = FIRST.objects[1]
    assert content_hash(flagged(item, name="edge")) != content_hash(item)
    assert flagged(item, name="edge") == replace(item, name="edge")


def test_values_compare_with_anything() -> None:
    values: list[Any] = [make() for make in VALUES.values()]
    for value in values:
        assert value != 0
        assert value != "scene"
        assert (value == values) is False
    assert scene().decals != scene().images[0]


@pytest.mark.slow_cases("panorama")
@pytest.mark.parametrize(
    ("make", "limit"),
    [
        (lambda: MeshObject("ball", *surface_arrays(60)), 2.0),
        (lambda: MeshSurface(*surface_arrays(60)), 2.0),
        (lambda: random_decals(0, 5000), 2.0),
        (lambda: DecalImage("noise", np.random.default_rng(0).integers(0, 255, (64, 64, 4), np.uint8)), 2.0),
        (lambda: decals.surfaces.ImplicitSurface(TREE).mesh, 2.0),
        (lambda: seen(Environment(np.ones((64, 128, 4), np.float32))).picture, 2.0),
    ],
    ids=["mesh object", "mesh surface", "decals", "image", "coarse mesh", "panorama"],
)
def test_pickles_are_at_most_twice_the_arrays(make: Callable[[], Any], limit: float) -> None:
    value = make()
    value.content_hash  # noqa: B018  (lazy values stay out)
    size = sum(array.nbytes for array in arrays_of(value))
    assert len(pickle.dumps(value, pickle.HIGHEST_PROTOCOL)) <= limit * size + 2000


def surface_arrays(resolution: int) -> tuple[Any, Any]:
    mesh = polygonize(TREE, resolution=resolution)
    return mesh.vertices, mesh.faces


def seen(environment: Environment) -> Environment:
    prefiltered(environment.picture)
    return environment


def arrays_of(value: Any) -> list[np.ndarray[Any, Any]]:
    """Return the arrays that are the contents of a value."""
    contents = value._contents()
    parts = [contents] if isinstance(contents, np.ndarray) else list(contents.values())
    return [part for part in parts if isinstance(part, np.ndarray)]


@pytest.mark.parametrize("seed", range(3))
def test_surfaces_are_the_same_after_a_pickle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices, faces = surface_arrays(20)
    faces = np.concatenate([faces, faces[:3], [[0, 0, 1]]])[rng.permutation(len(faces) + 4)]
    kinds = [MeshSurface(vertices, faces), decals.surfaces.ImplicitSurface(random_trees(seed, 1)[0]).mesh]
    for first in kinds:
        again = pickle.loads(pickle.dumps(first))
        assert vars(again).keys() >= {name for name in vars(first) if name.startswith("_w")}
        for name in (
            "vertices",
            "faces",
            "sound",
            "_corners",
            "_normals",
            "_cumulative",
            "_welded",
            "_one_sided",
        ):
            assert np.array_equal(getattr(again, name), getattr(first, name)), name
        assert all(map(np.array_equal, again.bounds, first.bounds))
        assert not again.vertices.flags.writeable
        points = rng.standard_normal((20, 3))
        assert all(map(np.array_equal, again.project(points), first.project(points)))
        assert all(map(np.array_equal, again.sample(9, 1), first.sample(9, 1)))


def test_images_do_not_change_with_the_array_that_they_were_made_of() -> None:
    pixels = PIXELS.copy()
    image, material = DecalImage("a", pixels), DecalMaterial("b", pixels, height=np.eye(4, 6))
    before = image.content_hash
    pixels[:] = 0
    assert np.array_equal(image.pixels, PIXELS)
    assert np.array_equal(material.pixels, PIXELS)
    assert DecalImage("a", image.pixels).content_hash == before
    for array in (image.pixels, material.pixels, material.roughness, material.height):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0  # type: ignore[index]


SCRIPT = """
import decals
from tests.decals.test_identity import VALUES, content_hash
print(*(content_hash(make()) for make in VALUES.values()))
"""


@pytest.mark.slow_cases("7-Haswell")
@pytest.mark.parametrize(("seed", "processor"), [("0", "Prescott"), ("7", "Haswell")])
def test_hashes_are_those_of_any_process(seed: str, processor: str) -> None:
    environment = {"PYTHONHASHSEED": seed, "OPENBLAS_CORETYPE": processor}
    printed = output_of(SCRIPT, env={**environment, "PATH": "", "HOME": str(Path.home())}).split()
    assert printed == [content_hash(make()) for make in VALUES.values()]


def test_dask_takes_the_content_hash(tmp_path: Path) -> None:
    tokenize = pytest.importorskip("dask.base", reason="dask is an optional package").tokenize
    for name, make in VALUES.items():
        assert tokenize(make()) == tokenize(make()), name
    assert tokenize(TREE) == tokenize(pickle.loads(pickle.dumps(TREE)))
    decals.save_scene(FIRST, tmp_path / "scene.json")
    assert tokenize(decals.load_scene(tmp_path / "scene.json")) == tokenize(FIRST)
    assert tokenize(FIRST.replace(locked_layers=[5])) != tokenize(FIRST)


def test_values_name_themselves_to_dask() -> None:
    value: Any
    for value in (FIRST, FIRST.decals, FIRST.objects[0], FIRST.images[1], TREE):
        assert value.__dask_tokenize__() == content_hash(value)


def test_all_values_are_tried() -> None:
    def kinds(base: type) -> set[type]:
        below: list[type] = base.__subclasses__()
        return {base}.union(*map(kinds, below))

    tried = {type(make()) for make in VALUES.values()} | {Panorama, Mesh}
    ours = {kind for kind in kinds(Value) if kind.__module__.split(".")[0] in ("blobtree", "decals")}
    untried = {kind.__name__ for kind in ours - tried}
    assert untried == {"Value", "CurvedMesh", "MeshData"}


def test_hashes_of_functions_are_refused() -> None:
    with pytest.raises(InvalidInput, match="expected a value with a content hash"):
        content_hash({"callback": print})
