"""Frames of a subplot in the OpenGL context of VTK's window.

They are drawn or prepared in slices, and put into VTK's frame by their depth.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

import moderngl
from _moderngl import DefaultLoader  # type: ignore[import-untyped]

from blobtree.graphics import hold_display
from decals.errors import NoGraphics
from decals.rendering import Renderer, RenderOptions, SceneLike, Size
from decals.rendering.background_compiler import BackgroundCompiler
from decals.rendering.context import Context
from decals.rendering.current_context import is_egl, kept_current
from decals.rendering.dirty_regions import TargetState, decal_version, same_objects
from decals.rendering.pixel_pass import set_uniform, use_textures
from decals.rendering.progressive import ProgressiveFrame
from decals.rendering.targets import Targets
from decals.rendering.viewpoint import Projection, Rectangle
from decals.rendering.warmup import WarmupPlan, WarmupThread
from decals.shaders import compose

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

    max_program_text = 100_000  # a window's renderers hold all programs of their frames

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


BLEND, DEPTH_TEST, CULL_FACE = 0x0BE2, 0x0B71, 0x0B44
LESS_OR_EQUAL = 0x0203
ONE, REST_OF_ALPHA = 1, 0x0303


class Composite:
    """Draws the renderer's targets into the framebuffer that VTK has bound.

    Edges are blended by their coverage, so opaque actors must be drawn before.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self._array: moderngl.VertexArray | None = None

    def draw(self, window: Any, viewport: tuple[int, int, int, int], targets: Targets) -> None:
        """Fill a viewport.

        Parameters
        ----------
        window
            VTK's window.
        viewport
            Lower left corner and size, in pixels.
        targets
            Targets with the picture; a smaller one is magnified.
        """
        self._array = array = self._array or self._new_array()
        (x, y, width, height), shown, program = viewport, targets.shown, array.program
        assert shown is not None  # frames draw it
        state = window.GetState()
        state.Push()
        window.GetShaderCache().ReleaseCurrentShader()
        state.vtkglEnable(DEPTH_TEST)
        state.vtkglDepthFunc(LESS_OR_EQUAL)
        state.vtkglDepthMask(1)
        state.vtkglDisable(CULL_FACE)
        state.vtkglEnable(BLEND)
        state.vtkglBlendFuncSeparate(ONE, REST_OF_ALPHA, ONE, REST_OF_ALPHA)
        use_textures(program, {"color": shown.color, "depth": shown.depth})
        set_uniform(program, "corner", (float(x), float(y)))
        set_uniform(program, "size", (float(width), float(height)))
        array.render(vertices=3)
        state.ResetGLActiveTexture()
        state.Pop()

    def _new_array(self) -> moderngl.VertexArray:
        program = self._context.program(compose("screen.vert"), compose("composite.frag"))
        return self._context.gl.vertex_array(program, [])

    def release(self) -> None:
        """Release all resources."""
        if self._array is not None:
            self._array.release()


@cache
def shared_compiler() -> BackgroundCompiler:
    """Return the compiler of all windows; the first call takes long, and VTK draws in it."""
    with kept_current():
        hold_display()  # VTK makes a window for it, so not in the compiler's thread
    return BackgroundCompiler(Context.standalone)


SPARE_SLOT = "spare"
"""Targets for a first frame while its own targets hold the shown one."""

Viewport = tuple[int, int, int, int]
"""Lower left corner and size, in pixels."""


@dataclass(frozen=True)
class FrameOptions:
    """Options of a frame.

    Attributes
    ----------
    options
        Options of the picture.
    magnified
        True if the picture is smaller than the window.
    """

    options: RenderOptions
    magnified: bool = False

    @property
    def slot(self) -> str:
        """Name of the targets: small frames and frames of one sample leave those of fine frames unchanged."""
        return "small" if self.magnified else "one sample" if self.options.samples == 1 else "several"


@dataclass(frozen=True, eq=False)
class FrameKey:
    """Everything that a picture depends on.

    Attributes
    ----------
    objects
        Parts that are compared by identity.
    values
        Parts that are compared by value.
    """

    objects: tuple[object, ...]
    values: tuple[object, ...]

    @classmethod
    def of(cls, scene: SceneLike, options: FrameOptions, viewpoint: Projection) -> Self:
        """Return the key of a picture."""
        return cls(cls.objects_of(scene), (options, viewpoint.matrix.tobytes(), decal_version(scene)))

    @staticmethod
    def objects_of(scene: SceneLike) -> tuple[object, ...]:
        """Return what identifies the content of a picture."""
        return (*scene.objects, scene.decals, *(image.pixels for image in scene.images))

    @classmethod
    def of_attempt(cls, scene: SceneLike, *values: object) -> Self:
        """Return the key of an attempt to draw a scene, without its viewpoint and lights."""
        objects = (scene, scene.objects, scene.images, scene.decals)
        return cls(objects, (*values, decal_version(scene)))

    def same(self, other: FrameKey | None) -> bool:
        """Return True if the pictures are the same."""
        return other is not None and self.values == other.values and same_objects(self.objects, other.objects)


class FrameRenderer:
    """Draws frames; parts that did not change since the last frame with the same options are kept.

    Parameters
    ----------
    context
        Context of the window.

    Attributes
    ----------
    drawn_fraction
        Part of the last frame's work, 0 to 1, that was done.
    """

    def __init__(self, context: WindowContext) -> None:
        self.context = context
        self.drawn_fraction = 0.0
        self._composited: Targets | None = None
        self._composited_state: TargetState | None = None
        self._warm: set[Hashable] = set()
        self._warmup_threads: dict[Hashable, WarmupThread] = {}
        self._progressive: tuple[FrameKey, ProgressiveFrame] | None = None
        with context.current():
            self.renderer = Renderer(context)
            self._composite = Composite(context)

    def draw(self, scene: SceneLike, options: FrameOptions, viewpoint: Projection, *, wait: bool) -> Targets:
        """Draw a scene into the renderer's targets; with ``wait``, until the graphics card has finished."""
        frame = self._begin(scene, options, viewpoint, options.slot)
        with self.context.current():
            try:
                frame.complete(max_samples=self.context.part_samples)
            finally:
                self.renderer.sweep()
            if not options.magnified:  # after small frames of a drag, it may be undone
                self._forget_others(scene, frame.targets)
            if wait and frame.work:
                self.context.gl.finish()
        self.drawn_fraction = frame.work
        if self.drawn_fraction:
            self._warm.add(self._warmup_plan(scene, options).key)
        return frame.targets

    def _forget_others(self, scene: SceneLike, shown: Targets) -> None:
        """Forget frames of other objects than the shown ones, drawn or in preparation, and spare targets."""
        self.renderer.forget_others(shown)
        if self._progressive and not same_objects(self._progressive[0].objects, FrameKey.objects_of(scene)):
            self._progressive = None
        if self._progressive is None:
            self.renderer.release_targets(SPARE_SLOT)

    def prepare(
        self, scene: SceneLike, options: FrameOptions, viewpoint: Projection, seconds: float
    ) -> float | None:
        """Draw a slice of a later frame, without showing it; see `SubplotRenderer.prepare`."""
        key = FrameKey.of(scene, options, viewpoint)
        frame = self._continue(key, scene, options, viewpoint, options.slot)
        if self.work_fraction(scene, options, viewpoint):
            with self._in_slices():
                if not frame.advance(seconds):
                    return None
        self._progressive = None
        self._warm.add(self._warmup_plan(scene, options).key)
        return frame.seconds if frame.work == 1.0 else 0.0

    def is_warm(self, scene: SceneLike, options: FrameOptions) -> bool:
        """Return True if the frame needs no warm-up, such as the compilation of shaders."""
        return self._warmup_plan(scene, options).key in self._warm

    def warm(
        self, scene: SceneLike, options: FrameOptions, viewpoint: Projection, seconds: float
    ) -> str | None:
        """Warm up for a slice, then draw the frame once without showing it.

        Returns
        -------
        str or None
            Status in plain words; None once the frame is warm.
        """
        plan = self._warmup_plan(scene, options)
        if plan.key not in self._warmup_threads:
            self._warmup_threads[plan.key] = WarmupThread(plan.tasks)
        thread = self._warmup_threads[plan.key]
        if not thread.done(seconds):
            return thread.status
        key = FrameKey.of(scene, options, viewpoint)
        shown = self._shown_targets
        free = shown is None or shown is not self.renderer.targets_of(options.slot)
        frame = self._continue(key, scene, options, viewpoint, options.slot if free else SPARE_SLOT)
        with self._in_slices():
            if not frame.advance(seconds):
                return frame.status
            self.renderer.release_targets(SPARE_SLOT)
        self._progressive = None
        del self._warmup_threads[plan.key]
        self._warm.add(self._warmup_plan(scene, options).key)  # it may know nested decals now
        return None

    @contextmanager
    def _in_slices(self) -> Iterator[None]:
        """Make the context current within a ``with`` block; of EGL, work may wait for programs."""
        with self.context.current(), ExitStack() as stack:
            if is_egl():  # no thread can have a current context of both EGL and GLX
                stack.enter_context(self.context.compiling_in_thread(shared_compiler()))
            yield

    def _continue(
        self, key: FrameKey, scene: SceneLike, options: FrameOptions, viewpoint: Projection, slot: str
    ) -> ProgressiveFrame:
        """Return the frame in preparation, or a new one if anything changed."""
        if self._progressive is None or not key.same(self._progressive[0]):
            self._progressive = key, self._begin(scene, options, viewpoint, slot)
        return self._progressive[1]

    def _begin(
        self, scene: SceneLike, options: FrameOptions, viewpoint: Projection, slot: str
    ) -> ProgressiveFrame:
        return self.renderer.begin_frame(scene, options.options, viewpoint=viewpoint, slot=slot)

    def _warmup_plan(self, scene: SceneLike, options: FrameOptions) -> WarmupPlan:
        return self.renderer.warmup(scene, options.options)

    def work_fraction(self, scene: SceneLike, options: FrameOptions, viewpoint: Projection) -> float:
        """Return the part of a whole frame's work, 0 to 1, that the frame would need now."""
        return self.renderer.remaining_work(scene, options.options, viewpoint=viewpoint, slot=options.slot)

    def least_depth(self, x: int, y: int, size: Size) -> float:
        """Return the least depth in VTK's frame at a pixel: 1 for no object, 0 for an unknown depth."""
        shown = self._shown_targets
        if shown is None:
            return 0.0
        magnified = shown.gbuffer.size[0] < size[0]
        texels = texels_of(x, y, size, shown.gbuffer.size, magnified=magnified)
        with self.context.current():
            return shown.gbuffer.read_depth(texels)

    @property
    def _shown_targets(self) -> Targets | None:
        """Targets with the picture in VTK's frame, if nothing else was drawn into them since."""
        targets, state = self._composited, self._composited_state
        if targets is None or state is None or targets.state is not state:
            return None
        return targets

    def composite(self, window: Any, viewport: Viewport, targets: Targets) -> None:
        """Put a picture into VTK's frame; see `Composite.draw`."""
        self._composited, self._composited_state = targets, targets.state
        self._composite.draw(window, viewport, targets)

    def composite_again(self, window: Any, viewport: Viewport) -> None:
        """Put the shown picture into VTK's frame again, if it still exists."""
        self.drawn_fraction, shown = 0.0, self._shown_targets
        if shown is not None:
            self._composite.draw(window, viewport, shown)

    def release(self) -> None:
        """Release all resources."""
        self._composited = self._composited_state = self._progressive = None
        for thread in self._warmup_threads.values():
            thread.end()
        with self.context.current():
            self.renderer.release()
            self._composite.release()


def texels_of(x: int, y: int, pixels: Size, texels: Size, *, magnified: bool) -> Rectangle:
    """Return the texels of a picture that contribute to a pixel of a frame.

    Parameters
    ----------
    x, y
        The pixel.
    pixels, texels
        Sizes of the frame and of the picture.
    magnified
        True if the picture is interpolated.
    """
    (left, right), (low, high) = (
        _span(index, count, of, magnified) for index, count, of in zip((x, y), pixels, texels, strict=True)
    )
    return Rectangle(left, low, right - left, high - low)


def _span(index: int, pixels: int, texels: int, magnified: bool) -> tuple[int, int]:
    """Return the first texel of a pixel along an axis, and the one after the last."""
    if not magnified:
        return index * texels // pixels, -(-(index + 1) * texels // pixels)
    begin, end = (edge * texels / pixels - 0.5 for edge in (index, index + 1))
    return max(math.floor(begin), 0), min(math.floor(end) + 2, texels)
