"""`export`: a scene as a file of another program, with the decals in a texture or in vertex colours."""

import base64
import logging
import os
import zlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np

from blobtree._typing import Float64Array
from blobtree.errors import InvalidResolution
from blobtree.files import write_together
from blobtree.progress import Cancel, Progress, reporting
from blobtree.validation import describe, truth
from decals.baking.fine_trees import below_texture
from decals.baking.formats import FORMATS
from decals.baking.instances import Instances, decal_instances
from decals.baking.layouts import AUTO, LAYOUTS, MAX_TILES, OWN, XATLAS, lay_out
from decals.baking.materials import SRGB, Maps, material_bytes, split_maps, vertex_tangents
from decals.baking.meshes import BakeMesh, bake_mesh
from decals.baking.parts import METRES, TILE_ROW, UP, Baked, Part
from decals.baking.surface_colors import ATTRIBUTES, BLOCK, SurfaceColors
from decals.baking.texture import Channels, bake_texture
from decals.baking.unwrapped import Unwrapped
from decals.errors import InvalidScene
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact
from decals.images.load import HasPixels
from decals.index.editor import DecalEditor
from decals.model import Decals
from decals.rendering.options import Drawing, SceneLike, drawing_of, drawn_objects
from decals.scenes.cover import scene_or_objects
from decals.scenes.files import to_json
from decals.scenes.objects import SceneObject
from decals.scenes.origin import WORLD
from decals.scenes.provenance import device_text, package_versions, provenance
from decals.scenes.recipe import Recipe, is_plain
from decals.scenes.render import option_value, scene_hashes
from decals.scenes.scene import Scene
from decals.surfaces.convert import Model
from decals.surfaces.mesh_check import MeshCheck
from decals.validation import checked_path, count_number, one_of, optional_package, whole_number

_logger = logging.getLogger(__name__)

TEXTURE, VERTICES, NO_COLORS = "texture", "vertices", "none"
"""Where a file holds colours."""

MIN_SIZE, MAX_SIZE = 16, 8192
"""Sides of a texture in texels: graphics cards read larger ones badly, or not at all."""

MAX_SAMPLES = 16
"""Samples along each axis of a texel, at most."""

EXPORT_FUNCTION = "decals.export"
"""Function in the recipes of exported files."""

MAX_SOURCE = 1 << 18
"""Characters of the compressed text of a scene, up to which a glTF file holds it."""


def export(
    scene: SceneLike | SceneObject | Model | Sequence[SceneObject | Model],
    path: str | os.PathLike[str],
    *,
    colors: str | None = None,
    attributes: str | Iterable[str] = (),
    instances: bool = False,
    unit: str | None = None,
    up: str | None = None,
    size: int = 2048,
    samples: int = 2,
    layout: str = AUTO,
    tiles: int = 1,
    contact: AnyContact | str | None = None,
    stiffness: float | None = None,
    mapping: ImageMapping | str | None = None,
    resolution: int | None = None,
    creases: bool = False,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> tuple[MeshCheck, ...]:
    """Write a scene as a file of another program, whole or not at all; the suffix is the format.

    The file has the surfaces of all objects, with normals and with the colours of decals and objects without
    light. No OpenGL is needed. docs/exporting.md has a table of what each format holds.

    Parameters
    ----------
    scene : Scene, SceneObject or Model
        A scene; or a model as `decals.cover` takes it, a list of such models, or the path of a model or a
        scene.
    path : str or path
        The file; its folder must exist. Its suffix, such as glb or ply, is a format of that table. Textures
        of OBJ and PLY files lie beside it, under its name.
    colors : str, optional
        ``"texture"`` (needs the extra ``bake``), ``"vertices"`` or ``"none"``. Default: what that table
        names first.
    attributes : str or sequence of str
        Values at the vertices besides the colours: ``"owner"``, ``"uv"`` and ``"field"`` as `decals.evaluate`
        returns them, and ``"stretch"``, the ratio of the largest to the smallest stretch of the image. They
        are 0 outside of decals, but for the owner, -1.
    instances : bool
        Leave the decals out of the colours, and write them as copies of a square with their images, for
        programs with decals of their own (EXT_mesh_gpu_instancing). For GLB and glTF files.
    unit : str, optional
        Unit of the scene's lengths: ``"millimeter"``, ``"centimeter"``, ``"meter"``, ``"inch"``, ``"foot"``
        or ``"micron"``. Formats in metres are scaled by it, others keep the numbers.
    up : str, optional
        Axis of the scene that points upward, ``"y"`` or ``"z"``. Formats with an own axis are turned to it.
        By default all coordinates are those of the scene.
    size : int
        Width and height of the texture in texels, from 16 to 8192.
    samples : int
        Samples along each axis of a texel whose neighbours differ; 2 means 4 samples a texel.
    layout : str
        How surfaces lie on the texture: ``"box"`` (as the six sides of a box see them), ``"xatlas"`` (needs
        the extra ``bake``), ``"own"`` (the texture coordinates of the meshes) or ``"auto"``, by default, the
        one with the shortest seams; docs/baking.md has its rule.
    tiles : int
        Textures of that size over which the surfaces are spread, as UDIM tiles from 1001 on; for GLB, glTF
        and OBJ files. At most 100.
    contact, stiffness, mapping : optional
        Modes, as for `decals.evaluate`. Default: those of the scene.
    resolution : int, optional
        Cells along the longest side of a tree's support, for the triangles of implicit objects. Default 64;
        below textures, edges are then halved until the triangles lie within a part of a texel of the surface.
    creases : bool
        Keep the edges that unions, intersections and differences leave on implicit objects.
    progress : callable, optional
        Called as ``progress(stage, fraction)``, with the stage in plain words and the fraction done.
    cancel : callable, optional
        Called often; the work stops if it returns True.

    Returns
    -------
    tuple of MeshCheck
        Whether the mesh of each object is closed and sound; faults are logged as well.

    Raises
    ------
    InvalidScene, InvalidMesh, InvalidFile, InvalidResolution
        If the scene, the path or an option cannot be used.
    UnusableFile
        If the file cannot be written.
    MissingPackage
        If a package of an extra is not installed; the message has the command.
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
    >>> (check,) = decals.export(scene, "ball.ply", attributes=["owner", "field"])
    >>> check.closed, check.sound
    (True, True)
    """
    path = checked_path(path, tuple(FORMATS))
    rules = FORMATS[path.suffix.lower()]
    if truth("instances", instances, InvalidScene) and not rules.instances:
        raise InvalidScene(f"instances: expected a .glb or .gltf file, got {str(path)!r}; choose one of them")
    place = _color_place(VERTICES if instances and colors is None else colors, rules.colors, path)
    names = _attribute_names(attributes, rules.attributes, path)
    for name, value, choices in (("unit", unit, tuple(METRES)), ("up", up, UP)):
        if value is not None:
            one_of(name, value, choices, InvalidScene)
    size = whole_number("size", size, MIN_SIZE, MAX_SIZE, InvalidScene)
    samples = count_number("samples", samples, 1, MAX_SAMPLES, InvalidScene)
    if resolution is not None:
        whole_number("resolution", resolution, 1, None, InvalidResolution)
    modes: dict[str, Any] = {"contact": contact, "mapping": mapping, "stiffness": stiffness}
    Drawing().overridden(**modes)  # checked before a model is read
    creases = truth("creases", creases, InvalidScene)
    one_of("layout", layout, LAYOUTS, InvalidScene)
    tiles = count_number("tiles", tiles, 1, MAX_TILES, InvalidScene)
    if tiles > 1 and not (rules.tiles and place == TEXTURE):
        others = ", ".join(suffix for suffix, each in FORMATS.items() if each.tiles)
        raise InvalidScene(
            f"tiles: expected 1 for {str(path)!r} with colors={place!r}, got {tiles}; "
            f"choose one of the formats {others} with a texture"
        )
    needs_xatlas = place == TEXTURE and layout == XATLAS
    for package, extra in (*rules.packages, *([("xatlas", "bake")] if needs_xatlas else [])):
        optional_package(package, extra)
    shape: dict[str, Any] = {
        "size": size,
        "samples": samples,
        "layout": layout,
        "tiles": tiles,
        "resolution": resolution,
        "creases": creases,
    }
    with reporting(progress, cancel) as report:
        baked = bake_parts(scene, place, report, attributes=names, instances=instances, **shape, **modes)
        report("writing the file", 0.0)
        if rules.recipe:
            given = {
                **modes,
                "colors": colors,
                "attributes": list(names),
                "instances": instances,
                "unit": unit,
                "up": up,
                **shape,
            }
            baked = replace(baked, made=_made(scene, path.parent, given))
        content = rules.write(replace(baked, unit=unit, up=up), path.stem)
        checks = tuple(part.check for part in baked.parts)
        report("writing the file", 0.5)
        write_together(
            {path: content[""], **{path.with_name(name): content[name] for name in content if name}}
        )
    for check in checks:
        if check.faults:
            _logger.warning("%s, object %r: %s", path, check.name, _listed(check.faults))
    if progress is not None:  # without the check of `cancel`, as the file is written
        progress("writing the file", 1.0)
    return checks


def bake_parts(
    scene: object,
    place: str,
    report: Progress,
    *,
    attributes: Collection[str] = (),
    instances: bool = False,
    size: int = 2048,
    samples: int = 2,
    layout: str = AUTO,
    tiles: int = 1,
    resolution: int | None = None,
    creases: bool = False,
    **modes: Any,
) -> Baked:
    """Return what a file of a scene holds; arguments are those of `export`, after its checks.

    Parameters
    ----------
    scene
        See `export`.
    place
        Place of the colours: `TEXTURE`, `VERTICES` or `NO_COLORS`.
    report
        Called with the stage and the fraction done.
    attributes, instances, size, samples, layout, tiles, resolution, creases, **modes
        See `export`.

    Raises
    ------
    InvalidScene, InvalidMesh
        There is no object, or one of them has no surface.
    """
    source = _Source.of(scene)
    if not source.objects:
        raise InvalidScene("expected at least one object to export, got none; add a mesh or a BlobTree")
    copies: list[Instances] = []
    if instances:
        rows = source.decals.decals if isinstance(source.decals, DecalEditor) else source.decals
        copies = decal_instances(rows, source.images, [getattr(item, "name", "") for item in source.objects])
        source = replace(source, decals=Decals.empty())
    textured = place == TEXTURE
    texels = tiles * size**2 if textured else 0
    own = textured and layout == OWN
    work = _Work(source, source.drawing.overridden(**modes), resolution, creases, texels, own, report)
    parts = work.laid_out(size, layout, tiles) if textured else work.plain(place)
    parts = [work.with_attributes(number, part, attributes) for number, part in enumerate(parts)]
    if textured:  # meshes are checked while textures are made
        Thread(target=lambda: [part.check for part in parts], daemon=True).start()
    maps = work.maps(size, samples) if textured else []
    return Baked(parts, maps, source.origin, recipe=source.recipe, instances=copies)


def _made(scene: object, folder: Path, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return how a file is made, as plain values, with the scene itself if it is small."""
    source = scene_or_objects(scene)
    if not isinstance(source, Scene):
        return {}
    options = {name: option_value(value) for name, value in given.items() if value is not None}
    record = {
        "function": EXPORT_FUNCTION,
        "parameters": options,
        "missing": [name for name in options if not is_plain(given[name])],
        "scene": scene_hashes(source),
        "versions": package_versions(),
        "made": provenance(device_text("cpu")),
    }
    text = base64.b64encode(zlib.compress(to_json(source, folder=folder))).decode()
    return record | ({"source": text} if len(text) <= MAX_SOURCE else {})


def _color_place(colors: object, held: tuple[str, ...], path: Path) -> str:
    """Return where a file holds colours, by default in the first place of its format."""
    if colors is None:
        return held[0] if held else NO_COLORS
    place = one_of("colors", colors, (TEXTURE, VERTICES, NO_COLORS), InvalidScene)
    if place not in (*held, NO_COLORS):
        others = ", ".join(suffix for suffix, rules in FORMATS.items() if place in rules.colors)
        raise InvalidScene(
            f"colors: expected {' or '.join((*held, NO_COLORS))} for {str(path)!r}, got {place!r}; "
            f"choose another, or one of the formats {others}"
        )
    return place


def _attribute_names(names: str | Iterable[str], held: bool, path: Path) -> tuple[str, ...]:
    """Return names of attributes, each once."""
    try:
        listed = [names] if isinstance(names, str) else list(names)
    except TypeError:  # arrays without dimensions are iterable by their type alone
        raise InvalidScene(f"attributes: expected names, got {describe(names)}") from None
    checked = dict.fromkeys(one_of("attributes", name, tuple(ATTRIBUTES), InvalidScene) for name in listed)
    if checked and not held:
        others = ", ".join(suffix for suffix, rules in FORMATS.items() if rules.attributes)
        raise InvalidScene(
            f"attributes: expected none for {str(path)!r}, got {', '.join(checked)}; "
            f"choose one of the formats {others}"
        )
    return tuple(checked)


def _listed(faults: dict[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in faults.items())


@dataclass(frozen=True, eq=False)
class _Source:
    """What is exported: a scene, or models without decals."""

    objects: Sequence[object]
    decals: Decals | DecalEditor
    images: list[HasPixels]
    drawing: Drawing
    recipe: Recipe | None

    @classmethod
    def of(cls, scene: object) -> "_Source":
        known = scene_or_objects(scene)
        if isinstance(known, list):
            return cls(known, Decals.empty(), [], Drawing(), None)
        recipe = getattr(known, "recipe", None)
        return cls(drawn_objects(known), known.decals, list(known.images), drawing_of(known), recipe)

    @property
    def origin(self) -> Any:
        """Point that all coordinates are relative to."""
        return getattr(self.objects[0], "origin", WORLD)


class _Work:
    """Makes the parts of a file."""

    def __init__(
        self,
        source: _Source,
        drawing: Drawing,
        resolution: int | None,
        creases: bool,
        texels: int,
        own: bool,
        report: Progress,
    ) -> None:
        self._meshes = [
            bake_mesh(item, resolution=resolution, creases=creases, report=report, own=own)
            for item in source.objects
        ]
        if texels and resolution is None:
            self._meshes = below_texture(self._meshes, source.objects, texels, report)
        self._colors = SurfaceColors(self._meshes, source.objects, source.decals, source.images, drawing)
        self._rows = [np.arange(len(mesh.vertices)) for mesh in self._meshes]
        self._report = report

    def laid_out(self, size: int, layout: str, tiles: int) -> list[Part]:
        """Return all meshes with coordinates in textures."""
        self._unwrapped = lay_out(self._meshes, size, layout, tiles, self._report)
        self._rows = [part.rows for part in self._unwrapped]
        return [
            _textured_part(mesh, part, size, self._colors.has_materials)
            for mesh, part in zip(self._meshes, self._unwrapped, strict=True)
        ]

    def maps(self, size: int, samples: int) -> list[Maps]:
        """Return the textures of meshes that are laid out."""
        channels = Channels(self._colors.at, on_device=self._colors.on_device)
        if self._colors.has_materials:  # maps are of the rest pose
            pairs = zip(self._meshes, self._unwrapped, strict=True)
            resting = [vertex_tangents(mesh.places, mesh.facings, part) for mesh, part in pairs]
            channels = Channels(self._colors.at, len(SRGB), material_bytes, resting, SRGB)
        texels = bake_texture(self._meshes, self._unwrapped, size, samples, channels, self._report)
        return [split_maps(of) for of in texels]

    def plain(self, place: str) -> list[Part]:
        """Return all meshes, with colours at the vertices if that is their place."""
        return [
            Part(
                mesh.name,
                mesh.vertices,
                mesh.faces,
                mesh.normals,
                colors=self._vertex_colors(number) if place == VERTICES else None,
            )
            for number, mesh in enumerate(self._meshes)
        ]

    def _vertex_colors(self, number: int) -> Float64Array:
        count = len(self._meshes[number].vertices)
        parts = []
        for first in range(0, count, BLOCK):
            self._report("colouring vertices", (number + first / count) / len(self._meshes))
            parts.append(self._colors.at_vertices(number, slice(first, first + BLOCK)))
        linear: Float64Array = np.clip(np.concatenate(parts).astype(np.float64), 0.0, 1.0)
        return linear

    def with_attributes(self, number: int, part: Part, names: Collection[str]) -> Part:
        """Return a part with values of the decals at its vertices."""
        if not names:
            return part
        columns = self._colors.attributes_at_vertices(number, names)
        rows = self._rows[number]
        return replace(part, attributes={name: column[rows] for name, column in columns.items()})


def _textured_part(mesh: BakeMesh, part: Unwrapped, size: int, tangents: bool) -> Part:
    uv = part.places / np.float32(size)
    uv[:, 1] = 1.0 - uv[:, 1]
    tile_of_face = part.tile_of_face if part.tile_of_face.any() else None
    if tile_of_face is not None:
        tile = np.zeros(len(uv), np.int32)
        tile[part.faces] = tile_of_face[:, None]
        uv += np.stack([tile % TILE_ROW, tile // TILE_ROW], axis=1).astype(np.float32)
    vertices, normals = mesh.vertices[part.rows], mesh.normals[part.rows]
    along = vertex_tangents(mesh.vertices, mesh.normals, part) if tangents else None
    return Part(mesh.name, vertices, part.faces, normals, uv=uv, tangents=along, tile_of_face=tile_of_face)
