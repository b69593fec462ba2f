"""``implicit-decals seed``: where decals would lie, as data."""

import json
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from blobtree.nodes.io import write_atomically
from decals.coat.choosing import ImageChoice
from decals.coat.orientation import Orientation
from decals.coat.seeding import seed as seed_decals
from decals.coat.sizing import Sizing
from decals.model import Decals
from decals.scenes.scene import Scene
from decals.seeds.painted_image import PaintedImage
from decals.seeds.projections import Planar

from ..errors import UsageError
from ..machine.warp_start import start_warp
from ..models.definitions import import_definitions
from ..models.loading import load_models
from ..output import check_output
from .options import MAX_DECALS, MAX_SEED, Definitions, OptionalWhole, Whole, check_count
from .progress_bars import FINDING, progress_bars

COLUMNS = ("x", "y", "z", "nx", "ny", "nz", "tx", "ty", "tz", "radius", "image")
SUFFIXES = (".json", ".csv")


def seed(
    model: Annotated[list[str], Parameter(negative=())],
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    count: OptionalWhole = None,
    spacing: Annotated[float | None, Parameter(show_default=False)] = None,
    sizing: Sizing = Sizing.COVERING,
    factor: float = 1.0,
    along: Annotated[Orientation | None, Parameter(show_default=False)] = None,
    images: Whole = 1,
    choice: ImageChoice = ImageChoice.RANDOM,
    painted: Annotated[Path | None, Parameter(show_default=False)] = None,
    painted_along: Literal["x", "y", "z"] = "z",
    black: float = 0.1,
    regularity: float = 1.0,
    seed: Whole = 0,
    define: Definitions = None,
) -> None:
    """Spread seeds over models and write the decals that lie on them.

    Several models keep their own coordinates; where they touch, seeds push each other.

    Parameters
    ----------
    model
        Mesh files (ply, obj, stl, vtp, ...), BlobTrees in JSON, or samples (creature, dragon, horse, knot,
        spheres).
    output
        The decals: json, an object of arrays, or csv, a row for each.
    count
        How many. Default: 500.
    spacing
        Distance of neighbours in the models' units, in place of the count.
    sizing
        How large decals are: covering leaves no gap, touching no overlap, delaunay is the paper's rule.
    factor
        Radii times this.
    along
        Where images point: curvature, or cross for a smooth field of quarter turns. Default: at random.
    images
        How many images decals choose among.
    choice
        What decides which: chance, the decals' size, or how much the surface bends.
    painted
        An image that says how densely seeds lie, laid over the models: most where it is white.
    painted_along
        Axis along which it is thrown onto them.
    black
        Density where it is black, as a part of that where it is white.
    regularity
        From 0, places at random, to 1, as even as can be.
    seed
        The same number gives the same decals.
    define
        A Python file or module that defines own kinds of nodes, for BlobTrees in JSON that use them. May be
        given several times.
    """
    if count is not None and spacing is not None:
        raise UsageError("expected --count or --spacing, got both; leave one of them out")
    if count is None and spacing is None:
        count = 500
    if count is not None:
        check_count("--count", count, 0, MAX_DECALS)
    check_count("--images", images, 1, MAX_DECALS)
    check_count("--seed", seed, 0, MAX_SEED)
    check_output(output, SUFFIXES)
    start_warp()
    import_definitions(define)
    objects = load_models(model)
    if isinstance(objects, Scene):
        raise UsageError("a saved scene brings its own decals; seed its models instead")
    with progress_bars() as progress:
        progress(FINDING, 0.0)
        surfaces = [item.surface for item in objects]
        density = None
        if painted is not None:
            density = PaintedImage(painted, Planar.over(surfaces, painted_along)).density(black=black)
        decals = seed_decals(
            surfaces,
            count=count,
            spacing=spacing,
            density=density,
            regularity=regularity,
            sizing=sizing,
            factor=factor,
            direction=along,
            images=images,
            choice=choice,
            seed=seed,
            progress=progress,
        )
    write_decals(decals, output)


def write_decals(decals: Decals, path: Path) -> None:
    """Write where decals lie as the kind of file that the extension names."""
    arrays = [
        decals.positions,
        decals.normals,
        decals.tangents,
        decals.radii[:, None],
        decals.images[:, None],
    ]
    if path.suffix.lower() == ".csv":
        rows = np.hstack([array.astype(object) for array in arrays])
        lines = [",".join(COLUMNS), *(",".join(map(str, row)) for row in rows)]
        text = "\n".join(lines) + "\n"
    else:
        names = ("positions", "normals", "tangents", "radii", "images")
        text = json.dumps({name: getattr(decals, name).tolist() for name in names}) + "\n"
    write_atomically(path, text.encode())
