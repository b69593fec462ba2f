"""Frames that are drawn in slices of time, so that a caller never waits for a whole one."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from decals.rendering.dirty_regions import TargetState, same_objects
from decals.rendering.options import RenderOptions, SceneLike
from decals.rendering.regions import Part, Step
from decals.rendering.targets import Targets
from decals.rendering.tiles import PictureView, Tile
from decals.rendering.uploads import UploadedScene
from decals.rendering.viewpoint import Bounds, Viewpoint

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
    steps = _surface_steps(uploaded, tile, targets, depth=depth) if dirty.surface else []
    gbuffer, paint = targets.gbuffer, targets.decal_pass.paint
    decal_arguments = gbuffer, uploaded.decals, uploaded.images, options.mapping, options.contact
    steps += [partial(targets.decal_pass.draw, rectangle, *decal_arguments) for rectangle in dirty.paint]
    radius = AMBIENT_RADIUS * float(np.linalg.norm(np.subtract(*uploaded.bounds)))
    light_arguments = gbuffer, paint, tile, radius, options.lights
    steps += [partial(targets.light_pass.draw, rectangle, *light_arguments) for rectangle in dirty.light]
    return FramePlan(state, steps, dirty.work(tile))


def _surface_steps(uploaded: UploadedScene, tile: Tile, targets: Targets, *, depth: bool) -> list[Step]:
    """Return the steps that draw all objects into the G-buffer."""
    gbuffer = targets.gbuffer
    objects = sorted(enumerate(uploaded.drawables), key=lambda item: not item[1].rasterised)
    steps: list[Step] = [
        partial(gbuffer.clear, tile.width, tile.height),
        *(partial(drawable.draw, number, tile, gbuffer) for number, drawable in objects),
    ]
    if depth and not all(drawable.rasterised for drawable in uploaded.drawables):
        steps.append(partial(gbuffer.complete_depth, tile.width, tile.height))
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

    def complete(self) -> None:
        """Draw the rest of the frame at once."""
        plan = self._begin(self.targets)
        for step in plan.steps[self._step :]:
            step(Part(self._unit / UNITS))
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
