"""Programs that the driver compiles in a thread, before a window draws with them.

Drivers compile while a program is linked, and some once more when it is first drawn: Mesa's software
rasteriser for each set of formats of its textures and targets. A window would answer no input meanwhile. A
second context therefore links and draws the same in a thread. The driver stores the result in its cache on
disk, where the window's context finds it. moderngl holds the interpreter's lock during each call, so the
long calls go to the driver directly.
"""

import ctypes
import time
from collections.abc import Callable, Hashable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Protocol, Self

import moderngl

from decals.rendering.current_context import system_library

GL = "libGL.so.1"
"""The library whose functions are called directly; without it, nothing is compiled in a thread."""

VERTEX_SHADER, FRAGMENT_SHADER, COMPUTE_SHADER = 0x8B31, 0x8B30, 0x91B9

TEXTURE_2D, TEXTURE_3D, TEXTURE_2D_ARRAY = 0x0DE1, 0x806F, 0x8C1A
BINDINGS = {TEXTURE_2D: 0x8069, TEXTURE_3D: 0x806A, TEXTURE_2D_ARRAY: 0x8C1D}
"""Names of the texture that is bound, by its target."""

SAMPLERS = {
    0x8B5E: TEXTURE_2D,
    0x8DCA: TEXTURE_2D,
    0x8DD2: TEXTURE_2D,
    0x8B5F: TEXTURE_3D,
    0x8DC1: TEXTURE_2D_ARRAY,
}
"""Target of a sampler, by the type of its uniform: of floats, integers and unsigned ones; 3D; array."""

WIDTH, HEIGHT, DEPTH, INTERNAL_FORMAT = 0x1000, 0x1001, 0x8071, 0x1003
PARAMETERS = 0x2800, 0x2801, 0x2802, 0x2803, 0x8072
"""Filters and wrapping of a texture."""

MIPMAPPED = range(0x2700, 0x2704)
"""Filters between levels."""

MINIFICATION = PARAMETERS.index(0x2801)

BLEND, CULL_FACE, DEPTH_TEST, SEAMLESS_CUBES = 0x0BE2, 0x0B44, 0x0B71, 0x884F
FLAGS = BLEND, CULL_FACE, DEPTH_TEST, SEAMLESS_CUBES
DEPTH_FUNCTION = 0x0B74
ACTIVE_UNIFORMS, TEXTURE_UNITS, ACTIVE_TEXTURE, SCISSOR_TEST = 0x8B86, 0x84C0, 0x84E0, 0x0C11
TRIANGLES, ALWAYS = 4, 0x0207

STORE_SECONDS = 0.05
"""Time in which a thread of the driver stores a result in its cache."""

WAIT_SECONDS = 0.01
"""Time to wait for the thread before other work goes on."""


class ProgramPending(Exception):
    """A program that is needed now is still being compiled in the thread."""


class CurrentContext(Protocol):
    """A context that can be made current."""

    gl: moderngl.Context

    def current(self) -> AbstractContextManager[Self]: ...  # noqa: D102


@dataclass(frozen=True)
class SampledTexture:
    """A texture as a program samples it.

    Attributes
    ----------
    name
        The sampler.
    target, internal_format, parameters
        What OpenGL calls so; the parameters are `PARAMETERS`.
    size
        Width, height and depth. A large one is replaced by 3, or by 4 if it is a power of two.
    """

    name: str
    target: int
    internal_format: int
    size: tuple[int, int, int]
    parameters: tuple[int, ...]


@dataclass(frozen=True)
class DrawState:
    """State of a draw; it and the program's text decide which machine code a driver makes.

    Attributes
    ----------
    textures
        The sampled textures.
    targets
        Components and type of each colour target.
    depth
        True if there is a depth buffer.
    enabled
        Tests and blending that are on.
    depth_function
        Comparison of depths.
    """

    textures: tuple[SampledTexture, ...]
    targets: tuple[tuple[int, str], ...]
    depth: bool
    enabled: tuple[int, ...]
    depth_function: int


class BackgroundCompiler:
    """Links and draws programs in a thread, each once.

    Parameters
    ----------
    make_context
        Makes the thread's context, once it is needed.
    """

    def __init__(self, make_context: Callable[[], CurrentContext]) -> None:
        self._make_context = make_context
        self._context: CurrentContext | None = None
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="compiler")
        self._jobs: dict[Hashable, Future[None]] = {}
        self._attempting = False

    def attempt(self, work: Callable[[], object]) -> bool:
        """Do work unless it needs a program that the thread still compiles; return True if it is done."""
        self._attempting = system_library(GL) is not None
        try:
            work()
        except ProgramPending:
            return False
        finally:
            self._attempting = False
        return True

    def require_linked(self, sources: tuple[str, ...]) -> None:
        """Raise `ProgramPending` within `attempt` until the thread has linked a program of these sources."""
        self._require(hash(sources), lambda _: _delete(_link(sources)))

    def require_drawn(
        self, gl: moderngl.Context, program: moderngl.Program, sources: tuple[str, ...]
    ) -> None:
        """Raise `ProgramPending` within `attempt` until the thread has drawn a program in this state."""
        if self._attempting:
            state = draw_state(gl, program)
            self._require((hash(sources), state), lambda own: draw_nothing(own, sources, state))

    def _require(self, key: Hashable, work: Callable[[moderngl.Context], None]) -> None:
        if not self._attempting:
            return
        if key not in self._jobs:
            self._jobs[key] = self._executor.submit(self._run, work)
        job = self._jobs[key]
        try:
            job.exception(WAIT_SECONDS)  # an error is raised where the window compiles
        except TimeoutError:
            raise ProgramPending from None

    def _run(self, work: Callable[[moderngl.Context], None]) -> None:
        if self._context is None:
            self._context = self._make_context()
        began = time.perf_counter()
        with self._context.current():
            work(self._context.gl)
        # A shorter job has found its result in the cache, or is repeated quickly.
        if time.perf_counter() - began > STORE_SECONDS:
            time.sleep(STORE_SECONDS)


def _call(function: str, *arguments: Any) -> int:
    """Call a function of OpenGL without the interpreter's lock."""
    return int(getattr(system_library(GL), function)(*arguments) or 0)


def _integer(function: str, *arguments: int) -> int:
    """Return the whole number that a function of OpenGL writes."""
    value = ctypes.c_int()
    _call(function, *arguments, ctypes.byref(value))
    return value.value


def _link(sources: tuple[str, ...]) -> int:
    """Return the name of a program of a vertex and a fragment shader, or of one compute shader."""
    program = _call("glCreateProgram")
    kinds = (COMPUTE_SHADER,) if len(sources) == 1 else (VERTEX_SHADER, FRAGMENT_SHADER)
    for kind, source in zip(kinds, sources, strict=True):
        shader = _call("glCreateShader", kind)
        sent = source if kind == COMPUTE_SHADER else source.strip()  # as moderngl does: caches go by the text
        text = ctypes.c_char_p(sent.encode())
        _call("glShaderSource", shader, 1, ctypes.byref(text), None)
        _call("glCompileShader", shader)
        _call("glAttachShader", program, shader)
        _call("glDeleteShader", shader)
    _call("glLinkProgram", program)
    return program


def _delete(program: int) -> None:
    _call("glDeleteProgram", program)


def draw_state(gl: moderngl.Context, program: moderngl.Program) -> DrawState:
    """Return the state in which a program would draw now."""
    fbo = gl.fbo
    enabled = tuple(flag for flag in FLAGS if _call("glIsEnabled", flag) & 0xFF)
    return DrawState(
        tuple(_sampled_textures(program.glo)),
        tuple((target.components, target.dtype) for target in fbo.color_attachments),
        fbo.depth_attachment is not None,
        enabled,
        _integer("glGetIntegerv", DEPTH_FUNCTION) if DEPTH_TEST in enabled else ALWAYS,
    )


def _sampled_textures(program: int) -> list[SampledTexture]:
    textures = []
    active = _integer("glGetIntegerv", ACTIVE_TEXTURE)
    for index in range(_integer("glGetProgramiv", program, ACTIVE_UNIFORMS)):
        kind, name = ctypes.c_uint(), ctypes.create_string_buffer(256)
        length = ctypes.c_int()
        _call("glGetActiveUniform", program, index, 256, None, ctypes.byref(length), ctypes.byref(kind), name)
        if (target := SAMPLERS.get(kind.value)) is None:
            continue
        unit = _integer("glGetUniformiv", program, _call("glGetUniformLocation", program, name))
        _call("glActiveTexture", TEXTURE_UNITS + unit)
        if not _integer("glGetIntegerv", BINDINGS[target]):
            continue
        size = (_integer("glGetTexLevelParameteriv", target, 0, side) for side in (WIDTH, HEIGHT, DEPTH))
        width, height, depth = map(_small, size)
        textures.append(
            SampledTexture(
                name.value.decode(),
                target,
                _integer("glGetTexLevelParameteriv", target, 0, INTERNAL_FORMAT),
                (width, height, depth),
                tuple(_integer("glGetTexParameteriv", target, parameter) for parameter in PARAMETERS),
            )
        )
    _call("glActiveTexture", active)
    return textures


def _small(side: int) -> int:
    """Return a side of a texture. A large side is replaced by 3, or by 4 if it is a power of two."""
    return min(side, 4 if side & (side - 1) == 0 else 3)


def draw_nothing(gl: moderngl.Context, sources: tuple[str, ...], state: DrawState) -> None:
    """Draw no pixel with a program of two shaders, in a state."""
    program = _link(sources)
    _call("glUseProgram", program)
    names = []
    for unit, sampled in enumerate(state.textures):
        _call("glUniform1i", _call("glGetUniformLocation", program, sampled.name.encode()), unit)
        names.append(_bind(unit, sampled))
    targets = [gl.texture((1, 1), components, dtype=dtype) for components, dtype in state.targets]
    depth = gl.depth_texture((1, 1)) if state.depth else None
    framebuffer = gl.framebuffer(targets, depth)
    framebuffer.use()
    for flag in FLAGS:
        _call("glEnable" if flag in state.enabled else "glDisable", flag)
    _call("glDepthFunc", state.depth_function)
    _call("glEnable", SCISSOR_TEST)
    _call("glScissor", 0, 0, 0, 0)
    array = ctypes.c_uint()
    _call("glGenVertexArrays", 1, ctypes.byref(array))
    _call("glBindVertexArray", array)
    _call("glDrawArrays", TRIANGLES, 0, 3)
    _call("glFinish")
    _call("glDisable", SCISSOR_TEST)
    _call("glDeleteVertexArrays", 1, ctypes.byref(array))
    _call("glDeleteTextures", len(names), (ctypes.c_uint * len(names))(*names))
    _call("glUseProgram", 0)
    _delete(program)
    framebuffer.release()
    for texture in targets + ([] if depth is None else [depth]):
        texture.release()


def _bind(unit: int, texture: SampledTexture) -> int:
    """Bind a new texture to a unit; return its name."""
    name, target = ctypes.c_uint(), texture.target
    _call("glActiveTexture", TEXTURE_UNITS + unit)
    _call("glGenTextures", 1, ctypes.byref(name))
    _call("glBindTexture", target, name)
    levels = texture.size[0].bit_length() if texture.parameters[MINIFICATION] in MIPMAPPED else 1
    if target == TEXTURE_2D:
        _call("glTexStorage2D", target, levels, texture.internal_format, *texture.size[:2])
    else:
        _call("glTexStorage3D", target, levels, texture.internal_format, *texture.size)
    for parameter, value in zip(PARAMETERS, texture.parameters, strict=True):
        _call("glTexParameteri", target, parameter, value)
    return name.value
