"""Programs and their uniforms; passes over all pixels, as fragment or as compute shaders from the same text.

Neither backend is faster on every driver. Data-centre GPUs, which have few units for fragments, run compute
shaders much faster. Software rasterisers run them as fast or several times slower. `choose_backend` measures
both.
"""

import math
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import StrEnum
from typing import Self, TypeAlias, TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Int32Array
from decals.errors import NoGraphics
from decals.rendering.viewpoint import Rectangle, Tile
from decals.shaders import Source, compile_error, compose

BACKEND_VARIABLE = "IMPLICIT_DECALS_ENTRY"
"""Environment variable that names the backend: ``fragment`` or ``compute``."""

COMPUTE_VERSION = 430
"""Version of OpenGL that brought compute shaders; macOS has none."""

GROUP = 8
"""Side of a compute shader's square group of pixels."""

LIST_GROUP = 128
"""Number of listed pixels that a group draws together."""

LIST_BINDING = 0
"""Binding point of the storage buffer ``PixelList`` in ``shaders/pixels.comp``."""

LIST_HEAD = np.array([0, 1, 1, 0], np.uint32)
"""Numbers before the pixels of an empty list: groups that draw it, along three axes, and its length."""

LIST_UNIT = 15
"""Texture unit of the list, the last that every driver has."""

MIN_COMPUTE_GAIN = 1.5
"""Gain in speed from which compute is chosen: near 1 the choice would change from run to run."""

CAMERA_BINDING = 0
"""Binding point of the uniform block in ``shaders/camera.glsl``."""

_PROBE_SIZE = (256, 256)
_PROBE_RUNS = 3
_NOISE_SIZE = 64
_TRIAL_SHADER = """#version 430 core
layout(local_size_x = 1) in;
layout(binding = 0, rgba32f) uniform image2D target;
void main() { imageStore(target, ivec2(0), vec4(0.0)); }
"""

Defines: TypeAlias = Mapping[str, str | int | float | bool]
Slots: TypeAlias = Mapping[str, str | Source]
Program: TypeAlias = moderngl.Program | moderngl.ComputeShader
"""A compiled program, which takes the uniforms of a pass."""

Compiled = TypeVar("Compiled", bound=Program)


class PassBackend(StrEnum):
    """Kind of shader that runs a pass over all pixels."""

    FRAGMENT = "fragment"
    COMPUTE = "compute"


# -- programs -------------------------------------------------------------------------------------------


def compile_program(gl: moderngl.Context, vertex: Source, fragment: Source) -> moderngl.Program:
    """Compile a vertex and a fragment shader; CompileError if the driver refuses them."""
    try:
        return gl.program(vertex_shader=vertex.text, fragment_shader=fragment.text)
    except moderngl.Error as error:
        raise compile_error(str(error), {"vertex_shader": vertex, "fragment_shader": fragment}) from error


def compile_compute(gl: moderngl.Context, source: Source) -> moderngl.ComputeShader:
    """Compile a compute shader; CompileError if the driver refuses it."""
    try:
        return gl.compute_shader(source.text)
    except moderngl.Error as error:
        raise compile_error(str(error), {"compute_shader": source}) from error


def pass_source(
    backend: PassBackend, body: str, targets: int, slots: Slots | None = None, defines: Defines | None = None
) -> Source:
    """Return the fragment or the compute shader of a pass.

    Parameters
    ----------
    backend
        Kind of shader.
    body
        Shader file that defines ``Pixel pixel_at(ivec2 texel)``.
    targets
        Number of textures that the pass fills, one or two.
    slots, defines
        Arguments of `decals.shaders.compose` for the body.
    """
    all_defines: dict[str, str | int | float | bool] = {**(defines or {}), "TWO_TARGETS": targets > 1}
    all_slots = {"body": f"//@ include {body}", **(slots or {})}
    if backend is PassBackend.COMPUTE:
        all_defines |= {"GROUP": GROUP, "LIST_GROUP": LIST_GROUP}
        return compose("pixels.comp", slots=all_slots, defines=all_defines, version="430 core")
    return compose("pixels.frag", slots=all_slots, defines=all_defines)


# -- uniforms and targets -------------------------------------------------------------------------------


class CameraBuffer:
    """The uniform block from which every program reads the tile's camera."""

    def __init__(self, gl: moderngl.Context) -> None:
        self._buffer = gl.buffer(reserve=128)

    def use(self, tile: Tile) -> Self:
        """Fill the block for a tile and bind it."""
        self._buffer.write(tile.block())
        self._buffer.bind_to_uniform_block(CAMERA_BINDING)
        return self

    def release(self) -> None:
        """Release the memory."""
        self._buffer.release()


def attach_camera(program: Compiled) -> Compiled:
    """Connect a program's ``CameraBlock``, if it has one, with the bound buffer."""
    block = program.get("CameraBlock", None)
    if isinstance(block, moderngl.UniformBlock):
        block.binding = CAMERA_BINDING
    return program


def set_uniform(program: Program, name: str, value: object) -> None:
    """Set a uniform; a name that the driver removed as unused is ignored."""
    uniform = program.get(name, None)
    if isinstance(uniform, moderngl.Uniform):
        uniform.value = value


def use_textures(program: Program, textures: Mapping[str, moderngl.Texture]) -> None:
    """Bind textures to the units from 0 on, and set the samplers of these names."""
    for unit, (name, texture) in enumerate(textures.items()):
        texture.use(unit)
        set_uniform(program, name, unit)


def draw(array: moderngl.VertexArray, vertices: int) -> None:
    """Draw triangles, unless the program is to be compiled in a thread first, see `Context.attempt`."""
    if array.program.extra is not None:
        array.program.extra(array.program)
    array.render(vertices=vertices)


def read_floats(framebuffer: moderngl.Framebuffer, attachment: int, tile: Tile) -> Float32Array:
    """Read the inner part of a tile from a target, ``float32[h, w, 4]``, the lowest row first."""
    inner = tile.inner
    part = inner.x - tile.x, inner.y - tile.y, inner.width, inner.height
    data = framebuffer.read(part, components=4, attachment=attachment, alignment=1, dtype="f4")
    return np.frombuffer(data, np.float32).reshape(inner.height, inner.width, 4)


# -- passes ---------------------------------------------------------------------------------------------


class PixelPass:
    """A program that fills textures of floats: a triangle over all pixels, or invocations for each pixel."""

    def __init__(self, gl: moderngl.Context, program: Program, targets: Sequence[moderngl.Texture]) -> None:
        self.programs: tuple[Program, ...] = (program,)
        self._targets, self._gl = tuple(targets), gl
        self._owned: tuple[moderngl.VertexArray, moderngl.Framebuffer] | None = None
        if isinstance(program, moderngl.Program):
            self._owned = gl.vertex_array(program, []), gl.framebuffer(list(targets))

    @property
    def program(self) -> Program:
        """The program; the first of several."""
        return self.programs[0]

    def run(self, rectangle: Rectangle) -> None:
        """Fill a rectangle of all targets."""
        if self._owned is None:
            assert isinstance(self.program, moderngl.ComputeShader)
            for unit, target in enumerate(self._targets):
                target.bind_to_image(unit, read=False, write=True)
            run_pixels(self.program, rectangle)
            self._gl.memory_barrier()
            return
        triangle, framebuffer = self._owned
        right, top = rectangle.x + rectangle.width, rectangle.y + rectangle.height
        framebuffer.viewport = (0, 0, right, top)
        framebuffer.scissor = scissor_of(rectangle)
        framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)
        draw(triangle, 3)

    def release(self) -> None:
        """Release the memory, except targets and program."""
        for resource in self._owned or ():
            resource.release()


class IndirectPass(PixelPass):
    """A pass of two compute shaders: the first lists pixels that need more work, the second draws these.

    Neighbours are drawn at once, each of them with the work of all. The card itself starts as many groups as
    the list needs.
    """

    def __init__(
        self, gl: moderngl.Context, programs: Sequence[Program], targets: Sequence[moderngl.Texture]
    ) -> None:
        super().__init__(gl, programs[0], targets)
        self.programs = tuple(programs)
        self._list = gl.buffer(reserve=LIST_HEAD.nbytes + 4 * math.prod(targets[0].size))

    def run(self, rectangle: Rectangle) -> None:
        """Fill a rectangle of all targets."""
        assert isinstance(self.programs[1], moderngl.ComputeShader)
        self._list.write(LIST_HEAD.tobytes())
        self._list.bind_to_storage_buffer(LIST_BINDING)
        super().run(rectangle)
        self.programs[1].run_indirect(self._list)
        self._gl.memory_barrier()

    def release(self) -> None:
        """Release the memory, except targets and programs."""
        super().release()
        self._list.release()


class ListedPass(PixelPass):
    """The same in fragment shaders: the first marks pixels, and the processor lists them for the second.

    Marks and pixels are read back, for which a graphics card would have to finish first, so it serves
    software rasterisers.
    """

    def __init__(
        self, gl: moderngl.Context, programs: Sequence[Program], targets: Sequence[moderngl.Texture]
    ) -> None:
        self._marks = gl.texture(targets[0].size, 1, dtype="f1")
        super().__init__(gl, programs[0], [*targets, self._marks])
        self.programs = tuple(programs)
        assert isinstance(self.programs[1], moderngl.Program)
        self._triangle = gl.vertex_array(self.programs[1], [])

    def run(self, rectangle: Rectangle) -> None:
        """Fill a rectangle of all targets."""
        super().run(rectangle)
        assert self._owned is not None
        whole, area = self._owned[1], (rectangle.x, rectangle.y, rectangle.width, rectangle.height)
        *targets, marks = self._targets
        rows, columns = np.nonzero(_read_raw(whole, len(targets), marks, area).view(np.uint8))
        if not len(rows):
            return
        texels = np.column_stack([columns, rows]) + area[:2]
        with self._draw_listed(texels.astype(np.int32)) as drawn:
            for number, target in enumerate(targets):
                pixels = _read_raw(whole, number, target, area).copy()
                exact = _read_raw(drawn, number, target, (0, 0, *drawn.size))
                pixels[rows, columns] = exact.reshape(-1)[: len(rows)]
                target.write(pixels, viewport=area)

    @contextmanager
    def _draw_listed(self, texels: Int32Array) -> Iterator[moderngl.Framebuffer]:
        """Draw pixels, ``int32[n, 2]``, one after the other into new textures."""
        size = list_size(len(texels))
        padding = np.repeat(texels[:1], size[0] * size[1] - len(texels), axis=0)
        listed = self._gl.texture(size, 2, np.concatenate([texels, padding]), dtype="i4")
        drawn = [self._gl.texture(size, 4, dtype=target.dtype) for target in self._targets[:-1]]
        framebuffer = self._gl.framebuffer(drawn)
        listed.use(LIST_UNIT)
        set_uniform(self.programs[1], "listed_texels", LIST_UNIT)
        framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)
        try:
            draw(self._triangle, 3)
            yield framebuffer
        finally:
            framebuffer.release()
            for texture in (listed, *drawn):
                texture.release()

    def release(self) -> None:
        """Release the memory, except targets and programs."""
        super().release()
        self._triangle.release()
        self._marks.release()


def list_size(count: int) -> tuple[int, int]:
    """Return width and height of the smallest square of so many texels, without its last empty rows."""
    width = math.isqrt(count - 1) + 1
    return width, -(-count // width)


def _read_raw(
    framebuffer: moderngl.Framebuffer,
    attachment: int,
    texture: moderngl.Texture,
    area: tuple[int, int, int, int],
) -> NDArray[np.void]:
    """Read the bytes of each pixel in an area, ``[h, w]``; ``texture`` has those of the attachment."""
    components, kind = texture.components, texture.dtype
    data = framebuffer.read(area, components, attachment=attachment, alignment=1, dtype=kind)
    return np.frombuffer(data, f"V{components * int(kind[1])}").reshape(area[3], area[2])


def scissor_of(rectangle: Rectangle) -> tuple[int, int, int, int]:
    """Return a rectangle as OpenGL's scissors."""
    return rectangle.x, rectangle.y, rectangle.width, rectangle.height


def run_pixels(program: moderngl.ComputeShader, rectangle: Rectangle) -> None:
    """Invoke a compute shader for every pixel of a rectangle."""
    program["first_texel"] = rectangle.x, rectangle.y
    program["end_texel"] = rectangle.x + rectangle.width, rectangle.y + rectangle.height
    program.run(-(-rectangle.width // GROUP), -(-rectangle.height // GROUP))


# -- choice of the backend ------------------------------------------------------------------------------

_times: dict[tuple[str, PassBackend], float] = {}
"""Seconds of the probe pass, by driver and backend."""


def driver_name(gl: moderngl.Context) -> str:
    """Return the renderer and the version of OpenGL, as the driver reports them."""
    return f"{gl.info['GL_RENDERER']}, OpenGL {gl.info['GL_VERSION']}"


def supports_compute(gl: moderngl.Context) -> bool:
    """Return True if the current context runs compute shaders.

    Some contexts can do more than their version promises: those that VTK makes through NVIDIA's EGL are of
    version 3.2.
    """
    if gl.version_code >= COMPUTE_VERSION:
        return True
    try:
        gl.compute_shader(_TRIAL_SHADER).release()
    except moderngl.Error:
        return False
    return True


def backend_named(gl: moderngl.Context, name: str) -> PassBackend:
    """Return the backend of a name.

    Raises
    ------
    NoGraphics
        If the name is unknown, or the context cannot run the backend.
    """
    try:
        backend = PassBackend(name.lower())
    except ValueError as error:
        known = ", ".join(PassBackend)
        raise NoGraphics(f"expected one of {known} as the backend of passes, got {name!r}") from error
    if backend is PassBackend.COMPUTE and not supports_compute(gl):
        raise NoGraphics(
            f"compute shaders need OpenGL 4.3, here is {driver_name(gl)}; "
            f"ask for {PassBackend.FRAGMENT}, or for none"
        )
    return backend


def choose_backend(gl: moderngl.Context, *, software: bool) -> PassBackend:
    """Return the faster backend of the current context.

    Each is measured once for each driver. Nothing is measured if only one is supported, and on a software
    rasteriser, which is slower through compute shaders.

    Raises
    ------
    NoGraphics
        If the environment variable names a backend that is unknown or unsupported.
    """
    if name := os.environ.get(BACKEND_VARIABLE, ""):
        return backend_named(gl, name)
    if software or not supports_compute(gl):
        return PassBackend.FRAGMENT
    gain = measured(gl, PassBackend.FRAGMENT) / measured(gl, PassBackend.COMPUTE)
    return PassBackend.COMPUTE if gain > MIN_COMPUTE_GAIN else PassBackend.FRAGMENT


def probe_backend(gl: moderngl.Context, backend: PassBackend, *, software: bool) -> None:
    """Measure a backend now, if `choose_backend` will measure it."""
    if not software and not os.environ.get(BACKEND_VARIABLE) and supports_compute(gl):
        measured(gl, backend)


def measured(gl: moderngl.Context, backend: PassBackend) -> float:
    """Return the result of `measure`, which is kept for each driver."""
    key = driver_name(gl), backend
    if key not in _times:
        _times[key] = measure(gl, backend)
    return _times[key]


def measure(gl: moderngl.Context, backend: PassBackend) -> float:
    """Return the seconds that the probe pass takes through a backend: the least of a few runs."""
    noise = np.random.default_rng(0).random((_NOISE_SIZE, _NOISE_SIZE, 4), np.float32)
    source = gl.texture((_NOISE_SIZE, _NOISE_SIZE), 4, noise.tobytes(), dtype="f4")
    target = gl.texture(_PROBE_SIZE, 4, dtype="f2")
    shader = pass_source(backend, "probe.glsl", 1)
    compute = backend is PassBackend.COMPUTE
    program = compile_compute(gl, shader) if compute else compile_program(gl, compose("screen.vert"), shader)
    probe = PixelPass(gl, program, [target])
    source.use(0)
    program["noise"] = 0
    times = [_seconds(gl, probe) for _ in range(_PROBE_RUNS + 1)]
    for resource in (probe, program, target, source):
        resource.release()
    return min(times[1:])


def _seconds(gl: moderngl.Context, probe: PixelPass) -> float:
    gl.finish()
    begin = time.perf_counter()
    probe.run(Rectangle(0, 0, *_PROBE_SIZE))
    gl.finish()
    return time.perf_counter() - begin
