"""From models to a scene in one call: decals over all of them, and a camera that shows them."""

from collections.abc import Sequence

import numpy as np

from blobtree import Progress
from blobtree._typing import Float32Array
from decals.errors import InvalidScene
from decals.scattering.orientation import Direction
from decals.scattering.scatter import scatter
from decals.scenes.camera import THREE_QUARTER, Camera, Vector
from decals.scenes.objects import SceneObject, as_objects
from decals.scenes.scene import DecalImage, Scene
from decals.surfaces.convert import Model
from decals.validation import describe

FRAMING_SAMPLES = 2000
"""Points per object that the camera is fitted to."""

FRAMING_MARGIN = 1.1
"""Space around the objects in a picture, 1 for none."""


def cover(
    *models: Model | SceneObject,
    count: int = 500,
    images: Sequence[str | DecalImage] = ("scale",),
    seed: int = 0,
    direction: Direction = None,
    view_direction: Vector = THREE_QUARTER,
    progress: Progress | None = None,
) -> Scene:
    """Cover models with decals that lie evenly, also across the places where models touch.

    Parameters
    ----------
    *models : Model or SceneObject
        BlobTrees, pyvista datasets, meshes with ``vertices`` and ``faces`` (trimesh), tuples
        ``(vertices, faces)``, paths of models, or objects of a scene.
    count : int
        Number of decals.
    images : sequence of str or DecalImage
        Names of generated images, paths of pictures, or images. Each decal shows one of them at random.
    seed : int
        Seed of all random choices; equal seeds give equal scenes.
    direction : optional
        Of the images' u axes: None (random), a vector, or a function of points (n, 3) to vectors (n, 3).
    view_direction : (x, y, z)
        Direction from the models toward the camera.
    progress : callable, optional
        Called with the name of a stage and the fraction done.

    Returns
    -------
    Scene

    Raises
    ------
    ImplicitDecalsError
        If an argument cannot be used; the message names it.

    See Also
    --------
    decals.scatter : decals alone, with all options of their distribution

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12)
    >>> len(scene.decals)
    12
    """
    objects = as_objects(models)
    try:
        sources = list(images)
    except TypeError:
        raise InvalidScene(f"images: expected a list of images, got {describe(images)}") from None
    pictures = [image if isinstance(image, DecalImage) else DecalImage.load(image) for image in sources]
    if not objects:
        raise InvalidScene("expected at least one model, got none")
    decals = scatter(
        [item.surface for item in objects],
        count=count,
        seed=seed,
        direction=direction,
        images=len(pictures),
        progress=progress,
    )
    return Scene(
        objects=tuple(objects),
        camera=fitting_camera(objects, direction=view_direction),
        decals=decals,
        images=tuple(pictures),
    )


def fitting_camera(
    objects: Sequence[SceneObject], *, direction: Vector = THREE_QUARTER, aspect: float = 4 / 3
) -> Camera:
    """Return a camera that looks from a direction and whose picture the objects fill."""
    points: Float32Array = np.concatenate(
        [item.surface.sample(FRAMING_SAMPLES, seed=0)[0] for item in objects]
    )
    return Camera.fitting(points, direction=direction, aspect=aspect, margin=FRAMING_MARGIN)
