"""OpenGL contexts: their limits, and the programs and textures made in them."""

import sys
import threading
import weakref
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager, nullcontext
from functools import cached_property, partial
from types import TracebackType
from typing import Any, ClassVar, Generic, Protocol, Self, TypeVar, cast

import moderngl

from blobtree.graphics import check_not_forked, hold_display, is_forked, mark_drawing, require_gl
from blobtree.sized_cache import LastUsed
from decals.errors import NoGraphics
from decals.rendering.background_compiler import BackgroundCompiler
from decals.rendering.current_context import is_current, kept_current
from decals.rendering.pixel_pass import (
    COMPUTE_VERSION,
    Compiled,
    Defines,
    PassBackend,
    Program,
    Slots,
    backend_named,
    choose_backend,
    compile_compute,
    compile_program,
    driver_name,
    pass_source,
    probe_backend,
)
from decals.shaders import Source, compose

MIN_VERSION = 330
"""Version of OpenGL that is enough for everything but compute shaders; macOS ends at 410."""

MESA_SOFTWARE = "llvmpipe", "softpipe"
"""Names of Mesa's renderers that draw on the processor."""

MAX_ANISOTROPY = 8.0
"""Greatest ratio of a pixel's footprint in an image at which the image is not blurred."""

DEPTH = "depth"
"""Kind of textures that hold depths."""

LOST = "GL_UNKNOWN_ERROR"
"""moderngl's text for GL_CONTEXT_LOST, the only error of OpenGL 3.3 to 4.6 that it has no name for."""

SOFTWARE_LOOP_ITERATIONS = 65_535
"""Iterations after which Mesa's software rasteriser ends all loops of a pixel, without an error
(LP_MAX_TGSI_LOOP_ITERATIONS)."""

SOFTWARE_SAMPLES = 1 << 18
"""Samples after which a drawing without a graphics card waits, so that progress can be shown."""


class _Entered(threading.local):
    """The contexts whose blocks are open on this thread, the innermost last."""

    def __init__(self) -> None:
        self.contexts: list[moderngl.Context] = []


_entered = _Entered()

_idle: list["Context"] = []
"""The context that the last renderer left to the next one, with its programs; none or one."""


def _is_software(gl: moderngl.Context) -> bool:
    """Return True if Mesa draws on the processor."""
    return any(name in gl.info["GL_RENDERER"] for name in MESA_SOFTWARE)


def _anisotropy(gl: moderngl.Context) -> float:
    """Return the degree of anisotropic filtering that is used.

    Mesa's software rasteriser filters a 2 × 2 quad along the derivatives of its first pixel, even those that
    ``textureGrad`` is given: neighbouring decals would show specks of each other's images.
    """
    return 1.0 if _is_software(gl) else min(MAX_ANISOTROPY, gl.max_anisotropy)


def _newest_context() -> moderngl.Context:
    """Make a context with compute shaders, or else an older one."""
    settings: dict[str, Any] = {"backend": "egl"} if sys.platform.startswith("linux") else {}
    for version in (COMPUTE_VERSION, MIN_VERSION):  # some drivers give no newer version than requested
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
    gl : moderngl.Context
        Context to draw in, such as one attached to a window's; `standalone` makes one.
    owned : bool
        True if `release` ends the context too, False if it releases only what was made in it.
    backend : str, optional
        Backend of passes over all pixels, ``"fragment"`` or ``"compute"``. Default: the environment variable
        ``IMPLICIT_DECALS_ENTRY`` or, without one, the faster backend by a short measurement.

    Raises
    ------
    NoGraphics
        If the backend is unknown or not supported.

    Examples
    --------
    >>> from decals.rendering import Context, Renderer
    >>> with Context.standalone(backend="fragment") as context, Renderer(context) as renderer:
    ...     print(renderer.backend)
    fragment
    """

    max_program_text: ClassVar[int] = 300_000
    """Characters of the last programs, which are kept though no renderer uses them.

    Without a graphics card, 100,000 take 6 to 18 MB. Most drivers keep compiled programs on disk too, from
    which they return in milliseconds.
    """

    def __init__(self, gl: moderngl.Context, *, owned: bool = False, backend: str | None = None) -> None:
        mark_drawing()
        self.gl = gl
        self._owned = owned
        self._display_held = False
        self._lost = False
        self._programs: LastUsed[tuple[str, ...], Program] = LastUsed(self.max_program_text)
        self._compiler: BackgroundCompiler | None = None
        self._unused: list[Any] = []
        self.requested_backend = backend_named(gl, backend) if backend else None
        self._spare_textures: dict[tuple[tuple[int, int], str], list[moderngl.Texture]] = {}
        self.max_texture_size = int(gl.info["GL_MAX_TEXTURE_SIZE"])
        self.anisotropy = _anisotropy(gl)
        self.software = _is_software(gl)
        self.part_samples = SOFTWARE_SAMPLES if self.software else None
        self.max_loop_iterations = SOFTWARE_LOOP_ITERATIONS if self.software else None

    @classmethod
    def standalone(cls, *, backend: str | None = None) -> "Context":
        """Make a context of its own, without a window; ``backend`` is that of the class.

        Raises
        ------
        NoGraphics
            If OpenGL 3.3 is missing (the message says what to install), or the backend is not supported.
        """
        require_gl()
        with kept_current():
            held = hold_display()
            gl = _newest_context()
            try:
                context = cls(gl, owned=True, backend=backend)
            finally:
                gl.__exit__(None, None, None)  # type: ignore[no-untyped-call]  # a new context is current
            context._display_held = held
            return context

    @classmethod
    def reused(cls) -> "Context":
        """Return the standalone context that was left idle, or make one; errors are those of `standalone`.

        Its programs need not be compiled again.
        """
        require_gl()
        try:
            context = _idle.pop()
        except IndexError:
            return cls.standalone()
        return context if context._is_alive() else cls.standalone()

    def _is_alive(self) -> bool:
        """Return False if the display may have been ended since the context was made, by VTK or by others."""
        if hold_display() != self._display_held:
            return False
        with self.current():
            return is_current()

    def check_not_lost(self) -> None:
        """Raise `NoGraphics` if the driver has reset the graphics card: pictures would stay black.

        The context must be current. It is not used again; the next renderer makes another one.
        """
        if self.gl.error == LOST:
            self._lost = True
            raise NoGraphics(
                "the graphics driver was reset while a picture was drawn; draw it again, and if that fails "
                "too, with fewer decals or a smaller picture"
            )

    def leave(self) -> None:
        """Keep this standalone context for `reused`; release it if it is lost or another context is kept."""
        if _idle or self._lost or is_forked():
            self.release()
            return
        with self.current():
            self.clear_spare_textures()
            self.release_unused()
        self.__dict__.pop("backend", None)  # the environment may name another one next time
        _idle.append(self)

    @property
    def name(self) -> str:
        """The renderer and the version of OpenGL, as the driver reports them."""
        return driver_name(self.gl)

    @cached_property
    def backend(self) -> PassBackend:
        """Backend of passes over all pixels. The first access needs the context to be current."""
        return self.requested_backend or choose_backend(self.gl, software=self.software)

    def probe(self, backend: PassBackend) -> None:
        """Measure a backend now, if the choice of `backend` will need it."""
        if self.requested_backend is None:
            probe_backend(self.gl, backend, software=self.software)

    @contextmanager
    def current(self) -> Iterator[Self]:
        """Make this the thread's current context within a ``with`` block.

        Blocks nest, of one context and of several. After the outermost block the context of the caller is
        current again. A context that is not owned must be current already: its
        window sees to that. (glcontext's own blocks leave no context current, hence the stack.)
        """
        if not self._owned:
            yield self
            return
        check_not_forked()
        stack = _entered.contexts
        with nullcontext() if stack else kept_current():
            stack.append(self.gl)
            self.gl.__enter__()  # type: ignore[no-untyped-call]
            try:
                yield self
            finally:
                stack.pop()
                self.gl.__exit__(None, None, None)  # type: ignore[no-untyped-call]
                if stack:
                    stack[-1].__enter__()  # type: ignore[no-untyped-call]

    @contextmanager
    def compiling_in_thread(self, compiler: BackgroundCompiler) -> Iterator[None]:
        """Within a ``with`` block, let `attempt` leave work undone that needs programs of the compiler."""
        self._compiler = compiler
        try:
            yield
        finally:
            self._compiler = None

    def attempt(self, work: Callable[[], object]) -> bool:
        """Do work; return False if it is to be repeated, as a thread compiles programs for it."""
        if self._compiler is not None:
            return self._compiler.attempt(work)
        work()
        return True

    def program(self, vertex: Source, fragment: Source) -> moderngl.Program:
        """Compile two sources, or return the program that was compiled of them before.

        Raises
        ------
        decals.shaders.CompileError
            If the driver refuses them.
        """
        key = vertex.text, fragment.text
        program = self._kept(key, lambda: compile_program(self.gl, vertex, fragment))
        program.extra = partial(self._require_drawn, key)
        return program

    def _require_drawn(self, sources: tuple[str, ...], program: moderngl.Program) -> None:
        if self._compiler is not None:
            self._compiler.require_drawn(self.gl, program, sources)

    def compute_program(self, source: Source) -> moderngl.ComputeShader:
        """Compile a compute shader, or return the program that was compiled of it before.

        Raises
        ------
        decals.shaders.CompileError
            If the driver refuses it.
        """
        return self._kept((source.text,), lambda: compile_compute(self.gl, source))

    def _kept(self, key: tuple[str, ...], compiled: Callable[[], Compiled]) -> Compiled:
        """Return a program, compiled if it is neither among the last ones nor in use."""

        def compiled_anew() -> Program:
            if self._compiler is not None:
                self._compiler.require_linked(key)
            program: Any = compiled()
            weakref.finalize(program, self._unused.append, program.mglo).atexit = False
            return cast(Program, program)

        self.release_unused()
        return cast(Compiled, self._programs.get(key, compiled_anew, lambda _: sum(map(len, key))))

    def pixel_program(
        self, body: str, targets: int, *, slots: Slots | None = None, defines: Defines | None = None
    ) -> Program:
        """Compile the program of a pass over all pixels, or return the one that was compiled before.

        Arguments are those of `decals.rendering.pixel_pass.pass_source`, errors those of `program`.
        """
        source = pass_source(self.backend, body, targets, slots, defines)
        if self.backend is PassBackend.COMPUTE:
            return self.compute_program(source)
        return self.program(compose("screen.vert"), source)

    def texture(self, size: tuple[int, int], kind: str) -> moderngl.Texture:
        """Return a new texture.

        Parameters
        ----------
        size
            Width and height in texels.
        kind
            A type of moderngl for its four components, such as "f1", "f2" or "f4"; or "depth".
        """
        spare = self._spare_textures.get((size, kind))
        return spare.pop() if spare else self._new_texture(size, kind)

    def prepare_texture(self, size: tuple[int, int], kind: str) -> None:
        """Make a texture for a later call of `texture`: large allocations are slow, so one at a time."""
        self._spare_textures.setdefault((size, kind), []).append(self._new_texture(size, kind))

    def _new_texture(self, size: tuple[int, int], kind: str) -> moderngl.Texture:
        return self.gl.depth_texture(size) if kind == DEPTH else self.gl.texture(size, 4, dtype=kind)

    def clear_spare_textures(self) -> None:
        """Release the prepared textures that were not used."""
        for texture in (texture for spare in self._spare_textures.values() for texture in spare):
            texture.release()
        self._spare_textures.clear()

    def release_unused(self) -> None:
        """Release the programs that are neither kept nor in use any more. The context must be current."""
        while self._unused:
            self._unused.pop().release()

    def release(self) -> None:
        """Release the programs, and the context if it is owned. Calling twice is harmless.

        In a forked child nothing is released, as the driver works in the parent alone.
        """
        if is_forked():
            return
        with self.current():
            self.clear_spare_textures()
            self.release_unused()
            for program in self._programs.values():
                program.release()
        self._programs.clear()
        if self._owned:
            with kept_current():
                self.gl.release()
            self._owned = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


class Releasable(Protocol):
    """A resource on the GPU."""

    def release(self) -> None:
        """Release the memory."""
        ...


Resource = TypeVar("Resource", bound=Releasable)


class GpuCache(Generic[Resource]):
    """Resources on the GPU, each made once for the (immutable) objects that it represents.

    Objects are compared by identity, and kept alive as long as their resources.
    """

    def __init__(self) -> None:
        self._entries: dict[Hashable, tuple[tuple[object, ...], Resource]] = {}
        self._used: set[Hashable] = set()

    def get(self, make: Callable[[], Resource], *objects: object) -> Resource:
        """Return the resource of these objects; make it at the first call."""
        key = tuple(id(item) for item in objects)
        if key not in self._entries:
            self._entries[key] = objects, make()
        self._used.add(key)
        return self._entries[key][1]

    def find(self, *objects: object) -> Resource | None:
        """Return the resource of these objects, or None before the first call of `get`."""
        return self._entries.get(tuple(id(item) for item in objects), (None, None))[1]

    def sweep(self) -> None:
        """Release the resources that `get` did not return since the last sweep."""
        for key in set(self._entries) - self._used:
            self._entries.pop(key)[1].release()
        self._used.clear()

    def release(self) -> None:
        """Release everything."""
        self._used.clear()
        self.sweep()
