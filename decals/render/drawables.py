"""How each kind of object gets into the G-buffer: one small class per kind, found by the object's type."""

from collections.abc import Callable
from typing import Any, Protocol

from decals.errors import InvalidScene
from decals.render.context import Context
from decals.render.gbuffer import GBuffer
from decals.render.parts import WHOLE, Part
from decals.render.pieces import Ahead
from decals.render.tile import Tile
from decals.scenes.viewpoint import Bounds


class Drawable(Protocol):
    """One object of the scene on the graphics card; it owns its handles."""

    @property
    def bounds(self) -> Bounds:
        """Box around everything that `draw` can draw."""
        ...

    @property
    def rasterised(self) -> bool:
        """Whether `draw` goes through the depth test; what does not is drawn after all that does."""
        ...

    def draw(self, object_id: int, tile: Tile, gbuffer: GBuffer, part: Part = WHOLE) -> None:
        """Put the object, or a part of it, into the G-buffer wherever it is nearer than what is there.

        The tile's camera is bound already (`decals.render.tile.attach_camera`). What is rasterised writes
        through ``write_surface`` of ``shaders/gbuffer.glsl``, with true depth; the rest writes to the
        textures and leaves the depth alone (`GBuffer.complete_depth` adds it where somebody asks for it).
        State that is changed beyond `GBuffer.use` is put back. It draws the same each time: where targets
        hold the same objects already, it is not asked again.
        """
        ...

    def release(self) -> None:
        """Give the memory back."""
        ...


Factory = Callable[[Context, Any], Drawable]
Foresight = Callable[[Context, Any], Ahead]

_KINDS: dict[type, tuple[Factory, Foresight]] = {}


def _nothing_ahead(_context: Context, thing: object) -> Ahead:
    return Ahead(repr(type(thing)), ())


def register(kind: type, factory: Factory, ahead: Foresight = _nothing_ahead) -> None:
    """Let objects of a type (and of its subtypes) be drawn by what ``factory(context, object)`` makes.

    ``ahead(context, object)`` says what the factory will ask for that takes long, such as programs.
    """
    _KINDS[kind] = factory, ahead


def drawable_for(context: Context, thing: object) -> Drawable:
    """Make the drawable of a scene's object.

    Raises
    ------
    InvalidScene
        No factory was registered for its type.
    """
    return _kind_of(thing)[0](context, thing)


def ahead_of(context: Context, thing: object) -> Ahead:
    """Say what the drawable of a scene's object needs; errors as for `drawable_for`."""
    return _kind_of(thing)[1](context, thing)


def _kind_of(thing: object) -> tuple[Factory, Foresight]:
    for kind in type(thing).__mro__:
        if kind in _KINDS:
            return _KINDS[kind]
    known = ", ".join(sorted(kind.__name__ for kind in _KINDS))
    raise InvalidScene(f"cannot draw a {type(thing).__name__}; expected one of: {known}")
