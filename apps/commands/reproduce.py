"""``implicit-decals reproduce``: make what a file holds again from its recipe, and say what differs."""

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from blobtree import Progress
from decals import Decals, Scene, load_scene, render
from decals.apps import gallery as examples
from decals.apps.commands.demo import DEMO_FUNCTION, PICTURES, demo_pictures
from decals.apps.commands.gallery import MAX_SIDE
from decals.apps.commands.options import MAX_SAMPLES, Definitions, Trust, check_count, parse_size
from decals.apps.commands.progress_bars import preparing
from decals.apps.commands.sweep import experiment_of
from decals.apps.experiments import SHIPPED
from decals.apps.gallery.helpers import GALLERY_FUNCTION, example_picture
from decals.apps.models.samples import sample_mesh
from decals.baking.reproduction import NO_RECIPE, reproduce_export
from decals.errors import ImplicitDecalsError, InvalidInput
from decals.experiments import Results
from decals.experiments.fingerprint import fingerprint
from decals.experiments.reproduction import reproduce_results
from decals.images.load import load_image
from decals.rendering import Picture, Renderer
from decals.rendering.picture import picture_recipe
from decals.scenes.files import camera_of_values
from decals.scenes.provenance import changes_since
from decals.scenes.render import missing_beside
from decals.scenes.reproduction import Reproduction
from decals.scenes.reproduction import reproduce as made_again
from decals.validation import one_of

DIFFERENT = 1
MISSING = 3
"""Exit codes: what was made differs; something that the recipe needs is missing."""

EXPORTED = (".glb", ".gltf")
"""Suffixes of exported files that keep how they were made."""


def reproduce(
    file: str,
    /,
    *,
    scene: Annotated[str | None, Parameter(show_default=False)] = None,
    experiment: Annotated[str | None, Parameter(show_default=False)] = None,
    define: Definitions = None,
    trust: Trust = False,
) -> int:
    """Make what a file holds again from its recipe, and say what differs.

    The exit code is 0 if all is equal, 1 if something differs, and 3 if something is missing.

    Parameters
    ----------
    file
        A saved scene; a PNG file that render, animate, gallery or demo wrote; a glb or gltf file that
        export or bake wrote; or the folder of results that sweep wrote.
    scene
        The scene of a picture, which the PNG file does not hold, or of an exported file that was too large
        to hold it.
    experiment
        The file of the experiment whose results a folder holds; shipped experiments are found without.
    """
    suffix, is_folder = Path(file).suffix.lower(), Path(file).is_dir()
    if not is_folder and suffix not in (".json", ".png", *EXPORTED):
        raise InvalidInput(
            f"expected a scene (.json), a PNG, GLB or glTF file, or a folder of results, got {file!r}; "
            "other files do not say how they were made"
        )
    if experiment is not None and not is_folder:
        raise InvalidInput(f"--experiment: expected a folder of results, got {file!r}; leave it out")
    if suffix not in (".png", *EXPORTED) and scene is not None:
        raise InvalidInput(f"--scene: expected a PNG, GLB or glTF file beside it, got {file!r}; leave it out")
    with preparing(define) as progress:
        held = None if scene is None else load_scene(scene, samples=sample_mesh, trust=trust)
        if is_folder:
            found = reproduce_results(file, _function_of(file, experiment), progress=progress)
        elif suffix == ".png":
            found = _of_picture(Path(file), held, progress)
        elif suffix in EXPORTED:
            found = reproduce_export(Path(file), held, samples=sample_mesh, trust=trust, progress=progress)
        else:
            found = made_again(load_scene(file, samples=sample_mesh, trust=trust), progress=progress)
    return _report(file, found)


def _function_of(folder: str, experiment: str | None) -> Callable[..., Any] | None:
    """Return the function of an experiment, or the shipped one that gave the results; None for others."""
    if experiment is not None:
        return experiment_of(experiment, "design")[0]
    digest = Results(folder).function
    functions = (experiment_of(name, "design")[0] for name in SHIPPED)
    return next((function for function in functions if fingerprint(function) == digest), None)


def _of_picture(path: Path, scene: Scene | None, progress: Progress) -> Reproduction:
    """Draw a picture again, and compare the pixels."""
    recipe = picture_recipe(path)
    if recipe is None:
        return Reproduction((NO_RECIPE,))
    try:
        if recipe.get("function") in (GALLERY_FUNCTION, DEMO_FUNCTION):
            picture = _own_picture(recipe["function"], recipe["parameters"], progress)
        else:
            if scene is not None and "camera" in recipe:  # no scene file holds the camera of a frame
                scene = scene.replace(camera=camera_of_values(recipe["camera"]))
            missing = missing_beside(recipe, scene)
            if missing or scene is None:
                return Reproduction(missing)
            options = recipe["parameters"]
            picture = render(scene, **options | {"size": tuple(options["size"])})
    except (ImplicitDecalsError, ValueError, LookupError, TypeError, AttributeError) as error:
        return Reproduction((f"a recipe that this version takes: {error}",))
    before, after = load_image(str(path)).astype(int), picture.pixels.astype(int)
    changes: list[str] = []
    if before.shape != after.shape:
        changes.append(f"size: {before.shape[1::-1]} in the file, {after.shape[1::-1]} made again")
    elif (apart := np.abs(before - after).max(axis=2)).any():
        changes.append(
            f"pixels: {np.count_nonzero(apart):,} of {apart.size:,} differ, up to {apart.max()} of 255"
        )
    now = picture.recipe or recipe
    decals = Decals.empty() if scene is None else scene.decals
    return Reproduction((), decals, tuple(changes), changes_since(recipe, now))


def _own_picture(function: str, parameters: Mapping[str, Any], progress: Progress) -> Picture:
    """Draw a picture of a command whose scenes are its own."""
    if function == DEMO_FUNCTION:
        one_of("picture", parameters["picture"], PICTURES, InvalidInput)
        check_count("samples", parameters["samples"], 1, MAX_SAMPLES)
        size = parse_size("{}x{}".format(*parameters["size"]))
        ((_, picture),) = demo_pictures([parameters["picture"]], size, parameters["samples"], progress)
        return picture
    name = one_of("example", parameters["example"], examples.EXAMPLES, InvalidInput)
    check_count("side", parameters["side"], 1, MAX_SIDE)
    panels = import_module(f"{examples.__name__}.{name}").panels()
    with Renderer() as renderer:
        return example_picture(renderer, name, panels, parameters["side"])


def _report(file: str, found: Reproduction) -> int:
    """Print what was found, and return the exit code."""
    console = Console(highlight=False, markup=False, soft_wrap=True)
    if found.missing:
        console.print(f"{file}: cannot be made again; it lacks")
    elif found.equal:
        console.print(f"{file}: made again, equal bit for bit")
    else:
        console.print(f"{file}: made again, with differences")
    for line in (*found.missing, *found.differences):
        console.print(f"  {line}")
    if found.circumstances:
        console.print("Circumstances that differ:")
    for line in found.circumstances:
        console.print(f"  {line}")
    return MISSING if found.missing else 0 if found.equal else DIFFERENT
