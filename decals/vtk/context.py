"""VTK's OpenGL context for the renderer."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Self

import moderngl
from _moderngl import DefaultLoader  # type: ignore[import-untyped]

from decals.errors import NoGraphics
from decals.rendering.context import Context

VIEWPORT = 0x0BA2
"""GL_VIEWPORT."""
FRAMEBUFFER = 0x8D40
"""GL_FRAMEBUFFER."""

VTK_VERSION = 320
"""OpenGL version that VTK requests. Some drivers report it although they support more."""

_TRIAL = """#version 330 core
out vec4 place;
void main() { place = vec4(0.0); gl_Position = place; }
"""

_idle: dict[str, list[moderngl.Context]] = {}
"""Contexts of closed windows by driver, for reuse: moderngl does not free all of their memory."""


def _driver(window: Any) -> str:
    """Return the identity of the driver, on which OpenGL's functions and limits depend."""
    state = window.GetState()
    return "; ".join([window.GetClassName(), state.GetVendor(), state.GetRenderer(), state.GetVersion()])


def _attach(window: Any) -> moderngl.Context:
    """Return a moderngl context for the current OpenGL context."""
    # moderngl inspects the bound framebuffer, and does not support all of VTK's.
    window.GetState().vtkglBindFramebuffer(FRAMEBUFFER, 0)
    idle = _idle.get(_driver(window), [])
    if not idle:
        try:
            loader: Any = DefaultLoader()
        except RuntimeError as error:
            raise NoGraphics(
                f"expected a window that draws through EGL, GLX, WGL or macOS, got a {window.GetClassName()} "
                f"({error}); set the environment variable VTK_DEFAULT_OPENGL_WINDOW to another kind"
            ) from error
        gl = moderngl.create_context(require=VTK_VERSION, context=loader)
        _require_language(gl)
        return gl
    gl = idle.pop()
    gl.fbo = gl.detect_framebuffer()  # as create_context does: the old window's is gone
    gl.mglo.fbo = gl.fbo.mglo
    return gl


def _require_language(gl: moderngl.Context) -> None:
    """Raise `NoGraphics` if the context does not compile shaders of version 3.30."""
    try:
        gl.program(vertex_shader=_TRIAL).release()
    except moderngl.Error as error:
        here = f"{gl.info['GL_RENDERER']}, OpenGL {gl.info['GL_VERSION']}"
        raise NoGraphics(
            f"expected a window that takes shaders of version 3.30, got {here}; a newer driver may help"
        ) from error


class WindowContext(Context):
    """The context of a render window, shared by all its subplots.

    A ``with context.current():`` block may change any OpenGL state; it is restored for VTK afterwards.

    Parameters
    ----------
    window
        A vtkOpenGLRenderWindow that has rendered before, or is rendering.

    Raises
    ------
    NoGraphics
        The window has no context yet, or one that cannot be shared.
    """

    def __init__(self, window: Any) -> None:
        self._window = window
        self._open = 0
        self.created = window.GetContextCreationTime()
        if not self.created:
            raise NoGraphics(
                "expected a window that has drawn before, got one without OpenGL; render it first"
            )
        with self.current():
            super().__init__(_attach(window))
        self._attached = True

    @contextmanager
    def current(self) -> Iterator[Self]:
        """Make the window's context current in a ``with`` block, and restore VTK's state; blocks nest."""
        if self._open:
            yield self
            return
        self._window.MakeCurrent()
        state = self._window.GetState()
        state.Push()
        state.PushFramebufferBindings()
        self._open += 1
        try:
            yield self
        finally:
            self._open -= 1
            self._window.GetShaderCache().ReleaseCurrentShader()
            state.Reset()
            state.PopFramebufferBindings()
            state.Pop()

    def release(self) -> None:
        """Release the programs; the window keeps its context. Calling twice is harmless."""
        if not self.stale:
            super().release()
        if self._attached:
            _idle.setdefault(_driver(self._window), []).append(self.gl)
            self._attached = False

    @property
    def stale(self) -> bool:
        """True if the window has a new context, so that all resources of this one are lost."""
        return bool(self._window.GetContextCreationTime() != self.created)

    def viewport(self) -> tuple[int, int, int, int]:
        """Return lower left corner and size of the part of the frame that VTK draws to now, in pixels."""
        corner = [0, 0, 0, 0]
        self._window.GetState().vtkglGetIntegerv(VIEWPORT, corner)
        x, y, width, height = corner
        return x, y, width, height
