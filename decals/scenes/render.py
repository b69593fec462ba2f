"""From a scene or a model to a picture in one call."""

from collections.abc import Mapping, Sequence
from enum import Enum
from types import MappingProxyType
from typing import Any, cast

from blobtree.colors import ColorLike
from blobtree.identity import content_hash
from blobtree.progress import reporting
from decals.field.law import AnyContact
from decals.field.mapping import ImageMapping
from decals.images.load import AnyImage
from decals.rendering.environment import Environment, as_environment
from decals.rendering.lights import Lighting
from decals.rendering.options import (
    Background,
    Drawing,
    RenderOptions,
    SceneLike,
    Size,
    drawing_of,
    is_scene_like,
)
from decals.rendering.picture import Picture
from decals.rendering.pixel_pass import driver_name
from decals.rendering.renderer import Renderer
from decals.rendering.viewpoint import Viewpoint
from decals.scenes.cover import as_scene
from decals.scenes.objects import SceneObject
from decals.scenes.provenance import package_versions, provenance
from decals.scenes.recipe import plain
from decals.scenes.scene import Scene
from decals.surfaces.convert import Model

SHOWN_PARTS = ("objects", "decals", "images", "camera", "drawing")
"""Parts of a scene that a picture shows."""

PICTURE_FUNCTION = "decals.render"
"""Function in the recipes of pictures."""


def render(
    scene: SceneLike | SceneObject | Model | Sequence[SceneObject | Model],
    *,
    size: Size = (800, 600),
    samples: int | None = None,
    contact: AnyContact | str | None = None,
    stiffness: float | None = None,
    mapping: ImageMapping | str | None = None,
    background: Background | ColorLike | None = None,
    lights: Lighting | None = None,
    filtered: bool | None = None,
    environment: Environment | AnyImage | None = None,
    viewpoint: Viewpoint | None = None,
) -> Picture:
    """Draw a scene, or a model without decals.

    A scene is drawn as its ``drawing`` says; options that are given are used in place of its own. Each call
    makes an OpenGL context. For many pictures, keep a `decals.rendering.Renderer`.

    Parameters
    ----------
    scene : Scene, SceneObject or Model
        A scene; or a model as `decals.cover` takes it, a list of such models, or the path of a model or a
        scene.
    size : (int, int)
        Width and height in pixels.
    samples : int, optional
        Samples along each axis of a pixel; 2 means 4 samples a pixel.
    contact : Contact or str, optional
        Contact mode: how decals that push each other share the surface; ``"elastic"``, ``"product"`` (the
        paper), ``"min"`` or ``"radial"``.
    stiffness : float, optional
        Stiffness of elastic contact, from 1: how close to contact lines images are compressed.
    mapping : ImageMapping or str, optional
        Image mapping: how images lie on curved surface; ``"corrected"``, ``"chord"`` or ``"walked"``.
    background : Background or colour, optional
        Colours behind the objects: a gradient; or one colour, by its name such as ``"white"`` or
        ``"transparent"``, or by numbers.
    lights : Lighting, optional
        Lights in place of the studio light.
    filtered : bool, optional
        Average images, rims and contact lines over each sample; they are then smooth with one sample a pixel.
    environment : Environment or image, optional
        Picture of all directions as light, in place of the studio light; ``lights`` are added to it.
    viewpoint : Camera or Projection, optional
        Viewpoint in place of the scene's camera.

    Returns
    -------
    Picture
        An array of pixels, uint8[h, w, 4], with a method ``save``.

    Raises
    ------
    InvalidScene, InvalidMesh, InvalidFile, InvalidImage
        If the scene or an option cannot be used.
    NoGraphics
        If there is no OpenGL; the message says what to install.
    TooMuchData
        If the scene does not fit on the GPU.

    See Also
    --------
    decals.show, decals.rendering.Renderer

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12)
    >>> decals.render(scene, size=(64, 48))
    Picture(64 × 48 pixels)
    """
    given: dict[str, object] = {
        "samples": samples,
        "contact": contact,
        "mapping": mapping,
        "background": background,
        "lights": lights,
        "stiffness": stiffness,
        "filtered": filtered,
        "environment": None if environment is None else as_environment(environment),
    }
    width, height = Drawing().overridden(**given).at(size).size  # checked before a model is read
    with reporting() as report:
        report("drawing", 0.0)
        drawn = cast(SceneLike, scene) if is_scene_like(scene) else as_scene(scene, aspect=width / height)
        options = drawing_of(drawn).overridden(**given).at(size)
        with Renderer() as renderer:
            return drawn_picture(renderer, drawn, options, given, viewpoint)


def drawn_picture(
    renderer: Renderer,
    scene: SceneLike,
    options: RenderOptions,
    given: Mapping[str, Any] = MappingProxyType({}),
    viewpoint: Viewpoint | None = None,
) -> Picture:
    """Draw a scene, and return the picture with its recipe; ``given`` are options that the scene lacks."""
    pixels = renderer.render(scene, options, viewpoint=viewpoint)
    if not isinstance(scene, Scene):  # such as a posed scene, which no file holds
        return Picture(pixels)
    changed = {name: value for name, value in given.items() if value is not None}
    if viewpoint is not None:
        changed["viewpoint"] = viewpoint
    plain_ones = {name: _option(value) for name, value in changed.items()}
    recipe = {
        "function": PICTURE_FUNCTION,
        "parameters": {"size": list(options.size)} | plain_ones,
        "missing": [name for name in changed if not isinstance(plain_ones[name], str | float | int)],
        "scene": scene_hashes(scene),
        "recipe": None if scene.recipe is None else scene.recipe.record,
        "versions": package_versions(),
        "made": provenance(driver_name(renderer.context.gl)),
    }
    return Picture(pixels, recipe)


def scene_hashes(scene: Scene) -> dict[str, str]:
    """Return the content hashes of the parts of a scene that a picture shows."""
    return {name: content_hash(getattr(scene, name)) for name in SHOWN_PARTS}


def _option(value: Any) -> Any:
    """Return an option as a recipe has it: the name of a mode, or a plain value."""
    return value.name.lower() if isinstance(value, Enum) else plain(value)
