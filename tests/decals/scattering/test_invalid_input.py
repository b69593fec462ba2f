"""Invalid arguments of scattering raise one-line errors that name the argument."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from blobtree import Point
from blobtree._typing import Float32Array, Float64Array
from decals import Relaxation, Sizing, scatter
from decals.errors import ImplicitDecalsError, InvalidDevice, InvalidMesh, InvalidPoints, InvalidScattering
from decals.scattering import (
    Creases,
    Cylindrical,
    ImageChoice,
    Jitter,
    PaintedImage,
    Planar,
    Spherical,
    TextureCoordinates,
    gradient_of,
    remeshed_points,
    vertex_density,
)
from decals.surfaces import ImplicitSurface, MeshSurface
from tests.decals.meshes import plane, sphere

NAN = float("nan")
SQUARE, BALL = plane(), sphere(level=2)


def fail(*_: object) -> Any:
    raise KeyError("bang")


def relaxed(**options: Any) -> Relaxation:
    relaxation = Relaxation(BALL, **{"count": 12, "iterations": 2} | options)
    relaxation.run()
    return relaxation


untouched = cache(relaxed)
"""A shared relaxation, for tests that do not change it."""


def error_of(call: Callable[..., object], *arguments: Any, **options: Any) -> str:
    """Return the message of the error, which must be one of ours and short."""
    with pytest.raises(ImplicitDecalsError, match=r".+: expected|^expected|makes more than") as caught:
        call(*arguments, **options)
    text = str(caught.value)
    assert "\n" not in text
    assert len(text) < 300
    return text


def giving(length: int, value: float) -> Callable[[Float32Array], Float64Array]:
    return lambda points: np.full(len(points) + length, value)


RELAXATION_ARGUMENTS: list[tuple[str, list[Any]]] = [
    ("count", ["x", 1.5, -1, 10**12, True, None, NAN, [5]]),
    ("seed", ["x", 1.5, -1, None]),
    (
        "density",
        [
            "x",
            5,
            [1.0],
            fail,
            giving(0, NAN),
            giving(0, 0.0),
            giving(0, -1.0),
            giving(0, np.inf),
            giving(1, 1.0),
            lambda p: "x",
        ],
    ),
    ("density", [lambda p: None, lambda p: 1.0, lambda: 1.0]),
    (
        "mask",
        [
            "x",
            5,
            [True],
            np.ones(3, bool),
            fail,
            giving(-1, True),
            giving(0, NAN),
            giving(0, False),
            lambda p: p,
        ],
    ),
    (
        "fixed",
        ["x", 5, [1, 2], [[1, 2]], [[1, 2], [3]], [[NAN, 0, 0]], [["a", "b", "c"]], np.zeros((30, 3)), fail],
    ),
    ("device", ["bogus", 5, "cuda:99", [1]]),
]
APPEARANCE_ARGUMENTS: list[tuple[str, list[Any]]] = [
    ("sizing", ["x", None, 5]),
    ("factor", ["x", 0, -1, NAN, np.inf, None, [1]]),
    ("direction", ["x", 5, [1, 2], [NAN, 0, 0], fail, lambda p: None, lambda p: p[:2], {}]),
    ("images", ["x", 0, -1, 1.5, None, [3, 3], 10**9, True]),
    ("weights", ["x", [1, 2], [NAN], [-1], [0], [[1]], {}, 5, ["a"], fail]),
    ("choice", ["x", None, 5]),
    ("jitter", ["x", 5, True]),
]


def pairs_of(arguments: list[tuple[str, list[Any]]]) -> list[tuple[str, Any]]:
    return [(name, value) for name, values in arguments for value in values]


@pytest.mark.parametrize(("name", "wrong"), pairs_of(RELAXATION_ARGUMENTS))
def test_invalid_relaxation_arguments(name: str, wrong: Any) -> None:
    options: dict[str, Any] = {"count": 12} | {name: wrong}
    for call in (relaxed, lambda **options: scatter(BALL, **options)):
        assert name in error_of(call, **options) or name in ("count", "mask")


@pytest.mark.parametrize(("name", "wrong"), pairs_of(APPEARANCE_ARGUMENTS))
def test_invalid_appearance_arguments(name: str, wrong: Any) -> None:
    error_of(untouched().to_decals, **{name: wrong})
    error_of(scatter, BALL, count=12, **{name: wrong})


def test_invalid_direction_raises_before_the_relaxation() -> None:
    stages = []
    error_of(scatter, BALL, count=12, direction=[1, 2], progress=lambda *stage: stages.append(stage))
    assert not stages


@pytest.mark.parametrize("spacing", ["x", "0.1", 0, -1, NAN, np.inf, [1], 1e-20, True])
def test_invalid_spacings(spacing: Any) -> None:
    error_of(Relaxation, BALL, spacing=spacing)


def test_spacing_larger_than_the_model_gives_no_particles(caplog: pytest.LogCaptureFixture) -> None:
    assert Relaxation(BALL, spacing=1e30).count == 0
    assert len(scatter(BALL, spacing=1e30)) == 0
    message = caplog.messages[-1]
    assert message.startswith("spacing: 1e+30 is too large for a particle on this surface; take at most ")
    largest = float(message.partition("at most ")[2].partition(",")[0])
    caplog.clear()
    assert Relaxation(BALL, spacing=0.999 * largest).count == 1
    assert not caplog.messages
    assert Relaxation(BALL, spacing=1.001 * largest).count == 0


@pytest.mark.parametrize("wrong", ["x", None, 5, [None], {"a": 1}, [BALL, 5], MeshSurface, np.eye(3)])
def test_invalid_surfaces(wrong: Any) -> None:
    for call in (Relaxation, scatter, untouched().deform, Planar.over, Cylindrical.over):
        options: dict[str, Any] = {"count": 3} if call in (Relaxation, scatter) else {}
        assert "surfaces: expected a model" in error_of(call, wrong, **options)
    for make in (
        Creases,
        lambda surface: remeshed_points(surface, 50),
        lambda surface: TextureCoordinates(surface, []),
    ):
        assert "surface: expected a model" in error_of(make, wrong)


@pytest.mark.parametrize("wrong", ["x", 1.5, 0, -1, None, True, 10**400])
def test_invalid_iterations(wrong: Any) -> None:
    assert "iterations: expected" in error_of(Relaxation, BALL, count=3, iterations=wrong)


def test_no_surfaces() -> None:
    assert Relaxation([], count=0).count == 0
    assert len(scatter([], count=0)) == 0
    assert "visible area for 3 particles" in error_of(scatter, [], count=3)
    assert "expected at least one" in error_of(Planar.over, [])


@pytest.mark.parametrize("wrong", ["x", [1], NAN, -1, {}, True])
def test_invalid_until(wrong: Any) -> None:
    relaxation = Relaxation(BALL, count=12, iterations=2)
    assert "until: expected" in error_of(relaxation.run, until=wrong)
    assert relaxation.steps == 0


@pytest.mark.parametrize("wrong", ["x", 5, [1]])
def test_invalid_callbacks(wrong: Any) -> None:
    assert "progress: expected a function" in error_of(untouched().run, wrong)
    assert "cancel: expected a function" in error_of(untouched().run, cancel=wrong)
    assert "progress: expected a function" in error_of(scatter, BALL, count=3, progress=wrong)
    assert "cancel: expected a function" in error_of(scatter, BALL, count=3, cancel=wrong)
    assert "function: expected" in error_of(gradient_of, wrong)


def test_error_names_the_user_function_that_failed() -> None:
    for name in ("density", "mask", "direction"):
        text = error_of(scatter, BALL, count=12, **{name: fail})
        assert text.startswith(f"{name}: expected numbers from the function, but it raised KeyError: 'bang'")
    error_of(scatter, BALL, count=12, direction=gradient_of(fail))
    error_of(scatter, BALL, count=12, density=PaintedImage(np.ones((2, 2)), fail).density())
    with pytest.raises(KeyError):  # a progress function may raise to stop the work
        scatter(BALL, count=12, progress=fail)


@pytest.mark.parametrize("wrong", ["x", None, 5, [1, 2], [NAN, 0, 0], [[0, 0, 1]], [0, 0, "a"], []])
def test_invalid_points_to_insert(wrong: Any) -> None:
    relaxation = untouched()
    error_of(relaxation.insert, wrong)
    assert relaxation.count == 12


@pytest.mark.parametrize("wrong", ["x", None, 1.5, -1, 12, [1], NAN, True])
def test_invalid_numbers_to_remove(wrong: Any) -> None:
    relaxation = untouched()
    error_of(relaxation.remove, wrong)
    assert relaxation.count == 12


@pytest.mark.parametrize("wrong", ["x", None, -1, 1.5, NAN])
def test_invalid_rounds_seed_and_positions(wrong: Any) -> None:
    relaxation = untouched()
    error_of(relaxation.polish, wrong)
    error_of(relaxation.to_decals, seed=wrong)
    invalid: list[Any] = ["x", None, 5, [[NAN, 0, 0]]]
    for positions in invalid:
        with pytest.raises((InvalidScattering, InvalidPoints), match="expected"):
            relaxation.sizes_at(positions)


@pytest.mark.parametrize("wrong", ["x", None, [1], NAN, -1, np.inf])
def test_invalid_lengths_and_angles(wrong: Any) -> None:
    creases = Creases(SQUARE)
    assert "angle: expected" in error_of(Creases, SQUARE, angle=wrong)
    assert "spacing: expected" in error_of(creases.points, wrong)
    assert "apart: expected" in error_of(lambda apart: creases.mask(apart=apart), wrong)
    assert "jitter: expected" in error_of(Jitter, wrong)
    assert "black: expected" in error_of(
        lambda black: PaintedImage(np.ones((2, 2)), Planar.over(SQUARE)).density(black=black), wrong
    )


@pytest.mark.parametrize("wrong", ["x", None, 5, [1], [NAN] * 4, [0] * 4, ["a"] * 4, [[1]] * 4])
def test_invalid_values_at_vertices(wrong: Any) -> None:
    assert "values: expected" in error_of(vertex_density, SQUARE, wrong)
    assert "uv: expected" in error_of(TextureCoordinates, SQUARE, wrong)


@pytest.mark.parametrize("wrong", ["x", None, 5, [], [None] * 3, BALL])
def test_invalid_projections(wrong: Any) -> None:
    for kind in (Planar, Cylindrical, Spherical):
        error_of(kind, wrong, wrong, wrong)
    assert "axis: expected" in error_of(Planar.over, SQUARE, [wrong])
    assert "projection: expected" in error_of(PaintedImage, np.ones((2, 2)), wrong)


@pytest.mark.parametrize("wrong", ["x", None, 1.5, -1, 3, NAN, 10**9])
def test_invalid_remesh_counts(wrong: Any) -> None:
    assert "count: expected" in error_of(remeshed_points, SQUARE, wrong)


@pytest.mark.parametrize("wrong", ["bogus", "cuda:99", 5, [1]])
def test_invalid_devices(wrong: Any) -> None:
    tree = Point((0, 0, 0), radius=1.0)
    for make in (
        lambda: ImplicitSurface(tree, device=wrong),
        lambda: MeshSurface(SQUARE.vertices, SQUARE.faces, device=wrong),
    ):
        with pytest.raises(InvalidDevice, match=r"expected a Warp device \('cpu'"):
            make()


@pytest.mark.parametrize("wrong", ["x", None, 5, [[1, 2, 3]], MeshSurface])
def test_invalid_trees(wrong: Any) -> None:
    with pytest.raises(InvalidMesh, match="tree: expected a BlobTree"):
        ImplicitSurface(wrong)


def test_invalid_faces_reaches_and_samples() -> None:
    with pytest.raises(InvalidMesh, match="rows of different lengths"):
        MeshSurface(SQUARE.vertices, [[0, 1], [0, 1, 2]])
    invalid: list[Any] = ["x", np.zeros(5, np.float32)]
    for within in invalid:
        with pytest.raises(InvalidPoints, match="within: expected 1 distances"):
            SQUARE.project([[0, 0, 0]], within=within)
    for count in ("x", None, -1, 1.5):
        error_of(SQUARE.sample, count, 0)
        error_of(SQUARE.sample, 3, count)


def test_errors_name_the_members_of_enumerations() -> None:
    assert "'covering', 'touching', 'delaunay'" in error_of(scatter, BALL, count=3, sizing="loose")
    assert "'random', 'size', 'curvature'" in error_of(scatter, BALL, count=3, choice="largest")
    assert Sizing("covering") is Sizing.COVERING
    assert ImageChoice("size") is ImageChoice.SIZE


@pytest.mark.parametrize(("options", "got"), [({}, "none"), ({"count": 5, "spacing": 0.1}, "both")])
def test_one_of_count_and_spacing_is_needed(options: dict[str, float], got: str) -> None:
    with pytest.raises(InvalidScattering, match=f"got {got}; give one"):
        Relaxation(sphere(8), **options)  # type: ignore[arg-type]
