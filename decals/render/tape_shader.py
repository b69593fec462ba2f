"""The tracing shader for the kinds of nodes that a tape uses; a switch holds nothing else.

An unused case costs as much as a used one on some drivers, and a compile takes tens of milliseconds: so one
program per set of kinds, none per tree.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from blobtree.formulas.vocabulary import BUILT_IN, Vocabulary
from blobtree.tapes.dispatch import partials, rises, slope, warp_forward, warp_pullback, warp_stretch
from blobtree.tapes.evaluate import field_bound, field_gradient
from blobtree.tapes.readings import BOUND, COLOR, GRADIENT, Reading, to_local, turned_to_local
from blobtree.tapes.tape import POP, POP_SWAPPED, PREFIX, PUSH, STRETCHED, UNWARP, WARP, Tape
from blobtree.tracing.rays import trace_ray
from blobtree.typed.glsl import translate_choice, translate_library
from decals.render.entry import GROUP, Entry
from implicit_decals.shaders import Source, compose

_READINGS: dict[str, tuple[Reading, str]] = {
    "bound": (BOUND, "vec3"),
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
    warps: tuple[int, ...]
    warp_registers: int
    vocabulary: Vocabulary = BUILT_IN

    @classmethod
    def of(cls, tape: Tape) -> "Kinds":
        """The kinds that `tape` uses."""
        return cls(
            tape.skeletons,
            tape.operators,
            tape.registers,
            tape.stretched,
            tape.warps,
            tape.warp_registers,
            tape.vocabulary,
        )


@lru_cache(maxsize=256)
def tracing_shader(kinds: Kinds, entry: Entry = Entry.FRAGMENT) -> Source:
    """``trace.frag`` or ``trace.comp`` with the cases of `kinds`."""
    readings = [
        _interpreter(name, reading, glsl_type, kinds) for name, (reading, glsl_type) in _READINGS.items()
    ]
    slots: dict[str, str | Source] = {
        "library": _library(kinds),
        "dispatch": _dispatch(kinds),
        "readings": _joined(readings),
    }
    if entry is Entry.COMPUTE:
        return compose("trace.comp", slots=slots, defines={"GROUP": GROUP}, version="430 core")
    return compose("trace.frag", slots=slots)


def _library(kinds: Kinds) -> str:
    """Every typed function that the shader calls, from the sources that Warp runs."""
    readings = [reading for reading, _ in _READINGS.values()]
    skeletons = [kinds.vocabulary.skeletons[code] for code in kinds.skeletons]
    functions = [
        *(f for skeleton in skeletons for f in (skeleton.closest, skeleton.slimmest)),
        *(f for choices in _choices(kinds).values() for f in choices.values()),
        *(f for reading in readings for f in (reading.leaf, reading.unstretch, reading.combine)),
        *(reading.unwarp for reading in readings if kinds.warps),
        to_local,
        turned_to_local,
        trace_ray,
    ]
    return translate_library(functions, provided=[*_choices(kinds), rises, field_bound, field_gradient])


def _choices(kinds: Kinds) -> dict[Any, dict[int, Any]]:
    """The functions that choose by a code on the tape, and what each chooses among."""
    operators, warps = kinds.vocabulary.operators, kinds.vocabulary.warps
    choices: dict[Any, dict[int, Any]] = {
        partials: {code: operators[code].partials for code in kinds.operators},
        slope: {code: operators[code].slope for code in kinds.operators},
        warp_forward: {code: warps[code].forward for code in kinds.warps},
        warp_pullback: {code: warps[code].pullback for code in kinds.warps},
        warp_stretch: {code: warps[code].stretch for code in kinds.warps},
    }
    return {chooser: among for chooser, among in choices.items() if among}


def _dispatch(kinds: Kinds) -> str:
    """Those functions, each knowing the kinds in use alone."""
    rising = [code for code in kinds.operators if kinds.vocabulary.operators[code].rises]
    test = " || ".join(f"operator == {code}" for code in rising) or "false"
    if len(rising) == len(kinds.operators):
        test = "true"
    choices = (translate_choice(chooser, among) for chooser, among in _choices(kinds).items())
    return "\n".join([*choices, f"bool rises(int operator) {{ return {test}; }}"])


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
            "UNWARP": reading.unwarp.key,
            "COMBINE": reading.combine.key,
            "PRIMITIVE_COLOR": "tape_texel(tape, at - 1)" if reading is COLOR else "vec4(0.0)",
        },
        slots={
            "registers": "".join(
                [
                    *(f"FIELD r{i} = FIELD(0.0);\n" for i in range(kinds.registers)),
                    *(f"vec4 w{i} = vec4(0.0);\n" for i in range(kinds.warp_registers)),
                ]
            ),
            "runs": "".join(_run_cases(kinds)),
            "stack": _stack_cases(kinds.registers) if kinds.registers else "",
            "warps": _warp_cases(kinds.warp_registers) if kinds.warps else "",
        },
    )


def _run_cases(kinds: Kinds) -> Iterable[str]:
    """A loop per kind of skeleton, so that the kind is not asked for inside it."""
    for code in kinds.skeletons:
        skeleton = kinds.vocabulary.skeletons[code]
        names = {
            "closest": skeleton.closest.key,
            "slimmest": skeleton.slimmest.key,
            "aim": "aim" if skeleton.convex else "vec3(0.0)",
            "local_aim": "turned_to_local(aim, tape, map)" if skeleton.convex else "vec3(0.0)",
        }
        yield _RUN.format(code=code, stride=skeleton.parameters + 1, **names)
        if kinds.stretched:
            yield _STRETCHED_RUN.format(
                code=code + STRETCHED,
                **names,
                stride=skeleton.parameters + PREFIX + 1,
                prefix=PREFIX,
            )


_RUN = """\
case {code}:
    for (int i = 0; i < count; i++) {{
        vec4 c = {closest}(place, tape, at);
        float slim = {slimmest}(tape, at);
        at += {stride};
        FIELD field = LEAF(place, {aim}, speed, reach, c, slim, PRIMITIVE_COLOR);
        accumulator = COMBINE(operator_, accumulator, field, reach, header.w);
    }}
    break;
"""

_STRETCHED_RUN = """\
case {code}:
    for (int i = 0; i < count; i++) {{
        int map = at;
        vec3 local = to_local(place, tape, map);
        vec4 c = {closest}(local, tape, map + {prefix});
        float slim = {slimmest}(tape, map + {prefix});
        at += {stride};
        float local_speed = speed * tape_texel(tape, map + {prefix} - 1).x;
        FIELD field = LEAF(local, {local_aim}, local_speed, reach, c, slim, PRIMITIVE_COLOR);
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


def _warp_cases(registers: int) -> str:
    """Entering keeps the place and the speed; leaving returns to them and takes the field along."""
    store = " ".join(f"case {i}: w{i} = vec4(place, speed); break;" for i in range(registers))
    load = " ".join(f"case {i}: kept = w{i}; break;" for i in range(registers))
    return f"""\
case {WARP}: {{
    switch (count) {{ {store} }}
    vec4 p = tape_texel(tape, at + {PREFIX} - 1);
    vec3 local = to_local(place, tape, at);
    speed *= p.x * warp_stretch(operator_, local, reach * speed * p.x, p);
    aim = vec3(0.0);
    place = warp_forward(operator_, local, p);
    at += {PREFIX};
    break;
}}
case {UNWARP}: {{
    vec4 kept = w0;
    switch (count) {{ {load} }}
    place = kept.xyz;
    speed = kept.w;
    aim = count == 0 ? heading : vec3(0.0);
    accumulator = UNWARP(operator_, accumulator, place, tape, at);
    at += {PREFIX};
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
