"""MODEL arguments: names of samples, and files by `decals.load_model`."""

from collections.abc import Sequence
from pathlib import Path

from decals import ImplicitDecalsError, Scene
from decals import load_model as load_file
from decals.apps.errors import UsageError
from decals.apps.models.samples import SAMPLES, sample, sample_mesh
from decals.scenes.objects import SceneObject, as_objects
from decals.validation import is_file


def load_model(model: str) -> SceneObject | Scene:
    """Load the sample or the file that a MODEL argument names.

    Raises
    ------
    UsageError, ImplicitDecalsError
        If it is neither a sample nor a file, or the file cannot be used; the message names it.
    """
    if model in SAMPLES:
        return sample(model)
    if not is_file(Path(model)):
        raise UsageError(
            f"expected a mesh file, a BlobTree or scene in JSON, or a sample ({', '.join(SAMPLES)}); "
            f"found no file {model!r}"
        )
    try:
        return load_file(model, samples=sample_mesh)
    except ImplicitDecalsError as error:
        if model in str(error):
            raise
        raise UsageError(f"{model!r}: {error}") from error


def load_models(models: Sequence[str]) -> list[SceneObject] | Scene:
    """Load one whole scene, or several models, each in its own coordinates and under its own name.

    Raises
    ------
    UsageError
        If a scene is named together with other models.
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
        objects.append(loaded)
    return as_objects(objects)
