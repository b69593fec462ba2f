"""``implicit-decals reproduce``: make what a file holds again from its recipe, and say what differs."""

import json
import struct
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from decals import Scene, load_scene, render
from decals.apps.commands.options import Definitions, Trust
from decals.apps.commands.progress_bars import preparing
from decals.errors import InvalidInput
from decals.images.load import load_image
from decals.rendering.picture import picture_recipe
from decals.scenes.provenance import changes_since
from decals.scenes.render import scene_hashes
from decals.scenes.reproduction import Reproduction
from decals.scenes.reproduction import reproduce as made_again

DIFFERENT = 1
MISSING = 3
"""Exit codes: what was made differs; something that the recipe needs is missing."""

NO_RECIPE = "a recipe: the file does not say how it was made"


def reproduce(
    file: str,
    /,
    *,
    scene: Annotated[str | None, Parameter(show_default=False)] = None,
    define: Definitions = None,
    trust: Trust = False,
) -> int:
    """Make what a file holds again from its recipe, and say what differs.

    The exit code is 0 if all is equal, 1 if something differs, and 3 if something is missing.

    Parameters
    ----------
    file
        A saved scene, a PNG file that render wrote, or a glb or gltf file that export or bake wrote.
    scene
        The scene of a picture, which the PNG file does not hold.
    """
    suffix = Path(file).suffix.lower()
    if suffix != ".png" and scene is not None:
        raise InvalidInput(f"--scene: expected a PNG file beside it, got {file!r}; leave it out")
    with preparing(define) as progress:
        if suffix == ".png":
            found = _of_picture(Path(file), None if scene is None else load_scene(scene, trust=trust))
        elif suffix in (".glb", ".gltf"):
            found = _of_export(Path(file))
        else:
            found = made_again(load_scene(file, trust=trust), progress=progress)
    return _report(file, found)


def _of_picture(path: Path, scene: Scene | None) -> Reproduction:
    """Draw a picture again, and compare the pixels."""
    recipe = picture_recipe(path)
    if recipe is None:
        return Reproduction((NO_RECIPE,))
    options = recipe["parameters"]
    missing = [f"the value of {name!r}, which the recipe only describes" for name in recipe["missing"]]
    if scene is None:
        missing.append("the scene: give its file with --scene")
    else:
        hashes = scene_hashes(scene)
        others = [name for name, value in recipe["scene"].items() if hashes.get(name) != value]
        missing += [f"the {name} of the scene that was drawn: the file has others" for name in others]
    if missing or scene is None:
        return Reproduction(tuple(missing))
    picture = render(scene, **options | {"size": tuple(options["size"])})
    before, after = load_image(str(path)).astype(int), picture.pixels.astype(int)
    changes: list[str] = []
    if before.shape != after.shape:
        changes.append(f"size: {before.shape[1::-1]} in the file, {after.shape[1::-1]} made again")
    elif (apart := np.abs(before - after).max(axis=2)).any():
        changes.append(
            f"pixels: {np.count_nonzero(apart):,} of {apart.size:,} differ, up to {apart.max()} of 255"
        )
    now = picture.recipe or recipe
    return Reproduction((), scene.decals, tuple(changes), changes_since(recipe, now))


def _of_export(path: Path) -> Reproduction:
    """Return what a glTF or GLB file lacks: its meshes hold the models with the decals in them."""
    recipe = _extras(path).get("recipe")
    if not isinstance(recipe, dict):
        return Reproduction((NO_RECIPE,))
    models = recipe.get("parameters", {}).get("models", [])
    missing = [f"the model {name!r}, which the file holds as a mesh with its decals alone" for name in models]
    return Reproduction((*missing, "the scene: save it as .json, and reproduce that file"))


def _extras(path: Path) -> dict[str, Any]:
    """Return the extras of the asset of a glTF or GLB file."""
    content = path.read_bytes()
    try:
        if content.startswith(b"glTF"):
            (length,) = struct.unpack_from("<I", content, 12)
            content = content[20 : 20 + length]
        extras = json.loads(content)["asset"].get("extras", {})
    except (ValueError, LookupError, TypeError, AttributeError, struct.error) as error:
        raise InvalidInput(f"could not read {str(path)!r} as glTF; export it again") from error
    return extras if isinstance(extras, dict) else {}


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
