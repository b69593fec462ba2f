"""Drawings that go on where the software rasteriser ended loops.

Mesa's software rasteriser ends all loops of a pixel, and of the pixels beside it, after
`context.SOFTWARE_LOOP_ITERATIONS` turns, without an error. Such a pixel has no right value. A shader with
``shaders/loop_guard.glsl`` leaves it out and reports it. Then a slower shader draws all pixels again, and
keeps how far their rays were traced. Further drawings go on there.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import moderngl
import numpy as np

from decals.rendering.context import Context
from decals.rendering.pixel_pass import Program, set_uniform

REPORT_UNIT, WAYS_UNIT = 3, 4
"""Image units of ``loop_guard.glsl``."""

GUARD_VERSION = 420
"""Version of OpenGL whose shaders write to images."""

MAX_DRAWINGS = 4096
"""Most drawings of the same pixels; what is still incomplete then is left out."""

COMPLETE = -1.0
"""Entry of a pixel that is complete, in place of the way along its ray."""


@dataclass
class GuardedProgram:
    """A program that reports ended loops, and how to make the one that goes on where they were ended."""

    first: Program
    resuming: Callable[[], Program]
    ends_loops: bool = False
    """True if loops were ended in the last drawings, which then begin with the second program."""


class LoopGuard:
    """The incomplete pixels of one target, on drivers that end loops; on others all are complete.

    Parameters
    ----------
    context
        Where to make the textures.
    size
        Width and height of the target in samples.
    """

    def __init__(self, context: Context, size: tuple[int, int]) -> None:
        self._context, self._size = context, size
        self._textures: list[moderngl.Texture] = []
        self._ways_are_complete = False

    def drawings(self, programs: GuardedProgram) -> Iterator[Program]:
        """Yield the program of each drawing, until all pixels are complete."""
        if not is_guarded(self._context):
            yield programs.first
            return
        report, ways = self._textures = self._textures or self._new_textures()
        if not programs.ends_loops:
            yield from self._drawing(programs.first, report)
            if self._is_complete(report):
                return
        program = programs.resuming()
        if not self._ways_are_complete:  # new, or a drawing was given up
            ways.write(np.full(self._size, COMPLETE, np.float32).tobytes())
        self._ways_are_complete = False
        for number in range(MAX_DRAWINGS):
            ways.bind_to_image(WAYS_UNIT, read=True, write=True)
            set_uniform(program, "resumed", number > 0)
            yield from self._drawing(program, report)
            self._ways_are_complete = self._is_complete(report)
            if self._ways_are_complete:
                programs.ends_loops = number > 0
                return

    def _drawing(self, program: Program, report: moderngl.Texture) -> Iterator[Program]:
        """Yield a program that is ready to report ended loops."""
        report.write(np.zeros(1, np.uint32).tobytes())
        report.bind_to_image(REPORT_UNIT, read=False, write=True)
        set_uniform(program, "guard_turns", 2)
        yield program
        self._context.gl.memory_barrier()

    def _is_complete(self, report: moderngl.Texture) -> bool:
        """Return True if the last drawing ended no loops."""
        return not np.frombuffer(report.read(), np.uint32)[0]

    def _new_textures(self) -> list[moderngl.Texture]:
        """Return the textures: whether loops were ended, and how far the ray of each pixel was traced."""
        gl = self._context.gl
        return [gl.texture((1, 1), 1, dtype="u4"), gl.texture(self._size, 1, dtype="f4")]

    def release(self) -> None:
        """Release the memory."""
        for texture in self._textures:
            texture.release()


def is_guarded(context: Context) -> bool:
    """Return True if shaders of a context report ended loops: if its driver ends them and can report it."""
    return context.max_loop_iterations is not None and context.gl.version_code >= GUARD_VERSION
