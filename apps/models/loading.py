"""Arguments that name files: models, samples and scenes, and modules that define custom nodes."""

import importlib
import importlib.util
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

from blobtree.files import no_file
from decals import ImplicitDecalsError, Scene
from decals import load_model as load_file
from decals.apps.models.samples import SAMPLES, sample, sample_mesh
from decals.apps.models.tables import with_table
from decals.errors import InvalidInput
from decals.scenes.objects import MeshObject, SceneObject, as_crease_angle, as_objects


def load_model(
    model: str, *, trust: bool = False, crease_angle: float | None = None, table: Path | None = None
) -> SceneObject | Scene:
    """Load the sample or the file that a MODEL argument names; ``trust`` is that of `decals.load_scene`.

    Meshes get the crease angle if it is given; else they keep their own. With a table, the model has its
    decals, as a scene.

    Raises
    ------
    InvalidInput
        If it is neither a sample nor a file, or the file cannot be used; the message names it.
    """
    if table is not None:
        loaded = load_model(model, trust=trust, crease_angle=crease_angle)
        return with_table(loaded if isinstance(loaded, Scene) else [loaded], table, model, trust=trust)
    if crease_angle is not None:
        loaded, angle = load_model(model, trust=trust), as_crease_angle(crease_angle)
        if isinstance(loaded, Scene):
            return loaded.replace(objects=tuple(_creased(item, angle) for item in loaded.objects))
        return _creased(loaded, angle)
    if model in SAMPLES:
        return sample(model)
    if reason := no_file(model):
        raise InvalidInput(
            "expected a mesh file, a BlobTree or scene in JSON, a program (.vm, .frep), or a sample "
            f"({', '.join(SAMPLES)}); "
            f"{reason}"
        )
    try:
        return load_file(model, samples=sample_mesh, trust=trust)
    except ImplicitDecalsError as error:
        if model in str(error):
            raise
        raise InvalidInput(f"{model!r}: {error}") from error


def load_models(
    models: Sequence[str],
    *,
    trust: bool = False,
    crease_angle: float | None = None,
    table: Path | None = None,
    images: Sequence[str] | None = None,
) -> list[SceneObject] | Scene:
    """Load one whole scene, or several models, each in its own coordinates and under its own name.

    Other arguments are those of `load_model`, and images of the decals of a table.

    Raises
    ------
    InvalidInput
        If a scene is named together with other models.
    """
    if table is not None:
        loaded_models = load_models(models, trust=trust, crease_angle=crease_angle)
        return with_table(loaded_models, table, models[0], images=images, trust=trust)
    objects: list[SceneObject] = []
    for model in models:
        loaded = load_model(model, trust=trust, crease_angle=crease_angle)
        if isinstance(loaded, Scene):
            if len(models) > 1:
                raise InvalidInput(
                    f"expected meshes and BlobTrees, {model!r} is a whole scene; give it alone"
                )
            return loaded
        objects.append(loaded)
    return as_objects(objects)


def _creased(item: SceneObject, angle: float) -> SceneObject:
    """Return an object that has a crease angle if it is a mesh."""
    return replace(item, crease_angle=angle) if isinstance(item, MeshObject) else item


def import_definitions(modules: Sequence[str] | None) -> None:
    """Import the modules of ``--define``: Python files, or dotted names of modules.

    Dotted names are searched in the working folder too, imports of a file in its own folder too.

    Raises
    ------
    InvalidInput
        If a module is missing or raises an error; the message names file and line.
    """
    for module in modules or ():
        import_module_or_file("--define", module)


def import_module_or_file(option: str, module: str) -> ModuleType:
    """Import the module that an option names: a Python file, or a dotted name; errors are those above."""
    path = Path(module)
    if path.suffix == ".py" and (reason := no_file(module)):
        raise InvalidInput(f"{option}: expected a Python file or the name of a module, {reason}")
    try:
        return _import(module)
    except (Exception, SystemExit) as error:
        if isinstance(error, ModuleNotFoundError) and f"{module}.".startswith(f"{error.name}."):
            raise InvalidInput(
                f"{option}: expected a Python file (.py) or the name of a module, got {module!r} ({error})"
            ) from error
        frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.name == "<module>"]
        raise _failed(f"{option} {module}", frames, error) from error


def call_imported(option: str, module: str, function: Callable[..., Any], *arguments: object) -> Any:
    """Return what a function of the module that an option names returns; its errors are InvalidInput."""
    try:
        return function(*arguments)
    except (Exception, SystemExit) as error:
        inner = traceback.extract_tb(error.__traceback__)[1:]
        frames = [frame for frame in inner if frame.filename == inner[0].filename]
        call = f"{getattr(function, '__name__', 'function')}({', '.join(map(repr, arguments))})"
        raise _failed(f"{option} {module}, {call}", frames, error) from error


def _import(module: str) -> ModuleType:
    """Import a dotted name, or run a file as a module of its name."""
    path = Path(module)
    if path.suffix != ".py":
        _add_search_path(Path.cwd())
        return importlib.import_module(module)
    _add_search_path(path.resolve().parent)
    name = path.stem if path.stem not in sys.modules else f"defined_by_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path.resolve())
    assert spec is not None
    assert spec.loader is not None
    definitions = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(definitions)
    except BaseException:
        del sys.modules[name]
        raise
    return definitions


def _add_search_path(folder: Path) -> None:
    if str(folder) not in sys.path:
        sys.path.append(str(folder))


def _failed(what: str, frames: Sequence[traceback.FrameSummary], error: BaseException) -> InvalidInput:
    """Return the error of a user's code that failed, with "file:line: " unless its message has it."""
    known = not frames or frames[-1].filename in str(error)
    place = "" if known else f"{frames[-1].filename}:{frames[-1].lineno}: "
    return InvalidInput(f"{what}: {place}{type(error).__name__}: {error}")
