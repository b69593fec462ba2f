"""The tracing shader for the kinds of nodes that a tape uses; a switch holds nothing else.

An unused case costs as much as a used one on some drivers, and a compile takes tens of milliseconds: so one
program per set of kinds, none per tree.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

from blobtree.evaluate import field_bound, field_gradient
from blobtree.glsl import translate_library
from blobtree.interpreter import (
    BOUND,
    COLOR,
    GRADIENT,
    Reading,
    partials,
    slope,
    to_local,
)
from blobtree.operators import OPERATORS
from blobtree.skeletons import SKELETONS
from blobtree.tape import POP, POP_SWAPPED, PREFIX, PUSH, STRETCHED, Tape
from blobtree.trace import trace_ray
from implicit_decals.shaders import Source, compose

_READINGS: dict[str, tuple[Reading, str]] = {
    "bound": (BOUND, "vec2"),
    "gradient": (GRADIENT, "vec4"),
    "color": (COLOR, "vec4"),
}
"""The readings that a ray needs, and their types in GLSL."""


@dataclass(frozen=True)
class Kinds:
    """What a tracing shader is specialised to."""

    skeletons: tuple[int, ...]
    operators: tuple[int, ...]
    registers: int
    stretched: bool

    @classmethod
    def of(cls, tape: Tape) -> "Kinds":
        """The kinds that `tape` uses."""
        return cls(tape.skeletons, tape.operators, tape.registers, tape.stretched)


@lru_cache(maxsize=256)
def tracing_shader(kinds: Kinds) -> Source:
    """``trace.frag`` with the cases of `kinds`."""
    readings = [
        _interpreter(name, reading, glsl_type, kinds) for name, (reading, glsl_type) in _READINGS.items()
    ]
    return compose(
        "trace.frag",
        slots={"library": _library(kinds), "dispatch": _dispatch(kinds), "readings": _joined(readings)},
    )


def _library(kinds: Kinds) -> str:
    """Every typed function that the shader calls, from the sources that Warp runs."""
    readings = [reading for reading, _ in _READINGS.values()]
    functions = [
        *(SKELETONS[code].closest for code in kinds.skeletons),
        *(
            function
            for code in kinds.operators
            for function in (OPERATORS[code].partials, OPERATORS[code].slope)
        ),
        *(
            function
            for reading in readings
            for function in (reading.leaf, reading.unstretch, reading.combine)
        ),
        to_local,
        trace_ray,
    ]
    return translate_library(functions, provided=[partials, slope, field_bound, field_gradient])


def _dispatch(kinds: Kinds) -> str:
    """`partials` and `slope` of any operator in use."""
    partials_cases = _cases(kinds.operators, [OPERATORS[code].partials.key for code in kinds.operators])
    slope_cases = _cases(kinds.operators, [OPERATORS[code].slope.key for code in kinds.operators])
    return f"""\
vec3 partials(int operator_, float a, float b, float parameter) {{
    {partials_cases.format(arguments="a, b, parameter")}
}}
float slope(int operator_, float slope_a, float slope_b, float max_a, float max_b, float parameter) {{
    {slope_cases.format(arguments="slope_a, slope_b, max_a, max_b, parameter")}
}}
"""


def _cases(codes: Sequence[int], functions: Sequence[str]) -> str:
    """A choice among `functions` by operator; the last needs no test."""
    *tested, last = zip(codes, functions, strict=True)
    choices = [f"if (operator_ == {code}) return {function}({{arguments}});" for code, function in tested]
    return "\n    ".join([*choices, f"return {last[1]}({{arguments}});"])


def _interpreter(name: str, reading: Reading, glsl_type: str, kinds: Kinds) -> Source:
    """The loop of ``interpreter.glsl`` closed over one reading."""
    return compose(
        "interpreter.glsl",
        version=None,
        defines={
            "INTERPRET": f"interpret_{name}",
            "FIELD": glsl_type,
            "LEAF": reading.leaf.key,
            "UNSTRETCH": reading.unstretch.key,
            "COMBINE": reading.combine.key,
            "PRIMITIVE_COLOR": "tape_texel(tape, at - 1)" if reading is COLOR else "vec4(0.0)",
        },
        slots={
            "registers": "".join(f"FIELD r{i} = FIELD(0.0);\n" for i in range(kinds.registers)),
            "runs": "".join(_run_cases(kinds)),
            "stack": _stack_cases(kinds.registers) if kinds.registers else "",
        },
    )


def _run_cases(kinds: Kinds) -> Iterable[str]:
    """A loop per kind of skeleton, so that the kind is not asked for inside it."""
    for code in kinds.skeletons:
        skeleton = SKELETONS[code]
        yield _RUN.format(code=code, closest=skeleton.closest.key, stride=skeleton.parameters + 1)
        if kinds.stretched:
            yield _STRETCHED_RUN.format(
                code=code + STRETCHED,
                closest=skeleton.closest.key,
                stride=skeleton.parameters + PREFIX + 1,
                prefix=PREFIX,
            )


_RUN = """\
case {code}:
    for (int i = 0; i < count; i++) {{
        vec4 c = {closest}(q, tape, at);
        at += {stride};
        accumulator = COMBINE(operator_, accumulator, LEAF(q, c, reach, PRIMITIVE_COLOR), reach, header.w);
    }}
    break;
"""

_STRETCHED_RUN = """\
case {code}:
    for (int i = 0; i < count; i++) {{
        int map = at;
        vec3 local = to_local(q, tape, map);
        vec4 c = {closest}(local, tape, map + {prefix});
        at += {stride};
        FIELD field = LEAF(local, c, reach * tape_texel(tape, map + {prefix} - 1).x, PRIMITIVE_COLOR);
        accumulator = COMBINE(operator_, accumulator, UNSTRETCH(field, tape, map), reach, header.w);
    }}
    break;
"""


def _stack_cases(registers: int) -> str:
    """Registers are scalars behind a switch: an indexed array costs several times as much."""
    store = " ".join(f"case {i}: r{i} = accumulator; break;" for i in range(registers))
    load = " ".join(f"case {i}: kept = r{i}; break;" for i in range(registers))
    return f"""\
case {PUSH}:
    switch (count) {{ {store} }}
    accumulator = FIELD(0.0);
    break;
case {POP}:
case {POP_SWAPPED}: {{
    FIELD kept = r0;
    switch (count) {{ {load} }}
    accumulator = int(header.x) == {POP}
        ? COMBINE(operator_, kept, accumulator, reach, header.w)
        : COMBINE(operator_, accumulator, kept, reach, header.w);
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
