"""`bake`: a scene as a GLB file whose texture or vertex colours show the decals."""

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from blobtree._typing import Float32Array, Float64Array
from blobtree.errors import InvalidResolution
from blobtree.files import write_atomically
from blobtree.progress import Cancel, Progress, reporting
from blobtree.validation import truth
from decals.baking.atlas import Unwrapped, unwrap
from decals.baking.glb import Node, glb_bytes
from decals.baking.materials import CHANNELS, material_bytes, split_maps, surface_values, vertex_tangents
from decals.baking.meshes import BakeMesh, bake_mesh
from decals.baking.texture import BLOCK_SAMPLES, bake_texture
from decals.errors import InvalidScene
from decals.field.evaluate import evaluate
from decals.field.law import AnyContact
from decals.field.mapping import ImageMapping
from decals.field.walks import walks_for
from decals.images.texels import decode_srgb
from decals.index.editor import DecalEditor
from decals.index.index import DecalIndex
from decals.model import Decals
from decals.rendering.options import Drawing, ImageLike, SceneLike, drawing_of, modes_of
from decals.scenes.cover import scene_or_objects
from decals.scenes.objects import SceneObject
from decals.scenes.origin import WORLD
from decals.scenes.scene import DecalImage
from decals.surfaces.convert import Model
from decals.validation import checked_path, optional_package, whole_number

SUFFIX = ".glb"

MIN_SIZE, MAX_SIZE = 16, 8192
"""Sides of a texture in texels: graphics cards read larger ones badly, or not at all."""

MAX_SAMPLES = 16
"""Samples along each axis of a texel, at most."""


def bake(
    scene: SceneLike | SceneObject | Model | Sequence[SceneObject | Model],
    path: str | os.PathLike[str],
    *,
    size: int = 2048,
    samples: int = 2,
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
        Samples along each axis of a texel; 2 means 4 samples a texel.
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
        Cells along the longest side of a tree's support, for the triangles of implicit objects. Default 64.
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
    path = checked_path(path, (SUFFIX,))
    size = whole_number("size", size, MIN_SIZE, MAX_SIZE, InvalidScene)
    samples = whole_number("samples", samples, 1, MAX_SAMPLES, InvalidScene)
    if resolution is not None:
        whole_number("resolution", resolution, 1, None, InvalidResolution)
    modes = {"contact": contact, "mapping": mapping, "stiffness": stiffness}
    Drawing().overridden(**modes)  # checked before a model is read
    vertex_colors = truth("vertex_colors", vertex_colors, InvalidScene)
    creases = truth("creases", creases, InvalidScene)
    for package in ("trimesh",) if vertex_colors else ("trimesh", "xatlas"):
        optional_package(package, "bake")
    with reporting(progress, cancel) as report:
        objects, decals, images, drawing = _parts(scene)
        drawing = drawing.overridden(**modes)
        if not objects:
            raise InvalidScene("expected at least one object to bake, got none; add a mesh or a BlobTree")
        meshes = [bake_mesh(item, resolution=resolution, creases=creases, report=report) for item in objects]
        colors = SurfaceColors(meshes, objects, decals, images, drawing)
        maps = None
        if vertex_colors:
            nodes = _colored_nodes(meshes, colors, report)
        else:
            unwrapped = unwrap(meshes, size, report)
            parts = list(zip(meshes, unwrapped, strict=True))
            options: dict[str, Any] = {}
            if colors.has_materials:  # maps are of the rest pose
                resting = [vertex_tangents(mesh.places, mesh.facings, part) for mesh, part in parts]
                options = {"channels": CHANNELS, "encode": material_bytes, "tangents": resting}
            texels = bake_texture(meshes, unwrapped, size, samples, colors.at, report, **options)
            maps = split_maps(texels)
            nodes = [_textured_node(mesh, part, size, colors.has_materials) for mesh, part in parts]
        report("writing the file", 0.0)
        content = glb_bytes(nodes, maps, getattr(objects[0], "origin", WORLD))
        report("writing the file", 0.5)
        try:
            write_atomically(path, content)
        except OSError as error:
            raise InvalidScene(
                f"could not write {str(path)!r} ({error.strerror}); choose another folder"
            ) from error
    if progress is not None:  # without the check of `cancel`, as the file is written
        progress("writing the file", 1.0)


class SurfaceColors:
    """Colours of the objects of a scene with the decals on them, without light.

    Parameters
    ----------
    meshes : sequence of BakeMesh
        The objects.
    objects : sequence of objects of a scene
        The same as the scene has them, which decides which decals lie on them.
    decals : Decals or DecalEditor
        The decals on them.
    images : sequence of images
        Images of the decals.
    drawing : Drawing
        Has the modes of the decals.
    """

    def __init__(
        self,
        meshes: Sequence[BakeMesh],
        objects: Sequence[object],
        decals: Decals | DecalEditor,
        images: Sequence[ImageLike],
        drawing: Drawing,
    ) -> None:
        self._meshes, self._objects, self._decals = meshes, objects, decals
        self.has_materials = any(hasattr(image, "surface_texels") for image in images)
        self._materials = list(images)
        self._images = [DecalImage(f"image {i}", image.pixels) for i, image in enumerate(images)]
        self._options = evaluation_options(drawing, decals, objects)

    def at_vertices(self, number: int, rows: slice = slice(None)) -> Float64Array:
        """Return linear colours of vertices of mesh ``number``, ``float64[n, 3]``."""
        mesh = self._meshes[number]
        base = None if mesh.vertex_light is None else mesh.vertex_light[rows]
        return self.at(number, mesh.places[rows], mesh.facings[rows], base=base)

    def at(
        self,
        number: int,
        points: Float32Array,
        normals: Float32Array,
        tangents: Float32Array | None = None,
        base: Float64Array | None = None,
    ) -> Float64Array:
        """Return linear colours ``float64[n, 3]`` of mesh ``number`` at points with unit normals.

        With tangents, they are the values of all maps, see `decals.baking.materials.surface_values`. The base
        colours at the points are linear too; by default those of `BakeMesh.base_colors`.
        """
        if base is None:
            srgb = np.asarray(self._meshes[number].base_colors(points), np.float64)
            base = decode_srgb(srgb).astype(np.float64, copy=False)
        samples = evaluate(
            self._decals,
            points,
            normals,
            images=self._images if tangents is None else self._materials,
            materials=tangents is not None,
            on=self._objects[number],
            **self._options,
        )
        over = samples.color
        assert over is not None  # there are images, if only an empty list of them
        colors: Float64Array = base * (1.0 - over[:, 3:]) + over[:, :3]
        if tangents is None or samples.materials is None:
            return colors
        return surface_values(colors, samples.materials, normals, tangents)


def evaluation_options(
    drawing: Drawing, decals: Decals | DecalEditor, objects: Sequence[object]
) -> dict[str, Any]:
    """Return the arguments of `evaluate` that are the same everywhere on some objects."""
    index = DecalIndex.of(decals) if isinstance(decals, Decals) else None
    return modes_of(drawing) | {"index": index, "walks": walks_for(drawing.mapping, decals, objects)}


def _textured_node(mesh: BakeMesh, part: Unwrapped, size: int, tangents: bool) -> Node:
    uv = part.places / np.float32(size)
    uv[:, 1] = 1.0 - uv[:, 1]
    vertices, normals = mesh.vertices[part.rows], mesh.normals[part.rows]
    along = vertex_tangents(mesh.vertices, mesh.normals, part) if tangents else None
    return Node(mesh.name, vertices, part.faces, normals, uv=uv, tangents=along)


def _colored_nodes(meshes: Sequence[BakeMesh], colors: SurfaceColors, report: Progress) -> list[Node]:
    nodes = []
    for number, mesh in enumerate(meshes):
        parts = []
        for first in range(0, len(mesh.vertices), BLOCK_SAMPLES):
            report("colouring vertices", (number + first / len(mesh.vertices)) / len(meshes))
            rows = slice(first, first + BLOCK_SAMPLES)
            parts.append(colors.at_vertices(number, rows))
        linear = np.clip(np.concatenate(parts), 0.0, 1.0).astype(np.float32)
        nodes.append(Node(mesh.name, mesh.vertices, mesh.faces, mesh.normals, colors=linear))
    return nodes


def _parts(scene: object) -> tuple[Sequence[object], Decals | DecalEditor, list[ImageLike], Drawing]:
    """Return objects, decals, images and drawing of a scene, of models or of the file of either."""
    known = scene_or_objects(scene)
    if isinstance(known, list):
        return known, Decals.empty(), [], Drawing()
    return known.objects, known.decals, list(known.images), drawing_of(known)
