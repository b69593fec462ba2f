"""The lines of Python that make the picture of a lesson's scene again."""

import re
from dataclasses import fields
from typing import Any

import numpy as np

from decals.apps.lab.bindings import MODES
from decals.apps.lab.experiment import Experiment
from decals.apps.lab.lesson import LESSONS, Lesson
from decals.apps.lab.relaxing import Recording
from decals.model import Decals
from decals.scenes.objects import TreeObject

TREE = """from blobtree import {kinds}

{loaded}
tree = {tree!r}
objects = [*scene.objects[:{number}], decals.TreeObject({name!r}, tree), *scene.objects[{number} + 1:]]
scene = scene.replace(objects=objects)"""

RELAXED = """from decals.apps.lab.relaxing import Recording
from decals.editing.queries import move_decals

{loaded}
run = Recording(scene.objects, len(scene.decals), seed={seed}, iterations={iterations})
step = run.advance({step}, seconds=60)
scene = scene.replace(decals=move_decals(scene.decals, run.points(step)))"""

PLACED = """
{loaded}
scene = scene.replace(decals=scene.decals.replace({changes}))"""


def script(lesson: Lesson, state: Experiment, recording: Recording | None = None) -> str:
    """Return a script that draws the scene of a lesson as it is now, from its file and what has changed."""
    shipped = lesson.folder == LESSONS
    text = f"scene = decals.load_scene({'LESSONS / ' if shipped else ''}{lesson.settings.scene!r})"
    for number, (item, before) in enumerate(zip(state.objects, lesson.scene.objects, strict=False)):
        if isinstance(item, TreeObject) and item != before:
            kinds = ", ".join(sorted(set(re.findall(r"\b([A-Z]\w+)\(", repr(item.tree)))))
            text = TREE.format(kinds=kinds, loaded=text, number=number, tree=item.tree, name=item.name)
    pairs = ((name, getattr(state.decals, name)) for name in (column.name for column in fields(Decals)))
    new = {name: row for name, row in pairs if not np.array_equal(row, getattr(lesson.scene.decals, name))}
    if new and recording is not None and state.relaxed is not None:
        known = {"seed": recording.seed, "iterations": recording.iterations, "step": state.relaxed.step}
        text = RELAXED.format(loaded=text, **known)
    elif new:
        changes = ", ".join(f"{name}={_plain(row)}" for name, row in new.items())
        text = PLACED.format(loaded=text, changes=changes)
    modes = ((name, getattr(state.rules, name)) for name in MODES)
    options = ", ".join(f"{name}={getattr(mode, 'name', mode)!r}".lower() for name, mode in modes)
    picture = re.sub(r"\W+", "-", lesson.settings.title.lower())
    head = "import decals\n" + "from decals.apps.lab.lesson import LESSONS\n" * shipped
    return f'{head}{text}\ndecals.render(scene, size=(600, 600), {options}).save("{picture}.png")\n'


def _plain(values: Any) -> Any:
    """Return an array as lists of numbers that read as the same float32."""
    if np.ndim(values):
        return [_plain(value) for value in values]
    return float(str(values)) if isinstance(values, np.floating) else values.item()
