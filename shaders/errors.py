"""What goes wrong with shaders.

ShaderError
├── ComposeError   the text could not be put together: a missing file, an unknown or empty slot
└── CompileError   the driver refused the text; every line is given as file:line of its origin
"""


class ShaderError(Exception):
    """Any failure of composing or compiling a shader."""


class ComposeError(ShaderError, ValueError):
    """A shader could not be put together from its files and slots."""


class CompileError(ShaderError, RuntimeError):
    """The driver refused a composed shader; the message names file and line of every complaint."""
