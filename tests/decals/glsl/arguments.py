"""Arguments for typed functions: by the parameters' names, seeded, edge cases among them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree.tape.codes import OPERATORS, WARPS
from decals import ImageMapping
from decals.field.contact import MIN_COMPLEMENT, MIN_SPAN
from decals.field.ownership import owner_at
from decals.index import DecalIndex
from decals.model import RECORD
from tests.blobtree.transpile.warp_functions import TypedFunction, call, element, numpy_type

Array = NDArray[Any]

COUNT = 10_240
TEXELS = 4096
DECALS = 300

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


def kept(rng: np.random.Generator, count: int) -> Array:
    """Four numbers of decals; −1 for none."""
    return rng.integers(-1, DECALS, (count, 4))


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
    "a": field, "b": field, "max_a": field, "max_b": field, "slope_a": uniform(0, 5),
    "slope_b": uniform(0, 5),
    "at": whole(0, (TEXELS - 8) // 2, step=2), "apart": place,
    "c": ball, "cells_per_unit": among(0.25, 0.5, 1, 2, 4, 8),
    "center": place, "chord": share, "color": uniform(0, 1, 4), "complement": uniform(0.0, 0.5),
    "contact": whole(0, 4),
    "ahead": beside(units_or_none, powers(-3, 0.5)), "decal": whole(0, DECALS),
    "limit": whole(-1, DECALS),
    "depth": uniform(-1.0, 1.0), "smallest": uniform(0.1, 0.3), "clearance": share,
    "inside": uniform(-1.0, 1.0), "start_apart": among(0.0, 4e-7, 0.5), "end_apart": among(0.0, 4e-7, 0.5),
    "direction": units, "distance": uniform(0.0, 1.5), "g": place, "kind": whole(0, len(WARPS)),
    "p": uniform(-1.5, 1.5, 4), "rate": uniform(0.1, 3.0), "min_influence": uniform(0.3, 2.5),
    "e": share, "e_k": uniform(0.0, 0.5), "e_i": share,
    "exponent": among(1.5, 2, 3, 7, 20, 100), "parameter": among(1.5, 2, 3, 7, 20, 100), "f": field,
    "farthest": uniform(0.0, 1.5), "half": uniform(0.0, 1.0), "lower": uniform(-1.5, 0.0, 3),
    "inverse": uniform(-3.0, 3.0, 3), "length": uniform(0.0, 1.5), "m": place,
    "mapping": whole(0, 2), "n": units, "n_p": units, "n_q": units, "nearest": uniform(0.0, 1.5),
    "most": uniform(0.0, 3.0, 2), "rise": uniform(0.0, 5.0, 2),
    "offset": beside(powers(-9, 9), powers(-9, 9)),
    "packed_rank": among(0.0, 0.5, 1.0, 4194303.5), "rank": whole(0, 4), "ray": units,
    "operator": whole(0, len(OPERATORS)), "origin": place,
    "profile": beside(among(1), among(0), uniform(0.3, 3.0), uniform(-2.0, 2.0)), "phi": share,
    "push": share, "q": place, "radius": uniform(0.0, 1.0), "reach": powers(-3, 0.5),
    "rim": share, "t": powers(-3, 0.5), "way": powers(-3, 0.5),
    "speed": uniform(0.1, 3.0), "stiffness": uniform(1.0, 6.0),
    "squared_distance": uniform(0.0, 1.5), "u": units, "upper": uniform(0.0, 1.5, 3),
    "uv": uniform(-0.2, 1.2, 2), "v": four, "w": place,
    "z": uniform(0.0, 1.5),
}  # fmt: skip
BY_FUNCTION: dict[str, dict[str, Draw]] = {
    "bound_combine": {key: beside(field, uniform(-2, 5), uniform(0, 5)) for key in "ab"},
    "gradient_combine": {"a": beside(field, uniform(-3, 3, 3)), "b": beside(field, uniform(-3, 3, 3))},
    "second_share": {"p": uniform(-2.0, 2.0, 3)},
    "distance_to_segment": {"a": place, "b": place},
    "color_combine": {"a": beside(field, uniform(0, 1, 3)), "b": beside(field, uniform(0, 1, 3))},
    "direction_to_local": {"v": place},
    "falloff_value": {"kind": among(0), "distance": share},
    "falloff_slope": {"kind": among(0), "distance": share},
    **{
        f"profile_{name}": {"u": uniform(0.0, 1.5)} for name in ("distance", "value", "slope", "steepest")
    },
    "falling_value": {"u": uniform(0.0, 1.5)},
    "unroll_step": {"step": place},
    "roll_step": {"step": place},
    "bound_pullback_affine": {"f": uniform(0, 3, 3)},
    "gradient_pullback_affine": {"f": four},
    "bound_pullback_warp": {"f": uniform(0, 3, 3)},
    "gradient_pullback_warp": {"f": uniform(-1.0, 1.0, 4), "q": uniform(-1.0, 1.0, 3)},
    "color_pullback_warp": {"f": four},
    "color_pullback_affine": {"f": four},
    "add_pushes": {"e": uniform(0.0, 1.0, 4)},
    "power": {"radius": uniform(0.1, 2.0)},
    "balls_nested": {"radius": uniform(0.1, 2.0), "other": uniform(0.1, 2.0)},
    "plane_distance": {"radius": uniform(0.1, 2.0), "other": uniform(0.1, 2.0)},
    "push_width": {"radius": uniform(0.1, 2.0), "other": uniform(0.1, 2.0), "squared": uniform(0.1, 9.0)},
    "bump_of": {"radius": uniform(1.0, 2.0), "other": uniform(0.3, 1.0)},
    "join_bumps": {"first": uniform(0.0, 1.0, 4), "second": uniform(0.0, 1.0, 4)},
    "bump_at": {"own_ball": uniform(0.5, 1.0, 4), "ball": uniform(0.1, 0.6, 4)},
    "image_shift": {"bump": uniform(0.0, 0.5, 4)},
    "pushed_distance": {"distance": share, "squares": powers(-6, 6)},
    "uv_at": {"pushed": uniform(0.0, 0.5, 3)},
    "plane_push": {"radius": uniform(0.1, 2.0), "other": uniform(0.1, 2.0), "distance": share},
    "square_of_push": {"distance": share},
    "pushed_along_ray": {"distance": share, "squares": powers(-6, 6)},
    "apart": {"other": whole(0, DECALS)},
    "is_above": {"other": whole(0, DECALS)},
    "are_nested": {"other": whole(0, DECALS)},
    "are_nested_contact": {"other": whole(0, DECALS)},
    "size_above": {
        **{name: among(0.5, 1, 2) for name in ("size", "other_size")}, "other": whole(0, DECALS),
    },
    "comes_next": {
        "ball": ball, "closest_ball": ball, "lower_size": uniform(0.3, 2.5), "lower": whole(-1, DECALS),
        "tried_size": uniform(0.3, 2.5), "tried": whole(0, DECALS), "closest": whole(0, DECALS),
    },
    "nested_owner": {"closest": whole(0, DECALS), "after": whole(0, DECALS)},
    "kept_owner": {
        "first": kept, "last": kept, "closest": whole(0, DECALS), "after": whole(0, DECALS),
    },
    "sum_of_pushes": {"distance": uniform(0.0, 0.2)},  # before all planes, where z is infinite
    "cell_owner": {"rank": among(1)},
    "log_one_minus": {"w": uniform(0.0, 0.999)},
    "cell_coordinate": {"x": uniform(-1000.0, 1000.0)},
    "cell_hash": dict.fromkeys("xyz", whole(-(2**31), 2**31)),
    **{
        f"{name}_{kind}": {"a": interval(2.0), "b": interval(2.0)}
        for name in OPERATORS
        for kind in ("interval", "keeps")
    },
    **{
        f"{name}_choice": {"a": interval(2.0), "b": interval(2.0)}
        for name in ("blend", "intersection_like", "difference_like", "unclaimed")
    },
    "newton_step": {"gap": uniform(0.0, 0.01), "rise": uniform(-1.0, 3.0), "tolerance": uniform(1e-3, 0.1)},
    "widened_range": {"smallest": field, "largest": field},
    "warp_texel": {"kept": four, "number": whole(0, 6)},
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
        index = self.index.on("cpu", records=self.decals, layered=True)
        index.mapping = int(ImageMapping.CORRECTED)
        return {"decals": self.decals, "index": index}


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


def arguments_of(typed: TypedFunction) -> dict[str, Any]:
    """The same seeded arguments for a function every time, in the types that it takes."""
    rng = np.random.default_rng(7)
    draws = BY_NAME | BY_FUNCTION.get(typed.name, {})
    known: dict[str, Any] = {"tape": texels(rng)}
    if {"decals", "index"} & set(typed.parameters):
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
    if "per_least" in typed.parameters:
        least = uniform(0.0, 0.5)(rng, COUNT)
        spans, divisors = np.maximum(1.0 - 2.0 * least, MIN_SPAN), np.maximum(least, MIN_COMPLEMENT)
        known |= {"least": least, "per_span": 1.0 / spans, "per_least": 1.0 / divisors}
    if typed.name == "arc_over_chord":
        angle = uniform(0.0, 0.5 * np.pi)(rng, COUNT)
        known |= {"sine_squared": np.sin(angle) ** 2, "cosine": np.cos(angle)}
    if typed.name == "image_distance":
        chord = draws["chord"](rng, COUNT)
        known |= {"chord": chord, "rim": chord + (1 - chord) * share(rng, COUNT)}
    if typed.name == "plane_distance":
        known["apart"] = ahead_of(known.setdefault("ray", units(rng, COUNT)), place(rng, COUNT))
    if {"n_p", "n_q"} <= set(typed.parameters):
        normal, other = units(rng, COUNT), units(rng, COUNT)
        opposite = (normal * other).sum(axis=1) < -0.9  # towards −1, no float32 tells the arc
        known |= {"n_p": normal, "n_q": np.where(opposite[:, None], -other, other)}
    drawn = {name: known[name] if name in known else draws[name](rng, COUNT) for name in typed.parameters}
    index = {"index": drawn.pop("index")} if "index" in drawn else {}
    whole_names = {
        name
        for name, hint in typed.parameters.items()
        if name in drawn and numpy_type(element(hint))[0] in (np.int32, np.bool_)
    }
    arrays = {
        name: np.asarray(v, np.int32 if name in whole_names else np.float32) for name, v in drawn.items()
    }
    return index | {name: np.full(COUNT, v) if v.ndim == 0 else v for name, v in arrays.items()}


def ahead_of(ray: Array, apart: Array) -> Array:
    """Neighbours that a ray comes to."""
    ahead = (ray * apart).sum(axis=1, keepdims=True)
    return np.asarray(apart + (0.2 - np.minimum(ahead, 0.2)) * ray)


@lru_cache
def owners() -> Array:
    everything: Any = {
        "index": world().arguments["index"],
        "contact": 0,
        "q": world().points,
        "n_q": world().points,
    }
    return call(owner_at, **everything)
