"""`bake`: a scene as a GLB file whose texture or vertex colours show the decals."""

import os
from collections.abc import Sequence

from blobtree.progress import Cancel, Progress
from blobtree.validation import truth
from decals.baking.export import TEXTURE, VERTICES, export
from decals.baking.layouts import AUTO
from decals.errors import InvalidScene
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact
from decals.rendering.options import SceneLike
from decals.scenes.objects import SceneObject
from decals.surfaces.convert import Model
from decals.validation import checked_path

SUFFIX = ".glb"


def bake(
    scene: SceneLike | SceneObject | Model | Sequence[SceneObject | Model],
    path: str | os.PathLike[str],
    *,
    size: int = 2048,
    samples: int = 2,
    layout: str = AUTO,
    tiles: int = 1,
    vertex_colors: bool = False,
    contact: AnyContact | str | None = None,
    stiffness: float | None = None,
    mapping: ImageMapping | str | None = None,
    resolution: int | None = None,
    creases: bool = False,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> None:
    """Write a scene as a GLB file for other programs, with the decals in a texture or in vertex colours.

    The file has a node for each object, with normals. All nodes share one texture and one material, whose
    base colour is that of decals and objects without light. Scenes with a `DecalMaterial` get textures of
    normals, roughness, metalness, occlusion and emission too. Coordinates are those of the scene. No OpenGL
    is needed.

    Parameters
    ----------
    scene : Scene, SceneObject or Model
        A scene; or a model as `decals.cover` takes it, a list of such models, or the path of a model or a
        scene.
    path : str or path
        The file, which ends in ``.glb``; its folder must exist.
    size : int
        Width and height of the texture in texels, from 16 to 8192.
    samples : int
        Samples along each axis of a texel whose neighbours differ; 2 means 4 samples a texel.
    layout : str
        How surfaces lie on the texture: ``"auto"``, ``"box"``, ``"xatlas"`` or ``"own"``; see `export`.
    tiles : int
        Textures of that size over which the surfaces are spread; see `export`.
    vertex_colors : bool
        Write the colours at the vertices instead of a texture. Only fine meshes then show images; xatlas is
        not needed.
    contact : Contact or str, optional
        Contact mode: how decals that push each other share the surface; ``"elastic"``, ``"product"`` (the
        paper), ``"min"`` or ``"radial"``. Default: that of the scene, as for stiffness and mapping.
    stiffness : float, optional
        Stiffness of elastic contact, from 1: how close to contact lines images are compressed.
    mapping : ImageMapping or str, optional
        Image mapping: how images lie on curved surface; ``"corrected"``, ``"chord"`` or ``"walked"``.
    resolution : int, optional
        Cells along the longest side of a tree's support, for the triangles of implicit objects. Default 64;
        below textures, edges are then halved until the triangles lie within a part of a texel of the surface.
    creases : bool
        Keep the edges that unions, intersections and differences leave on implicit objects.
    progress : callable, optional
        Called as ``progress(stage, fraction)``, with the stage in plain words and the fraction done.
    cancel : callable, optional
        Called often; the work stops if it returns True.

    Raises
    ------
    InvalidScene, InvalidMesh, InvalidFile, InvalidResolution
        If the scene, the path or an option cannot be used, or the file cannot be written.
    MissingPackage
        If a package of the extra ``bake`` is not installed; the message has the command.
    Cancelled
        `cancel` returned True; no file was written.

    See Also
    --------
    decals.evaluate : colours at any points.
    decals.save_scene : a scene as a file for this package.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12)
    >>> decals.bake(scene, "ball.glb", size=64, resolution=16)
    """
    export(
        scene,
        checked_path(path, (SUFFIX,)),
        colors=VERTICES if truth("vertex_colors", vertex_colors, InvalidScene) else TEXTURE,
        size=size,
        samples=samples,
        layout=layout,
        tiles=tiles,
        contact=contact,
        stiffness=stiffness,
        mapping=mapping,
        resolution=resolution,
        creases=creases,
        progress=progress,
        cancel=cancel,
    )
