"""GLSL of decals for other programs: each form of decals in each version of the language."""

import re
from functools import lru_cache
from typing import NamedTuple

from blobtree.transpile.builtins import RESERVED_WORDS
from decals.rendering.decal_library import Form, decal_library
from decals.shaders import compose
from decals.shaders.isolate import (
    Declaration,
    declarations,
    prefixed,
    prefixed_name,
    preprocessed,
    reachable,
    replaced,
)

FUNCTIONS = "decal_color", "decal_material", "decal_owner"
"""Functions of ``shaders/exported_decals.glsl`` that a host calls; their names begin with its prefix."""

STAGES = "fragment", "vertex", "compute"
"""Stages of a shader. Only that of fragments has derivatives."""

SAMPLERS = {
    "sampler2D": "texture2D",
    "isampler2D": "itexture2D",
    "sampler2DArray": "texture2DArray",
}
"""Types of textures, and those where samplers are apart from textures."""

FIRST_TEXTURE = 2
"""Binding of the first texture where they have numbers, behind the block of uniforms and the sampler."""


class Version(NamedTuple):
    """A version of GLSL.

    Attributes
    ----------
    header
        Lines with which a whole shader begins.
    stages
        Stages that it has.
    precision
        Statements of precision, with which the code begins.
    apart
        True if samplers are apart from textures, and uniforms in a block, as SPIR-V and WGSL have them.
    """

    header: str
    stages: tuple[str, ...] = STAGES[:2]
    precision: str = ""
    apart: bool = False


VERSIONS = {
    "330 core": Version("#version 330 core\n"),
    "300 es": Version(
        "#version 300 es\n",
        precision="".join(f"precision highp {name};\n" for name in ("float", "int", *SAMPLERS)),
    ),
    "450": Version(
        "#version 450\n#extension GL_EXT_samplerless_texture_functions : require\n", STAGES, apart=True
    ),
}
"""Versions of GLSL by their names."""


class Code(NamedTuple):
    """The code of a form, and the names in it of textures and of other uniforms by those in our own files."""

    text: str
    textures: dict[str, str]
    uniforms: dict[str, str]


@lru_cache(64)
def code_of(form: Form, version: str, stage: str, prefix: str) -> Code:
    """Return the code of a form; ComposeError if two names would be the same with the prefix."""
    defines = {"MATERIALS": form.materials, "FRAGMENT": stage == "fragment"}
    slots = {"functions": decal_library(form)}
    source = compose("exported_decals.glsl", slots=slots, defines=defines, version=None)
    parts = reachable(declarations(preprocessed(source.text)), FUNCTIONS)
    uniforms = [part for part in parts if part.kind == "uniform"]
    textures = [part for part in uniforms if type_of(part) in SAMPLERS]
    language = VERSIONS[version]
    written = prefixed(parts, prefix, RESERVED_WORDS)
    text = _apart(written, prefix) if language.apart else _joined(written)
    names = {part.name: prefixed_name(part.name, prefix) for part in uniforms}
    return Code(
        language.precision + text,
        {part.name: names[part.name] for part in textures},
        {part.name: names[part.name] for part in uniforms if part not in textures},
    )


def type_of(uniform: Declaration) -> str:
    """Return the type of a uniform."""
    return uniform.code.split()[1]


def _joined(parts: list[Declaration]) -> str:
    """Return declarations as one text, with an empty line around those of several lines."""
    text = ""
    for part in parts:
        text += f"\n{part.text}\n\n" if "\n" in part.text else f"{part.text}\n"
    return re.sub(r"\n{3,}", "\n\n", text)


def _apart(parts: list[Declaration], prefix: str) -> str:
    """Return declarations with samplers apart from textures, and with numbers in a block of uniforms."""
    place, sampler = f"set = {prefix}SET, binding = {prefix}BINDING", f"{prefix}sampler"
    uniforms = [part for part in parts if part.kind == "uniform"]
    textures = [part for part in uniforms if type_of(part) in SAMPLERS]
    numbers = [part.code.removeprefix("uniform ") for part in uniforms if part not in textures]
    head = "".join(
        f"#ifndef {prefix}{name}\n#define {prefix}{name} 0\n#endif\n" for name in ("SET", "BINDING")
    )
    members = "".join(f"    {number}\n" for number in numbers)
    head += f"layout(std140, {place}) uniform {prefix}Uniforms {{\n{members}}};\n"
    head += f"layout({place} + 1) uniform sampler {sampler};\n"
    for binding, part in enumerate(textures, FIRST_TEXTURE):
        head += f"layout({place} + {binding}) {replaced(part.code, SAMPLERS)}\n"
    body = replaced(_joined([part for part in parts if part.kind != "uniform"]), SAMPLERS)
    return head + re.sub(r"\btextureGrad\((\w+),", rf"textureGrad(sampler2DArray(\1, {sampler}),", body)
