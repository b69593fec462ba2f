"""GLSL files with named slots, and what puts them together. Pure text: nothing here touches GL."""

from decals.shaders.compose import ComposeError, Origin, ShaderError, Source, compose, constants
from decals.shaders.diagnose import CompileError, compile_error

__all__ = [
    "CompileError",
    "ComposeError",
    "Origin",
    "ShaderError",
    "Source",
    "compile_error",
    "compose",
    "constants",
]
