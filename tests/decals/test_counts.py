"""Counts: a number with a fraction is refused wherever a count is taken, and 12.0 counts as 12."""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import blobtree
import decals
from decals.apps.commands.bench import parse_counts
from decals.apps.commands.options import parse_whole
from decals.apps.experiments import contact_peers, cost, evenness
from decals.editing import ScatterDecals
from decals.errors import ImplicitDecalsError, InvalidInput
from decals.experiments import LatinHypercube, Seeds, Sobol
from decals.options import options_of
from decals.scattering.appearance import image_shares
from decals.validation import count_number

BALL = blobtree.Point((0, 0, 0), radius=1.0)
SURFACE = decals.surfaces.MeshSurface(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], device="cpu"
)


@cache
def scene() -> decals.Scene:
    return decals.cover(SURFACE, count=3)


TAKERS: dict[str, Callable[[Any], Any]] = {
    "scatter": lambda count: len(decals.scatter(SURFACE, count=count)),
    "images of scatter": lambda count: len(image_shares(count, None)),
    "cover": lambda count: len(decals.cover(SURFACE, count=count).decals),
    "steps": lambda count: decals.Relaxation(SURFACE, count=3, iterations=count).iterations,
    "rounds": lambda count: decals.Relaxation(SURFACE, count=3).polish(count),
    "command": lambda count: len(
        ScatterDecals((0,), count).compute_command(scene().objects, 1).decals.positions
    ),
    "sample": lambda count: len(SURFACE.sample(count, 0)[0]),
    "turntable": lambda count: len(decals.turntable(scene(), count)),
    "samples of measure": lambda count: decals.measure(scene(), samples=count).samples,
    "samples of a picture": lambda count: decals.rendering.RenderOptions(samples=count).samples,
    "Seeds": lambda count: len([*Seeds(count)]),
    "Sobol": lambda count: len([*Sobol(count, x=(0.0, 1.0))]),
    "LatinHypercube": lambda count: len([*LatinHypercube(count, x=(0.0, 1.0))]),
    "triangles": lambda count: len(
        blobtree.polygonize(BALL, chord_error=0.5, max_triangles=1000 + count).faces
    ),
    "form": lambda count: options_of(decals.scatter)["count"].parsed(str(count), InvalidInput),
    "command line": lambda count: parse_whole(str(count)),
    "counts of bench": lambda count: parse_counts(str(count))[0],
}
"""Calls with a count, which return what the count makes."""


@pytest.mark.parametrize("name", TAKERS)
def test_a_count_with_a_fraction_is_refused_and_one_without_passes(name: str) -> None:
    rng = np.random.default_rng([ord(letter) for letter in name])
    call, whole = TAKERS[name], int(rng.integers(2, 9))
    for wrong in (whole + rng.uniform(0.01, 0.99), np.float32(whole + 0.5), math.nan, math.inf):
        with pytest.raises((ImplicitDecalsError, ValueError), match=r"expected .*(whole|finite) number"):
            call(wrong)
    made = call(whole)
    for same in (float(whole), np.float32(whole), np.int16(whole)):
        assert call(same) == made


@pytest.mark.parametrize("study", [contact_peers.contact_peers, cost.cost, evenness.evenness])
def test_grids_of_experiments_give_floats(study: Callable[..., Any]) -> None:
    first = {"method": "darts"} if study is evenness.evenness else {"method": "circles", "crowding": 0.5}
    with pytest.raises(InvalidInput, match=r"count: expected a whole number from 1 upward, got 12\.5"):
        study(**{} if study is cost.cost else first, count=12.5)


def test_counts_in_the_forms_of_numbers() -> None:
    for text in ("1e3", "1E+3", "1000.", "1000.000", "1_000", "+1000"):
        assert parse_whole(text) == 1000
    for text in ("12.5", "1e-3", "1e999", "nan", "inf", "1e", "x", "", "0x10", "1.2.3", "--3"):
        with pytest.raises(ValueError, match="expected a whole number"):
            parse_whole(text)
    for whole in (1e3, np.float64(1e3), np.float32(1e3), np.float16(1000), 1000):
        assert count_number("count", whole, 0, None, InvalidInput) == 1000
    for wrong in (True, "12", None, [12], 12 + 0j, 1e300):
        with pytest.raises(InvalidInput, match="count: expected a whole number"):
            count_number("count", wrong, 0, 10**9, InvalidInput)
