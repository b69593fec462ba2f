"""GLSL files with named slots, and what puts them together. Pure text: nothing here touches GL."""

from decals.shaders.compose import Origin, Source, compose
from decals.shaders.diagnose import compile_error
from decals.shaders.errors import CompileError, ComposeError, ShaderError

__all__ = ["CompileError", "ComposeError", "Origin", "ShaderError", "Source", "compile_error", "compose"]
