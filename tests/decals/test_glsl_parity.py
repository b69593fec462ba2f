"""Every typed function that shaders share, in Warp and GLSL, on the same numbers; whole tapes; pictures."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import Node, Point, Segment
from blobtree.formulas.operators import OPERATORS
from blobtree.formulas.skeletons import SKELETONS
from blobtree.formulas.warps import WARPS
from blobtree.tapes.dispatch import partials, rises, slope, warp_forward, warp_pullback, warp_stretch
from blobtree.tapes.evaluate import bounds_along, bounds_at, colors_at, gradients_at
from blobtree.tracing.trace import trace
from blobtree.typed.glsl import translate_library
from decals.field.ownership import owner_at
from decals.grid.index import DecalIndex
from decals.model import RECORD
from decals.render.context import Context
from decals.render.drawables import register
from decals.render.renderer import Renderer
from decals.render.tape_shader import Kinds, _dispatch, tracing_shader
from decals.render.tree import TreeDrawable
from decals.scenes.camera import Camera
from tests.blobtree.trees import points_around, random_trees
from tests.blobtree.warp_functions import TypedFunction, call, element, numpy_type, typed_functions
from tests.decals.glsl_functions import run_program, through_glsl
from tests.decals.shapes import View
from tests.oracles import blobtree as oracle

Array = NDArray[Any]

AGREEMENT = 1e-5
COUNT = 10_240
TEXELS = 4096
DECALS = 300

MODULES = (
    "blobtree.formulas.kernels",
    "blobtree.formulas.skeletons",
    "blobtree.formulas.operators",
    "blobtree.tapes.dispatch",
    "blobtree.tapes.readings",
    "blobtree.tracing.rays",
    "blobtree.formulas.warps",
    "decals.field.contact",
    "decals.field.mapping",
    "decals.grid.lookup",
    "decals.field.radial",
    "decals.records",
    "decals.field.stack",
    "decals.field.cells",
    "decals.field.ownership",
)
WRITTEN_TWICE = {"closest", "slimmest", "stride", "convex", "rises"}
"""Switches over the tables, written per backend."""


def shared(module: str) -> list[TypedFunction]:
    """What both backends have from one source, save what reads a whole tape: that comes below."""
    functions = typed_functions(import_module(module))
    whole_tapes = {"span", "blocks"}
    return [f for f in functions if f.name not in WRITTEN_TWICE and not whole_tapes & set(f.parameters)]


FUNCTIONS = {f"{module}.{typed.name}": typed for module in MODULES for typed in shared(module)}
ALL_KINDS = Kinds(
    tuple(range(len(SKELETONS))),
    tuple(range(len(OPERATORS))),
    6,
    stretched=True,
    warps=tuple(range(len(WARPS))),
    warp_registers=4,
)
CHOOSERS: list[Any] = [partials, rises, slope, warp_forward, warp_pullback, warp_stretch]


# -- arguments ------------------------------------------------------------------------------------------

Draw = Callable[[np.random.Generator, int], Array]


def uniform(low: float, high: float, *shape: int) -> Draw:
    """Evenly spread numbers; the first rows are all 0, all ½ and all 1 where these lie in the range."""

    def draw(rng: np.random.Generator, count: int) -> Array:
        numbers = rng.uniform(low, high, (count, *shape))
        for row, special in enumerate((0.0, 0.5, 1.0)):
            if low <= special <= high:
                numbers[row::1000] = special
        return numbers

    return draw


def powers(low: float, high: float) -> Draw:
    return lambda rng, count: 10.0 ** rng.uniform(low, high, count)


def whole(low: int, high: int, step: int = 1) -> Draw:
    return lambda rng, count: rng.integers(low, high, count) * step


def among(*values: float) -> Draw:
    return lambda rng, count: rng.choice(values, count)


def units(rng: np.random.Generator, count: int) -> Array:
    vectors = rng.normal(size=(count, 3))
    vectors[:3] = np.eye(3)
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def units_or_none(rng: np.random.Generator, count: int) -> Array:
    vectors = units(rng, count)
    vectors[::5] = 0.0
    return vectors


def beside(*draws: Draw) -> Draw:
    """A vector whose components are drawn by these."""
    return lambda rng, count: np.column_stack([draw(rng, count) for draw in draws])


def interval(high: float) -> Draw:
    return lambda rng, count: np.sort(uniform(0.0, high, 2)(rng, count), axis=1)


place, ball = uniform(-2.0, 2.0, 3), beside(uniform(-2.0, 2.0, 3), uniform(0.3, 2.5))
share, field, four = uniform(0.0, 1.0), uniform(0.0, 3.0), uniform(-3.0, 3.0, 4)

BY_NAME: dict[str, Draw] = {
    "a": field, "aim": units_or_none, "b": field, "max_a": field, "max_b": field, "slope_a": uniform(0, 5),
    "slope_b": uniform(0, 5),
    "at": whole(0, (TEXELS - 8) // 2, step=2), "apart": place,
    "c": ball, "cells_per_unit": among(0.25, 0.5, 1, 2, 4, 8),
    "center": place, "color": uniform(0, 1, 4), "complement": uniform(0.0, 0.5), "contact": whole(0, 3),
    "decal": whole(0, DECALS),
    "above": whole(-1, DECALS),
    "direction": units, "distance": uniform(0.0, 1.5), "g": place, "kind": whole(0, len(WARPS)),
    "p": uniform(-1.5, 1.5, 4), "slim": uniform(0.3, 2.5), "slimmest": uniform(0.3, 2.5),
    "e_k": uniform(0.0, 0.5), "e_i": share,
    "exponent": among(1.5, 2, 3, 7, 20, 100), "parameter": among(1.5, 2, 3, 7, 20, 100), "f": field,
    "farthest": uniform(0.0, 1.5), "half": uniform(0.0, 1.0), "lower": uniform(-1.5, 0.0, 3),
    "inverse": uniform(-3.0, 3.0, 3), "m": place,
    "mapping": whole(0, 2), "n": units, "n_p": units, "n_q": units, "nearest": uniform(0.0, 1.5),
    "offset": beside(powers(-9, 9), powers(-9, 9)),
    "packed_rank": among(0.0, 0.5, 1.0, 4194303.5), "rank": whole(0, 4), "ray": units,
    "operator": whole(0, len(OPERATORS)), "origin": place,
    "phi": share, "push": share, "q": place, "radius": uniform(0.0, 1.0), "reach": powers(-3, 0.5),
    "rim": share,
    "speed": uniform(0.1, 3.0),
    "squared_distance": uniform(0.0, 1.5), "u": units, "upper": uniform(0.0, 1.5, 3), "v": four, "w": place,
    "z": uniform(0.0, 1.5),
}  # fmt: skip
BY_FUNCTION: dict[str, dict[str, Draw]] = {
    "bound_combine": {key: beside(field, uniform(-2, 5), uniform(0, 5)) for key in "ab"},
    "gradient_combine": {"a": beside(field, uniform(-3, 3, 3)), "b": beside(field, uniform(-3, 3, 3))},
    "color_combine": {"a": beside(field, uniform(0, 1, 3)), "b": beside(field, uniform(0, 1, 3))},
    "turned_to_local": {"v": place},
    "bound_unstretch": {"f": uniform(0, 3, 3)},
    "gradient_unstretch": {"f": four},
    "bound_unwarp": {"f": uniform(0, 3, 3)},
    "gradient_unwarp": {"f": uniform(-1.0, 1.0, 4), "q": uniform(-1.0, 1.0, 3)},
    "color_unwarp": {"f": four},
    "color_unstretch": {"f": four},
    "power": {"radius": uniform(0.1, 2.0)},
    "are_stacked": {"radius": uniform(0.1, 2.0), "other": uniform(0.1, 2.0)},
    "plane_distance": {"radius": uniform(0.1, 2.0), "other": uniform(0.1, 2.0)},
    "apart": {"other": whole(0, DECALS)},
    "lies_over": {"other": whole(0, DECALS)},
    "stacked": {"other": whole(0, DECALS)},
    "cell_owner": {"rank": among(1)},
    "log_of_rest": {"w": uniform(0.0, 0.999)},
    "cell_coordinate": {"x": uniform(-1000.0, 1000.0)},
    "cell_hash": dict.fromkeys("xyz", whole(-(2**31), 2**31)),
} | {
    f"{name}_{kind}": {"a": interval(2.0), "b": interval(2.0)}
    for name in ("sum", "ricci", "union", "intersection", "difference", "blend")
    for kind in ("range", "choice")
}  # fmt: skip


def texels(rng: np.random.Generator) -> Array:
    """What every skeleton reads at every even place of a tape: (point, influence), (axis, number above 0)."""
    tape = rng.uniform(-1.5, 1.5, (TEXELS, 4)).astype(np.float32)
    tape[::2, 3] = rng.uniform(0.3, 2.0, TEXELS // 2)
    tape[1::2, 3] = 1.0 / (tape[1::2, :3] ** 2).sum(axis=1)
    return tape


@dataclass(frozen=True)
class World:
    """Decals of two sizes on the unit ball, and their index."""

    decals: Array
    index: DecalIndex
    points: Array

    @property
    def arguments(self) -> dict[str, Any]:
        index = self.index
        return {"decals": self.decals, "level_count": index.level_count, "layered": True,
                "levels": index.levels, "table": index.table, "mask": index.mask,
                "ids": index.ids}  # fmt: skip


@lru_cache
def world() -> World:
    rng = np.random.default_rng(11)
    centres, tangents = units(rng, DECALS), units(rng, DECALS)
    reach = rng.choice([0.1, 0.35], DECALS)
    record = np.zeros((DECALS, RECORD, 4), np.float32)
    kind = rng.choice(3, DECALS, p=[0.1, 0.8, 0.1])
    record[:, 0] = np.column_stack([centres, reach])
    record[:, 1] = np.column_stack([centres, kind + 0.5 * (rng.random(DECALS) < 0.2)])
    record[:, 2, :3] = np.cross(centres, np.cross(tangents, centres))
    near = centres[rng.integers(0, DECALS, COUNT)] + rng.normal(size=(COUNT, 3)) * 0.1
    points = near / np.linalg.norm(near, axis=1, keepdims=True)
    return World(record.reshape(-1, 4), DecalIndex.build(centres, reach, kind), points.astype(np.float32))


def arguments_of(typed: TypedFunction) -> dict[str, Array]:
    """The same seeded arguments for a function every time, in the types that it takes."""
    rng = np.random.default_rng(7)
    draws = BY_NAME | BY_FUNCTION.get(typed.name, {})
    known: dict[str, Any] = {"tape": texels(rng)}
    if {"decals", "levels"} & set(typed.parameters):
        known |= world().arguments | {"q": world().points, "n_q": world().points}
        known["level"] = rng.integers(0, world().index.level_count, COUNT)
    if "owner" in typed.parameters:
        sheet = world().decals[1::RECORD, 3][owners()].astype(int) == 1
        fits = (owners() >= 0) & (sheet | (typed.name != "pushed_complement"))
        owned = np.resize(np.flatnonzero(fits), COUNT)
        known |= {"q": world().points[owned], "n_q": world().points[owned], "owner": owners()[owned]}
    if typed.name == "contact_push":
        least = draws["e_k"](rng, COUNT)
        known |= {"e_k": least, "e_i": least + share(rng, COUNT)}
    if typed.name == "arc_over_chord":
        angle = uniform(0.0, 0.5 * np.pi)(rng, COUNT)
        known |= {"sine": np.sin(angle), "cosine": np.cos(angle)}
    if typed.name == "plane_distance":
        known["apart"] = ahead_of(known.setdefault("ray", units(rng, COUNT)), place(rng, COUNT))
    if {"n_p", "n_q"} <= set(typed.parameters):
        normal, other = units(rng, COUNT), units(rng, COUNT)
        opposite = (normal * other).sum(axis=1) < -0.9  # towards −1, no float32 tells the arc
        known |= {"n_p": normal, "n_q": np.where(opposite[:, None], -other, other)}
    drawn = {name: known[name] if name in known else draws[name](rng, COUNT) for name in typed.parameters}
    whole_names = {
        name
        for name, hint in typed.parameters.items()
        if numpy_type(element(hint))[0] in (np.int32, np.bool_)
    }
    arrays = {
        name: np.asarray(v, np.int32 if name in whole_names else np.float32) for name, v in drawn.items()
    }
    return {name: np.full(COUNT, v) if v.ndim == 0 else v for name, v in arrays.items()}


def ahead_of(ray: Array, apart: Array) -> Array:
    """Neighbours that a ray comes to."""
    ahead = (ray * apart).sum(axis=1, keepdims=True)
    return np.asarray(apart + (0.2 - np.minimum(ahead, 0.2)) * ray)


@lru_cache
def owners() -> Array:
    everything: Any = {**world().arguments, "contact": 0, "q": world().points, "n_q": world().points}
    return call(owner_at, **everything)


# -- function by function -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_is_the_same_in_both_languages(context: Context, name: str) -> None:
    typed = FUNCTIONS[name]
    arguments = arguments_of(typed)
    library = _dispatch(ALL_KINDS)
    rows_of_operators = [f for operator in OPERATORS for f in (operator.partials, operator.slope)]
    rows_of_warps = [f for warp in WARPS for f in (warp.forward, warp.pullback, warp.stretch)]
    chosen = [*rows_of_operators, *rows_of_warps]
    if typed.function in CHOOSERS:
        library = translate_library(chosen) + library
    else:
        library = translate_library([typed.function, *chosen], provided=CHOOSERS) + library
    count = COUNT if typed.parameters else 1
    seen = through_glsl(context, typed, library, arguments, count)
    expected = call(typed.function, **arguments).reshape(count, -1)
    seen = seen[:, : expected.shape[1]]
    if expected.dtype.kind in "iub":
        np.testing.assert_array_equal(seen.astype(expected.dtype), expected)
        return
    assert np.isfinite(expected).all()
    error = np.abs(seen - expected) / np.maximum(1.0, np.abs(expected))
    worst = np.unravel_index(error.argmax(), error.shape)[0]
    at_worst = {key: value[worst] for key, value in arguments.items() if len(value) == count}
    assert error.max() <= AGREEMENT, f"{error.max()}: {seen[worst]} and {expected[worst]} at {at_worst}"
    assert not typed.parameters or typed.returned is None or np.ptp(expected) > 0.0, "they never change"


# -- whole tapes ----------------------------------------------------------------------------------------

TREES = random_trees(seed=31, count=24)
MAIN = """
uniform sampler2D points; uniform ivec2 part; uniform int reading; uniform vec3 heading;
void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 q = texelFetch(points, here, 0);
    vec4 result = vec4(0.0);
    if (reading == 0) result.xyz = field_bound(q.xyz, heading, q.w, tape, part);
    if (reading == 1) result = field_gradient(q.xyz, tape, part);
    if (reading == 2) result = interpret_color(q.xyz, vec3(0.0), 0.0, tape, part);
    g_position = result;
}
"""
BOUND_AND_VALUE, GRADIENT, COLOR = range(3)


def read_tape(
    context: Context, tree: Node, reading: int, points: Array, heading: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> Array:
    """What the tracing shader's own functions give for `tree`, in place of a picture."""
    shader, _, _ = tracing_shader(ALL_KINDS).text.partition("void main()")
    textures = {"tape": tree.tape.data, "points": padded(points)}
    uniforms = {"reading": reading, "part": (0, len(tree.tape.data)), "heading": heading}
    return run_program(context, shader + MAIN, len(points), textures, uniforms)


def padded(points: Array) -> Array:
    return np.pad(points, ((0, 0), (0, 4 - points.shape[1]))).astype(np.float32)


def assert_close(seen: Array, expected: Array) -> None:
    error = np.abs(seen - expected) / np.maximum(1.0, np.abs(expected))
    assert error.max(initial=0.0) <= AGREEMENT


def test_the_trees_use_everything_that_a_tape_can_hold() -> None:
    assert {code for tree in TREES for code in tree.tape.skeletons} == set(ALL_KINDS.skeletons)
    assert {code for tree in TREES for code in tree.tape.operators} == set(ALL_KINDS.operators)
    assert 2 <= max(tree.tape.registers for tree in TREES) <= ALL_KINDS.registers
    assert sum(tree.tape.stretched for tree in TREES) > 5


@pytest.mark.parametrize("start", range(0, 24, 6))
def test_whole_tapes_are_the_same_in_both_languages(context: Context, start: int) -> None:
    rng = np.random.default_rng(start)
    compared = 0
    for tree in TREES[start : start + 6]:
        points = points_around(rng, tree, 500)
        reach = (10.0 ** rng.uniform(-3.0, 0.5, 500)).astype(np.float32)
        seen = read_tape(context, tree, BOUND_AND_VALUE, np.column_stack([points, reach]))
        assert_close(seen[:, :2], bounds_at(tree.tape, points, reach))
        heading = units(rng, 4)[3]
        seen = read_tape(
            context, tree, BOUND_AND_VALUE, np.column_stack([points, reach]), tuple(heading.tolist())
        )
        assert_close(seen[:, :3], bounds_along(tree.tape, points, np.tile(heading, (500, 1)), reach))
        field = oracle.evaluate(tree, points)
        smooth = field.margin > 1e-5
        assert_close(
            read_tape(context, tree, GRADIENT, points)[smooth], gradients_at(tree.tape, points)[smooth]
        )
        strong = smooth & (field.value > 1e-3)
        seen = read_tape(context, tree, COLOR, points)[:, 1:]
        assert_close(seen[strong], colors_at(tree.tape, points)[strong])
        compared += int(strong.sum())
    assert compared > 0.3 * 6 * 500


# -- pictures -------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Model:
    """A tree in a scene: all that the renderer asks of one."""

    tree: Node


register(Model, TreeDrawable)

MODELS = {
    "one point": Point((0, 0, 0), radius=1.0),
    "one segment": Segment((0, 0, 0), (1, 1, 0), radius=0.4),
    "a tiny model": (Point((0, 0, 0), radius=1.0) - Point((0.5, 0, 1), radius=0.7)).scale(1e-4),
    "random trees side by side": random_trees(seed=5, count=1)[0]
    | random_trees(seed=6, count=1)[0].translate((2, 0, 0)),
}


@pytest.mark.parametrize("name", MODELS)
def test_a_traced_picture_is_what_warp_traces(renderer: Renderer, name: str) -> None:
    tree, (width, height) = MODELS[name], (160, 120)
    camera = Camera.framing(tree.bounds, direction=(0.3, 0.5, 1.0), aspect=width / height)
    buffers = renderer.buffers(View((Model(tree),), camera), size=(width, height))
    x, y = np.meshgrid(np.arange(width) + 0.5, height - np.arange(height) - 0.5)
    rays = camera.rays(width, height)
    directions = rays.directions(x, y).reshape(-1, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    distance = trace(tree, np.tile(rays.origin, (len(directions), 1)), directions)
    expected = np.isfinite(distance)
    seen = buffers.object_id.ravel() == 0
    assert expected.sum() > 500
    assert (seen != expected).sum() <= 1e-3 * expected.size
    both = seen & expected
    depth = np.linalg.norm(buffers.position.reshape(-1, 3)[both] - rays.origin, axis=1)
    size = float(np.linalg.norm(tree.bounds[1] - tree.bounds[0]))
    assert (np.abs(depth - distance[both]) > 1e-4 * size).mean() <= 2e-3
    points = buffers.position.reshape(-1, 3)[both]
    smooth = oracle.evaluate(tree, points).margin > 2e-3  # a hit may lie a tolerance beside its block
    gradient = tree.gradient(points[smooth])
    normal = -gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
    np.testing.assert_allclose(buffers.normal.reshape(-1, 3)[both][smooth], normal, atol=1e-4)
