"""Detection of loops that the software rasteriser ended.

Mesa's software rasteriser ends all loops of a pixel, and of the pixels beside it, after
`context.SOFTWARE_LOOP_ITERATIONS` turns, without an error. Such a pixel has no right value. A shader with
``shaders/loop_guard.glsl`` leaves it out and reports it here, so that it can be drawn again in several parts.
"""

import moderngl
import numpy as np

from decals.rendering.context import Context
from decals.rendering.pixel_pass import Program, set_uniform

GUARD_UNIT = 3
"""Image unit of ``loop_guard.glsl``."""

GUARD_VERSION = 420
"""Version of OpenGL whose shaders write to images."""


class LoopGuard:
    """The report of one kind of shader, on drivers that end loops; on others nothing is reported."""

    def __init__(self, context: Context) -> None:
        self._gl = context.gl
        self._report: moderngl.Texture | None = None
        if is_guarded(context):
            self._report = context.gl.texture((1, 1), 1, dtype="u4")

    def use(self, program: Program) -> None:
        """Clear the report, and bind it for a program."""
        if self._report is not None:
            self._report.write(np.zeros(1, np.uint32).tobytes())
            self._report.bind_to_image(GUARD_UNIT, read=False, write=True)
            set_uniform(program, "guard_turns", 2)

    @property
    def ended(self) -> bool:
        """True if loops were ended since `use`; this waits for the drawing."""
        if self._report is None:
            return False
        self._gl.memory_barrier()
        return bool(np.frombuffer(self._report.read(), np.uint32)[0])

    def release(self) -> None:
        """Release the memory."""
        if self._report is not None:
            self._report.release()


def is_guarded(context: Context) -> bool:
    """Return True if shaders of a context report ended loops: if its driver ends them and can report it."""
    return context.max_loop_iterations is not None and context.gl.version_code >= GUARD_VERSION
