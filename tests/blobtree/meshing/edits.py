"""Random edits of trees: one node moved, resized, recoloured, added, deleted, or its parameter changed."""

from dataclasses import fields, replace
from typing import Any

import numpy as np

from blobtree import Cone, Node, Offset, Point, Ricci, Segment, Sum, Transform, Twist, Union
from tests.blobtree.trees import random_leaf, triple

PLACES = {Point: ("center",), Segment: ("start", "end"), Cone: ("start", "end")}


def edited(rng: np.random.Generator, tree: Node) -> Node:
    """Return `tree` after one random edit; unchanged nodes stay the same objects."""
    path = [tree]
    while path[-1].children and rng.random() < 0.85:
        path.append(path[-1].children[rng.integers(len(path[-1].children))])
    node = _changed(rng, path[-1])
    for child, parent in zip(path[:0:-1], path[-2::-1], strict=True):
        node = with_child(parent, child, node)
    return node


def with_child(parent: Node, old: Node, new: Node) -> Node:
    """Return `parent` with `new` in place of the child `old`."""
    changes: dict[str, Any] = {}
    for field in fields(parent):  # type: ignore[arg-type]
        value = getattr(parent, field.name)
        if value is old:
            changes[field.name] = new
        elif isinstance(value, tuple) and any(item is old for item in value):
            changes[field.name] = tuple(new if item is old else item for item in value)
    return replace(parent, **changes)  # type: ignore[type-var]


def _changed(rng: np.random.Generator, node: Node) -> Node:
    if isinstance(node, Point | Segment | Cone):
        return _changed_leaf(rng, node)
    if isinstance(node, Ricci) and rng.random() < 0.4:
        return replace(node, exponent=float(rng.choice([1.0, 1.5, 2.0, 5.0])))  # type: ignore[call-arg]
    if isinstance(node, Twist):
        return replace(node, degrees=node.degrees + float(rng.normal() * 5.0))
    if isinstance(node, Offset):
        return replace(node, distance=float(rng.uniform(-0.02, 0.05)))
    if isinstance(node, Transform):
        return replace(node, child=node.child.translate(triple(rng.normal(size=3) * 0.1)))
    operands = getattr(node, "operands", None)
    if operands is None:
        return node - random_leaf(rng)
    if len(operands) > 1 and rng.random() < 0.5:
        gone = int(rng.integers(len(operands)))
        return replace(node, operands=operands[:gone] + operands[gone + 1 :])  # type: ignore[type-var]
    place = int(rng.integers(len(operands) + 1))
    return replace(node, operands=(*operands[:place], random_leaf(rng), *operands[place:]))  # type: ignore[type-var]


def _changed_leaf(rng: np.random.Generator, leaf: Point | Segment | Cone) -> Node:
    kind = rng.integers(0, 5)
    if kind == 0:
        return replace(leaf, radius=leaf.radius * float(rng.uniform(0.7, 1.4)))
    if kind == 1:
        return replace(leaf, color=triple(rng.uniform(0.0, 1.0, 3)))
    if kind == 2:
        return random_leaf(rng)
    if kind == 3:
        return (Sum if rng.random() < 0.5 else Union)((leaf, random_leaf(rng)))
    move = rng.normal(size=3) * 0.15
    places = {name: triple(np.array(getattr(leaf, name)) + move) for name in PLACES[type(leaf)]}
    return replace(leaf, **places)  # type: ignore[arg-type]
