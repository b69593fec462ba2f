"""Shaders of a page, in the GLSL of WebGL 2: those of surfaces, and those of decals and light."""

from dataclasses import replace
from typing import Any

from decals.hosts.code import VERSIONS, code_of
from decals.hosts.shader import RECEIVERS, Shader
from decals.record import Contact
from decals.rendering.light_pass import light_text, light_variant
from decals.rendering.options import Drawing
from decals.rendering.tracing_shader import Kinds, tracing_slots
from decals.shaders import Source, compose

VERSION = "300 es"

PREFIX = "decal_"
"""Beginning of the names of decals in the page's shaders."""


def mesh_program(*, textured: bool) -> list[str]:
    """Return the vertex and the fragment shader that draw a mesh into the G-buffer."""
    names = "base_mesh.vert", "base_mesh.frag"
    return [_whole(compose(name, defines={"TEXTURED": textured}, version=None)) for name in names]


def tree_program(kinds: Kinds) -> list[str]:
    """Return the vertex and the fragment shader that trace trees of some kinds of nodes into the G-buffer."""
    traced = compose("trace.frag", slots=tracing_slots(kinds), version=None)
    return [_whole(compose("box.vert", version=None)), _whole(traced)]


def picture_programs(code: Shader, drawing: Drawing) -> dict[str, Any]:
    """Return the vertex shader of the picture, and the parts of its fragment shaders: of modes, and the ends.

    The plain form of a mode is fast, and the full one is right for all decals that an edit can make.
    """
    slots, defines = light_text(
        **light_variant(drawing.lights, drawing.environment, materials=code.form.materials)
    )
    full = replace(code.form, layered=True, limited=True, nested=True)
    return {
        "screen": _whole(compose("screen.vert", version=None)),
        "modes": {
            mode.name.lower(): {
                "plain": _decals(code, replace(code.form, contact=mode)),
                "full": _decals(code, replace(full, contact=mode)),
            }
            for mode in Contact
        },
        "ends": {
            "color": compose("page.frag", slots=slots, defines=defines, version=None).text,
            "pick": compose("page.frag", slots=slots, defines={**defines, "PICK": True}, version=None).text,
        },
    }


def _whole(source: Source) -> str:
    language = VERSIONS[VERSION]
    return language.header + language.precision + source.text


def _decals(code: Shader, form: Any) -> str:
    """Return the beginning of a shader with the decals of a form; each pixel sets the mask of its object."""
    text = code.header + code_of(form, code.version, code.stage, code.prefix).text
    declaration = f"int {PREFIX}{RECEIVERS};"
    own = text.replace(f"uniform {declaration}", declaration)
    return own if own != text else f"{text}{declaration}\n"
