"""GLSL over arrays: a program per function, one fragment per row."""

from collections.abc import Mapping
from typing import Any

import moderngl
import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.formulas.falloff import FALLOFFS
from blobtree.tape.codes import OPERATORS, SKELETONS, WARPS
from blobtree.transpile.builtins import type_name
from blobtree.transpile.glsl import uniforms_of
from decals.rendering import Context
from decals.rendering.data_texture import ROW_TEXELS, DataTexture
from decals.rendering.tracing_shader import Kinds
from tests.blobtree.transpile.warp_functions import TypedFunction

AGREEMENT = 1e-5
"""Largest relative difference between the two languages, or absolute one below 1."""
ALL_KINDS = Kinds(
    tuple(range(len(SKELETONS))),
    tuple(range(len(OPERATORS))),
    6,
    stretched=True,
    warps=tuple(range(len(WARPS))),
    warp_registers=4,
    falloffs=tuple(range(len(FALLOFFS))),
)
"""All that a tape of core kinds can hold, in one program."""
VERTEX = """#version 330 core
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
"""
_SWIZZLES = {
    "float": ".x",
    "vec2": ".xy",
    "vec3": ".xyz",
    "vec4": "",
    "ivec4": "",
    "int": ".x",
    "bool": ".x != 0",
}
_RESULTS = {
    "float": "vec4({}, 0.0, 0.0, 0.0)",
    "vec2": "vec4({}, 0.0, 0.0)",
    "vec3": "vec4({}, 0.0)",
    "vec4": "{}",
    "int": "ivec4({}, 0, 0, 0)",
    "bool": "ivec4(int({}), 0, 0, 0)",
    "uint": "ivec4(int({}), 0, 0, 0)",
    "ivec2": "ivec4({}, 0, 0)",
}


def fetch(name: str, glsl_type: str) -> str:
    """The fragment's own row of a texture."""
    return f"texelFetch({name}, ivec2(gl_FragCoord.xy), 0){_SWIZZLES[glsl_type]}"


def rows(array: NDArray[Any]) -> NDArray[Any]:
    """`array` as a data texture takes it: int32[n], or float32[n, 4] padded with zeros."""
    if array.dtype.kind in "iu" and array.shape[1:] in ((), (4,)):
        return array.astype(np.int32)
    if not len(array):
        return np.zeros((1, 4), np.float32)
    columns = array.reshape(len(array), -1).astype(np.float32)
    return np.pad(columns, ((0, 0), (0, 4 - columns.shape[1])))


_last_program: tuple[Context, str, moderngl.Program] | None = None
"""The program of the last call: to compile a program takes a driver longer than to run it."""


def program_of(context: Context, fragment: str) -> moderngl.Program:
    """The compiled program of a fragment shader: that of the last call if the text is the same."""
    global _last_program
    if _last_program is None or _last_program[0] is not context or _last_program[1] != fragment:
        if _last_program is not None and _last_program[0] is context:
            _last_program[2].release()
        program = context.gl.program(vertex_shader=VERTEX, fragment_shader=fragment)
        _last_program = (context, fragment, program)
    return _last_program[2]


def run_program(
    context: Context,
    fragment: str,
    count: int,
    textures: Mapping[str, NDArray[Any]],
    uniforms: Mapping[str, object],
    *,
    whole_numbers: bool = False,
) -> NDArray[Any]:
    """What `fragment` writes for rows 0 to count − 1: float32[count, 4] or int32[count, 4]."""
    gl = context.gl
    program = program_of(context, fragment)
    held = [DataTexture(context, array) for array in textures.values()]
    for unit, (name, texture) in enumerate(zip(textures, held, strict=True)):
        texture.use(unit)
        if name in program:
            program[name] = unit
    for name, value in uniforms.items():
        if name in program:
            program[name] = value
    kind = "i4" if whole_numbers else "f4"
    image = gl.texture((ROW_TEXELS, -(-count // ROW_TEXELS)), 4, dtype=kind)
    target = gl.framebuffer([image])
    target.viewport = (0, 0, min(count, ROW_TEXELS), image.height)  # the rest of a row is not computed
    target.use()
    gl.enable_only(moderngl.NOTHING)
    vertices = gl.vertex_array(program, [])
    vertices.render(vertices=3)
    seen = (
        np.frombuffer(image.read(), np.int32 if whole_numbers else np.float32).reshape(-1, 4)[:count].copy()
    )
    made: list[Any] = [vertices, target, image, *held]
    for thing in made:
        thing.release()
    return seen


def through_glsl(
    context: Context, typed: TypedFunction, library: str, arguments: Mapping[str, Any], count: int
) -> NDArray[Any]:
    """Call `typed` for row i of every argument, for all i; arrays and structs are passed whole."""
    uniforms, expressions = [], []
    textures: dict[str, NDArray[Any]] = {}
    numbers: dict[str, Any] = {}
    for name, hint in typed.parameters.items():
        fields = uniforms_of(hint)
        if fields is not None:
            for field, uniform in fields.items():
                value = getattr(arguments[name], field)
                uniforms.append(
                    f"uniform {uniform.type.replace('ivec4_sampler', 'isampler2D')} {uniform.code};"
                )
                if isinstance(value, wp.array):
                    textures[uniform.code] = rows(value.numpy())
                else:
                    numbers[uniform.code] = value
            continue
        textures[f"x_{name}"] = rows(arguments[name])
        glsl_type = str(type_name(hint))
        if isinstance(hint, wp.array):
            uniforms.append(f"uniform {glsl_type.replace('ivec4_sampler', 'isampler2D')} x_{name};")
            expressions.append(f"x_{name}")
        else:
            uniforms.append(
                f"uniform {'isampler2D' if glsl_type in ('int', 'ivec4', 'bool') else 'sampler2D'} x_{name};"
            )
            expressions.append(fetch(f"x_{name}", glsl_type))
    returned = str(type_name(typed.returned))
    result = _RESULTS[returned].format(f"{typed.name}({', '.join(expressions)})")
    whole = result.startswith("ivec4")
    out = f"out {'ivec4' if whole else 'vec4'} result;"
    main = f"void main() {{ result = {result}; }}"
    source = "\n".join(["#version 330 core", *uniforms, out, library, main, ""])
    return run_program(context, source, count, textures, numbers, whole_numbers=whole)
