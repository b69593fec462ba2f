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
        The window has made no context yet.
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
            # One for each window: moderngl's default is one for the whole process.
            loader: Any = DefaultLoader()
            super().__init__(moderngl.create_context(context=loader))

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
