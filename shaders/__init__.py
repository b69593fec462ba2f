"""GLSL files with named slots, and what puts them together. Pure text: nothing here touches GL."""

from .compose import Origin, Source, compose
from .diagnose import compile_error
from .errors import CompileError, ComposeError, ShaderError

__all__ = ["CompileError", "ComposeError", "Origin", "ShaderError", "Source", "compile_error", "compose"]
