"""``implicit-decals measure``: how the decals of a saved scene lie on its models."""

import json
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from decals import Scene
from decals import measure as measured
from decals.apps.commands.options import Inputs, OptionalWhole, Rules, Whole
from decals.apps.commands.progress_bars import preparing
from decals.apps.models.loading import load_models
from decals.errors import InvalidInput

LABELS = {
    "area": "area",
    "coverage": "coverage",
    "gap_area": "area without an image",
    "overlap_area": "area inside two rims or more",
    "stretch_median": "stretch, median",
    "stretch_p95": "stretch, 95 % of the points below",
    "stretch_max": "stretch, largest",
    "stretched": "share of stretch above 5",
    "folded": "folded share",
    "contact_length": "length of contact lines",
    "kept": "share of images that contact keeps",
    "residual_overlap": "area of several images after contact",
    "gap_mean": "distance of bare surface from images, mean",
    "gap_cv": "variation of that distance",
    "gap_p95": "95 % of these distances below",
    "gap_max": "largest of these distances",
    "least_distance": "least distance of centres",
    "mean_distance": "mean distance to the nearest centre",
    "bond_order": "bond order, 1 in a lattice",
    "rho": "evenness, rho",
    "covering_radius": "largest distance of surface from a centre",
    "cv": "variation of the nearest distance",
    "cv6": "variation of six distances",
    "samples": "points",
}

HIGH_RHO, HIGH_BOND_ORDER = 0.75, 0.8
"""Values above which centres lie as in a lattice. Blue noise of dart throwing has a rho of 0.75."""


def measure(
    scene: str,
    /,
    *,
    rules: Rules = Rules(),
    samples: OptionalWhole = None,
    seed: Whole = 0,
    json_output: Annotated[bool, Parameter(name="--json", negative=())] = False,
    inputs: Inputs = Inputs(),
) -> None:
    """Measure coverage, gaps, overlaps, stretch, folds and contact lines of a saved scene.

    Parameters
    ----------
    scene
        A saved scene in JSON.
    samples
        Number of random points on the models. Default: 200 for each decal.
    seed
        Seed of these points.
    json_output
        Print one JSON object in place of a table, with the measures of each decal.
    """
    with preparing(inputs.define) as progress:
        loaded = load_models([scene], trust=inputs.trust, table=inputs.table)
        if not isinstance(loaded, Scene):
            raise InvalidInput(f"expected a saved scene in JSON, got the model {scene!r}; scatter makes one")
        found = measured(loaded, samples=samples, seed=seed, progress=progress, **rules.given())
    if json_output:
        print(json.dumps(found.to_dict()))
        return
    lines = Table(box=None, show_header=False)
    for name, value in found.summary().items():
        lines.add_row(LABELS[name], f"{value:,}" if isinstance(value, int) else f"{value:.4g}")
    console = Console()
    console.print(lines, highlight=False)
    if found.rho > HIGH_RHO and found.bond_order > HIGH_BOND_ORDER:
        console.print(
            "A high rho with a high bond order: the centres lie as in a lattice, not as blue noise."
        )
