"""Frames that are drawn in slices of time, so that a caller never waits for a whole one.

Targets remember the picture in them; only the regions in which the next one differs are drawn.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from decals.index.change_log import affected_balls
from decals.index.editor import DecalEditor
from decals.model import Decals
from decals.rendering.context import DEPTH, Context
from decals.rendering.decal_pass import DecalPass, DecalSource
from decals.rendering.gbuffer import GBuffer
from decals.rendering.light_pass import LightPass, ResolvePass
from decals.rendering.materials import has_relief
from decals.rendering.mesh import PosedMeshDrawable
from decals.rendering.offset_tree import OffsetTreeDrawable
from decals.rendering.options import RenderOptions, SceneLike, Size
from decals.rendering.pixel_pass import GROUP
from decals.rendering.rest_buffer import RestBuffer
from decals.rendering.uploads import UploadedScene
from decals.rendering.viewpoint import Bounds, Part, PictureView, Rectangle, Step, Tile, Viewpoint

Regions = tuple[Rectangle, ...]

ROUNDING = 2.0**-20
"""Rounding of positions in the G-buffer, relative to the largest coordinate."""
MAX_RECTANGLES = 32
"""Rectangles that are drawn one by one; more become one."""
BALL_MARGIN = 1.0
"""Samples around the image of a ball: rasterisers round edges of triangles to a finer grid."""


def ball_extents(matrix: Float64Array, balls: ArrayLike) -> tuple[Float64Array, Float64Array] | None:
    """Return the boxes around the images of balls: least and greatest x and y in clip space.

    With rows a, b of ``matrix`` for x and w, a ball lies where x/w ≤ c if its centre lies R |a − c b| before
    the plane a = c b; so the c where it touches solve a quadratic equation, in perspective and without
    (Mara and McGuire, 2D Polyhedral Bounds of a Clipped, Perspective-Projected 3D Sphere, JCGT 2013).

    Parameters
    ----------
    matrix
        World to clip space, ``float64[4, 4]``, acting on columns.
    balls
        Centres and radii, ``float[n, 4]``.

    Returns
    -------
    (float64[n, 2], float64[n, 2]) or None
        None if a ball reaches behind the eye: its image may be anywhere.
    """
    rows = np.asarray(balls, np.float64).reshape(-1, 4)
    squared = rows[:, 3:] ** 2
    centres = rows[:, :3] @ matrix[:, :3].T + matrix[:, 3]
    across, depth = centres[:, :2], centres[:, 3:]
    slopes, away = matrix[:2, :3], matrix[3, :3]
    a = depth**2 - squared * (away @ away)
    if (depth <= 0.0).any() or (a <= 0.0).any():
        return None
    b = across * depth - squared * (slopes @ away)
    c = across**2 - squared * (slopes**2).sum(axis=1)
    half = np.sqrt(np.maximum(b**2 - a * c, 0.0))
    return (b - half) / a, (b + half) / a


def regions_of(tile: Tile, balls: Float64Array, span: float) -> Regions:
    """Return rectangles of a tile, counted from its own corner, that enclose the images of all balls.

    They consist of whole groups of samples: some rasterisers filter images for several samples together, by
    the derivatives of one of them.

    Parameters
    ----------
    tile
        The tile that is drawn.
    balls
        Centres and radii, ``float64[n, 4]``.
    span
        The largest coordinate of the objects.
    """
    span = max(span, float(np.abs(tile.view.rays.origin).max()))
    extents = ball_extents(tile.matrix(), balls + np.array([0.0, 0.0, 0.0, ROUNDING * span]))
    if extents is None:
        return (Rectangle(0, 0, tile.width, tile.height),)
    size = np.array([tile.width, tile.height])
    low = np.floor(((0.5 * extents[0] + 0.5) * size - BALL_MARGIN) / GROUP) * GROUP
    high = np.ceil(((0.5 * extents[1] + 0.5) * size + BALL_MARGIN) / GROUP) * GROUP
    corners = np.clip(np.column_stack([low, high]), 0, np.tile(size, 2))
    corners = corners[(corners[:, 2:] > corners[:, :2]).all(axis=1)]
    if len(corners) > MAX_RECTANGLES:
        corners = np.concatenate([corners[:, :2].min(axis=0), corners[:, 2:].max(axis=0)])[None]
    rows = corners.astype(int).tolist()
    return joined([Rectangle(x, y, right - x, top - y) for x, y, right, top in rows])


def joined(rectangles: Sequence[Rectangle]) -> Regions:
    """Return rectangles that cover the same samples: two become one if that takes no more samples."""
    result: list[Rectangle] = []
    for rectangle in rectangles:
        union = rectangle
        for other in [*result]:
            both = union.around(other)
            if both.area <= union.area + other.area:
                result.remove(other)
                union = both
        result.append(union)
    return tuple(result)


def _inner_groups(tile: Tile) -> Rectangle:
    """Return the groups of samples, counted from the tile's own corner, that its inner rectangle touches."""
    inner = tile.inner
    left, low = (start // GROUP * GROUP for start in (inner.x - tile.x, inner.y - tile.y))
    right = min(-(-(inner.x - tile.x + inner.width) // GROUP) * GROUP, tile.width)
    top = min(-(-(inner.y - tile.y + inner.height) // GROUP) * GROUP, tile.height)
    return Rectangle(left, low, right - left, top - low)


class DirtyRegions(NamedTuple):
    """The rectangles of a tile in which surface, paint and light must be drawn."""

    surface: Regions
    paint: Regions
    light: Regions

    def work(self, tile: Tile) -> float:
        """Return the part of the work of the whole tile, 0 to 1, if the three passes take equally long."""
        return sum(part.area for regions in self for part in regions) / (3 * tile.width * tile.height)


@dataclass(frozen=True, eq=False)
class TargetState:
    """Everything that the picture of a tile depends on.

    Objects, images and decals do not change in place, except decals of an editor, which counts its versions.

    Attributes
    ----------
    objects, bounds
        The objects in the G-buffer, and the box around them.
    view
        The camera and the tile.
    decals
        The decals and the pixels of their images.
    formulas
        Everything that decides which formulas paint the decals.
    version
        Version of the editor.
    options
        Mapping, contact mode, stiffness, lights and environment.
    relief
        True if rays are followed over the surface, so that an edit may change pixels far from it.
    moved
        True if heights of decals move objects.
    """

    objects: tuple[object, ...]
    bounds: Bounds
    view: tuple[object, ...]
    decals: tuple[object, ...]
    formulas: tuple[object, ...]
    version: int
    options: RenderOptions
    relief: bool
    moved: bool

    @classmethod
    def of(cls, scene: SceneLike, bounds: Bounds, tile: Tile, options: RenderOptions, *, depth: bool) -> Self:
        """Return the state of a tile of a scene; ``depth``: the targets hold the depth of all objects."""
        decals, relief = scene.decals, has_relief(scene)
        return cls(
            tuple(scene.objects),
            bounds,
            (tile.block(), tile.x, tile.y, tile.width, tile.height, tile.inner, depth),
            (
                decals,
                *(image if hasattr(image, "surface_texels") else image.pixels for image in scene.images),
            ),
            (
                options.mapping,
                options.contact,
                options.stiffness,
                options.filtered,
                options.lights if relief else None,  # the first casts shadows
                *_editor_formulas(decals),
            ),
            decal_version(scene),
            options,
            relief,
            relief and any(hasattr(item, "tree") for item in scene.objects),
        )

    def dirty(self, previous: TargetState | None, tile: Tile) -> DirtyRegions:
        """Return the regions to draw in targets of a previous state; None for targets without a picture."""
        # Light reads the surface around the inner rectangle, but neither paint nor light there.
        paint: Regions = (_inner_groups(tile),)
        whole = paint
        same_surface = previous is not None and same_objects(self.objects, previous.objects)
        if previous is not None and (self.moved or previous.moved):  # decals move trees
            same_surface = same_surface and self._same_decals(previous) and self.version == previous.version
        if previous is None or self.view != previous.view or not same_surface:
            return DirtyRegions((Rectangle(0, 0, tile.width, tile.height),), whole, whole)
        if self._same_decals(previous):
            paint = self._edited(previous.version, tile)
        same_light = all(
            getattr(self.options, name) == getattr(previous.options, name)
            for name in ("lights", "environment")
        )
        return DirtyRegions((), paint, paint if same_light else whole)

    def _same_decals(self, previous: TargetState) -> bool:
        """Return True if the same formulas paint the same decals, but for edits."""
        return self.formulas == previous.formulas and same_objects(self.decals, previous.decals)

    def _edited(self, since: int, tile: Tile) -> Regions:
        """Return the rectangles that edits after a version reach."""
        editor = self.decals[0]
        if not isinstance(editor, DecalEditor) or since == self.version:
            return ()
        changed = editor.changed_balls(since)
        balls = None
        if changed is not None and not self.relief:
            balls = affected_balls(changed, self.options.contact, editor.max_influence)
        if balls is None:
            return (Rectangle(0, 0, tile.width, tile.height),)
        return regions_of(tile, balls, float(np.abs(np.asarray(self.bounds)).max()))


def _editor_formulas(decals: Decals | DecalEditor) -> tuple[object, ...]:
    """Return the properties of an editor's decals that decide which shader paints them."""
    if not isinstance(decals, DecalEditor):
        return ()
    return (decals.layered, decals.limited, decals.nested, len(decals) > 0)


def decal_version(scene: SceneLike) -> int:
    """Return the version of a scene's decals: an editor counts its edits, other decals have version 0."""
    return scene.decals.version if isinstance(scene.decals, DecalEditor) else 0


def same_objects(one: tuple[object, ...], other: tuple[object, ...]) -> bool:
    """Return True if two tuples hold identical objects."""
    return len(one) == len(other) and all(a is b for a, b in zip(one, other, strict=True))


TEXTURE_KINDS = ("f4", "f4", "f2", DEPTH, "f2", "f2", "f1")
"""Kinds of the textures of targets without buffers."""


class Targets:
    """The targets of all passes, for tiles up to a size.

    Attributes
    ----------
    state
        Everything that the picture in the targets depends on; None while it is incomplete.
    frame
        The frame that was drawn last, complete or not.
    """

    def __init__(self, context: Context, size: Size, *, buffers: bool) -> None:
        self.buffers = buffers
        self.state: TargetState | None = None
        self.frame: object = None
        self.gbuffer = GBuffer(context, size)
        self._context = context
        self._rest: RestBuffer | None = None
        self.decal_pass = DecalPass(context, size, buffers=buffers)
        self.light_pass = LightPass(context, size)
        self.resolve = ResolvePass(context, size)

    def rest_for(self, uploaded: UploadedScene) -> RestBuffer | None:
        """Return the rest buffer if some objects are posed, or moved by heights, else None."""
        if not any(isinstance(drawable, PosedMeshDrawable) for drawable in uploaded.drawables) and not any(
            map(uploaded.moves, uploaded.drawables)
        ):
            return None
        if self._rest is None:
            self._rest = RestBuffer(self._context, self.gbuffer)
        return self._rest

    def release(self) -> None:
        """Release the memory."""
        self.state = self.frame = None
        if self._rest is not None:
            self._rest.release()
        self.gbuffer.release()
        self.decal_pass.release()
        self.light_pass.release()
        self.resolve.release()


WHOLE_SLOT, BUFFERS_SLOT = "whole", "buffers"
"""Slots of pictures that are drawn at once, and of pictures with buffers."""


class TargetPool:
    """The targets of a renderer, by slot: each keeps its targets while its pictures have the same size."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._targets: dict[str, Targets] = {}

    def get(self, slot: str) -> Targets | None:
        """Return the targets of a slot's last picture; None before the first."""
        return self._targets.get(slot)

    def of(self, slot: str, size: Size) -> Targets:
        """Return targets of a size; those of the slot's last picture if they have it."""
        targets = self._targets.get(slot)
        if targets is None or targets.gbuffer.size != size:
            if targets is not None:
                targets.release()
            targets = self._targets[slot] = Targets(self._context, size, buffers=slot == BUFFERS_SLOT)
        return targets

    def make(self, slot: str, size: Size) -> Iterator[Targets | None]:
        """Yield None after each new texture, for memory is allocated slowly, and targets of a size last."""
        targets = self._targets.get(slot)
        if targets is None or targets.gbuffer.size != size:
            if targets is not None:
                self._targets.pop(slot).release()
            self._context.clear_spare_textures()
            for kind in TEXTURE_KINDS:
                self._context.prepare_texture(size, kind)
                yield None
        yield self.of(slot, size)

    def forget(self) -> None:
        """Draw the next pictures from the beginning."""
        for targets in self._targets.values():
            targets.state = None

    def release(self) -> None:
        """Release the memory."""
        for targets in self._targets.values():
            targets.release()
        self._targets.clear()


AMBIENT_RADIUS = 0.1
"""Greatest distance at which surface keeps out the studio light, relative to the scene's diagonal."""


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """A picture in one tile, with the depth of all objects: a scene, a viewpoint and options."""

    scene: SceneLike
    viewpoint: Viewpoint
    options: RenderOptions

    def tile(self, bounds: Bounds) -> Tile:
        """Return the tile for a box around the objects."""
        return PictureView.of(self.viewpoint, self.options.sample_size, bounds).whole()

    def remaining_work(self, targets: Targets | None) -> float:
        """Return the part of a whole frame's work, 0 to 1, that the frame takes in these targets."""
        if targets is None or targets.gbuffer.size != self.options.sample_size:
            return 1.0
        previous = targets.state
        if previous is None or not same_objects(tuple(self.scene.objects), previous.objects):
            return 1.0
        tile = self.tile(previous.bounds)
        state = TargetState.of(self.scene, previous.bounds, tile, self.options, depth=True)
        return state.dirty(previous, tile).work(tile)


@dataclass(frozen=True, eq=False)
class FramePlan:
    """The drawing steps that bring targets to a state.

    Attributes
    ----------
    state
        State of the targets after all steps.
    steps
        Steps in their order; none if the targets have the state already.
    work
        Part of the work of a whole tile, 0 to 1.
    """

    state: TargetState
    steps: list[Step]
    work: float


def plan_frame(
    scene: SceneLike,
    uploaded: UploadedScene,
    tile: Tile,
    options: RenderOptions,
    targets: Targets,
    previous: TargetState | None,
    *,
    depth: bool,
) -> FramePlan:
    """Return the plan of a tile in targets of a previous state; the tile's camera must be bound.

    ``depth``: the depth of objects that are not rasterised is drawn too.
    """
    state = TargetState.of(scene, uploaded.bounds, tile, options, depth=depth)
    dirty = state.dirty(previous, tile)
    source = decal_source(uploaded, options)
    steps = _surface_steps(uploaded, tile, targets, source, depth=depth) if dirty.surface else []
    gbuffer, paint = targets.gbuffer, targets.decal_pass.paint
    rest = targets.rest_for(uploaded)
    decal_arguments = gbuffer, source, uploaded.images, options.filtered, rest
    steps += [partial(targets.decal_pass.draw, rectangle, *decal_arguments) for rectangle in dirty.paint]
    radius = AMBIENT_RADIUS * float(np.linalg.norm(np.subtract(*uploaded.bounds)))
    materials = None if uploaded.materials is None else targets.decal_pass.material_targets
    relief = uploaded.relief is not None
    maps = None if uploaded.environment is None else uploaded.environment.textures
    shining = options.lights, options.environment, maps, materials, relief
    light_arguments = gbuffer, paint, tile, radius, *shining
    steps += [partial(targets.light_pass.draw, rectangle, *light_arguments) for rectangle in dirty.light]
    return FramePlan(state, steps, dirty.work(tile))


def decal_source(uploaded: UploadedScene, options: RenderOptions) -> DecalSource | None:
    """Return the decals of a scene and how options draw them; None without decals."""
    if uploaded.decals is None:
        return None
    modes = options.mapping, options.contact, options.stiffness
    maps = uploaded.masks, uploaded.materials, uploaded.relief
    return DecalSource(uploaded.decals, *modes, *maps, options.lights, uploaded.walks)


def _surface_steps(
    uploaded: UploadedScene, tile: Tile, targets: Targets, source: DecalSource | None, *, depth: bool
) -> list[Step]:
    """Return the steps that draw all objects into the G-buffer; heights of decals move trees."""
    gbuffer, rest = targets.gbuffer, targets.rest_for(uploaded)
    objects = sorted(enumerate(uploaded.drawables), key=lambda item: not item[1].rasterised)
    steps: list[Step] = [partial(gbuffer.clear, tile.width, tile.height)]
    if rest is not None:
        steps.append(partial(rest.clear, tile.width, tile.height))
    for number, drawable in objects:
        if isinstance(drawable, OffsetTreeDrawable) and uploaded.moves(drawable):
            assert rest is not None
            assert source is not None
            steps.append(partial(drawable.draw_offset, number, tile, gbuffer, rest, source))
        else:
            steps.append(partial(drawable.draw, number, tile, gbuffer))
    if depth and not all(drawable.rasterised for drawable in uploaded.drawables):
        steps.append(partial(gbuffer.complete_depth, tile.width, tile.height))
    if rest is not None:
        steps += [
            partial(drawable.draw_rest, number, tile, rest)
            for number, drawable in objects
            if isinstance(drawable, PosedMeshDrawable)
        ]
    return steps


UNITS = 1024
"""Parts of a step begin and end at multiples of 1 / UNITS."""

MIN_UNITS, FIRST_UNITS, MAX_UNITS = 4, 8, 16
"""Units of one part: at least, of a step's first part, and at most, for rows with much work may follow
empty rows."""

PART_OF_SLICE = 0.25
"""Part of a time slice after which the clock is read again."""

DRAWING = "picture"
"""Status of a frame whose warm-up is done."""


class ProgressiveFrame:
    """A frame in progress; the result is the same, bit for bit, as of `Renderer.draw`.

    Regions that are up to date in the targets at the beginning are not drawn again. If another frame is drawn
    into the targets before this one is done, this one begins anew.

    Parameters
    ----------
    targets
        Iterator that ends with the targets. Before that it yields None or a status text after each task of
        the warm-up.
    plan
        Function of the targets and their state at the beginning, called for every slice of time.
    finish
        Waits until the GPU is idle.
    clock
        Returns seconds.

    Attributes
    ----------
    done
        True once the picture is in the targets.
    seconds
        Time that drawing has taken so far.
    work
        Part of a whole frame's work, 0 to 1, at the beginning.
    status
        The last task of the warm-up, such as ``"shaders 3 of 7"``.
    """

    def __init__(
        self,
        targets: Iterator[Targets | str | None],
        plan: Callable[[Targets, TargetState | None], FramePlan],
        finish: Callable[[], None],
        *,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._warmup = targets
        self._targets: Targets | None = None
        self.done, self.seconds, self.work, self.status = False, 0.0, 1.0, ""
        self._plan, self._finish, self._clock = plan, finish, clock
        self._previous: TargetState | None = None
        self._step, self._unit, self._part_units = 0, 0, FIRST_UNITS

    @property
    def targets(self) -> Targets:
        """The targets; they hold the picture once the frame is `done`."""
        while self._targets is None:
            self._run_warmup_task()
        return self._targets

    def advance(self, seconds: float) -> bool:
        """Draw for about so long, at least one part; return True if the frame is done.

        The context must be current, and the scene as it was when the frame began.
        """
        begin = before = self._clock()
        plan: FramePlan | None = None
        while not self.done and before - begin <= (1.0 - PART_OF_SLICE) * seconds:
            if self._targets is None:
                self._run_warmup_task()
                self._finish()
                before = self._clock()
                continue
            plan = plan or self._begin(self._targets)
            self._draw_part(plan.steps)
            self._complete_if_done(plan)
            now = self._clock()
            self._adapt_part(now - before, PART_OF_SLICE * seconds)
            before = now
        self.seconds += before - begin
        return self.done

    def complete(self, *, max_samples: int | None = None) -> None:
        """Draw the rest of the frame at once.

        With `max_samples`, wait for the GPU after parts of about so many samples. OpenGL holds the
        interpreter's lock while it draws, so other threads run between the parts only.
        """
        plan = self._begin(self.targets)
        width, height = self.targets.gbuffer.size
        parts = 1 if max_samples is None else max(1, round(plan.work * width * height / max_samples))
        for step in plan.steps[self._step :]:
            ends = np.linspace(self._unit / UNITS, 1.0, parts + 1)
            for begin, end in pairwise(ends.tolist()):
                step(Part(begin, end))
                if parts > 1:
                    self._finish()
            self._step, self._unit = self._step + 1, 0
        self._complete_if_done(plan)

    def _run_warmup_task(self) -> None:
        result = next(self._warmup)
        if result is None or isinstance(result, str):
            self.status = result or self.status
        else:
            self._targets, self.status = result, DRAWING

    def _begin(self, targets: Targets) -> FramePlan:
        """Return the plan; begin anew if another frame was drawn into the targets since the last call."""
        anew = targets.frame is not self
        if anew:
            self._previous, targets.frame, targets.state = targets.state, self, None
            self._step, self._unit, self._part_units = 0, 0, FIRST_UNITS
        plan = self._plan(targets, self._previous)
        self.work = plan.work if anew else self.work
        return plan

    def _draw_part(self, steps: Sequence[Step]) -> None:
        """Draw the next part, unless all parts are drawn."""
        if self._step == len(steps):
            return
        end = min(self._unit + self._part_units, UNITS)
        steps[self._step](Part(self._unit / UNITS, end / UNITS))
        self._finish()
        self._unit = end
        if end == UNITS:
            self._step, self._unit = self._step + 1, 0

    def _complete_if_done(self, plan: FramePlan) -> None:
        self.done = self._step == len(plan.steps)
        if self.done:
            self.targets.state = plan.state

    def _adapt_part(self, seconds: float, target_seconds: float) -> None:
        """Choose the size of the next part; steps differ in speed, so each begins with a small part."""
        fitting = self._part_units * target_seconds / max(seconds, 1e-9)
        self._part_units = FIRST_UNITS if self._unit == 0 else int(min(max(fitting, MIN_UNITS), MAX_UNITS))
