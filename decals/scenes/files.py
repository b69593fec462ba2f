"""Files: models of any kind are loaded, scenes are saved as JSON and loaded with the same bits.

::

    {
      "format": "implicit-decals-scene",
      "version": 1,
      "objects": [{"type": "mesh", ...}, {"type": "tree", ...}],
      "images": ["scale", "pictures/moss.png", {"name": "steel", "pixels": "steel.png", "roughness": ...}],
      "camera": {"position": [x, y, z], ...},
      "drawing": {"contact": "elastic", "stiffness": 2.0, "mapping": "corrected", "samples": 2, ...},
      "recipe": {"function": "decals.cover", "parameters": {"count": 500, ...}, "seed": 0, "versions": {...},
                 "made": {"time": ..., "device": ...}, "inputs": {"ball": HASH}, "result": HASH},
      "decals": [
        {"position": [x, y, z], "normal": ..., "tangent": ..., "radius": r, "image": 0, "spill": false,
         "interaction": "overlap", "layer": 1, "tint": [r, g, b], "opacity": 1.0,
         "receivers": "hull, lid", "fade_angle": 80.0, "fade_depth": 0.5,
         "single_sheet": true},
        ...
      ]
    }

The last seven of a decal are written where they are not contact, 0, white, 1, any object and no fades.
Image -1 is the plain tint. A file without "drawing" was drawn in the contact mode "product"; "recipe" is
there if it is known, "hidden_decals", "locked_layers" and "layer_names" if there are any; objects give the
paths of hidden, locked and named nodes.

Numbers are the shortest decimals that give the same float32 again. Paths are relative to the scene file.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import msgspec
from msgspec import Raw, Struct

from blobtree.files import is_file, is_folder, read_file, write_atomically
from blobtree.json_errors import json_reason
from blobtree.progress import Progress, reporting
from blobtree.validation import truth
from decals.errors import ImplicitDecalsError, InvalidScene
from decals.images.builtin import is_builtin
from decals.images.load import embedded_image, is_embedded, load_image
from decals.model import Decals
from decals.scenes.camera import Camera, Fit, Vector
from decals.scenes.drawing_record import DrawingRecord, drawing_of_record, drawing_record
from decals.scenes.material import DecalMaterial
from decals.scenes.material_record import MaterialRecord, material_of, material_record, sources_of
from decals.scenes.objects import SceneObject, as_object
from decals.scenes.recipe import Recipe
from decals.scenes.records import (
    TRUST_ADVICE,
    DecalRecord,
    MeshRecord,
    SampleLoader,
    TreeRecord,
    absolute,
    check_inside,
    decals_of,
    object_of,
    picture_source,
    record_of,
    records_of,
)
from decals.scenes.scene import DecalImage, Scene, require_scene
from decals.validation import as_path

PART = 500
"""Decals that are described at a time."""

MAX_IMAGES = 1024
"""Most images of a scene that is not trusted."""

MAX_IMAGE_PIXELS = 1 << 28
"""Most pixels of all images of a scene that is not trusted: 1 GB of memory."""

FORMAT = "implicit-decals-scene"
VERSION = 1


class _Header(Struct):
    format: str = ""
    version: int = 0


class _CameraRecord(Struct, forbid_unknown_fields=True, omit_defaults=True):
    position: Vector
    target: Vector
    up: Vector
    fov: float
    fit: list[Vector] | None = None
    margin: float = 1.0


class _RecipeRecord(Struct, forbid_unknown_fields=True):
    function: str
    parameters: dict[str, Any]
    seed: int
    versions: dict[str, str]
    made: dict[str, Any] = {}
    missing: list[str] = []
    inputs: dict[str, str] = {}
    result: str = ""


class _SceneRecord(Struct, forbid_unknown_fields=True):
    format: Literal["implicit-decals-scene"]
    version: Literal[1]
    objects: list[MeshRecord | TreeRecord]
    images: list[str | MaterialRecord]
    camera: _CameraRecord
    decals: list[DecalRecord]
    drawing: DrawingRecord | None = None
    recipe: _RecipeRecord | None = None
    hidden_decals: list[DecalRecord] = []
    locked_layers: list[int] = []
    layer_names: dict[int, str] = {}


def save_scene(scene: Scene, path: str | os.PathLike[str], *, progress: Progress | None = None) -> None:
    """Write a scene to a JSON file, whole or not at all.

    Meshes with a ``source`` and images with a name or a path are written as references, others in full.

    Parameters
    ----------
    scene : Scene
        The scene.
    path : str or path
        The file, named ``.json``; its folder must exist.
    progress : callable, optional
        Function of the stage and its finished fraction, 0 to 1, called repeatedly.

    Raises
    ------
    InvalidScene
        If the file has another name, or the folder does not exist or cannot be written.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
    >>> decals.save_scene(scene, "ball.json")
    """
    require_scene("scene", scene, "save the scene that was posed, or write this pose by decals.bake")
    path = as_path(path)
    if path.suffix.lower() != ".json":
        raise InvalidScene(f"expected a file name that ends in .json, got {path.name!r}; rename the file")
    folder = path.parent
    if not is_folder(folder):
        raise InvalidScene(
            f"expected an existing folder for the scene, found none at {str(folder)!r}; make it first"
        )
    try:
        write_atomically(path, to_json(scene, folder=folder, progress=progress))
    except OSError as error:
        raise InvalidScene(f"could not write the scene {str(path)!r} ({error.strerror})") from error


def load_scene(
    path: str | os.PathLike[str], *, samples: SampleLoader | None = None, trust: bool = False
) -> Scene:
    """Read a scene from a JSON file.

    Parameters
    ----------
    path : str or path
        A scene file, as `save_scene` writes it.
    samples : callable, optional
        Function that returns the vertices and faces of a source ``"sample:NAME"``, by NAME.
    trust : bool
        True reads meshes and images at any path, and images of any number. By default a scene may name
        files in its own folder or below it, and at most `MAX_IMAGES` images of `MAX_IMAGE_PIXELS` pixels.

    Returns
    -------
    Scene
        The scene of the file, with relative paths resolved from its folder.

    Raises
    ------
    InvalidScene
        If the file is missing or is no scene, or names a file that it may not without ``trust``; the message
        names the offending field.
    InvalidMesh, InvalidImage, blobtree.ImplicitDecalsError
        If a mesh, an image or a tree that the scene refers to is missing or broken.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
    >>> decals.save_scene(scene, "ball.json")
    >>> len(decals.load_scene("ball.json").decals)
    20
    """
    path = as_path(path)
    try:
        text = read_file(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "no file can have this name"
        raise InvalidScene(f"could not read the scene {str(path)!r} ({reason}); check the path") from error
    try:
        return from_json(text, folder=path.parent, samples=samples, trust=trust)
    except InvalidScene as error:
        raise InvalidScene(f"{str(path)!r}: {error}") from error


def to_json(scene: Scene, *, folder: Path, progress: Progress | None = None) -> bytes:
    """Write a scene as UTF-8 JSON whose paths are relative to ``folder``; one object or decal a line."""
    camera = scene.camera
    with reporting(progress) as report:
        decals = _lines(_decal_records(scene.decals, report))
    parts = {
        "format": FORMAT,
        "version": VERSION,
        "objects": _lines(record_of(item, folder) for item in scene.objects),
        "images": [image_record(image, folder) for image in scene.images],
        "camera": _camera_record(camera),
        "drawing": drawing_record(scene.drawing, folder),
        "decals": decals,
    }
    if scene.recipe is not None:
        parts["recipe"] = scene.recipe.record
    if len(scene.hidden_decals):
        parts["hidden_decals"] = _lines(records_of(scene.hidden_decals))
    for name in ("locked_layers", "layer_names"):
        if getattr(scene, name):
            parts[name] = getattr(scene, name)
    fields = [
        b"  %b: %b" % (msgspec.json.encode(key), msgspec.json.encode(value)) for key, value in parts.items()
    ]
    return b"{\n" + b",\n".join(fields) + b"\n}\n"


def from_json(
    text: bytes, *, folder: Path, samples: SampleLoader | None = None, trust: bool = False
) -> Scene:
    """Read a scene from JSON; see `load_scene`."""
    trust, record = truth("trust", trust, InvalidScene), _decode(text)
    if not trust:
        meshes = [item.source for item in record.objects if isinstance(item, MeshRecord)]
        images = [source for image in record.images for source in sources_of(image)]
        drawing = [] if record.drawing is None else record.drawing.sources()
        check_inside([*(source for source in meshes if source is not None), *images, *drawing], folder)
    objects = [object_of(item, folder, samples) for item in record.objects]
    return Scene(
        objects=tuple(objects),
        camera=_camera(record.camera),
        decals=decals_of(record.decals),
        images=images_of(record.images, folder, trust),
        drawing=drawing_of_record(record.drawing, folder),
        recipe=None if record.recipe is None else Recipe(**msgspec.structs.asdict(record.recipe)),
        hidden_decals=decals_of(record.hidden_decals),
        locked_layers=tuple(record.locked_layers),
        layer_names=record.layer_names,
    )


def image_record(image: DecalImage, folder: Path) -> str | MaterialRecord:
    """Return an image as a file has it."""
    if isinstance(image, DecalMaterial):
        return material_record(image)
    named = image.is_generated or not is_builtin(image.source)
    reference = picture_source(image.source, folder) if named else ""
    # a name that is no path, which could be that of another picture where the file is read
    return reference or MaterialRecord(Path(image.source).stem, embedded_image(image.pixels))


def images_of(sources: list[str | MaterialRecord], folder: Path, trust: bool) -> tuple[DecalImage, ...]:
    """Load the images of a scene; InvalidScene if an unknown scene has too many, or too large ones."""
    images: list[DecalImage] = []
    pixels = 0
    if not trust and len(sources) > MAX_IMAGES:
        raise InvalidScene(f"images: expected at most {MAX_IMAGES}, got {len(sources)}; {TRUST_ADVICE}")
    for number, source in enumerate(sources):
        name = f"image {number}"
        if isinstance(source, MaterialRecord):
            images.append(material_of(source, folder))
            source = source.name
        elif is_embedded(source):
            images.append(DecalImage(name, load_image(source)))
            source = name
        else:
            images.append(DecalImage.load(absolute(source, folder)))
        height, width = images[-1].pixels.shape[:2]
        pixels += height * width
        if not trust and pixels > MAX_IMAGE_PIXELS:
            raise InvalidScene(
                f"images: expected at most {MAX_IMAGE_PIXELS:,} pixels together, got more with {source!r}; "
                f"scale them, or {TRUST_ADVICE}"
            )
    return tuple(images)


HEADER_BYTES = 200
"""Length of the beginning of a file that names its format."""


def is_scene(text: bytes) -> bool:
    """Return True if JSON has the format of a scene; damaged JSON if it begins like one."""
    try:
        return msgspec.json.decode(text, type=_Header).format == FORMAT
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        return f'"{FORMAT}"'.encode() in text[:HEADER_BYTES]


def _decode(text: bytes) -> _SceneRecord:
    try:
        header = msgspec.json.decode(text, type=_Header)
        if header.format != FORMAT:
            raise InvalidScene(f'expected a scene with "format": "{FORMAT}", got {header.format!r}')
        if header.version != VERSION:
            raise InvalidScene(
                f"expected a scene of version {VERSION}, got version {header.version}; "
                "it was written by another release of implicit-decals"
            )
        return msgspec.json.decode(text, type=_SceneRecord)
    except RecursionError:
        raise InvalidScene(f"not a scene of version {VERSION}: nested too deeply") from None
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise InvalidScene(f"not a scene of version {VERSION}: {json_reason(error, text)}") from error


def _decal_records(decals: Decals, tell: Progress) -> Iterator[DecalRecord]:
    """Describe decals, some at a time: numbers become text by calls that let no other thread go on."""
    for first in range(0, len(decals), PART):
        tell("saving the scene", first / len(decals))
        yield from records_of(decals[first : first + PART])


def _lines(records: Iterator[Any]) -> Raw:
    """Encode a list with one record a line, which people and `diff` can read."""
    lines = [b"\n    " + msgspec.json.encode(record) for record in records]
    return Raw(b"[" + b",".join(lines) + b"\n  ]") if lines else Raw(b"[]")


def camera_values(camera: Camera) -> dict[str, Any]:
    """Return a camera as plain values, as files have it."""
    values: dict[str, Any] = msgspec.to_builtins(_camera_record(camera))
    return values


def camera_of_values(values: object) -> Camera:
    """Return the camera of `camera_values`; raise InvalidScene for other values."""
    try:
        return _camera(msgspec.convert(values, _CameraRecord))
    except msgspec.ValidationError as error:
        raise InvalidScene(f"camera: {error}") from error


def _camera_record(camera: Camera) -> _CameraRecord:
    fit = camera.fit
    of_fit = () if fit is None else (list(fit.points), fit.margin)
    return _CameraRecord(camera.position, camera.target, camera.up, camera.fov, *of_fit)


def _camera(record: _CameraRecord) -> Camera:
    pose = record.position, record.target, record.up, record.fov
    try:
        fit = None if record.fit is None else Fit(pose, tuple(record.fit), record.margin)
        return Camera(*pose, fit)
    except ImplicitDecalsError as error:
        raise InvalidScene(f"camera: {error}") from error


def load_model(
    path: str | os.PathLike[str], *, samples: SampleLoader | None = None, trust: bool = False
) -> SceneObject | Scene:
    """Load a mesh, a BlobTree or a scene from a file.

    Parameters
    ----------
    path : str or path
        A mesh file of any format that pyvista reads, or a BlobTree or a scene in JSON.
    samples : callable, optional
        Function that returns the meshes of a scene whose source is ``"sample:NAME"``.
    trust : bool
        True lets a scene name files at any path, see `decals.load_scene`.

    Returns
    -------
    MeshObject, TreeObject or Scene
        An object is named after its file.

    Raises
    ------
    InvalidScene, InvalidMesh, InvalidFile, InvalidImage
        If the file is missing, or cannot be used.

    See Also
    --------
    decals.load_scene, decals.surfaces.read_mesh, blobtree.load

    Examples
    --------
    >>> import tempfile, pathlib, blobtree, decals
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "ball.json"
    >>> blobtree.save(blobtree.Point((0, 0, 0), radius=1), path)
    >>> decals.load_model(path).name
    'ball'
    """
    if is_scene_file(as_path(path)):
        return load_scene(path, samples=samples, trust=trust)
    return as_object(path, "model")


def is_scene_file(path: Path) -> bool:
    """Return True if a file holds a saved scene, rather than a mesh or a BlobTree."""
    if path.suffix.lower() != ".json" or not is_file(path):
        return False
    try:
        return is_scene(read_file(path))
    except OSError:  # reported by the function that reads the model
        return False
