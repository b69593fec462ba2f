"""Sketches: the pad on which students draw an outline before contact is switched on, and the truth."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from decals.apps.lab.experiment import Experiment, Scope
from decals.apps.lab.lesson import Lesson

MARGIN = 0.1
"""Space around the images on a pad, in model units."""


@cache
def pad(lesson: Lesson) -> dict[str, Any]:
    """Return the pad of a lesson in SVG, "picture": the rims before contact, and an outline as its last part.

    It lies in the square in the middle of the map from -"half" to "half" in both directions; y points down.
    """
    experiment = lesson.experiment()
    radii = experiment.decals.radii[:, None]
    centers = np.array([experiment.on_map(place) for place in experiment.decals.positions]) * (1, -1)
    low, high = ((centers - radii).min(axis=0) - MARGIN, (centers + radii).max(axis=0) + MARGIN)
    discs = np.column_stack([centers, radii])
    rims = "".join(f'<circle cx="{x:.4g}" cy="{y:.4g}" r="{radius:.4g}"/>' for x, y, radius in discs)
    box = " ".join(f"{number:g}" for number in (*low, *(high - low)))
    picture = f'<svg viewBox="{box}">{rims}<polygon points=""/></svg>'
    return {"half": float(np.abs([low, high]).max()), "picture": picture}


def truth(lesson: Lesson, experiment: Experiment, formula: str) -> list[bool]:
    """Return where a formula of a lesson is not 0 on its pad, row by row from the top."""
    seen = replace(experiment, size=2.0 * pad(lesson)["half"], plane=None)
    points = seen.map_points()
    holds = points.exists & (lesson.formulas[formula].evaluate(Scope(seen, points)) != 0)
    return [bool(one) for one in holds]
