"""Random pairs of convex primitives at a known distance from each other, in float64.

A pair has a plane of support each, parallel and a distance apart, and touches these planes in points opposite
each other. So no two points of both are nearer, however they are turned.
"""

from dataclasses import dataclass

import numpy as np

from blobtree import Box, Disc, Node, Point, Segment, Union
from blobtree._typing import Float64Array

KINDS = ("ball", "rod", "box", "plate")


@dataclass(frozen=True)
class Pair:
    """Two primitives, and their distance over the longest side of their box."""

    tree: Union
    kinds: tuple[str, str]
    share: float


@dataclass(frozen=True)
class _Body:
    """A primitive, with a point that lies farthest along a direction."""

    kind: str
    node: Node
    direction: Float64Array
    farthest: Float64Array


def random_pair(seed: int, *, nearest: float = 1e-4) -> Pair:
    """Return a random pair at a distance from `nearest` to 0.5 of its box."""
    rng = np.random.default_rng([34, seed])
    share = float(10.0 ** rng.uniform(np.log10(nearest), np.log10(0.5)))
    first, second = _random_body(rng), _random_body(rng)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    scale = 10.0 ** rng.uniform(-1.0, 1.0)
    left = _placed(first, _turn(rng, first.direction, normal), np.zeros(3), scale)
    turn, distance = _turn(rng, second.direction, -normal), share
    for _round in range(20):  # the box grows with the distance
        tree = Union((left, _placed(second, turn, distance * normal, scale)))
        box = float((tree.support[1] - tree.support[0]).max()) / scale
        distance = share * box
    return Pair(tree, (first.kind, second.kind), share)


def _random_body(rng: np.random.Generator) -> _Body:
    """Return a body about the origin, and one of its farthest points along a direction."""
    kind, radius = str(rng.choice(KINDS)), float(10.0 ** rng.uniform(-1.2, 0.0))
    extent = float(rng.uniform(0.3, 1.5))
    direction = rng.normal(size=3)
    if rng.random() < 0.6:  # along a side or an edge
        direction[rng.permutation(3)[: rng.integers(1, 3)]] = 0.0
    direction /= np.linalg.norm(direction)
    inner = rng.uniform(-1.0, 1.0, 3)
    if kind == "ball":
        return _Body(kind, Point((0, 0, 0), radius=radius), direction, radius * direction)
    if kind == "rod":
        end = np.array([0.0, 0.0, extent]) * (np.sign(direction[2]) or inner[2])
        node: Node = Segment((0, 0, -extent), (0, 0, extent), radius=radius)
        return _Body(kind, node, direction, end + radius * direction)
    if kind == "plate":
        aside = np.array([*direction[:2], 0.0])
        length = float(np.linalg.norm(aside))
        place = extent * (aside / length if length > 0.0 else np.array([*(0.7 * inner[:2]), 0.0]))
        thin = 0.2 * radius
        return _Body(
            kind, Disc((0, 0, 0), (0, 0, 1), extent, radius=thin), direction, place + thin * direction
        )
    sides, edge = extent * rng.uniform(0.5, 1.5, 3), 0.1 * radius
    corner = 0.5 * sides * np.where(direction == 0.0, inner, np.sign(direction))
    x, y, z = sides.tolist()
    return _Body(kind, Box((0, 0, 0), (x, y, z), radius=edge), direction, corner + edge * direction)


def _turn(rng: np.random.Generator, first: Float64Array, second: Float64Array) -> Float64Array:
    """Return a random rotation (3, 3) that turns a direction to another."""
    frames = []
    for direction in (first, second):
        frame = np.linalg.qr(np.column_stack([direction, rng.normal(size=(3, 2))]))[0]
        frame[:, 0] = direction
        frame[:, 2] = np.cross(frame[:, 0], frame[:, 1])
        frames.append(frame)
    return np.asarray(frames[1] @ frames[0].T)


def _placed(body: _Body, turn: Float64Array, place: Float64Array, scale: float) -> Node:
    """Return a body turned, with its farthest point at a place, and everything scaled."""
    return body.node.transform(scale * np.column_stack([turn, place - turn @ body.farthest]))
