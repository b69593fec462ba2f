"""From models to a scene in one call: decals over all of them, and a camera that shows them."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from blobtree._typing import Float32Array
from blobtree.progress import Progress, reporting
from blobtree.validation import describe
from decals.errors import InvalidScattering, InvalidScene
from decals.images.load import DEFAULT_IMAGE, AnyImage
from decals.rendering.options import SceneLike, is_scene_like, relief_ranges
from decals.scattering.orientation import Direction
from decals.scattering.scatter import scatter
from decals.scattering.sizing import Sizing
from decals.scenes.camera import REFERENCE_ASPECT, THREE_QUARTER, UPRIGHT, Camera, Vector
from decals.scenes.objects import MeshObject, SceneObject, as_objects
from decals.scenes.recipe import Recipe
from decals.scenes.scene import Scene, as_images
from decals.surfaces.convert import Model
from decals.surfaces.normals import CREASE_ANGLE
from decals.surfaces.windings import MeshOrientation
from decals.validation import instance, member

FRAMING_SAMPLES = 2000
"""Points per object that the camera is fitted to."""

LEAST_FILLED = 0.9
"""Least share of a picture's width or height that a model takes; below it, all vertices count."""

DEFAULT_FOV = 30.0
"""Default angle of view, in degrees."""

FRAMING_MARGIN = 1.1
"""Space around the objects in a picture, 1 for none."""


def cover(
    *models: Model | SceneObject | list[Any],
    count: int = 500,
    images: AnyImage | Iterable[AnyImage] = DEFAULT_IMAGE,
    seed: int = 0,
    direction: Direction = None,
    sizing: Sizing | str = Sizing.COVERING,
    view_direction: Vector | None = None,
    up: str = "y",
    fov: float = DEFAULT_FOV,
    crease_angle: float = CREASE_ANGLE,
    orientation: MeshOrientation | str = MeshOrientation.OUTWARD,
    progress: Progress | None = None,
) -> Scene:
    """Cover models with decals that lie evenly, also across the places where models touch.

    Parameters
    ----------
    *models : Model or SceneObject
        BlobTrees, pyvista datasets, meshes with ``vertices`` and ``faces`` (trimesh), tuples
        ``(vertices, faces)``, paths of models, or objects of a scene; or one list of these.
    count : int
        Number of decals.
    images : image, or sequence of images
        Names of generated images, paths of pictures, arrays, PIL images, textures or `DecalImage` objects.
        Each decal shows one of them at random.
    seed : int
        Seed of all random choices; equal seeds give equal scenes.
    direction : optional
        Of the images' u axes: None (random), a vector, or a function of points (n, 3) to vectors (n, 3).
    sizing : Sizing or str
        Rule for the radii: ``"covering"`` (no gaps), ``"touching"`` (no overlaps) or ``"delaunay"``.
    view_direction : (x, y, z), optional
        Direction from the models toward the camera; from three-quarters in front by default.
    up : {"y", "z", "x"}
        The axis that points upward in pictures, ``"z"`` for most meshes of pyvista.
    fov : float
        Vertical angle of view of the camera in degrees. The models fill pictures of all aspect ratios.
    crease_angle : float
        Angle between two faces of a mesh, in degrees, from which their edge is drawn sharp. Objects of a
        scene keep their own.
    orientation : MeshOrientation or str
        ``"outward"`` (default): closed parts of meshes that wind inward are turned, with what lies inside
        them. ``"keep"``: all parts stay as they are. ``"flip"``: all faces are turned. Objects of a scene
        keep their own.
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
    if not isinstance(up, str) or up not in UPRIGHT:
        raise InvalidScene(f"up: expected 'x', 'y' or 'z', got {describe(up)}")
    axes = UPRIGHT[up]
    toward = axes.preset("three-quarter") if view_direction is None else view_direction
    rule = member("sizing", sizing, Sizing, InvalidScattering)
    rule_of_meshes = member("orientation", orientation, MeshOrientation, InvalidScene)
    with reporting(progress) as report:
        report("reading models and images", 0.0)
        listed = models[0] if len(models) == 1 and isinstance(models[0], list) else models
        objects = as_objects(listed, crease_angle=crease_angle, orientation=rule_of_meshes)
        pictures = as_images(images)
        if not objects:
            raise InvalidScene("expected at least one model, got none")
        if not pictures:
            raise InvalidScene("images: expected at least one image, got none; leave it out for the default")
        report("preparing the surfaces", 0.0)
        decals = scatter(
            [item.surface for item in objects],
            count=count,
            seed=seed,
            direction=direction,
            sizing=rule,
            images=len(pictures),
            progress=report,
        )
        heights = relief_ranges(pictures)[decals.images, 1] * decals.radii
        raised = float(heights.max(initial=0.0))
        camera = fitting_camera(objects, direction=toward, up=axes.up, fov=fov, aspect=None, raised=raised)
    recipe = Recipe.of(
        "decals.cover",
        seed=seed,
        models=[item.name for item in objects],
        count=count,
        images=[picture.source for picture in pictures],
        direction=direction,
        sizing=rule.value,
        view_direction=toward,
        up=up,
        fov=fov,
        crease_angle=crease_angle,
        orientation=rule_of_meshes,
    ).giving(decals, objects)
    return Scene(objects=tuple(objects), camera=camera, decals=decals, images=pictures, recipe=recipe)


def fitting_camera(
    objects: Sequence[SceneObject],
    *,
    direction: Vector = THREE_QUARTER,
    up: Vector = UPRIGHT["y"].up,
    fov: float = DEFAULT_FOV,
    aspect: float | None = 4 / 3,
    raised: float = 0.0,
) -> Camera:
    """Return a camera that looks from a direction and whose picture the objects fill.

    Heights of decals raise the surface by at most ``raised``. Without ``aspect``, the objects fill pictures
    of all aspect ratios.
    """
    samples = [item.surface.sample(FRAMING_SAMPLES, seed=0) for item in objects]
    points: Float32Array = np.concatenate([places + raised * normals for places, normals in samples])
    shape = REFERENCE_ASPECT if aspect is None else aspect
    options: dict[str, Any] = {"direction": direction, "up": up, "fov": fov, "margin": FRAMING_MARGIN}
    camera = Camera.fitting(points, aspect=shape, **options)
    outermost = np.concatenate([points, *map(vertices_of, objects)])
    if not camera.shows(outermost, shape, least=LEAST_FILLED):
        camera = Camera.fitting(outermost, aspect=None, **options)
    elif aspect is None:
        camera = camera.fitted_to(outermost, margin=FRAMING_MARGIN)
    return camera if aspect is None else replace(camera.at(aspect), fit=None)


def vertices_of(item: SceneObject) -> Float32Array:
    """Return the vertices of the faces of an object, of a tree those of a coarse mesh."""
    surface = item.surface if isinstance(item, MeshObject) else item.surface.mesh
    used = np.zeros(len(surface.vertices), np.bool_)
    used[surface.faces[surface.sound]] = True
    return surface.vertices[used]


def scene_or_objects(model: object) -> SceneLike | list[SceneObject]:
    """Return a scene as it is, the scene of a file, or the objects of a model or of a list of models.

    Raises
    ------
    InvalidScene, InvalidMesh, InvalidFile
        If the model is of another kind, or cannot be used.
    """
    loaded = model
    if isinstance(model, str | os.PathLike):
        from decals.scenes.files import load_model  # needs all kinds of nodes: half a second of imports

        loaded = load_model(model)
    if is_scene_like(loaded):
        return cast(SceneLike, loaded)
    return as_objects(loaded if isinstance(loaded, list) and loaded else [loaded])


def as_scene(model: object, *, aspect: float = 4 / 3) -> Scene:
    """Return a scene as it is, or models without decals as a scene whose camera shows them.

    Parameters and errors are those of `scene_or_objects`; ``aspect`` is the width of the picture over its
    height.
    """
    built = scene_or_objects(model)
    if isinstance(built, list):
        return Scene(objects=built, camera=fitting_camera(built, aspect=aspect))
    return instance("scene", built, Scene, InvalidScene, "decals.cover makes one; a document has `.scene`")
