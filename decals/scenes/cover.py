"""From models to a scene in one call: one coat of decals over all of them, and a camera that sees them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from blobtree import Node, Progress
from decals.coat.orientation import Direction
from decals.coat.seeding import seed as seed_decals
from decals.errors import InvalidScene
from decals.scenes.camera import Camera, Vector
from decals.scenes.scene import DecalImage, MeshObject, Scene, SceneObject, TreeObject

THREE_QUARTER: Vector = (0.55, 0.35, 1.0)
"""Direction toward the camera: from the right, a little above."""

SAMPLES = 2000
"""Points per object that a picture is framed by."""


def cover(
    *models: Node | SceneObject,
    count: int = 500,
    images: Sequence[str | DecalImage] = ("scale",),
    seed: int = 0,
    direction: Direction = None,
    view: Vector = THREE_QUARTER,
    progress: Progress | None = None,
) -> Scene:
    """Cover models with one coat of decals that run across wherever the models touch.

    Parameters
    ----------
    models
        BlobTrees, or objects of a scene.
    count
        How many decals, exactly.
    images
        Names of generated images, paths of pictures, or images; decals choose among them at random.
    seed
        The same number gives the same scene.
    direction
        Of the images' u axes: None (random), a vector, or a function of points (n, 3) to vectors (n, 3).
    view
        Direction from the models toward the camera.

    Raises
    ------
    DecalsError
        Something given makes no sense; the message says what.
    """
    objects = [_object(model, number) for number, model in enumerate(models, 1)]
    pictures = [image if isinstance(image, DecalImage) else DecalImage.load(image) for image in images]
    if not objects:
        raise InvalidScene("expected at least one model, got none")
    decals = seed_decals(
        [item.surface for item in objects],
        count=count,
        seed=seed,
        direction=direction,
        images=len(pictures),
        progress=progress,
    )
    return Scene(
        objects=tuple(objects),
        camera=Camera.fitting(_seen_points(objects), direction=view, margin=1.1),
        decals=decals,
        images=tuple(pictures),
    )


def _seen_points(objects: Sequence[SceneObject]) -> NDArray[np.float32]:
    """Points (n, 3) spread over all surfaces, for the camera to see."""
    return np.concatenate([item.surface.sample(SAMPLES, seed=0)[0] for item in objects])


def _object(model: Node | SceneObject, number: int) -> SceneObject:
    if isinstance(model, Node):
        return TreeObject(f"model {number}", model)
    if isinstance(model, MeshObject | TreeObject):
        return model
    raise InvalidScene(f"model {number}: expected a BlobTree, MeshObject or TreeObject, got {model!r}")
