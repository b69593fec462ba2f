"""From a scene or a model to a picture in one call."""

from collections.abc import Sequence
from typing import cast

from blobtree.progress import reporting
from decals.field.mapping import ImageMapping
from decals.record import DEFAULT_CONTACT, DEFAULT_STIFFNESS, Contact
from decals.rendering.lights import Lighting
from decals.rendering.options import STUDIO, Background, RenderOptions, SceneLike, Size, is_scene_like
from decals.rendering.picture import Picture
from decals.rendering.renderer import Renderer
from decals.rendering.viewpoint import Viewpoint
from decals.scenes.cover import as_scene
from decals.scenes.objects import SceneObject
from decals.surfaces.convert import Model


def render(
    scene: SceneLike | SceneObject | Model | Sequence[SceneObject | Model],
    *,
    size: Size = (800, 600),
    samples: int = 2,
    contact: Contact | str = DEFAULT_CONTACT,
    stiffness: float = DEFAULT_STIFFNESS,
    mapping: ImageMapping | str = ImageMapping.CORRECTED,
    background: Background = STUDIO,
    lights: Lighting | None = None,
    viewpoint: Viewpoint | None = None,
) -> Picture:
    """Draw a scene, or a model without decals.

    Each call makes an OpenGL context. For many pictures, keep a `decals.rendering.Renderer`.

    Parameters
    ----------
    scene : Scene, SceneObject or Model
        A scene; or a model as `decals.cover` takes it, a list of such models, or the path of a model or a
        scene.
    size : (int, int)
        Width and height in pixels.
    samples : int
        Samples along each axis of a pixel; 2 means 4 samples a pixel.
    contact : Contact or str
        Contact mode: how decals that push each other share the surface; ``"elastic"``, ``"product"`` (the
        paper), ``"min"`` or ``"radial"``.
    stiffness : float
        Stiffness of elastic contact, from 1: how close to contact lines images are compressed.
    mapping : ImageMapping or str
        Image mapping: how images lie on curved surface; ``"corrected"`` or ``"chord"``.
    background : Background
        Colours behind the objects, such as `decals.rendering.TRANSPARENT`.
    lights : Lighting, optional
        Lights in place of the studio light.
    viewpoint : Camera or Projection, optional
        Viewpoint in place of the scene's camera.

    Returns
    -------
    Picture
        An array of pixels, uint8[h, w, 4], with a method ``save``.

    Raises
    ------
    InvalidScene, InvalidMesh, InvalidFile
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
    options = RenderOptions(size, samples, contact, mapping, background, lights, stiffness)
    width, height = options.size
    with reporting() as report:
        report("drawing", 0.0)
        drawn = cast(SceneLike, scene) if is_scene_like(scene) else as_scene(scene, aspect=width / height)
        with Renderer() as renderer:
            return Picture(renderer.render(drawn, options, viewpoint=viewpoint))
