"""Models from files of any kind: a mesh, a BlobTree or a whole scene."""

import os
from pathlib import Path

from decals.errors import InvalidScene
from decals.scenes.objects import SceneObject, as_object
from decals.scenes.records import SampleLoader
from decals.scenes.scene import Scene
from decals.scenes.scene_file import is_scene, load_scene
from decals.validation import describe, is_file


def load_model(path: str | os.PathLike[str], *, samples: SampleLoader | None = None) -> SceneObject | Scene:
    """Load a mesh, a BlobTree or a scene from a file.

    Parameters
    ----------
    path : str or path
        A mesh file of any format that pyvista reads, or a BlobTree or a scene in JSON.
    samples : callable, optional
        Function that returns the meshes of a scene whose source is ``"sample:NAME"``.

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
    if not isinstance(path, str | os.PathLike):
        raise InvalidScene(f"path: expected the path of a model, got {describe(path)}")
    if _is_scene_file(Path(path)):
        return load_scene(path, samples=samples)
    return as_object(path, "model")


def _is_scene_file(path: Path) -> bool:
    if path.suffix.lower() != ".json" or not is_file(path):
        return False
    try:
        return is_scene(path.read_bytes())
    except OSError:  # reported by the function that reads the model
        return False
