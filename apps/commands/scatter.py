"""``implicit-decals scatter``: scattered decals as a scene, or as a table."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from blobtree import Node
from decals import Scene, Sizing, save_scene, save_table
from decals import scatter as scatter_decals
from decals.apps.commands.options import (
    MAX_DECALS,
    MAX_SEED,
    CreaseAngle,
    Definitions,
    OptionalWhole,
    Trust,
    Whole,
    check_count,
)
from decals.apps.commands.progress_bars import preparing
from decals.apps.commands.zone_options import parse_zones
from decals.apps.models.loading import load_models
from decals.apps.models.samples import axes_of
from decals.apps.models.tables import ASPECT, scale_images
from decals.apps.output import check_output, print_path
from decals.apps.views import frame, parse_view
from decals.errors import InvalidInput
from decals.rendering import Drawing
from decals.scattering import ImageChoice, Orientation, PaintedImage, Planar
from decals.scattering.copies import has_copies, on_all_copies, one_copy
from decals.scattering.neighbors import ideal_spacing
from decals.scenes.objects import SceneObject, TreeObject
from decals.scenes.recipe import Recipe
from decals.scenes.tables import SUFFIXES as TABLE_SUFFIXES
from decals.surfaces import ImplicitSurface

SUFFIXES = (".json", *TABLE_SUFFIXES)
MAX_IMAGES = 256


def scatter(
    model: Annotated[list[str], Parameter(negative=())],
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    count: OptionalWhole = None,
    spacing: Annotated[float | None, Parameter(show_default=False)] = None,
    sizing: Sizing = Sizing.COVERING,
    factor: float = 1.0,
    along: Annotated[Orientation | None, Parameter(show_default=False)] = None,
    images: OptionalWhole = None,
    choice: ImageChoice = ImageChoice.RANDOM,
    painted: Annotated[Path | None, Parameter(show_default=False)] = None,
    painted_along: Annotated[Literal["x", "y", "z"] | None, Parameter(show_default=False)] = None,
    black: Annotated[float | None, Parameter(show_default=False)] = None,
    zone: Annotated[list[str] | None, Parameter(negative=(), show_default=False)] = None,
    border_width: Annotated[float | None, Parameter(show_default=False)] = None,
    same_on_copies: Annotated[bool, Parameter(negative=())] = False,
    regularity: float = 1.0,
    seed: Whole = 0,
    crease_angle: CreaseAngle = None,
    define: Definitions = None,
    trust: Trust = False,
) -> None:
    """Scatter decals over models and write them to a file.

    All models share one coordinate system. Decals of different models push each other where the models touch.

    Parameters
    ----------
    model
        Mesh files (ply, obj, stl, vtp, ...), BlobTrees in JSON, programs (vm, frep), samples (creature,
        dragon, horse, knot, spheres), or one saved scene, which keeps its images and camera.
    output
        The output file: json, a scene that other commands open, or csv or parquet, a table with a row for
        each decal, which they take by --table.
    count
        Number of decals. Default: 500.
    spacing
        Distance of neighbours in the models' units, instead of --count.
    sizing
        Rule for the radii: covering (no gaps), touching (no overlaps), or delaunay (the paper's rule).
    factor
        Factor on all radii.
    along
        Orientation of images: curvature, or cross (a smooth field with fourfold symmetry). Default: random.
    images
        Number of images, from 1 to 256. Default: the images of a saved scene, else 1.
    choice
        Rule that assigns images: random, or by the decals' size or the surface's curvature.
    painted
        An image file, projected onto the models, that sets the density of decals: highest where it is white.
    painted_along
        Axis of that projection, and of those of zones. Default: z.
    black
        Density where the image is black, as a fraction of that where it is white. Default: 0.1.
    zone
        A zone with decals of its own, such as "head:spacing=0.1,images=0+2". Where: the name of a model, of a
        node of a tree or of a label; a tree file, for the inside of its solid; an image file, where it is
        bright; or * for everywhere else. Keys: density, spacing, factor, images, along. May be repeated; the
        first zone at a place counts.
    border_width
        Width of the band in which decals of neighbouring zones mix. Default: 0, they press each other.
    same_on_copies
        Scatter over one copy of a repeat, and put the same decals on all copies. --count is that of one copy.
    regularity
        From 0 (random positions) to 1 (as even as possible).
    seed
        Seed of the random numbers: equal seeds give equal decals.
    """
    if count is not None and spacing is not None:
        raise InvalidInput("expected --count or --spacing, got both; leave one of them out")
    if painted is None and ((painted_along is not None and not zone) or black is not None):
        raise InvalidInput(
            "--painted-along and --black change a painted image; give --painted, or leave them out"
        )
    if border_width is not None and not zone:
        raise InvalidInput("--border-width is that of zones; give --zone, or leave it out")
    if same_on_copies and zone:
        raise InvalidInput("--same-on-copies scatters over one copy without --zone; leave one of them out")
    painted_along, black = painted_along or "z", 0.1 if black is None else black
    if count is not None:
        check_count("--count", count, 0, MAX_DECALS)
    if images is not None:
        check_count("--images", images, 1, MAX_IMAGES)
    check_count("--seed", seed, 0, MAX_SEED)
    check_output(output, SUFFIXES)
    with preparing(define) as progress:
        loaded = load_models(model, trust=trust, crease_angle=crease_angle)
        objects = loaded.objects if isinstance(loaded, Scene) else tuple(loaded)
        if not objects:
            raise InvalidInput(f"expected a scene with objects, {model[0]!r} has none; add one with `edit`")
        own = loaded.images if images is None and isinstance(loaded, Scene) else ()
        pictures = own or scale_images(images or 1)
        tree = _tree_of_copies(objects) if same_on_copies else None
        one, copies = (None, 1) if tree is None else one_copy(tree)
        surfaces = [item.surface for item in objects] if one is None else [ImplicitSurface(one)]
        if spacing is not None:
            _check_spacing(spacing, copies * sum(surface.area for surface in surfaces))
        density = None
        if painted is not None:
            density = PaintedImage(painted, Planar.over(surfaces, painted_along)).density(black=black)
        options: dict[str, Any] = {
            "count": count,
            "spacing": spacing,
            "regularity": regularity,
            "sizing": sizing,
            "factor": factor,
            "direction": along,
            "images": len(pictures),
            "choice": choice,
        }
        if zone:
            options["zones"] = zones = parse_zones(
                zone,
                border_width or 0.0,
                objects,
                axis=painted_along,
                images=len(pictures),
                trust=trust,
            )
        if count is None and spacing is None and not (zone and zones.have_spacings):
            options["count"] = 500
        if copies * (options["count"] or 0) > MAX_DECALS:
            raise InvalidInput(
                f"--count: expected at most {MAX_DECALS:,} decals on all copies, got {options['count']:,} on "
                f"each of {copies:,}; take fewer"
            )
        decals = scatter_decals(
            list(objects) if tree is None else surfaces,
            density=density,
            seed=seed,
            progress=progress,
            **options,
        )
        if tree is not None:
            decals = on_all_copies(decals, tree)
        if output.suffix.lower() in TABLE_SUFFIXES:
            save_table(decals, output, images=own, origin=objects[0].origin)
        else:
            if isinstance(loaded, Scene):
                camera, drawing = loaded.camera, loaded.drawing
            else:
                camera, drawing = frame(objects, parse_view(None, axes_of(model[0])), ASPECT), Drawing()
            if painted is not None:
                options |= {"painted": str(painted), "painted_along": painted_along, "black": black}
            if same_on_copies:
                options["same_on_copies"] = True
            names = [item.name for item in objects]
            recipe = Recipe.of("decals.scatter", seed=seed, models=names, **options).giving(decals, objects)
            kept: dict[str, Any] = {"drawing": drawing, "recipe": recipe}
            save_scene(Scene(objects=objects, camera=camera, images=pictures, decals=decals, **kept), output)
    print_path(output)


def _tree_of_copies(objects: Sequence[SceneObject]) -> Node:
    """Return the tree of the only object; InvalidInput if it does not consist of copies."""
    only = objects[0] if len(objects) == 1 else None
    if not isinstance(only, TreeObject) or not has_copies(only.tree):
        raise InvalidInput(
            "--same-on-copies: expected one model, a tree whose root is a Repeat or a PolarRepeat, got "
            f"{', '.join(item.name for item in objects)}; leave the option out"
        )
    return only.tree


def _check_spacing(spacing: float, area: float) -> None:
    """Raise `InvalidInput` for a distance of neighbours at which an area would need too many decals."""
    least = ideal_spacing(area, MAX_DECALS)
    if 0.0 < spacing < least:
        raise InvalidInput(
            f"--spacing: expected at least {least:.3g}, which makes {MAX_DECALS:,} decals, got {spacing:g}"
        )
