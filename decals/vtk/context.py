"""VTK's OpenGL context as a place where our renderer draws."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Self

import moderngl
from _moderngl import DefaultLoader  # type: ignore[import-untyped]

from decals.errors import NoGraphics
from decals.render.context import Context

VIEWPORT = 0x0BA2
"""GL_VIEWPORT."""
FRAMEBUFFER = 0x8D40
"""GL_FRAMEBUFFER."""

VTK_VERSION = 320
"""OpenGL that VTK makes do with. Some drivers give just that, and do more."""

_TRIAL = """#version 330 core
out vec4 place;
void main() { place = vec4(0.0); gl_Position = place; }
"""

_idle: dict[str, list[moderngl.Context]] = {}
"""What windows that are gone leave behind, by driver: moderngl never gives all of its memory back."""


def _driver(window: Any) -> str:
    """What OpenGL's functions and limits depend on."""
    state = window.GetState()
    return "; ".join([window.GetClassName(), state.GetVendor(), state.GetRenderer(), state.GetVersion()])


def _attach(window: Any) -> moderngl.Context:
    """Give moderngl's view of the context that is current: one for each window, while it is open."""
    # moderngl looks at the framebuffer that is bound, and cannot describe all of VTK's.
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
    """Refuse a context that cannot take our shaders; its version may be no more than what VTK asked for."""
    try:
        gl.program(vertex_shader=_TRIAL).release()
    except moderngl.Error as error:
        here = f"{gl.info['GL_RENDERER']}, OpenGL {gl.info['GL_VERSION']}"
        raise NoGraphics(
            f"expected a window that takes shaders of version 3.30, got {here}; a newer driver may help"
        ) from error


class WindowContext(Context):
    """A render window's context; programs are compiled once for all renderers of the window.

    Inside a ``with context.current():`` block OpenGL is ours; afterwards VTK finds everything as it left it.

    Parameters
    ----------
    window
        A vtkOpenGLRenderWindow that has rendered before, or is rendering: it owns the context.

    Raises
    ------
    NoGraphics
        The window has made no context yet, or one of a kind that cannot be shared.
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
        """Make the window's context current within a ``with`` block, and keep VTK's state; blocks nest."""
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
        """Give back the programs; the context is the window's. Calling twice is harmless.

        A stale context took its programs with it.
        """
        if not self.stale:
            super().release()
        if self._attached:
            _idle.setdefault(_driver(self._window), []).append(self.gl)
            self._attached = False

    @property
    def stale(self) -> bool:
        """Whether the window has made itself another context since: what was made in this one is gone."""
        return bool(self._window.GetContextCreationTime() != self.created)

    def viewport(self) -> tuple[int, int, int, int]:
        """Lower left corner and size of the part of the frame that VTK draws to now, in pixels."""
        corner = [0, 0, 0, 0]
        self._window.GetState().vtkglGetIntegerv(VIEWPORT, corner)
        x, y, width, height = corner
        return x, y, width, height
