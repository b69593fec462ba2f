"""The warm-up plan of a scene: everything that its first picture takes long for."""

from functools import partial

from decals.index.editor import DecalEditor
from decals.rendering.decal_data import decal_library
from decals.rendering.decal_pass import decal_program
from decals.rendering.drawables import warmup_of
from decals.rendering.gbuffer import depth_program
from decals.rendering.light_pass import light_file, light_program
from decals.rendering.options import RenderOptions, SceneLike
from decals.rendering.pixel_pass import PassBackend
from decals.rendering.resolve import resolve_program
from decals.rendering.uploads import Uploads
from decals.rendering.warmup import DECALS, IMAGES, SHADERS, SHAPES, WarmupPlan, WarmupTask


def scene_warmup(uploads: Uploads, scene: SceneLike, options: RenderOptions) -> WarmupPlan:
    """Return the warm-up plan of a picture of a scene.

    Raises
    ------
    InvalidScene
        If the scene holds an object of unknown kind.
    """
    context = uploads.context
    objects = [warmup_of(context, item) for item in scene.objects]
    has_decals, light = len(scene.decals) > 0, light_file(options.lights)
    formulas = (options.contact, scene.decals.layered) if has_decals else None
    tasks = [WarmupTask(SHADERS, partial(context.probe, backend)) for backend in PassBackend]
    tasks += [task for plan in objects for task in plan.tasks]
    tasks += [WarmupTask(SHAPES, partial(uploads.drawable, item)) for item in scene.objects]
    if has_decals:
        tasks += _decal_tasks(uploads, scene, options)
    tasks += [
        WarmupTask(SHADERS, lambda: decal_program(context, _library(scene, options))),
        WarmupTask(SHADERS, lambda: light_program(context, light)),
        WarmupTask(SHADERS, partial(depth_program, context)),
        WarmupTask(SHADERS, partial(resolve_program, context)),
    ]
    return WarmupPlan((frozenset(plan.key for plan in objects), formulas, light), tasks)


def _decal_tasks(uploads: Uploads, scene: SceneLike, options: RenderOptions) -> list[WarmupTask]:
    decals = scene.decals
    index = [WarmupTask(DECALS, lambda: decals.index)] if isinstance(decals, DecalEditor) else []
    translate = partial(decal_library, options.contact, layered=decals.layered)
    return [
        *index,
        WarmupTask(DECALS, partial(uploads.decals, scene)),
        WarmupTask(IMAGES, partial(uploads.images, scene)),
        WarmupTask(SHADERS, translate, threaded=True),
    ]


def _library(scene: SceneLike, options: RenderOptions) -> str:
    """Return the formulas of the decals; nothing for a scene without decals."""
    return decal_library(options.contact, layered=scene.decals.layered) if len(scene.decals) else ""
