"""From a scene or a model to a picture in one call."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import Enum
from itertools import repeat
from types import MappingProxyType
from typing import Any, TypeAlias, cast

import numpy as np

from blobtree.colors import ColorLike
from blobtree.identity import content_hash
from blobtree.progress import reporting
from blobtree.validation import items
from decals.errors import InvalidScene
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact
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
    is_viewpoint,
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

Drawn: TypeAlias = SceneLike | SceneObject | Model | Sequence[SceneObject | Model]
"""What `render` draws: a scene, a model, or several models as one scene."""

SHOWN_PARTS = ("objects", "decals", "images", "camera", "drawing")
"""Parts of a scene that a picture shows."""

PICTURE_FUNCTION = "decals.render"
"""Function in the recipes of pictures."""


def render(
    scene: Drawn,
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

    A scene is drawn as its ``drawing`` says; options that are given are used in place of its own. For many
    pictures, take `decals.render_batch`.

    Parameters
    ----------
    scene : Scene, SceneObject or Model
        A scene; or a model as `decals.cover` takes it, a list of such models, or the path of a model or a
        scene.
    size : (int, int)
        Width and height in pixels, each at most 16384.
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
        If the scene does not fit on the GPU, or the picture in memory.

    See Also
    --------
    decals.render_batch, decals.show, decals.rendering.Renderer

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12)
    >>> decals.render(scene, size=(64, 48))
    Picture(64 × 48 pixels)
    """
    (picture,) = render_batch(
        [scene],
        viewpoints=viewpoint,
        size=size,
        samples=samples,
        contact=contact,
        stiffness=stiffness,
        mapping=mapping,
        background=background,
        lights=lights,
        filtered=filtered,
        environment=environment,
    )
    return picture


def render_batch(
    scenes: Drawn | Iterable[Drawn],
    *,
    viewpoints: Viewpoint | Iterable[Viewpoint] | None = None,
    size: Size = (800, 600),
    samples: int | None = None,
    contact: AnyContact | str | None = None,
    stiffness: float | None = None,
    mapping: ImageMapping | str | None = None,
    background: Background | ColorLike | None = None,
    lights: Lighting | None = None,
    filtered: bool | None = None,
    environment: Environment | AnyImage | None = None,
) -> Iterator[Picture]:
    """Draw many scenes, or one scene from many viewpoints, in one OpenGL context.

    Each picture equals the picture of `render`. Programs and uploads are kept from picture to picture. A
    picture is drawn when it is taken, so that any number of them needs little memory.

    Parameters
    ----------
    scenes : Scene, SceneObject or Model, or iterable of them
        Scenes or models as `render` takes them; a list of models as one scene lies in a list of its own. A
        single one is drawn from each viewpoint.
    viewpoints : Camera or Projection, or iterable of them, optional
        One viewpoint for all scenes, or one for each, in place of their cameras.
    size, samples, contact, stiffness, mapping, background, lights, filtered, environment
        See `render`; they hold for all pictures.

    Yields
    ------
    Picture
        An array of pixels, uint8[h, w, 4], with a method ``save``.

    Raises
    ------
    InvalidScene
        The numbers of scenes and viewpoints differ; and the errors of `render`.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12)
    >>> around = [decals.Camera((5, 0, 0)), decals.Camera((0, 0, 5))]
    >>> for number, picture in enumerate(decals.render_batch(scene, viewpoints=around, size=(32, 24))):
    ...     picture.save(f"view-{number}.png")
    >>> [picture.shape for picture in decals.render_batch([scene, scene], size=(32, 24))]
    [(24, 32, 4), (24, 32, 4)]
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
    Drawing().overridden(**given).at(size)  # checked before a model is read
    return _drawn_pictures(_paired(scenes, viewpoints), size, given)


def _paired(scenes: Any, viewpoints: Any) -> Iterator[tuple[Drawn, Viewpoint | None]]:
    """Return scenes with their viewpoints; one of either stands for all."""
    views = None if viewpoints is None or is_viewpoint(viewpoints) else items(viewpoints)
    if not _is_several(scenes):
        return zip(repeat(scenes), (viewpoints,) if views is None else views, strict=False)
    if views is None:
        return zip(scenes, repeat(viewpoints), strict=False)
    if hasattr(scenes, "__len__") and len(scenes) != len(views):
        raise InvalidScene(
            f"viewpoints: expected one, or one for each of {len(scenes)} scenes, got {len(views)}"
        )
    return zip(scenes, views, strict=False)


def _is_several(scenes: object) -> bool:
    """Return True for a list, a tuple or an iterator of scenes; a pair of arrays is one model."""
    if isinstance(scenes, tuple):
        return not (len(scenes) == 2 and all(isinstance(part, np.ndarray | list) for part in scenes))
    return isinstance(scenes, list | Iterator)


def _drawn_pictures(
    pairs: Iterable[tuple[Drawn, Viewpoint | None]], size: Size, given: Mapping[str, Any]
) -> Iterator[Picture]:
    """Yield the picture of each scene from its viewpoint."""
    width, height = size
    with Renderer() as renderer:
        for scene, viewpoint in pairs:
            with reporting() as report:
                report("drawing", 0.0)
                is_scene = is_scene_like(scene)
                drawn = cast(SceneLike, scene) if is_scene else as_scene(scene, aspect=width / height)
                options = drawing_of(drawn).overridden(**given).at(size)
                picture = drawn_picture(renderer, drawn, options, given, viewpoint)
            yield picture


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
    plain_ones = {name: option_value(value) for name, value in changed.items()}
    of_scene = {
        "missing": [name for name in changed if not isinstance(plain_ones[name], str | float | int)],
        "scene": scene_hashes(scene),
        "recipe": None if scene.recipe is None else scene.recipe.record,
    }
    parameters = {"size": list(options.size)} | plain_ones
    return Picture(pixels, picture_record(renderer, PICTURE_FUNCTION, parameters) | of_scene)


def picture_record(renderer: Renderer, function: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return the recipe of a picture that a function with some parameters draws."""
    made = provenance(driver_name(renderer.context.gl))
    return {"function": function, "parameters": parameters, "versions": package_versions(), "made": made}


def scene_hashes(scene: Scene) -> dict[str, str]:
    """Return the content hashes of the parts of a scene that a picture shows."""
    return {name: content_hash(getattr(scene, name)) for name in SHOWN_PARTS}


def missing_beside(recipe: Mapping[str, Any], scene: Scene | None) -> tuple[str, ...]:
    """Return what the recipe of a picture or an exported file needs and a scene does not have."""
    missing = [f"the value of {name!r}, which the recipe only describes" for name in recipe["missing"]]
    if scene is None:
        return (*missing, "the scene: give its file with --scene")
    hashes = scene_hashes(scene)
    others = [name for name, value in recipe["scene"].items() if hashes.get(name) != value]
    return (*missing, *(f"the {name} of the recipe: the scene has others" for name in others))


def option_value(value: Any) -> Any:
    """Return an option as a recipe has it: the name of a mode, or a plain value."""
    return value.name.lower() if isinstance(value, Enum) else plain(value)
