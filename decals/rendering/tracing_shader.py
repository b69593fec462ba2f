"""Shaders that trace BlobTrees, each for a set of kinds of nodes.

An unused case of a shader costs as much as a used one on some drivers, and a compile takes tens of
milliseconds: so one program per set of kinds, none per tree.
"""

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import warp as wp

from blobtree.declare.skeleton import Skeleton
from blobtree.tape.codes import FIELD, POP, POP_SWAPPED, PREFIX, PUSH, STRETCHED, UNWARP, WARP
from blobtree.tape.dispatch import (
    directed_partials,
    directed_slope,
    falloff_numbers,
    falloff_slope,
    falloff_value,
    has_distances,
    is_distance,
    is_monotone,
    is_windowed,
    kind_bounds,
    kind_distance_along,
    kind_distance_at,
    kind_value_gradient,
    paints,
    partials,
    reads_gradients,
    slope,
    warp_forward,
    warp_pullback,
    warp_stretch,
)
from blobtree.tape.evaluators import (
    BOUND,
    COLOR,
    GRADIENT,
    Evaluator,
    bound_way,
    direct_value_gradient,
    direction_to_local,
    to_local,
    way_between,
    way_end,
    way_outside,
)
from blobtree.tape.extras import gradient_evaluators, gradient_steps
from blobtree.tape.instruction_set import InstructionSet, core
from blobtree.tape.interpreter import field_bound, field_gradient
from blobtree.tape.tape import Tape
from blobtree.tracing.ray_kernels import passed_way, trace_ray
from blobtree.transpile.derivative import directional_derivative
from blobtree.transpile.glsl import translate_choice, translate_library
from blobtree.transpile.specialize import row_choice
from decals.rendering.pixel_pass import GROUP, PassBackend
from decals.shaders import Source, compose

_EVALUATORS: dict[str, tuple[Evaluator, str]] = {
    "bound": (BOUND, "vec3"),
    "gradient": (GRADIENT, "vec4"),
    "color": (COLOR, "vec4"),
}
"""The evaluators that a ray needs, and their types in GLSL."""

LONGEST_COPIED = 40_000
"""Characters of kinds up to which NVIDIA's compiler may copy functions into their callers.

On an H200 it takes 1.5 s for 34,000 characters, 22 s for 50,000 and 150 s for 97,000. With calls in their
place it takes at most 2 s, and rays take two to six times as long.
"""

_ALONG: dict[Any, tuple[str, ...]] = {
    directed_partials: ("a", "b", "direction_a", "direction_b"),
    warp_forward: ("q",),
    warp_pullback: ("q", "g"),
    kind_value_gradient: ("q",),
    falloff_value: ("distance",),
    falloff_slope: ("distance",),
}
"""Choices by a code of which their gradient needs derivatives, and the parameters that vary."""


_CHOOSERS = (
    warp_forward,
    warp_pullback,
    warp_stretch,
    kind_value_gradient,
    kind_bounds,
    kind_distance_at,
    kind_distance_along,
    falloff_value,
    falloff_slope,
)
"""Functions that choose by a code, beside those of operators."""


@dataclass(frozen=True)
class Kinds:
    """What a tracing shader is specialised to."""

    skeletons: tuple[int, ...]
    operators: tuple[int, ...]
    registers: int
    stretched: bool
    warps: tuple[int, ...]
    warp_registers: int
    fields: tuple[int, ...] = ()
    instruction_set: InstructionSet = field(default_factory=core)
    falloffs: tuple[int, ...] = ()
    """Codes of the falloffs of primitives with a profile."""

    @property
    def directed(self) -> bool:
        """True if an operator reads the gradients of its operands."""
        return self.instruction_set.reads_gradients

    @classmethod
    def of(cls, tape: Tape) -> "Kinds":
        """Return the kinds that `tape` uses."""
        return cls(*(getattr(tape, name) for name in cls.__dataclass_fields__))


@lru_cache(maxsize=32)
def tracing_shader(
    kinds: Kinds,
    backend: PassBackend = PassBackend.FRAGMENT,
    *,
    guarded: bool = False,
    resuming: bool = False,
) -> Source:
    """``trace.frag`` or ``trace.comp`` with the cases of `kinds`.

    `guarded` ones report ended loops, and those that are `resuming` go on where loops were ended.
    """
    slots = tracing_slots(kinds)
    defines = {"GUARDED": guarded, "RESUMING": resuming, "MANY_KINDS": many_kinds(slots)}
    if backend is PassBackend.COMPUTE:
        return compose("trace.comp", slots=slots, defines={"GROUP": GROUP, **defines}, version="430 core")
    return compose("trace.frag", slots=slots, defines=defines, version="420 core" if guarded else "330 core")


def tracing_slots(kinds: Kinds, functions: Iterable[Any] = ()) -> dict[str, str | Source]:
    """Return the fillings of ``trace.glsl``; the library has these typed functions too."""
    evaluators = [
        _interpreter(name, evaluator, glsl_type, kinds)
        for name, (evaluator, glsl_type) in _evaluators(kinds).items()
    ]
    if kinds.directed:
        evaluators += [_interpreter_along(kinds), compose("directed.glsl", version=None)]
    return {
        "library": _library(kinds, functions),
        "dispatch": _dispatch(kinds),
        "evaluators": _joined(evaluators),
    }


def many_kinds(slots: Mapping[str, str | Source]) -> bool:
    """Return True for fillings of ``trace.glsl`` that are too long to be copied into their callers."""
    return sum(len(str(text)) for text in slots.values()) > LONGEST_COPIED


def _evaluators(kinds: Kinds) -> dict[str, tuple[Evaluator, str]]:
    """Return the evaluators; where operators read gradients, ``directed.glsl`` adds the gradient to them."""
    if not kinds.directed:
        return _EVALUATORS
    bound, color = gradient_evaluators()
    return {"directed_bound": (bound, "mat2x4"), "directed_color": (color, "mat2x4")}


def _library(kinds: Kinds, others: Iterable[Any]) -> str:
    """Every typed function that the shader calls, from the sources that Warp runs."""
    evaluators = [evaluator for evaluator, _ in _evaluators(kinds).values()]
    skeletons = [kinds.instruction_set.skeletons[code] for code in kinds.skeletons]
    functions = [
        *(f for skeleton in skeletons for f in (skeleton.closest, skeleton.min_influence)),
        *(
            f
            for one in skeletons
            for f in (one.depth, one.own_influence_near, one.apart)
            if isinstance(f, wp.Function)
        ),
        *(f for choices in _choices(kinds).values() for f in choices.values()),
        *(
            f
            for evaluator in evaluators
            for f in (evaluator.leaf, evaluator.pullback_affine, evaluator.combine)
        ),
        *(evaluator.pullback_warp for evaluator in evaluators if kinds.warps),
        *(evaluator.direct for evaluator in evaluators if kinds.fields),
        *(evaluator.profiled_leaf for evaluator in evaluators if kinds.falloffs),
        *(_functions_along(kinds, skeletons) if kinds.directed else ()),
        to_local,
        direction_to_local,
        way_between,
        way_end,
        way_outside,
        trace_ray,
        *others,
    ]
    provided = [*_choices(kinds), *_flags(kinds), falloff_numbers, field_bound, field_gradient, passed_way]
    return translate_library(functions, provided=provided)


def _functions_along(kinds: Kinds, skeletons: list[Skeleton]) -> Iterable[Any]:
    """Yield the functions of `_interpreter_along`."""
    along = gradient_steps()
    yield from (directional_derivative(skeleton.closest, ["q"]) for skeleton in skeletons)
    yield from (along.leaf_along, along.pullback_affine_along, along.combine_along)
    if kinds.falloffs:
        yield along.profiled_leaf_along
    if kinds.warps:
        yield along.pullback_warp_along
    if kinds.fields:
        yield directional_derivative(direct_value_gradient, ["q"])


def _choices(kinds: Kinds) -> dict[Any, dict[int, Any]]:
    """Return the functions that choose by a code on the tape, and their alternatives in use."""
    of_operators = (directed_partials, directed_slope) if kinds.directed else (partials, slope)
    choosers = (*of_operators, *_CHOOSERS)
    used = {chooser: among for chooser in choosers if (among := _in_use(chooser, kinds))}
    if not kinds.directed:
        return used
    derivatives = {
        directional_derivative(chooser, names): {
            code: _derivative_like(choice, chooser, names) for code, choice in used[chooser].items()
        }
        for chooser, names in _ALONG.items()
        if chooser in used
    }
    return used | derivatives


def _in_use(chooser: Any, kinds: Kinds) -> dict[int, Any]:
    """Return what a function returns or calls for each code in use."""
    choice = row_choice(chooser)
    assert choice is not None
    rows = getattr(kinds.instruction_set, choice.table)
    return {code: getattr(rows[code], choice.attribute) for code in getattr(kinds, choice.table)}


def _derivative_like(choice: Any, chooser: Any, names: tuple[str, ...]) -> Any:
    """Return the derivative of a choice by the parameters at the places of the chooser's own.

    A choice may have other names, and fewer parameters. It has none for the chooser's code.
    """
    places = list(inspect.signature(chooser.func).parameters)[1:]
    own = dict(zip(places, inspect.signature(choice.func).parameters, strict=False))
    return directional_derivative(choice, [own[name] for name in names if name in own])


def _dispatch(kinds: Kinds) -> str:
    """Those functions, each knowing the kinds in use alone."""
    flags = (_flag(flag.key, _in_use(flag, kinds)) for flag in _flags(kinds))
    choices = (translate_choice(chooser, among) for chooser, among in _choices(kinds).items())
    return "\n".join([*choices, *flags, _falloff_numbers(kinds)])


def _flags(kinds: Kinds) -> list[Any]:
    """Return the functions of a code that return a bool."""
    return [
        *(is_monotone, paints, is_distance, is_windowed, has_distances),
        *([reads_gradients] * kinds.directed),
    ]


def _flag(name: str, values: dict[int, bool]) -> str:
    """Return a function of a code in use that returns its value."""
    test = " || ".join(f"code == {code}" for code, value in values.items() if value) or "false"
    return f"bool {name}(int code) {{ return {'true' if all(values.values()) else test}; }}"


def _falloff_numbers(kinds: Kinds) -> str:
    """`falloff_numbers` for the falloffs in use."""
    numbers = _in_use(falloff_numbers, kinds).items()
    cases = " ".join(f"if (kind == {code}) {{ return vec3{row!r}; }}" for code, row in numbers)
    return f"vec3 falloff_numbers(int kind) {{ {cases} return vec3(0.0); }}"


def _interpreter(name: str, evaluator: Evaluator, glsl_type: str, kinds: Kinds) -> Source:
    """Return the loop of ``interpreter.glsl`` closed over one evaluator."""
    colored = name in ("color", "directed_color")
    defines = {
        "INTERPRET": f"interpret_{name}",
        "FIELD": glsl_type,
        "LEAF": evaluator.leaf.key,
        "DIRECT": evaluator.direct.key,
        "PROFILED_LEAF": evaluator.profiled_leaf.key,
        "PULLBACK_AFFINE": evaluator.pullback_affine.key,
        "PULLBACK_WARP": evaluator.pullback_warp.key,
        "COMBINE": evaluator.combine.key,
        "PRIMITIVE_COLOR": "tape_texel(tape, at - 1)" if colored else "vec4(0.0)",
    }
    runs = _run_cases(kinds, bounds=evaluator.way is bound_way)
    return _loop(kinds, defines, runs, "vec4 w{i} = vec4(0.0);\n", _warp_cases)


def _loop(
    kinds: Kinds,
    defines: Mapping[str, str],
    runs: Iterable[str],
    warp_register: str,
    warp_cases: Callable[[int], str],
) -> Source:
    """Return ``interpreter.glsl`` with the cases of `kinds`; `warp_register` declares register i of warps."""
    registers = [f"FIELD r{i} = FIELD(0.0);\n" for i in range(kinds.registers)]
    registers += [warp_register.format(i=i) for i in range(kinds.warp_registers)]
    slots = {
        "registers": "".join(registers),
        "runs": "".join(runs),
        "stack": _stack_cases(kinds.registers) if kinds.registers else "",
        "warps": warp_cases(kinds.warp_registers) if kinds.warps else "",
    }
    return compose("interpreter.glsl", version=None, defines=defines, slots=slots)


def _run_cases(kinds: Kinds, *, bounds: bool) -> Iterable[str]:
    """Return one loop per kind of skeleton, so that no loop branches on the kind.

    Bounds on slopes read the depth in solid skeletons, and the distance from tapered ones.
    """
    for code in kinds.skeletons:
        skeleton = kinds.instruction_set.skeletons[code]
        smallest = skeleton.min_influence.key
        influence, mapped_influence = f"{smallest}(tape, at)", f"{smallest}(tape, map + {PREFIX})"
        if bounds and skeleton.own_influence_near is not None:
            near = skeleton.own_influence_near.key
            influence, mapped_influence = (
                f"{near}(tape, at, point, c)",
                f"{near}(tape, map + {PREFIX}, local, c)",
            )
        way, mapped_way = "vec4(0.0, 0.0, 0.0, reach)", "vec4(0.0, 0.0, 0.0, reach)"
        if skeleton.convex:
            way, mapped_way = (
                "vec4(local_direction, reach)",
                "vec4(direction_to_local(local_direction, tape, map), reach)",
            )
        if bounds and isinstance(skeleton.apart, wp.Function):
            away = skeleton.apart.key
            way = f"way_between({way}, squared_distance(point, c), {away}(way_end(point, {way}), tape, at))"
            mapped_way = (
                f"way_between({mapped_way}, squared_distance(local, c), "
                f"{away}(way_end(local, {mapped_way}), tape, map + {PREFIX}))"
            )
        if bounds and isinstance(skeleton.depth, wp.Function):
            depth = skeleton.depth.key
            way = f"way_outside({way}, {depth}(point, tape, at), speed)"
            mapped_way = f"way_outside({mapped_way}, {depth}(local, tape, map + {PREFIX}), speed * profile.x)"
        closest = skeleton.closest.key
        yield _run_case(code, _RUN, stride=skeleton.stride, closest=closest, way=way, influence=influence)
        if kinds.stretched:
            field = _PROFILED_FIELD if kinds.falloffs else _MAPPED_FIELD
            yield _run_case(
                code + STRETCHED,
                _STRETCHED_RUN,
                stride=skeleton.stride + PREFIX,
                field=field,
                closest=closest,
                way=mapped_way,
                influence=mapped_influence,
            )
    for code in kinds.fields:
        stride = kinds.instruction_set.fields[code].stride + PREFIX
        yield _run_case(code + FIELD, _DIRECT_RUN, stride=stride, kind=code)


def _interpreter_along(kinds: Kinds) -> Source:
    """Return the loop of ``interpreter.glsl`` for the derivative of (value, direction) along `direction`."""
    along = gradient_steps()
    defines = {
        "INTERPRET": "interpret_along",
        "FIELD": "mat2x4",
        "PULLBACK_AFFINE": _key(along.pullback_affine_along),
        "PULLBACK_WARP": _key(along.pullback_warp_along),
        "COMBINE": _key(along.combine_along),
    }
    register = "vec3 w{i} = vec3(0.0); vec3 v{i} = vec3(0.0);\n"
    return _loop(kinds, defines, _run_cases_along(kinds), register, _warp_cases_along)


def _key(function: Any) -> str:
    """Return the name of a typed function in shaders."""
    return str(function.key)


def _run_cases_along(kinds: Kinds) -> Iterable[str]:
    """Return the cases of `_run_cases` for derivatives; `local_direction` is the velocity of the point."""
    along = gradient_steps()
    for code in kinds.skeletons:
        skeleton = kinds.instruction_set.skeletons[code]
        closest = directional_derivative(skeleton.closest, ["q"]).key
        yield _run_case(
            code, _RUN_ALONG, stride=skeleton.stride, closest=closest, leaf=_key(along.leaf_along)
        )
        if kinds.stretched:
            field = f"{_key(along.leaf_along)}(local, velocity, c, drift)"
            if kinds.falloffs:
                profiled = f"{_key(along.profiled_leaf_along)}(local, velocity, c, drift, profile)"
                field = f"profile.z == 0.0 ? {field} : {profiled}"
            stride = skeleton.stride + PREFIX
            yield _run_case(
                code + STRETCHED, _STRETCHED_RUN_ALONG, stride=stride, closest=closest, field=field
            )
    for code in kinds.fields:
        direct = _key(directional_derivative(direct_value_gradient, ["q"]))
        stride = kinds.instruction_set.fields[code].stride + PREFIX
        yield _run_case(code + FIELD, _DIRECT_RUN_ALONG, stride=stride, kind=code, direct=direct)


def _run_case(code: int, body: str, **names: str | int) -> str:
    """Return the case of a run: `body` computes the field of each primitive, and they are combined."""
    return f"""\
case {code}:
    do {{
{body.format(prefix=PREFIX, **names)}\
        accumulator = COMBINE(operator_, accumulator, field, reach, header.w, tape);
    }} while (--count > 0);
    break;
"""


_RUN_ALONG = """\
        vec4 c;
        vec4 drift;
        {closest}(point, local_direction, tape, at, c, drift);
        at += {stride};
        FIELD field = {leaf}(point, local_direction, c, drift);
"""

_STRETCHED_RUN_ALONG = """\
        int map = at;
        vec3 local = to_local(point, tape, map);
        vec3 velocity = direction_to_local(local_direction, tape, map);
        vec4 profile = tape_texel(tape, map + {prefix} - 1);
        vec4 c;
        vec4 drift;
        {closest}(local, velocity, tape, map + {prefix}, c, drift);
        at += {stride};
        FIELD field = {field};
        field = PULLBACK_AFFINE(field, tape, map);
"""

_DIRECT_RUN_ALONG = """\
        int map = at;
        vec3 local = to_local(point, tape, map);
        vec3 velocity = direction_to_local(local_direction, tape, map);
        vec4 f;
        vec4 change_of_f;
        {direct}({kind}, local, velocity, tape, map + {prefix}, f, change_of_f);
        at += {stride};
        FIELD field = PULLBACK_AFFINE(FIELD(f, change_of_f), tape, map);
"""

_RUN = """\
        vec4 c = {closest}(point, tape, at);
        float rate = speed / {influence};
        vec4 ahead = {way};
        at += {stride};
        FIELD field = LEAF(point, c, PRIMITIVE_COLOR, ahead, rate);
"""

_STRETCHED_RUN = """\
        int map = at;
        vec3 local = to_local(point, tape, map);
        vec4 c = {closest}(local, tape, map + {prefix});
        vec4 profile = tape_texel(tape, map + {prefix} - 1);
        float rate = speed * profile.x / {influence};
        vec4 ahead = {way};
        at += {stride};
        FIELD field = {field};
        field = PULLBACK_AFFINE(field, tape, map);
"""

_MAPPED_FIELD = "LEAF(local, c, PRIMITIVE_COLOR, ahead, rate)"

_PROFILED_FIELD = (
    f"profile.z == 0.0 ? {_MAPPED_FIELD} : PROFILED_LEAF(local, c, PRIMITIVE_COLOR, ahead, rate, profile)"
)


_DIRECT_RUN = """\
        int map = at;
        vec3 local = to_local(point, tape, map);
        vec3 along = direction_to_local(local_direction, tape, map);
        float local_speed = speed * tape_texel(tape, map + {prefix} - 1).x;
        at += {stride};
        FIELD field = DIRECT(
            {kind}, local, tape, map + {prefix}, PRIMITIVE_COLOR, vec4(along, reach), local_speed);
        field = PULLBACK_AFFINE(field, tape, map);
"""


def _stack_cases(registers: int) -> str:
    """Return registers as scalars behind conditions: an indexed array costs several times as much.

    A switch is a loop to Mesa, whose software rasteriser bounds the turns of all loops of a pixel.
    """
    store = " ".join(f"if (count == {i}) {{ r{i} = accumulator; }}" for i in range(registers))
    load = " ".join(f"if (count == {i}) {{ kept = r{i}; }}" for i in range(1, registers))
    return f"""\
case {PUSH}:
    {store}
    accumulator = FIELD(0.0);
    break;
case {POP}:
case {POP_SWAPPED}: {{
    FIELD kept = r0;
    {load}
    accumulator = int(header.x) == {POP}
        ? COMBINE(operator_, kept, accumulator, reach, header.w, tape)
        : COMBINE(operator_, accumulator, kept, reach, header.w, tape);
    break;
}}
"""


def _warp_cases(registers: int) -> str:
    """Entering keeps the point and the speed; leaving returns to them and takes the field along."""
    store = " ".join(f"case {i}: w{i} = vec4(point, speed); break;" for i in range(registers))
    load = " ".join(f"case {i}: kept = w{i}; break;" for i in range(registers))
    return f"""\
case {WARP}: {{
    switch (count) {{ {store} }}
    vec3 local = to_local(point, tape, at);
    speed *= tape_texel(tape, at + 3).x;
    speed *= warp_stretch(operator_, local, reach * speed, tape, at + 3);
    local_direction = vec3(0.0);
    point = warp_forward(operator_, local, tape, at + 3);
    at += {PREFIX} + int(header.w);
    break;
}}
case {UNWARP}: {{
    vec4 kept = w0;
    switch (count) {{ {load} }}
    point = kept.xyz;
    speed = kept.w;
    local_direction = count == 0 ? direction : vec3(0.0);
    accumulator = PULLBACK_WARP(operator_, accumulator, point, tape, at);
    at += {PREFIX} + int(header.w);
    break;
}}
"""


def _warp_cases_along(registers: int) -> str:
    """Do the same for derivatives: entering keeps the velocity of the point too."""
    store = " ".join(f"case {i}: w{i} = point; v{i} = local_direction; break;" for i in range(registers))
    load = " ".join(f"case {i}: point = w{i}; local_direction = v{i}; break;" for i in range(registers))
    forward = directional_derivative(warp_forward, ["q"]).key
    return f"""\
case {WARP}: {{
    switch (count) {{ {store} }}
    vec3 local = to_local(point, tape, at);
    vec3 velocity = direction_to_local(local_direction, tape, at);
    {forward}(operator_, local, velocity, tape, at + 3, point, local_direction);
    at += {PREFIX} + int(header.w);
    break;
}}
case {UNWARP}: {{
    switch (count) {{ {load} }}
    accumulator = PULLBACK_WARP(operator_, accumulator, point, local_direction, tape, at);
    at += {PREFIX} + int(header.w);
    break;
}}
"""


def _joined(sources: Iterable[Source]) -> Source:
    """Several sources one after the other, every line keeping its origin."""
    parts = list(sources)
    return Source(
        tuple(line for part in parts for line in part.lines),
        tuple(origin for part in parts for origin in part.origins),
    )
