"""Paths of parameters, which sliders of lessons read and set by commands of the edit session.

======================================  ==================================================================
``decals.0.x``, ``.y``, ``.z``          a coordinate of decal 0, which stays on the surface
``decals.0.radius``                     its visible radius; also ``opacity``, ``layer`` and ``interaction``
``decals.*.radius``                     the same of all decals
``objects.0.stiffness.1``               number 1 of the parameter ``stiffness`` of the tree of object 0
``objects.0.2.center.0``                number 0 of the parameter ``center`` of operand 2 of that tree
``contact``, ``stiffness``, ``mapping``  the modes in which decals are drawn
``probe.x``, ``.y``, ``.z``             a coordinate of the probe
``step``, ``seed``                      the step and the random numbers of a relaxation
======================================  ==================================================================
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from blobtree.declare.parameters import parameters_of
from decals.apps.lab.errors import InvalidLesson
from decals.apps.sandbox.controls import exchanged
from decals.editing.commands import MoveDecals, SetValues
from decals.editing.document import Document
from decals.editing.queries import nearest_points
from decals.editing.session import Command
from decals.editing.tree_commands import SetParameter
from decals.errors import InvalidEdit
from decals.model import Decals, Interaction
from decals.scenes.objects import SceneObject, TreeObject
from decals.validation import number_of

AXES = "xyz"
COLUMNS = {"radius": "radii", "opacity": "opacities", "layer": "layers", "interaction": "interactions"}
"""Arrays of decals by their names in paths."""

MODES = ("contact", "stiffness", "mapping")
OWN = (*MODES, "step", "seed", *(f"probe.{axis}" for axis in AXES))
"""Paths that are no parts of a scene."""

DECALS = re.compile(r"decals\.(\d+|\*)\.(\w+)")
OBJECTS = re.compile(r"objects\.(\d+)((?:\.\d+)*)\.([a-z_]+)((?:\.\d+)*)")


@dataclass(frozen=True)
class DecalPath:
    """A value of one decal, or of all."""

    row: int | None
    name: str

    def rows(self, count: int) -> list[int]:
        """Return the decals; raise `InvalidLesson` for a scene without decals."""
        rows = list(range(count)) if self.row is None else [self.row]
        if not rows or rows[-1] >= count:
            raise InvalidLesson(f"expected a decal from 0 to {count - 1}, got {self.row}")
        return rows

    def read(self, objects: Sequence[SceneObject], decals: Decals) -> Any:
        """Return the present value; of several decals that of the first."""
        row = self.rows(len(decals))[0]
        if self.name in AXES:
            return float(decals.positions[row, AXES.index(self.name)])
        value = getattr(decals, COLUMNS[self.name])[row].item()
        return Interaction(value).name.lower() if self.name == "interaction" else value

    def command(self, document: Document, numbers: Sequence[int], value: Any) -> Command:
        """Return the command that sets a value."""
        chosen = [numbers[row] for row in self.rows(len(numbers))]
        if self.name not in AXES:
            value = value if self.name == "interaction" else number_of(self.name, value, InvalidEdit)
            value = round(value) if self.name == "layer" else value
            return SetValues(chosen, {COLUMNS[self.name]: value}, f"set {self.name}")
        place = document.decals.take(np.array(chosen[:1])).positions.astype(np.float64)
        place[0, AXES.index(self.name)] = number_of(self.name, value, InvalidEdit)
        point = nearest_points(document.objects, place)
        return MoveDecals(chosen[:1], point.positions[0], point.normals[0])


@dataclass(frozen=True)
class NodePath:
    """A parameter of a node, or one number of it."""

    object: int
    path: tuple[int, ...]
    name: str
    index: tuple[int, ...]

    def _parameter(self, objects: Sequence[SceneObject]) -> Any:
        item = objects[self.object] if self.object < len(objects) else None
        node: Any = item.tree if isinstance(item, TreeObject) else None
        for number in self.path:
            node = node.children[number] if node is not None and number < len(node.children) else None
        if node is None or self.name not in parameters_of(type(node)):
            raise InvalidLesson(
                f"expected the path of a parameter of a tree, got {self.name!r} of {item!r:.80}"
            )
        return getattr(node, self.name)

    def read(self, objects: Sequence[SceneObject], decals: Decals) -> Any:
        """Return the present value."""
        value = self._parameter(objects)
        for number in self.index:
            if not isinstance(value, tuple) or number >= len(value):
                raise InvalidLesson(f"{self.name}: expected the index of one of its numbers, got {number}")
            value = value[number]
        return value

    def command(self, document: Document, numbers: Sequence[int], value: Any) -> Command:
        """Return the command that sets a value."""
        self.read(document.objects, document.decals.decals)
        number, parameter = number_of(self.name, value, InvalidEdit), self._parameter(document.objects)
        value = exchanged(parameter, list(self.index), number)
        return SetParameter(self.object, self.path, self.name, value, quick=True)


def binding(path: str) -> DecalPath | NodePath:
    """Return what a path leads to.

    Raises
    ------
    InvalidLesson
        No such path exists.
    """
    if match := DECALS.fullmatch(path):
        row, name = match.groups()
        if name in COLUMNS or (name in AXES and len(name) == 1 and row != "*"):
            return DecalPath(None if row == "*" else int(row), name)
    if match := OBJECTS.fullmatch(path):
        number, above, name, index = match.groups()
        return NodePath(int(number), _whole(above), name, _whole(index))
    raise InvalidLesson(
        f"path: expected {', '.join(OWN)}, or one such as decals.0.radius or objects.0.1.center.0, "
        f"got {path!r}"
    )


def _whole(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(".") if part)
