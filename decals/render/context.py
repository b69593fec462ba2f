"""A place to draw: an OpenGL context, what it can do, and the programs compiled in it."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from types import TracebackType
from typing import Any, Self

import moderngl

from decals.errors import NoGraphics
from decals.render.entry import COMPUTE_BASELINE, Entry, Program, checked_entry, choose_entry
from decals.render.libraries import require_gl
from decals.render.shared_display import hold_display
from implicit_decals.shaders import Source, compile_error

BASELINE = 330
"""OpenGL 3.3 is enough; macOS ends at 4.1."""
ANISOTROPY = 8.0
"""How much longer than wide a pixel's footprint in an image may be before it blurs."""

DEPTH = "depth"
"""Kind of textures that hold depths."""

SOFTWARE_TURNS = 65_535
"""Turns after which Mesa's software rasteriser ends all loops of a pixel together, without a word
(LP_MAX_TGSI_LOOP_ITERATIONS)."""


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
    return 1.0 if _is_software(gl) else min(ANISOTROPY, gl.max_anisotropy)


def _is_software(gl: moderngl.Context) -> bool:
    """Whether Mesa draws on the processor."""
    return "llvmpipe" in gl.info["GL_RENDERER"] or "softpipe" in gl.info["GL_RENDERER"]


def _newest() -> moderngl.Context:
    """Make a context with compute shaders, or else one that draws: some drivers give just what is asked."""
    settings: dict[str, Any] = {"backend": "egl"} if sys.platform.startswith("linux") else {}
    for version in (COMPUTE_BASELINE, BASELINE):
        try:
            return moderngl.create_context(require=version, standalone=True, **settings)
        except Exception as error:  # glcontext raises bare Exceptions
            reason = error
    raise NoGraphics(
        f"no OpenGL 3.3 context could be made here ({reason}); `implicit-decals doctor` shows what is missing"
    ) from reason


class Context:
    """An OpenGL context and the programs compiled in it.

    Use it as a context manager, or call `release`. GL calls belong into a ``with context.current():`` block.

    Parameters
    ----------
    gl
        A moderngl context to draw in, such as one attached to a window's; `standalone` makes one.
    owned
        Whether `release` ends the context too, or only what was made in it.
    entry
        How passes over all pixels are run: ``"fragment"`` or ``"compute"``. Not given, the environment
        variable ``IMPLICIT_DECALS_ENTRY`` says it, or a short measurement.

    Raises
    ------
    NoGraphics
        The entry point that was asked for is unknown or cannot be had here.
    """

    def __init__(self, gl: moderngl.Context, *, owned: bool = False, entry: str | None = None) -> None:
        self.gl = gl
        self._owned = owned
        self._programs: dict[tuple[str, str], moderngl.Program] = {}
        self._compute_programs: dict[str, moderngl.ComputeShader] = {}
        self.wished_entry = checked_entry(self, entry) if entry else None
        self._stock: dict[tuple[tuple[int, int], str], list[moderngl.Texture]] = {}
        self.max_texture_size = int(gl.info["GL_MAX_TEXTURE_SIZE"])
        self.anisotropy = _anisotropy(gl)
        self.software = _is_software(gl)
        self.most_turns = SOFTWARE_TURNS if self.software else None

    @classmethod
    def standalone(cls, *, entry: str | None = None) -> "Context":
        """Make a context of its own, without a window; `entry` is as for the class.

        Raises
        ------
        NoGraphics
            There is no OpenGL here, or one older than 3.3; the message says what to install. Or the entry
            point that was asked for cannot be had.
        """
        require_gl()
        hold_display()
        gl = _newest()
        context = cls(gl, owned=True, entry=entry)
        with context.current():  # making it made it current; hand the thread back to whoever had it
            return context

    @property
    def name(self) -> str:
        """What draws, in the driver's words."""
        return f"{self.gl.info['GL_RENDERER']}, OpenGL {self.gl.info['GL_VERSION']}"

    @cached_property
    def entry(self) -> Entry:
        """How passes over all pixels are run here. Ask while the context is current."""
        return self.wished_entry or choose_entry(self)

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

    def compute_program(self, source: Source) -> moderngl.ComputeShader:
        """Compile a compute shader, or give the program that it already is.

        Raises
        ------
        implicit_decals.shaders.CompileError
            The driver refuses it.
        """
        if source.text not in self._compute_programs:
            try:
                self._compute_programs[source.text] = self.gl.compute_shader(source.text)
            except moderngl.Error as error:
                raise compile_error(str(error), {"compute_shader": source}) from error
        return self._compute_programs[source.text]

    def texture(self, size: tuple[int, int], kind: str) -> moderngl.Texture:
        """Give a new texture: of four components of a kind, as moderngl names it, or of ``"depth"``."""
        stock = self._stock.get((size, kind))
        return stock.pop() if stock else self._new_texture(size, kind)

    def stock(self, size: tuple[int, int], kind: str) -> None:
        """Make a texture for those who will ask for one like it: where memory comes slowly, one at a time."""
        self._stock.setdefault((size, kind), []).append(self._new_texture(size, kind))

    def _new_texture(self, size: tuple[int, int], kind: str) -> moderngl.Texture:
        return self.gl.depth_texture(size) if kind == DEPTH else self.gl.texture(size, 4, dtype=kind)

    def clear_stock(self) -> None:
        """Give back the textures that nobody asked for."""
        for texture in (texture for stock in self._stock.values() for texture in stock):
            texture.release()
        self._stock.clear()

    def release(self) -> None:
        """Give the programs back, and the context if it is owned. Calling twice is harmless."""
        with self.current():
            self.clear_stock()
            programs: list[Program] = [*self._programs.values(), *self._compute_programs.values()]
            for program in programs:
                program.release()
        self._programs.clear()
        self._compute_programs.clear()
        if self._owned:
            self.gl.release()
            self._owned = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()
