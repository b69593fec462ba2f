"""Values of a lesson about solids for all positions of its sliders, computed when its page is made."""

from dataclasses import dataclass, replace
from itertools import product
from math import prod
from typing import Any

import numpy as np

from decals.apps.lab.bindings import NodePath, binding
from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.experiment import Scope
from decals.apps.lab.lesson import Lesson
from decals.editing.session import EditSession
from decals.scenes.objects import SceneObject

SAMPLES = 81
"""Samples of a curve."""

DIGITS = 5
"""Digits of a value in a page."""

MOST = 128
"""Most models of a page."""


@dataclass(frozen=True, eq=False)
class Table:
    """What a page knows of a lesson at all positions of its sliders; those of the last one change first.

    Attributes
    ----------
    positions
        Positions of each slider, by its path.
    objects
        A model for each state.
    line
        Distances of the samples of curves.
    values
        For each formula its value in each state, or its curve.
    """

    positions: dict[str, list[float]]
    objects: list[SceneObject]
    line: list[float]
    values: dict[str, list[Any]]


def positions_of(lesson: Lesson) -> dict[str, list[float]]:
    """Return all positions of each slider, by its path.

    Raises
    ------
    InvalidLesson
        A slider that moves no parameter of a tree, or more than MOST positions together.
    """
    positions: dict[str, list[float]] = {}
    for slider in lesson.settings.sliders:
        if not isinstance(binding(slider.path), NodePath) or not slider.step:
            raise InvalidLesson(f"{slider.path}: expected a parameter of a tree with a step, on a page")
        places = np.arange(slider.low, slider.high + slider.step / 2, slider.step)
        positions[slider.path] = [float(f"{place:.6g}") for place in places]
    count = prod(map(len, positions.values()))
    if count > MOST:
        raise InvalidLesson(
            f"a page has at most {MOST} positions of its sliders, got {count:,}; take larger steps"
        )
    return positions


def tabulated(lesson: Lesson) -> Table:
    """Return the values of a lesson for all positions of its sliders.

    Raises
    ------
    InvalidLesson
        Positions as `positions_of` refuses them, or a formula that is a curve and stands in a text, too.
    """
    settings, positions = lesson.settings, positions_of(lesson)
    paths = [binding(path) for path in positions]
    curves = {
        curve.formula: lesson.formulas[curve.formula] for plot in settings.plots for curve in plot.curves
    }
    maps = {plot.map for plot in settings.plots}
    parts = [part for template in lesson.templates.values() for part in template]
    scalars = {part.text: part for part in parts if not isinstance(part, str)}
    scalars |= {text: part for text, part in lesson.formulas.items() if text not in {*curves, *maps}}
    if both := curves.keys() & scalars.keys():
        raise InvalidLesson(f"a page shows {min(both)!r} as a curve or as a number, not as both")
    values: dict[str, list[Any]] = {text: [] for text in (*curves, *scalars)}
    models: list[SceneObject] = []
    line: list[float] = []
    for state in product(*positions.values()):
        session = EditSession(lesson.scene)
        for path, place in zip(paths, state, strict=True):
            session.do(path.command(session.document, (), place))
        model = session.document.objects[0]
        models.append(replace(model, name=f"{model.name} {len(models) + 1}"))
        experiment = lesson.experiment(session.document.objects)
        scope = Scope.at_probe(experiment)
        along = scope.at(experiment.line_points(SAMPLES))
        line = [_short(x) for x in along["x"]]
        for text, formula in curves.items():
            found = np.broadcast_to(formula.evaluate(along), (SAMPLES,))
            values[text].append([_short(value) for value in found])
        for text, formula in scalars.items():
            values[text].append(_short(np.ravel(formula.evaluate(scope))[0]))
    return Table(positions, models, line, values)


def _short(value: Any) -> Any:
    """Return a value with few digits; none for one that is no number."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None
