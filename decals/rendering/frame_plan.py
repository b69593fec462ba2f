"""The drawing steps of a frame."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from decals.rendering.decal_pass import DecalSource
from decals.rendering.dirty_regions import TargetState, same_objects
from decals.rendering.drawable import can_be_moved, has_rest_pose
from decals.rendering.options import RenderOptions, SceneLike
from decals.rendering.targets import Targets
from decals.rendering.uploads import UploadedScene
from decals.rendering.viewpoint import Bounds, PictureView, Step, Tile, Viewpoint

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

    ``depth``: the frame stays on the card, so the pixels and the depth of all objects are drawn too.
    """
    state = TargetState.of(scene, uploaded.bounds, tile, options, depth=depth)
    dirty = state.dirty(previous, tile)
    source = decal_source(uploaded, options)
    steps = _surface_steps(uploaded, tile, targets, source, depth=depth) if dirty.surface else []
    gbuffer, paint = targets.gbuffer, targets.decal_pass.paint
    rest = targets.rest_for(uploaded)
    places = None if rest is None else rest.textures
    decal_arguments = gbuffer, source, uploaded.images, places
    steps += [partial(targets.decal_pass.draw, rectangle, *decal_arguments) for rectangle in dirty.paint]
    radius = AMBIENT_RADIUS * float(np.linalg.norm(np.subtract(*uploaded.bounds)))
    materials = None if uploaded.materials is None else targets.decal_pass.material_targets
    relief = uploaded.relief is not None
    maps = None if uploaded.environment is None else uploaded.environment.textures
    shining = options.lights, options.environment, maps, materials, relief
    light_arguments = gbuffer, paint, tile, radius, *shining
    steps += [partial(targets.light_pass.draw, rectangle, *light_arguments) for rectangle in dirty.light]
    if depth:
        shown, samples = targets.shown_for(options.samples), (targets.light_pass.light, gbuffer.depth)
        steps += [partial(shown.draw, rectangle, *samples) for rectangle in dirty.light]
    return FramePlan(state, steps, dirty.work(tile))


def decal_source(uploaded: UploadedScene, options: RenderOptions) -> DecalSource | None:
    """Return the decals of a scene and how options draw them; None without decals."""
    if uploaded.decals is None:
        return None
    maps = uploaded.masks, uploaded.materials, uploaded.relief
    return DecalSource(uploaded.decals, options.rules, *maps, options.lights, uploaded.walks)


def _surface_steps(
    uploaded: UploadedScene, tile: Tile, targets: Targets, source: DecalSource | None, *, depth: bool
) -> list[Step]:
    """Return the steps that draw all objects into the G-buffer; heights of decals move trees."""
    gbuffer, rest = targets.gbuffer, targets.rest_for(uploaded)
    objects = sorted(enumerate(uploaded.drawables), key=lambda item: not item[1].rasterised)
    needs_depth = depth or rest is not None or any(drawable.rasterised for drawable in uploaded.drawables)
    steps: list[Step] = [partial(gbuffer.clear, tile.width, tile.height, depth=needs_depth)]
    if rest is not None:
        steps.append(partial(rest.clear, tile.width, tile.height))
    for number, drawable in objects:
        if uploaded.relief is not None and can_be_moved(drawable):
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
            if has_rest_pose(drawable)
        ]
    return steps
