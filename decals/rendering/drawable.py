"""The drawables of objects, by the types of the objects."""

from collections.abc import Callable
from typing import Any, Protocol, TypeGuard

from decals.errors import InvalidScene
from decals.rendering.context import Context
from decals.rendering.gbuffer import GBuffer
from decals.rendering.viewpoint import WHOLE, Bounds, Part, Tile
from decals.rendering.warmup import WarmupPlan


class Drawable(Protocol):
    """One object of the scene on the GPU; it owns its handles.

    Examples
    --------
    Annotate a factory for `register`:

    >>> import pyvista
    >>> from decals.rendering import Context, Drawable
    >>> from decals.rendering.mesh import MeshDrawable
    >>> from decals.scenes.objects import as_object
    >>> def draw_cube(context: Context, item: object) -> Drawable:
    ...     return MeshDrawable(context, as_object(pyvista.Cube(), "cube"))
    """

    @property
    def bounds(self) -> Bounds:
        """Box around everything that `draw` can draw."""
        ...

    @property
    def rasterised(self) -> bool:
        """True if `draw` uses the depth test; all other drawables are drawn after those that do."""
        ...

    def draw(self, object_id: int, tile: Tile, gbuffer: GBuffer, part: Part = WHOLE) -> None:
        """Put the object, or a part of it, into the G-buffer wherever it is nearer than the surface there.

        The tile's camera is bound already, see `attach_camera`. A rasterised object is written by
        ``write_surface`` of ``shaders/gbuffer.glsl``, with true depth. Any other writes to the textures and
        leaves the depth unchanged; `GBuffer.complete_depth` adds it. OpenGL state other than that of
        `GBuffer.use` must be restored. Each call must draw the same: the renderer leaves it out for targets
        that hold the same objects.
        """
        ...

    def release(self) -> None:
        """Release the memory."""
        ...


class RestDrawable(Drawable, Protocol):
    """A drawable whose decals lie on a rest pose."""

    def draw_rest(self, object_id: int, tile: Tile, rest: Any, part: Part = WHOLE) -> None:
        """Write the places in the rest pose, a `RestBuffer`, where the object is visible."""
        ...


class OffsetDrawable(Drawable, Protocol):
    """A drawable whose surface heights of decals can move."""

    def prepare(self, source: Any) -> None:
        """Compile the programs for decals, a `DecalSource`."""
        ...

    def draw_offset(
        self, object_id: int, tile: Tile, gbuffer: GBuffer, rest: Any, source: Any, part: Part = WHOLE
    ) -> None:
        """Draw the moved surface into the G-buffer, and its places at rest into a `RestBuffer`."""
        ...


def has_rest_pose(drawable: Drawable) -> TypeGuard[RestDrawable]:
    """Return True if the decals of an object lie on a rest pose."""
    return hasattr(drawable, "draw_rest")


def can_be_moved(drawable: Drawable) -> TypeGuard[OffsetDrawable]:
    """Return True if heights of decals can move the surface of an object."""
    return hasattr(drawable, "draw_offset")


Factory = Callable[[Context, Any], Drawable]
WarmupFactory = Callable[[Context, Any], WarmupPlan]

_DRAWABLE_KINDS: dict[type, tuple[Factory, WarmupFactory]] = {}


def _no_warmup(_context: Context, item: object) -> WarmupPlan:
    return WarmupPlan(repr(type(item)), ())


def register(kind: type, factory: Factory, warmup: WarmupFactory = _no_warmup) -> None:
    """Draw objects of a type by ``factory(context, object)``, a `Drawable`.

    Parameters
    ----------
    kind : type
        A class, also for its subclasses; or a runtime-checkable protocol, for objects of no registered class.
    factory : callable
        Function of the context and the object that returns its `Drawable`.
    warmup : callable, optional
        Function of the same arguments that returns the `WarmupPlan` of the drawable.

    Examples
    --------
    Draw dice as cubes:

    >>> import pyvista
    >>> from decals.rendering import register
    >>> from decals.rendering.mesh import MeshDrawable
    >>> from decals.scenes.objects import as_object
    >>> class Die: ...
    >>> register(Die, lambda context, die: MeshDrawable(context, as_object(pyvista.Cube(), "die")))
    """
    _DRAWABLE_KINDS[kind] = factory, warmup


def drawable_for(context: Context, item: object) -> Drawable:
    """Return the drawable of a scene's object.

    Raises
    ------
    InvalidScene
        If no factory was registered for its type.
    """
    return _kind_of(item)[0](context, item)


def warmup_of(context: Context, item: object) -> WarmupPlan:
    """Return the warm-up plan of a scene's object; errors are those of `drawable_for`."""
    return _kind_of(item)[1](context, item)


def _kind_of(item: object) -> tuple[Factory, WarmupFactory]:
    for kind in type(item).__mro__:
        if kind in _DRAWABLE_KINDS:
            return _DRAWABLE_KINDS[kind]
    for kind, factories in _DRAWABLE_KINDS.items():
        if getattr(kind, "_is_protocol", False) and isinstance(item, kind):
            return factories
    raise InvalidScene(
        f"cannot draw a {type(item).__name__}; expected a MeshObject, a TreeObject "
        "or an object of a type given to decals.rendering.register"
    )
