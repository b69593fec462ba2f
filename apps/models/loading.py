"""From a MODEL argument to an object: a sample's name, a mesh file, a BlobTree or a scene in JSON."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from blobtree import BlobTreeError, from_json
from decals.errors import DecalsError
from decals.paths import is_file
from decals.scenes.mesh_file import read_mesh
from decals.scenes.scene import MeshObject, Scene, SceneObject, TreeObject
from decals.scenes.scene_file import is_scene, load_scene

from ..errors import UsageError
from .samples import SAMPLES, sample, sample_mesh


def load_model(model: str) -> SceneObject | Scene:
    """Load what a MODEL argument names.

    Raises
    ------
    UsageError, decals.errors.DecalsError, blobtree.BlobTreeError
        If it is neither a sample nor a file, or the file cannot be used; the message names it.
    """
    try:
        return _load(model)
    except (DecalsError, BlobTreeError) as error:
        if model in str(error):
            raise
        raise UsageError(f"{model!r}: {error}") from error


def _load(model: str) -> SceneObject | Scene:
    if model in SAMPLES:
        return sample(model)
    path = Path(model)
    if not is_file(path):
        raise UsageError(
            f"expected a mesh file, a BlobTree or scene in JSON, or a sample ({', '.join(SAMPLES)}); "
            f"found no file {model!r}"
        )
    if path.suffix.lower() == ".json":
        return _load_json(path)
    vertices, faces = read_mesh(path)
    return MeshObject(path.stem, vertices, faces, source=str(path))


def _load_json(path: Path) -> TreeObject | Scene:
    text = _read(path)
    if is_scene(text):
        return load_scene(path, samples=sample_mesh)
    return TreeObject(path.stem, from_json(text))


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UsageError(f"could not read {str(path)!r} ({error.strerror}); check its permissions") from error


def load_models(models: Sequence[str]) -> list[SceneObject] | Scene:
    """Load one whole scene, or models side by side, each in its own coordinates.

    The second object of a name becomes ``name-2``.

    Raises
    ------
    UsageError
        If a scene comes with other models.
    """
    objects: list[SceneObject] = []
    for model in models:
        loaded = load_model(model)
        if isinstance(loaded, Scene):
            if len(models) > 1:
                raise UsageError(
                    f"expected meshes and BlobTrees, {model!r} is a whole scene; render it alone"
                )
            return loaded
        objects.append(_renamed(loaded, [item.name for item in objects]))
    return objects


def _renamed(item: SceneObject, taken: Sequence[str]) -> SceneObject:
    name, number = item.name, 2
    while name in taken:
        name, number = f"{item.name}-{number}", number + 1
    return item if name == item.name else replace(item, name=name)
