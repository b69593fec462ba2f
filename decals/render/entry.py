"""Passes over all pixels of a target, as fragment or as compute shaders, from the same text.

Neither is faster everywhere: data-centre cards, where few units take fragments, run compute shaders up to
thirty times faster; software rasterisers run them no faster or several times slower. So a short measurement
decides.
"""

import os
import time
from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, Protocol

import moderngl
import numpy as np

from decals.errors import NoGraphics
from decals.render.parts import Rectangle
from implicit_decals.shaders import Source, compose

if TYPE_CHECKING:
    from decals.render.context import Context

OVERRIDE = "IMPLICIT_DECALS_ENTRY"
"""Environment variable that names the entry point to take: ``fragment`` or ``compute``."""
COMPUTE_BASELINE = 430
"""Compute shaders came with OpenGL 4.3; macOS has none."""
GROUP = 8
"""Side of a compute shader's square group of pixels."""

CLEARLY = 1.5
"""How many times faster compute must be to be taken: around 1, the choice would change from run to run."""

_PROBE_SIZE = (256, 256)
_PROBE_RUNS = 3
_NOISE_SIZE = 64
_TRIAL = """#version 430 core
layout(local_size_x = 1) in;
layout(binding = 0, rgba32f) uniform image2D target;
void main() { imageStore(target, ivec2(0), vec4(0.0)); }
"""

Defines = Mapping[str, bool]
Slots = Mapping[str, str | Source]
Program = moderngl.Program | moderngl.ComputeShader
"""What takes a pass's uniforms."""


class Entry(StrEnum):
    """How a pass over all pixels is run."""

    FRAGMENT = "fragment"
    COMPUTE = "compute"


class PixelPass(Protocol):
    """A compiled pass over all pixels."""

    @property
    def program(self) -> Program:
        """What takes the uniforms."""
        ...

    def run(self, where: Rectangle) -> None:
        """Fill a rectangle of all targets."""
        ...

    def release(self) -> None:
        """Give the memory back, less the targets and the program."""
        ...


def pixel_program(
    context: "Context",
    body: str,
    targets: int,
    *,
    slots: Slots | None = None,
    defines: Defines | None = None,
    entry: Entry | None = None,
) -> Program:
    """Compile the program of a pass, or give what it already is.

    Parameters
    ----------
    context
        Where it runs.
    body
        Shader file that defines ``Pixel pixel_at(ivec2 texel)``.
    targets
        How many textures it fills, one or two.
    slots, defines
        For the body, as in `implicit_decals.shaders.compose`.
    entry
        How it is run; the context's choice if not given.
    """
    entry = entry or context.entry
    source = _source(entry, body, targets, slots or {}, defines or {})
    if entry is Entry.COMPUTE:
        return context.compute_program(source)
    return context.program(compose("screen.vert"), source)


def pixel_pass(context: "Context", program: Program, targets: Sequence[moderngl.Texture]) -> PixelPass:
    """Let a program of `pixel_program` fill textures of floats."""
    if isinstance(program, moderngl.ComputeShader):
        return ComputePass(context, program, targets)
    return FragmentPass(context, program, targets)


def _source(entry: Entry, body: str, targets: int, slots: Slots, defines: Defines) -> Source:
    given: dict[str, str | int | float | bool] = {**defines, "TWO_TARGETS": targets > 1}
    filled = {"body": f"//@ include {body}", **slots}
    if entry is Entry.COMPUTE:
        return compose("pixels.comp", slots=filled, defines={**given, "GROUP": GROUP}, version="430 core")
    return compose("pixels.frag", slots=filled, defines=given)


class FragmentPass:
    """One triangle over all pixels."""

    def __init__(
        self, context: "Context", program: moderngl.Program, targets: Sequence[moderngl.Texture]
    ) -> None:
        self.program: Program = program
        self._array = context.gl.vertex_array(program, [])
        self._framebuffer = context.gl.framebuffer(list(targets))
        self._gl = context.gl

    def run(self, where: Rectangle) -> None:
        """Fill a rectangle of all targets."""
        self._framebuffer.viewport = (0, 0, where.x + where.width, where.y + where.height)
        self._framebuffer.scissor = scissor_of(where)
        self._framebuffer.use()
        self._gl.enable_only(moderngl.NOTHING)
        self._array.render(vertices=3)

    def release(self) -> None:
        """Give the memory back."""
        self._array.release()
        self._framebuffer.release()


class ComputePass:
    """A group of invocations for every square of pixels."""

    def __init__(
        self, context: "Context", program: moderngl.ComputeShader, targets: Sequence[moderngl.Texture]
    ) -> None:
        self.program: Program = program
        self._targets = tuple(targets)
        self._gl = context.gl

    def run(self, where: Rectangle) -> None:
        """Fill a rectangle of all targets."""
        for unit, target in enumerate(self._targets):
            target.bind_to_image(unit, read=False, write=True)
        program = self.program
        assert isinstance(program, moderngl.ComputeShader)
        run_pixels(program, where)
        self._gl.memory_barrier()

    def release(self) -> None:
        """Nothing but targets and program was made."""


def scissor_of(where: Rectangle) -> tuple[int, int, int, int]:
    """Give a rectangle as OpenGL's scissors."""
    return where.x, where.y, where.width, where.height


def run_pixels(program: moderngl.ComputeShader, where: Rectangle) -> None:
    """Invoke a compute shader for every pixel of a rectangle."""
    program["first_texel"] = where.x, where.y
    program["end_texel"] = where.x + where.width, where.y + where.height
    program.run(-(-where.width // GROUP), -(-where.height // GROUP))


_times: dict[tuple[str, Entry], float] = {}
"""Seconds that a short piece of work takes, by driver and entry point."""


def choose_entry(context: "Context") -> Entry:
    """Give the faster entry point of a context; it must be current.

    Measured once for each driver (a few milliseconds, and two compilations), never where there is no choice
    or it is known: processors are several times slower through compute shaders.

    Raises
    ------
    NoGraphics
        The environment asks for an entry point that is unknown or cannot be had here.
    """
    wish = os.environ.get(OVERRIDE, "")
    if wish:
        return checked_entry(context, wish)
    if context.software or not supports_compute(context):
        return Entry.FRAGMENT
    gain = measured(context, Entry.FRAGMENT) / measured(context, Entry.COMPUTE)
    return Entry.COMPUTE if gain > CLEARLY else Entry.FRAGMENT


def measured(context: "Context", entry: Entry) -> float:
    """Give what `measure` found once for the context's driver."""
    key = context.name, entry
    if key not in _times:
        _times[key] = measure(context, entry)
    return _times[key]


def probe(context: "Context", entry: Entry) -> None:
    """Measure an entry point now, if it is going to be measured."""
    settled = context.wished_entry or context.software or os.environ.get(OVERRIDE)
    if not settled and supports_compute(context):
        measured(context, entry)


def checked_entry(context: "Context", wish: str) -> Entry:
    """Give the entry point of a name.

    Raises
    ------
    NoGraphics
        There is none, or the context cannot run it.
    """
    try:
        entry = Entry(wish.lower())
    except ValueError as error:
        raise NoGraphics(f"expected one of {', '.join(Entry)} as the entry point, got {wish!r}") from error
    if entry is Entry.COMPUTE and not supports_compute(context):
        raise NoGraphics(
            f"compute shaders need OpenGL 4.3, here is {context.name}; ask for {Entry.FRAGMENT}, or for none"
        )
    return entry


def supports_compute(context: "Context") -> bool:
    """Whether a context runs compute shaders; it must be current.

    Some contexts are older by name than by what they can do: those that VTK makes through NVIDIA's EGL are
    of version 3.2.
    """
    if context.gl.version_code >= COMPUTE_BASELINE:
        return True
    try:
        context.gl.compute_shader(_TRIAL).release()
    except moderngl.Error:
        return False
    return True


def measure(context: "Context", entry: Entry) -> float:
    """Give the seconds that a short piece of work takes through an entry point: the best of a few runs."""
    noise = np.random.default_rng(0).random((_NOISE_SIZE, _NOISE_SIZE, 4), np.float32)
    source = context.gl.texture((_NOISE_SIZE, _NOISE_SIZE), 4, noise.tobytes(), dtype="f4")
    target = context.gl.texture(_PROBE_SIZE, 4, dtype="f2")
    trial = pixel_pass(context, pixel_program(context, "probe.glsl", 1, entry=entry), [target])
    source.use(0)
    trial.program["noise"] = 0
    times = [_seconds(context, trial) for _ in range(_PROBE_RUNS + 1)]
    for resource in (trial, target, source):
        resource.release()
    return min(times[1:])


def _seconds(context: "Context", trial: PixelPass) -> float:
    context.gl.finish()
    begin = time.perf_counter()
    trial.run(Rectangle(0, 0, *_PROBE_SIZE))
    context.gl.finish()
    return time.perf_counter() - begin
