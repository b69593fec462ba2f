"""The renderer: scenes to pictures, buffers, and frames that stay on the GPU."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Hashable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain
from types import FrameType, TracebackType
from typing import Self

import numpy as np

from blobtree._typing import UInt8Array
from blobtree.graphics import is_forked
from blobtree.progress import reporting
from decals.errors import InvalidPoints, InvalidScene
from decals.index.editor import DecalEditor
from decals.rendering import extras  # noqa: F401  (registers kinds of objects and effects)
from decals.rendering.context import Context
from decals.rendering.decal_data import DecalData
from decals.rendering.decal_library import Form, decal_library
from decals.rendering.decal_pass import decal_programs
from decals.rendering.dirty_regions import TargetState
from decals.rendering.drawable import can_be_moved, warmup_of
from decals.rendering.frame_plan import FramePlan, FrameRequest, decal_source, plan_frame
from decals.rendering.gbuffer import depth_program
from decals.rendering.image_array import ImageArray
from decals.rendering.light_pass import light_program, light_variant, shown_program
from decals.rendering.options import (
    RenderOptions,
    SceneLike,
    check_scene,
    drawn_objects,
    has_materials,
    has_relief,
    is_limited,
    viewpoint_of,
)
from decals.rendering.picture import Buffers, TiledArray, TiledBuffers
from decals.rendering.pixel_pass import CameraBuffer, PassBackend
from decals.rendering.progressive import ProgressiveFrame
from decals.rendering.targets import BUFFERS_SLOT, WHOLE_SLOT, TargetPool, Targets
from decals.rendering.uploads import UploadedScene, Uploads
from decals.rendering.viewpoint import (
    MAX_TILE,
    TILE_MARGIN,
    PictureView,
    Rectangle,
    Tile,
    Viewpoint,
    largest_tile,
    tiles,
)
from decals.rendering.warmup import DECALS, IMAGES, SHADERS, SHAPES, WarmupPlan, WarmupTask, with_status
from decals.validation import instance, whole_number

DEFAULT_OPTIONS = RenderOptions()

PACKAGES = ("blobtree", "decals")
"""Packages whose lines no warning names."""


class Renderer:
    """Draws scenes; owns everything that it puts on the GPU.

    Uploads of objects, decals and images are kept for the next picture of the same ones. Parts of a picture
    that are equal to the one before are not drawn again. Use it as a context manager, or call `release`.

    Parameters
    ----------
    context : Context, optional
        Where to draw. Default: a standalone context. The next renderer takes it over after `release`,
        with its compiled programs.
    max_tile : int
        Pictures with more samples along a side are drawn in tiles.

    Raises
    ------
    NoGraphics
        If no context can be made.

    Examples
    --------
    >>> import blobtree, decals
    >>> from decals.rendering import Renderer, RenderOptions
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12)
    >>> with Renderer() as renderer:
    ...     pixels = renderer.render(scene, RenderOptions(size=(32, 24), samples=1))
    ...     buffers = renderer.buffers(scene, RenderOptions(size=(32, 24)))
    >>> pixels.shape, buffers.owner.shape
    ((24, 32, 4), (24, 32))
    """

    def __init__(self, context: Context | None = None, *, max_tile: int = MAX_TILE) -> None:
        if context is not None:
            instance("context", context, Context, InvalidScene, "Context.standalone makes one")
        whole_number("max_tile", max_tile, 1, MAX_TILE, InvalidScene)
        self._owned = context is None
        self._released = False
        self.context = context or Context.reused()
        self._max_tile = min(max_tile, self.context.max_texture_size - 2 * TILE_MARGIN)
        self._uploads = Uploads(self.context)
        self._targets = TargetPool(self.context)
        self._warm: set[Hashable] = set()
        with self.context.current():
            self._camera = CameraBuffer(self.context.gl)

    # -- pictures -----------------------------------------------------------------------------------------

    def render(
        self,
        scene: SceneLike,
        options: RenderOptions = DEFAULT_OPTIONS,
        *,
        viewpoint: Viewpoint | None = None,
    ) -> UInt8Array:
        """Draw a scene.

        Parameters
        ----------
        scene : Scene
            Objects, decals, images and camera.
        options : RenderOptions
            Size, samples, contact mode, image mapping, background and lights.
        viewpoint : Camera or Projection, optional
            Viewpoint in place of the scene's camera.

        Returns
        -------
        uint8[h, w, 4]
            sRGB and straight alpha, row 0 at the top.

        Raises
        ------
        InvalidScene
            If the scene holds an object of unknown kind, or an argument is of another type.
        TooMuchData
            If the scene does not fit on the GPU.
        NoGraphics
            If the graphics driver was reset meanwhile.
        """
        check_options(options)
        picture = TiledArray(options.size, 4, np.uint8)
        with reporting() as report:
            report("drawing", 0.0)
            for tile, targets in self._tiles(scene, viewpoint, options):
                light = targets.light_pass.light
                pixels = targets.resolve.pixels(light, tile, options.samples, options.background)
                picture.insert(pixels, tile, options.samples)
        return picture.array

    def buffers(
        self,
        scene: SceneLike,
        options: RenderOptions = DEFAULT_OPTIONS,
        *,
        viewpoint: Viewpoint | None = None,
    ) -> Buffers:
        """Return the surface and the decal at every pixel's centre.

        Arguments and errors are those of `render`; ``samples`` and ``background`` are not used.
        """
        options = one_sample(options)
        buffers = TiledBuffers(options.size)
        with reporting() as report:
            report("drawing", 0.0)
            for tile, targets in self._tiles(scene, viewpoint, options, slot=BUFFERS_SLOT):
                buffers.insert(targets, tile)
        return buffers.buffers

    def buffers_at(
        self,
        scene: SceneLike,
        x: int,
        y: int,
        options: RenderOptions = DEFAULT_OPTIONS,
        *,
        viewpoint: Viewpoint | None = None,
    ) -> Buffers:
        """Return the surface and the decal at the centre of one pixel, in arrays of 1 × 1 pixels.

        ``(x, y)`` counts from the lower left corner. Only this pixel is drawn, so its color lacks the shadow
        of its surroundings. Other arguments and errors are those of `buffers`.
        """
        options = one_sample(options)
        for name, coordinate, side in (("x", x, options.size[0]), ("y", y, options.size[1])):
            whole_number(name, coordinate, 0, side - 1, InvalidPoints)
        with self.context.current():
            uploaded = self._uploads.scene(scene, options)
            view = PictureView.of(viewpoint_of(scene, viewpoint), options.size, uploaded.bounds)
            targets = self._targets.of(BUFFERS_SLOT, (1, 1))
            self._draw_tile(scene, uploaded, view.part(Rectangle(x, y, 1, 1)), targets, options)
            buffers = TiledBuffers((1, 1))
            buffers.insert(targets, Tile(view, 0, 0, 1, 1, Rectangle(0, 0, 1, 1)))
            return buffers.buffers

    def time_frame(self, scene: SceneLike, options: RenderOptions = DEFAULT_OPTIONS) -> float:
        """Return the seconds of drawing one picture with one sample a pixel, without reading it back.

        Uploads are included if the scene is drawn for the first time. Arguments and errors are those of
        `render`.
        """
        options = one_sample(options)
        with self.context.current():
            self._targets.forget()
            self.context.gl.finish()
            begin = time.perf_counter()
            for _ in self._tiles(scene, None, options):
                pass
            self.context.gl.finish()
            return time.perf_counter() - begin

    def _tiles(
        self,
        scene: SceneLike,
        viewpoint: Viewpoint | None,
        options: RenderOptions,
        *,
        slot: str = WHOLE_SLOT,
    ) -> Iterator[tuple[Tile, Targets]]:
        """Draw tile after tile. The targets hold a tile until the next tile is drawn."""
        _warn_of_plain_samples(scene, options)
        with self.context.current():
            uploaded = self._uploads.scene(scene, options)
            view = PictureView.of(viewpoint_of(scene, viewpoint), options.sample_size, uploaded.bounds)
            size = largest_tile(options.size, options.samples, limit=self._max_tile)
            targets = self._targets.of(slot, size)
            for tile in tiles(view, options.samples, limit=self._max_tile):
                self._draw_tile(scene, uploaded, tile, targets, options)
                yield tile, targets
            self.context.check_not_lost()
            self.sweep()

    def _draw_tile(
        self, scene: SceneLike, uploaded: UploadedScene, tile: Tile, targets: Targets, options: RenderOptions
    ) -> None:
        self._camera.use(tile)
        plan = partial(plan_frame, scene, uploaded, tile, options, depth=False)
        frame = ProgressiveFrame(iter([targets]), plan, self.context.gl.finish)
        frame.complete(max_samples=self.context.part_samples)

    # -- frames that stay on the GPU ----------------------------------------------------------------------

    def draw(
        self,
        scene: SceneLike,
        options: RenderOptions = DEFAULT_OPTIONS,
        *,
        viewpoint: Viewpoint | None = None,
    ) -> Targets:
        """Draw a scene at once, without tiles, and leave it on the GPU.

        The targets hold light and depth of all samples until the next picture. The context must be current.
        Arguments and errors are those of `render`; the background is not drawn.
        """
        frame = self.begin_frame(scene, options, viewpoint=viewpoint)
        frame.complete()
        self.sweep()
        return frame.targets

    def begin_frame(
        self,
        scene: SceneLike,
        options: RenderOptions = DEFAULT_OPTIONS,
        *,
        viewpoint: Viewpoint | None = None,
        slot: str = WHOLE_SLOT,
    ) -> ProgressiveFrame:
        """Begin a frame that is drawn in slices of time, and stays on the GPU.

        The scene and the viewpoint must not change until it is done. Frames of different slots (any names) do
        not overwrite each other. The context must be current. Other arguments and errors are those of `draw`.
        """
        request = self._request(scene, options, viewpoint)

        def plan(targets: Targets, previous: TargetState | None) -> FramePlan:
            # each time: other frames may be drawn between slices
            uploaded = self._uploads.scene(scene, options)
            tile = request.tile(uploaded.bounds)
            self._camera.use(tile)
            return plan_frame(scene, uploaded, tile, options, targets, previous, depth=True)

        targets = chain(self._run_warmup(scene, options), self._targets.make(slot, options.sample_size))
        return ProgressiveFrame(targets, plan, self.context.gl.finish, attempt=self.context.attempt)

    def remaining_work(
        self,
        scene: SceneLike,
        options: RenderOptions = DEFAULT_OPTIONS,
        *,
        viewpoint: Viewpoint | None = None,
        slot: str = WHOLE_SLOT,
    ) -> float:
        """Return the part of a whole frame's work, 0 to 1, that a frame would take now.

        Arguments and errors are those of `begin_frame`.
        """
        return self._request(scene, options, viewpoint).remaining_work(self._targets.get(slot))

    def _request(self, scene: SceneLike, options: RenderOptions, viewpoint: Viewpoint | None) -> FrameRequest:
        check_options(options)
        width, height = options.sample_size
        if max(width, height) > self.context.max_texture_size:
            raise InvalidScene(
                f"expected at most {self.context.max_texture_size} samples along each axis, got {width} x "
                f"{height}; take fewer a pixel, or `render` draws in parts"
            )
        check_scene(scene)
        _warn_of_plain_samples(scene, options)
        return FrameRequest(scene, viewpoint_of(scene, viewpoint), options)

    def warmup(self, scene: SceneLike, options: RenderOptions = DEFAULT_OPTIONS) -> WarmupPlan:
        """Return the slow first-time work of such pictures of a scene.

        Raises
        ------
        InvalidScene
            If the scene holds an object of unknown kind.
        """
        return scene_warmup(self._uploads, scene, options)

    def _run_warmup(self, scene: SceneLike, options: RenderOptions) -> Iterator[str]:
        """Run the warm-up, once; yield the status after each task."""
        plan = self.warmup(scene, options)
        if plan.key not in self._warm:
            for task, status in with_status(plan.tasks):
                while not self.context.attempt(task.run):
                    yield status
                yield status
            self._warm.add(self.warmup(scene, options).key)  # it may know nested decals now

    def release_targets(self, slot: str) -> None:
        """Release the targets of a slot. The context must be current."""
        self._targets.release(slot)

    def forget_others(self, shown: Targets) -> None:
        """Forget the pictures of other objects than the shown ones, and so the objects."""
        self._targets.forget_others(shown)

    def targets_of(self, slot: str) -> Targets | None:
        """Return the targets of a slot's last frame; None before the first."""
        return self._targets.get(slot)

    def uploads(self, scene: SceneLike) -> tuple[DecalData | None, ImageArray | None]:
        """Return a scene's decals and images on the GPU, for shaders of VTK.

        They stay until another scene is drawn. The context must be current.
        """
        return self._uploads.decals(scene), self._uploads.images(scene)

    def walks_ready(self, scene: SceneLike) -> bool:
        """Return True if pictures in the mapping WALKED need not wait for walks of the decals of a scene.

        Otherwise the walks are being computed in a thread. A new state of the scene cancels them.
        """
        return self._uploads.ready(scene)

    @property
    def backend(self) -> PassBackend:
        """Kind of shader, fragment or compute, that runs passes over all pixels."""
        with self.context.current():
            return self.context.backend

    def sweep(self) -> None:
        """Release the uploads that were not used since the last sweep, and programs out of use."""
        self._uploads.sweep()
        self.context.release_unused()

    def release(self) -> None:
        """Release everything. Calling twice is harmless. A forked child releases nothing of its parent."""
        if self._released or is_forked():
            return
        self._released = True
        with self.context.current():
            self._targets.release()
            self._uploads.release()
            self._camera.release()
        if self._owned:
            self.context.leave()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


def check_options(options: RenderOptions) -> RenderOptions:
    """Return render options; InvalidScene for any other value."""
    return instance("options", options, RenderOptions, InvalidScene, "such as RenderOptions(size=(320, 240))")


def one_sample(options: RenderOptions) -> RenderOptions:
    """Return options with one sample a pixel, at its centre."""
    check_options(options)
    exact = options.samples == 1 and not options.filtered
    return options if exact else replace(options, samples=1, filtered=False)


def scene_warmup(uploads: Uploads, scene: SceneLike, options: RenderOptions) -> WarmupPlan:
    """Return the warm-up plan of a picture of a scene.

    Raises
    ------
    InvalidScene
        If the scene holds an object of unknown kind.
    """
    context = uploads.context
    objects = [warmup_of(context, item) for item in drawn_objects(scene)]
    environment = options.environment
    materials, relief = has_materials(scene), has_relief(scene)

    def form() -> Form | None:  # the index tells whether decals are nested, once it is made
        return _form(uploads, scene, options) if len(scene.decals) else None

    light = light_variant(options.lights, environment, materials=materials, relief=relief)
    tasks = [WarmupTask(SHADERS, partial(context.probe, backend)) for backend in PassBackend]
    tasks += [task for plan in objects for task in plan.tasks]
    tasks += [WarmupTask(SHAPES, partial(uploads.drawable, item)) for item in drawn_objects(scene)]
    if len(scene.decals):
        tasks += _decal_tasks(uploads, scene, options)
    tasks += [
        WarmupTask(SHADERS, lambda: decal_programs(context, form())),
        WarmupTask(SHADERS, partial(light_program, context, **light)),
        WarmupTask(SHADERS, partial(depth_program, context)),
        WarmupTask(SHADERS, partial(shown_program, context)),
    ]
    if relief:
        tasks.append(WarmupTask(SHADERS, partial(_compile_offsets, uploads, scene, options)))
    tasks += uploads.effect_tasks(scene, options)
    shown = None if environment is None else environment.picture
    kinds = frozenset(plan.key for plan in objects)
    return WarmupPlan((kinds, form(), tuple(light.values()), shown), tasks)


def _compile_offsets(uploads: Uploads, scene: SceneLike, options: RenderOptions) -> None:
    """Compile the programs that trace the trees that heights of a scene move."""
    uploaded = uploads.scene(scene, options)
    source = decal_source(uploaded, options)
    for drawable in uploaded.drawables:
        if source is not None and can_be_moved(drawable):
            drawable.prepare(source)


def _decal_tasks(uploads: Uploads, scene: SceneLike, options: RenderOptions) -> list[WarmupTask]:
    decals = scene.decals
    index = [WarmupTask(DECALS, lambda: decals.index)] if isinstance(decals, DecalEditor) else []
    return [
        *index,
        WarmupTask(DECALS, partial(uploads.decals, scene)),
        WarmupTask(IMAGES, partial(uploads.images, scene)),
        WarmupTask(SHADERS, lambda: decal_library(_form(uploads, scene, options)), threaded=True),
    ]


def _is_filtered(scene: SceneLike, options: RenderOptions) -> bool:
    """Return True if decals are averaged over pixels; relief and walked images are not."""
    return options.filtered and not has_relief(scene) and not options.walked


def _warn_of_plain_samples(scene: SceneLike, options: RenderOptions) -> None:
    """Warn if decals cannot be averaged over pixels although the options ask for it."""
    if options.filtered and len(scene.decals) and not _is_filtered(scene, options):
        reason = "decals with relief" if has_relief(scene) else "the walked mapping"
        warnings.warn(
            f"filtered=True has no effect on {reason}: plain samples are drawn; take more samples a pixel",
            stacklevel=_caller_level(),
        )


def _caller_level() -> int:
    """Return the stack level, for the function that calls this one, of the line outside our packages."""
    level = 1
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] in PACKAGES:
        level, frame = level + 1, frame.f_back
    return level


def _form(uploads: Uploads, scene: SceneLike, options: RenderOptions) -> Form:
    """Return the form of the decals of a scene."""
    return Form(
        options.contact,
        scene.decals.layered,
        is_limited(scene),
        uploads.nested(scene),
        materials=has_materials(scene),
        relief=has_relief(scene),
        walked=options.walked,
        filtered=_is_filtered(scene, options),
    )
