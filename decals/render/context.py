"""A place to draw: an OpenGL context, what it can do, and the programs compiled in it."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any, Self

import moderngl

from decals.errors import NoGraphics
from decals.render.libraries import require_gl
from implicit_decals.shaders import Source, compile_error

BASELINE = 330
"""OpenGL 3.3 is enough; macOS ends at 4.1."""
ANISOTROPY = 8.0
"""How much longer than wide a pixel's footprint in an image may be before it blurs."""


class _Entered(threading.local):
    """The contexts whose blocks are open on this thread, the innermost last."""

    def __init__(self) -> None:
        self.contexts: list[moderngl.Context] = []


_entered = _Entered()


def _anisotropy(gl: moderngl.Context) -> float:
    """Give the degree of anisotropic filtering to ask for.

    Mesa's software rasteriser filters a 2 × 2 quad along the derivatives of its first pixel, even those that
    ``textureGrad`` is given: neighbouring decals would show specks of each other's images.
    """
    software = "llvmpipe" in gl.info["GL_RENDERER"] or "softpipe" in gl.info["GL_RENDERER"]
    return 1.0 if software else min(ANISOTROPY, gl.max_anisotropy)


class Context:
    """An OpenGL context and the programs compiled in it.

    Use it as a context manager, or call `release`. GL calls belong into a ``with context.current():`` block.

    Parameters
    ----------
    gl
        A moderngl context to draw in, such as one attached to a window's; `standalone` makes one.
    owned
        Whether `release` ends the context too, or only what was made in it.
    """

    def __init__(self, gl: moderngl.Context, *, owned: bool = False) -> None:
        self.gl = gl
        self._owned = owned
        self._programs: dict[tuple[str, str], moderngl.Program] = {}
        self.max_texture_size = int(gl.info["GL_MAX_TEXTURE_SIZE"])
        self.anisotropy = _anisotropy(gl)

    @classmethod
    def standalone(cls) -> "Context":
        """Make a context of its own, without a window.

        Raises
        ------
        NoGraphics
            There is no OpenGL here, or one older than 3.3; the message says what to install.
        """
        require_gl()
        settings: dict[str, Any] = {"backend": "egl"} if sys.platform.startswith("linux") else {}
        try:
            gl = moderngl.create_context(require=BASELINE, standalone=True, **settings)
        except Exception as error:  # glcontext raises bare Exceptions
            raise NoGraphics(
                f"no OpenGL 3.3 context could be made here ({error}); "
                "`implicit-decals doctor` shows what is missing"
            ) from error
        context = cls(gl, owned=True)
        with context.current():  # making it made it current; hand the thread back to whoever had it
            return context

    @property
    def name(self) -> str:
        """What draws, in the driver's words."""
        return f"{self.gl.info['GL_RENDERER']}, OpenGL {self.gl.info['GL_VERSION']}"

    @contextmanager
    def current(self) -> Iterator[Self]:
        """Make this the thread's current context within a ``with`` block.

        Blocks nest, of one context and of several. A context that is not owned must be current already: its
        window sees to that. (glcontext's own blocks leave no context current, hence the stack.)
        """
        if not self._owned:
            yield self
            return
        stack = _entered.contexts
        stack.append(self.gl)
        self.gl.__enter__()  # type: ignore[no-untyped-call]
        try:
            yield self
        finally:
            stack.pop()
            self.gl.__exit__(None, None, None)  # type: ignore[no-untyped-call]
            if stack:
                stack[-1].__enter__()  # type: ignore[no-untyped-call]

    def program(self, vertex: Source, fragment: Source) -> moderngl.Program:
        """Compile two sources, or give the program that they already are.

        Raises
        ------
        implicit_decals.shaders.CompileError
            The driver refuses them.
        """
        key = vertex.text, fragment.text
        if key not in self._programs:
            try:
                self._programs[key] = self.gl.program(
                    vertex_shader=vertex.text, fragment_shader=fragment.text
                )
            except moderngl.Error as error:
                stages = {"vertex_shader": vertex, "fragment_shader": fragment}
                raise compile_error(str(error), stages) from error
        return self._programs[key]

    def release(self) -> None:
        """Give the programs back, and the context if it is owned. Calling twice is harmless."""
        with self.current():
            for program in self._programs.values():
                program.release()
        self._programs.clear()
        if self._owned:
            self.gl.release()
            self._owned = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()
