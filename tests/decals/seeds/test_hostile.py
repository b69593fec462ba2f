"""Wishes for seeds that make no sense are refused in one line: what was expected, what came."""

from functools import cache

import numpy as np
import pytest

from blobtree import Point
from decals.coat.choosing import ImageChoice
from decals.coat.fields import gradient_of
from decals.coat.jitter import Jitter
from decals.coat.laying import lay
from decals.coat.seeding import seed
from decals.coat.sizing import Sizing
from decals.errors import DecalsError, InvalidDevice, InvalidMesh, InvalidPoints, InvalidSeeding
from decals.seeds.creases import Creases
from decals.seeds.painted_image import PaintedImage
from decals.seeds.projections import Cylindrical, Planar, Spherical, TextureCoordinates
from decals.seeds.relaxation import Relaxation
from decals.seeds.remeshing import remeshed_points
from decals.seeds.vertex_density import vertex_density
from decals.surfaces.implicit import ImplicitSurface
from decals.surfaces.mesh import MeshSurface
from tests.decals.meshes import plane, sphere

NAN = float("nan")
SQUARE, BALL = plane(), sphere(level=2)


def bang(*_):
    raise KeyError("bang")


def relaxed(**wish):
    relaxation = Relaxation(BALL, **{"count": 12, "iterations": 2} | wish)
    relaxation.run()
    return relaxation


untouched = cache(relaxed)
"""For those that must not change it."""


def refused(call, *given, **wish):
    """The error's text, which must be one of ours and short."""
    with pytest.raises(DecalsError, match=r".+: expected|^expected|makes more than") as refusal:
        call(*given, **wish)
    text = str(refusal.value)
    assert "\n" not in text
    assert len(text) < 300
    return text


def of(length, value):
    return lambda points: np.full(len(points) + length, value)


WISHES = [
    ("count", ["x", 1.5, -1, 10**12, True, None, NAN, [5]]),
    ("seed", ["x", 1.5, -1, None]),
    (
        "density",
        ["x", 5, [1.0], bang, of(0, NAN), of(0, 0.0), of(0, -1.0), of(0, np.inf), of(1, 1.0), lambda p: "x"],
    ),
    ("density", [lambda p: None, lambda p: 1.0, lambda: 1.0]),
    ("mask", ["x", 5, [True], np.ones(3, bool), bang, of(-1, True), of(0, NAN), of(0, False), lambda p: p]),
    ("fixed", ["x", 5, [1, 2], [[1, 2]], [[NAN, 0, 0]], [["a", "b", "c"]], np.zeros((30, 3)), bang]),
    ("device", ["bogus", 5, "cuda:99", [1]]),
]
COATS = [
    ("sizing", ["x", None, 5]),
    ("factor", ["x", 0, -1, NAN, np.inf, None, [1]]),
    ("direction", ["x", 5, [1, 2], [NAN, 0, 0], bang, lambda p: None, lambda p: p[:2], {}]),
    ("images", ["x", 0, -1, 1.5, None, [3], 10**9, True]),
    ("weights", ["x", [1, 2], [NAN], [-1], [0], [[1]], {}, 5, ["a"], bang]),
    ("choice", ["x", None, 5]),
    ("jitter", ["x", 5, True]),
]


@pytest.mark.parametrize(("name", "wrong"), [(name, value) for name, values in WISHES for value in values])
def test_impossible_wishes_of_a_population(name, wrong):
    wish = {"count": 12} | {name: wrong}
    for call in (relaxed, lambda **given: seed(BALL, **given)):
        assert name in refused(call, **wish) or name in ("count", "mask")


@pytest.mark.parametrize(("name", "wrong"), [(name, value) for name, values in COATS for value in values])
def test_impossible_wishes_of_a_coat(name, wrong):
    refused(lay, untouched(), **{name: wrong})
    refused(seed, BALL, count=12, **{name: wrong})


def test_a_direction_that_is_none_is_refused_before_the_long_work():
    told = []
    refused(seed, BALL, count=12, direction=[1, 2], progress=lambda *stage: told.append(stage))
    assert not told


@pytest.mark.parametrize("spacing", ["x", "0.1", 0, -1, NAN, np.inf, [1], 1e-20, True])
def test_spacings(spacing):
    refused(Relaxation, BALL, spacing=spacing)


def test_a_spacing_larger_than_the_model_has_nobody():
    assert Relaxation(BALL, spacing=1e30).count == 0
    assert len(seed(BALL, spacing=1e30)) == 0


@pytest.mark.parametrize("wrong", ["x", None, 5, [None], {"a": 1}, [BALL, 5], MeshSurface])
def test_what_is_no_surface(wrong):
    for call in (Relaxation, seed, untouched().deform, Planar.over, Cylindrical.over):
        wish = {"count": 3} if call in (Relaxation, seed) else {}
        assert "surfaces: expected a surface or several" in refused(call, wrong, **wish)
    for make in (
        Creases,
        lambda given: remeshed_points(given, 50),
        lambda given: TextureCoordinates(given, []),
    ):
        assert "surface: expected a MeshSurface" in refused(make, wrong)
    assert "relaxation: expected a Relaxation" in refused(lay, wrong)


def test_an_empty_scene_holds_nobody():
    assert Relaxation([], count=0).count == 0
    assert len(seed([], count=0)) == 0
    assert "visible area for 3 seeds" in refused(seed, [], count=3)
    assert "expected at least one" in refused(Planar.over, [])


@pytest.mark.parametrize("wrong", ["x", [1], NAN, -1, {}, True])
def test_running_until(wrong):
    relaxation = Relaxation(BALL, count=12, iterations=2)
    assert "until: expected" in refused(relaxation.run, until=wrong)
    assert relaxation.steps == 0


@pytest.mark.parametrize("wrong", ["x", 5, [1]])
def test_what_cannot_be_called(wrong):
    assert "progress: expected a function" in refused(untouched().run, wrong)
    assert "cancel: expected a function" in refused(untouched().run, cancel=wrong)
    assert "progress: expected a function" in refused(seed, BALL, count=3, progress=wrong)
    assert "cancel: expected a function" in refused(seed, BALL, count=3, cancel=wrong)
    assert "function: expected" in refused(gradient_of, wrong)


def test_a_function_that_fails_is_named_with_its_own_error():
    for name in ("density", "mask", "direction"):
        text = refused(seed, BALL, count=12, **{name: bang})
        assert text.startswith(f"{name}: expected numbers from the function, but it raised KeyError: 'bang'")
    refused(seed, BALL, count=12, direction=gradient_of(bang))
    refused(seed, BALL, count=12, density=PaintedImage(np.ones((2, 2)), bang).density())
    with pytest.raises(KeyError):  # whoever watches may stop the work so
        seed(BALL, count=12, progress=bang)


@pytest.mark.parametrize("wrong", ["x", None, 5, [1, 2], [NAN, 0, 0], [[0, 0, 1]], [0, 0, "a"], []])
def test_places_to_insert_at(wrong):
    relaxation = untouched()
    refused(relaxation.insert, wrong)
    assert relaxation.count == 12


@pytest.mark.parametrize("wrong", ["x", None, 1.5, -1, 12, [1], NAN, True])
def test_numbers_to_remove(wrong):
    relaxation = untouched()
    refused(relaxation.remove, wrong)
    assert relaxation.count == 12


@pytest.mark.parametrize("wrong", ["x", None, -1, 1.5, NAN])
def test_polishing_and_sizes(wrong):
    relaxation = untouched()
    refused(relaxation.polish, wrong)
    refused(lay, relaxation, seed=wrong)
    for places in ("x", None, 5, [[NAN, 0, 0]]):
        with pytest.raises((InvalidSeeding, InvalidPoints), match="expected"):
            relaxation.sizes_at(places)


@pytest.mark.parametrize("wrong", ["x", None, [1], NAN, -1, np.inf])
def test_lengths_and_angles_of_creases(wrong):
    creases = Creases(SQUARE)
    assert "angle: expected" in refused(Creases, SQUARE, angle=wrong)
    assert "spacing: expected" in refused(creases.points, wrong)
    assert "apart: expected" in refused(lambda apart: creases.mask(apart=apart), wrong)
    assert "jitter: expected" in refused(Jitter, wrong)
    assert "black: expected" in refused(
        lambda black: PaintedImage(np.ones((2, 2)), Planar.over(SQUARE)).density(black=black), wrong
    )


@pytest.mark.parametrize("wrong", ["x", None, 5, [1], [NAN] * 4, [0] * 4, ["a"] * 4, [[1]] * 4])
def test_values_at_vertices(wrong):
    assert "values: expected" in refused(vertex_density, SQUARE, wrong)
    assert "uv: expected" in refused(TextureCoordinates, SQUARE, wrong)


@pytest.mark.parametrize("wrong", ["x", None, 5, [], [None] * 3, BALL])
def test_projections(wrong):
    for kind in (Planar, Cylindrical, Spherical):
        refused(kind, wrong, wrong, wrong)
    assert "axis: expected" in refused(Planar.over, SQUARE, [wrong])
    assert "projection: expected" in refused(PaintedImage, np.ones((2, 2)), wrong)


@pytest.mark.parametrize("wrong", ["x", None, 1.5, -1, 3, NAN, 10**9])
def test_counts_of_a_remesh(wrong):
    assert "count: expected" in refused(remeshed_points, SQUARE, wrong)


@pytest.mark.parametrize("wrong", ["bogus", "cuda:99", 5, [1]])
def test_devices(wrong):
    tree = Point((0, 0, 0), radius=1.0)
    for make in (
        lambda: ImplicitSurface(tree, device=wrong),
        lambda: MeshSurface(SQUARE.vertices, SQUARE.faces, device=wrong),
    ):
        with pytest.raises(InvalidDevice, match=r"expected a Warp device \('cpu'"):
            make()


@pytest.mark.parametrize("wrong", ["x", None, 5, [[1, 2, 3]], MeshSurface])
def test_what_is_no_tree_makes_no_surface(wrong):
    with pytest.raises(InvalidMesh, match="tree: expected a BlobTree"):
        ImplicitSurface(wrong)


def test_ragged_faces_and_short_promises():
    with pytest.raises(InvalidMesh, match="rows of different lengths"):
        MeshSurface(SQUARE.vertices, [[0, 1], [0, 1, 2]])
    for within in ("x", np.zeros(5, np.float32)):
        with pytest.raises(InvalidPoints, match="within: expected 1 distances"):
            SQUARE.project([[0, 0, 0]], within=within)
    for count in ("x", None, -1, 1.5):
        refused(SQUARE.sample, count, 0)
        refused(SQUARE.sample, 3, count)


def test_what_is_meant_for_a_closed_set_is_named():
    assert "Sizing.COVERING" in refused(seed, BALL, count=3, sizing="covering")
    assert "ImageChoice.SIZE" in refused(seed, BALL, count=3, choice="size")
    assert Sizing("covering") is Sizing.COVERING
    assert ImageChoice("size") is ImageChoice.SIZE
