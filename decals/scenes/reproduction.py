"""Scenes made again from their recipes, and what differs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from blobtree import Node
from blobtree.progress import Cancel, Progress
from decals.errors import ImplicitDecalsError
from decals.model import COLUMNS, Decals
from decals.scattering.copies import on_all_copies, one_copy
from decals.scattering.density import PaintedImage
from decals.scattering.image_projections import Planar
from decals.scattering.jitter import Jitter
from decals.scattering.scatter import scatter
from decals.scenes.objects import SceneObject, TreeObject
from decals.scenes.provenance import changes_since, device_text, package_versions, provenance
from decals.scenes.recipe import Recipe, shape_hash
from decals.scenes.scene import Scene, require_scene
from decals.surfaces.implicit import ImplicitSurface

FUNCTIONS = ("decals.cover", "decals.scatter")
"""Functions of recipes whose decals can be made again."""

UNUSED = (
    *("models", "view_direction", "up", "fov", "crease_angle", "orientation"),
    *("painted", "painted_along", "black", "same_on_copies"),
)
"""Parameters of recipes that are none of `decals.scatter`."""


@dataclass(frozen=True)
class Reproduction:
    """The decals of a scene, made again from its recipe.

    Attributes
    ----------
    missing : tuple of str
        What the recipe needs and neither it nor the file has, such as functions or edits by hand. Nothing was
        made again if there is any.
    decals : Decals, optional
        The decals that were made.
    differences : tuple of str
        How they differ from those of the scene; none if they are equal bit for bit.
    circumstances : tuple of str
        Versions, device, platform and commit that differ from those of the recipe.
    """

    missing: tuple[str, ...]
    decals: Decals | None = None
    differences: tuple[str, ...] = ()
    circumstances: tuple[str, ...] = ()

    @property
    def equal(self) -> bool:
        """True if the decals were made again and are equal bit for bit."""
        return self.decals is not None and not self.differences


def reproduce(
    scene: Scene, *, progress: Progress | None = None, cancel: Cancel | None = None
) -> Reproduction:
    """Make the decals of a scene again from its recipe, and compare them.

    Parameters
    ----------
    scene : Scene
        A scene of `decals.cover`, of the command ``scatter``, or of a file of such a scene.
    progress, cancel : callable, optional
        As for `decals.scatter`.

    Returns
    -------
    Reproduction
        What is missing, or how the decals differ.

    Raises
    ------
    InvalidScene
        The value is no scene.

    See Also
    --------
    decals.content_hash : equal values, without making anything again.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12)
    >>> decals.reproduce(scene).equal
    True
    >>> decals.reproduce(scene.replace(decals=scene.decals[:5])).missing
    ('edits by hand: the decals of the scene are others than its recipe made',)
    """
    require_scene("scene", scene, "give the scene that was posed")
    recipe = scene.recipe
    if recipe is None:
        return Reproduction(("a recipe: the scene does not say how its decals were made",))
    missing = tuple(_missing(scene, recipe))
    if missing:
        return Reproduction(missing)
    objects = {item.name: item for item in scene.objects}
    models = [objects[name] for name in recipe.parameters["models"]]
    tree = _tree_of_copies(recipe.parameters, models)
    surfaces = [item.surface for item in models] if tree is None else [ImplicitSurface(one_copy(tree)[0])]
    try:
        options = _options(recipe.parameters, surfaces)
        made = scatter(surfaces, seed=recipe.seed, progress=progress, cancel=cancel, **options)
        made = made if tree is None else on_all_copies(made, tree)
    except (ImplicitDecalsError, TypeError) as error:
        return Reproduction((f"parameters that this version takes: {error}",))
    here = provenance(device_text(str(options.get("device") or "cpu")))
    now = {"versions": package_versions(), "made": here}
    return Reproduction((), made, tuple(_changes(scene.decals, made)), changes_since(recipe.record, now))


def _missing(scene: Scene, recipe: Recipe) -> list[str]:
    """Return what the recipe needs and neither it nor the scene has."""
    if recipe.function not in FUNCTIONS:
        return [f"the function {recipe.function!r}, which is none of {', '.join(FUNCTIONS)}"]
    found = [
        f"the value of {name!r}, which the recipe only describes: {recipe.parameters.get(name)}"
        for name in recipe.missing
    ]
    objects = {item.name: item for item in scene.objects}
    models = recipe.parameters.get("models")
    if not isinstance(models, list):
        return [*found, "the names of its models"]
    for name in models:
        if name not in objects:
            found.append(f"the model {name!r}, which the scene does not have")
        elif recipe.inputs.get(name, shape := shape_hash(objects[name])) != shape:
            found.append(f"the model {name!r} as it was: the scene has it in another shape")
    if recipe.result and scene.decals.content_hash != recipe.result:
        found.append("edits by hand: the decals of the scene are others than its recipe made")
    return found


def _tree_of_copies(parameters: Mapping[str, Any], models: Sequence[SceneObject]) -> Node | None:
    """Return the tree whose copies show the same decals, if a recipe says so."""
    only = models[0] if len(models) == 1 else None
    return only.tree if parameters.get("same_on_copies") and isinstance(only, TreeObject) else None


def _options(parameters: Mapping[str, Any], surfaces: Sequence[Any]) -> dict[str, Any]:
    """Return the arguments of `decals.scatter` that a recipe describes."""
    options = {name: value for name, value in parameters.items() if name not in UNUSED}
    if isinstance(options.get("images"), list):
        options["images"] = len(options["images"])
    if isinstance(options.get("jitter"), Mapping):
        options["jitter"] = Jitter(**options["jitter"])
    if parameters.get("painted") is not None:
        planes = Planar.over(surfaces, parameters["painted_along"])
        options["density"] = PaintedImage(parameters["painted"], planes).density(black=parameters["black"])
    return options


def _changes(before: Decals, after: Decals) -> list[str]:
    """Return how decals differ from others, with figures."""
    if len(before) != len(after):
        return [f"number of decals: {len(before)} in the scene, {len(after)} made again"]
    changed = {
        name: np.flatnonzero(
            (getattr(before, name) != getattr(after, name)).reshape(len(before), -1).any(axis=1)
        )
        for name in COLUMNS
    }
    lines = [
        f"{name}: {len(rows)} of {len(before)} decals differ" for name, rows in changed.items() if len(rows)
    ]
    if len(changed["positions"]):
        moved = np.linalg.norm(after.positions - before.positions, axis=1) / before.radii
        lines.append(f"positions: up to {moved.max():.2g} radii apart")
    return lines
