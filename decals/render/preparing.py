"""All that a picture of a scene asks for when it is drawn for the first time, in pieces."""

from functools import partial

from decals.grid.editor import DecalEditor
from decals.render.decal_data import library
from decals.render.decal_pass import painting_program
from decals.render.drawables import ahead_of
from decals.render.entry import Entry, probe
from decals.render.gbuffer import depth_program
from decals.render.light_pass import LAMPS, STUDIO, lighting_program
from decals.render.modes import Modes
from decals.render.pieces import DECALS, IMAGES, SHADERS, SHAPES, Ahead, Piece
from decals.render.resolve import resolve_program
from decals.render.scene_like import SceneLike
from decals.render.uploads import Uploads


def ahead_of_scene(uploads: Uploads, scene: SceneLike, modes: Modes) -> Ahead:
    """Say what a picture of a scene in these modes needs that takes long for the first time.

    Raises
    ------
    InvalidScene
        It holds an object of unknown kind.
    """
    context = uploads.context
    objects = [ahead_of(context, thing) for thing in scene.objects]
    coated, light = len(scene.decals) > 0, STUDIO if modes.lamps is None else LAMPS
    mode = (modes.contact, scene.decals.layered) if coated else None
    pieces = [Piece(SHADERS, partial(probe, context, entry)) for entry in Entry]
    pieces += [piece for thing in objects for piece in thing.pieces]
    pieces += [Piece(SHAPES, partial(uploads.drawable, thing)) for thing in scene.objects]
    if coated:
        pieces += _coat(uploads, scene, modes)
    pieces += [
        Piece(SHADERS, lambda: painting_program(context, _functions(scene, modes))),
        Piece(SHADERS, lambda: lighting_program(context, light)),
        Piece(SHADERS, partial(depth_program, context)),
        Piece(SHADERS, partial(resolve_program, context)),
    ]
    return Ahead((frozenset(thing.key for thing in objects), mode, light), pieces)


def _coat(uploads: Uploads, scene: SceneLike, modes: Modes) -> list[Piece]:
    decals = scene.decals
    index = [Piece(DECALS, lambda: decals.index)] if isinstance(decals, DecalEditor) else []
    return [
        *index,
        Piece(DECALS, partial(uploads.decals, scene)),
        Piece(IMAGES, partial(uploads.images, scene)),
        Piece(SHADERS, partial(library, modes.contact, layered=decals.layered), beside=True),
    ]


def _functions(scene: SceneLike, modes: Modes) -> str:
    """The formulas of the decals, if there are any."""
    return library(modes.contact, layered=scene.decals.layered) if len(scene.decals) else ""
