"""The place of a node in the world: maps of points through the transforms, warps and mirrors above it."""

from collections.abc import Callable
from functools import cache, cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from blobtree.declare.warp import SpaceWarp
from blobtree.errors import InvalidNode
from blobtree.nodes.node import Node
from blobtree.nodes.paths import Path, ended_box, nodes_along, square_matrix
from blobtree.nodes.tree import Transform
from blobtree.transpile.python import plain_python, vector

NEWTON_STEPS = 30
DIFFERENCE = 1e-6
"""Step of the finite differences, in sizes of the node."""

TOLERANCE = 1e-9
"""Largest distance from the point of a warp that counts as its preimage, in sizes of the node."""

STARTS = np.array(list(product(np.linspace(0.0, 1.0, 7), repeat=3)))
"""Starts of Newton's method, in the box of the warped node, for points where the first one fails."""


class Place:
    """Where the space of the node at a path lies in the world.

    Parameters
    ----------
    tree
        The tree.
    path
        Path of the node.

    Raises
    ------
    InvalidNode
        The node is too large for a warp above it, or the warp takes no point to the node's middle.
    """

    def __init__(self, tree: Node, path: Path) -> None:
        *above, node = nodes_along(tree, path)
        low, high = ended_box(node)
        self.own_middle: Float64Array = (low + high).astype(np.float64) / 2.0
        self._size = float((high - low).max())
        self._steps: list[Float64Array | Callable[[Float64Array], Float64Array]] = []
        self._boxes: list[tuple[Float64Array, Float64Array]] = []
        for parent in above:
            if isinstance(parent, Transform):
                self._steps.append(square_matrix(parent.matrix))
            elif parent.warp is not None:
                self._steps.append(_forward(parent.warp, _parameters(parent)))
            else:
                continue
            low, high = ended_box(parent)
            self._boxes.append((low.astype(np.float64), high.astype(np.float64)))

    @property
    def warped(self) -> bool:
        """True if there is a warp above the node."""
        return any(callable(step) for step in self._steps)

    def local(self, point: ArrayLike) -> Float64Array:
        """Return a point of the world, shape (3,), in the node's own space."""
        result = np.asarray(point, np.float64)
        for step in self._steps:
            result = step(result) if callable(step) else _solved(step, result)
        return result

    def world(self, point: ArrayLike) -> Float64Array:
        """Return a point of the node's own space, shape (3,), in the world; the inverse of `local`."""
        result = np.asarray(point, np.float64)
        for step, box in zip(reversed(self._steps), reversed(self._boxes), strict=True):
            if callable(step):
                result = self._preimage(step, result, box)
            else:
                result = step[:3, :3] @ result + step[:3, 3]
        return result

    @cached_property
    def middle(self) -> Float64Array:
        """The middle of the node's box, in the world, shape (3,)."""
        return self.world(self.own_middle)

    def linear(self) -> Float64Array:
        """Return the Jacobian of `local` at the node's middle, float64[3, 3]."""
        return self._jacobian(self.local, self.middle)

    def moved(self, offset: ArrayLike) -> Float64Array:
        """Return the displacement, shape (3,), in its own space of a node whose middle moves in the world."""
        if not self.warped:
            return self.local(offset) - self.local(np.zeros(3))
        return self.local(self.middle + np.asarray(offset)) - self.own_middle

    def mapped(self, matrix: ArrayLike) -> Float64Array:
        """Return an affine map of the world as one of the node's own space, float64[4, 4].

        Below a warp it is turned as the warp turns the node's middle, without the warp's shear.
        """
        change = square_matrix(matrix)
        if not self.warped:
            world = np.eye(4)
            for step in self._steps:
                assert not callable(step)
                world = world @ step
            solved: Float64Array = np.asarray(np.linalg.solve(world, change @ world), np.float64)
            return solved
        u, _, v = np.linalg.svd(self.linear())
        turn, middle = u @ v, self.middle
        result = np.eye(4)
        result[:3, :3] = turn @ change[:3, :3] @ turn.T
        goal = self.local(change[:3, :3] @ middle + change[:3, 3])
        result[:3, 3] = goal - result[:3, :3] @ self.own_middle
        return result

    def _jacobian(self, function: Callable[[Float64Array], Float64Array], at: Float64Array) -> Float64Array:
        step = DIFFERENCE * self._size
        columns = [(function(at + step * e) - function(at - step * e)) / (2.0 * step) for e in np.eye(3)]
        return np.stack(columns, axis=1)

    def _preimage(
        self,
        forward: Callable[[Float64Array], Float64Array],
        goal: Float64Array,
        box: tuple[Float64Array, Float64Array],
    ) -> Float64Array:
        """Return a point that a warp takes to another one, by Newton's method."""
        low, high = box
        found = self._newton(forward, goal, goal)
        if found is None:
            starts = low + STARTS * (high - low)
            distances = [float(np.linalg.norm(forward(start) - goal)) for start in starts]
            found = self._newton(forward, goal, starts[int(np.argmin(distances))])
        if found is None:
            raise InvalidNode("path: expected a node that its warps show, got one whose middle they do not")
        return found

    def _newton(
        self, forward: Callable[[Float64Array], Float64Array], goal: Float64Array, start: Float64Array
    ) -> Float64Array | None:
        point = start
        for _ in range(NEWTON_STEPS):
            miss = forward(point) - goal
            if not np.isfinite(miss).all():
                return None
            if float(np.abs(miss).max()) <= TOLERANCE * self._size:
                return point
            point = point - np.linalg.lstsq(self._jacobian(forward, point), miss, rcond=None)[0]
        return None


def mirror_maps(tree: Node, path: Path) -> list[Float64Array]:
    """Return the maps, float64[4, 4], from a node in the world to itself and to its mirror images.

    Mirrors below warps are left out: their maps are not affine.
    """
    world, found = np.eye(4), [np.eye(4)]
    for node in list(nodes_along(tree, path))[:-1]:
        if isinstance(node, Transform):
            world = world @ square_matrix(node.matrix)
        elif node.warp is not None:
            break
        elif (reflection := getattr(node, "reflection", None)) is not None:  # a mirror
            image = world @ reflection @ np.linalg.inv(world)
            found += [one @ image for one in found]
    return found


def _solved(matrix: Float64Array, point: Float64Array) -> Float64Array:
    solved: Float64Array = np.asarray(np.linalg.solve(matrix[:3, :3], point - matrix[:3, 3]), np.float64)
    return solved


def _parameters(node: Node) -> tuple[float, ...]:
    """Return all parameters of a node's warp."""
    assert node.warp is not None
    own, (low, high) = node.warp_parameters, node.children[0].support
    room = () if node.warp.room is None else node.warp.room(low.astype(float), high.astype(float), own)
    return own + room


@cache
def _plain(warp: SpaceWarp) -> Callable[..., Any]:
    return plain_python(warp.forward.func)  # type: ignore[arg-type]  # a Python function


def _forward(warp: SpaceWarp, parameters: tuple[float, ...]) -> Callable[[Float64Array], Float64Array]:
    """Return the map of points (3,) to the space below a warp, in double precision."""
    padded = np.zeros(4 + 4 * -(-max(len(parameters) - 3, 0) // 4))
    padded[1 : 1 + len(parameters)] = parameters
    tape, plain = [vector(*row) for row in padded.reshape(-1, 4)], _plain(warp)
    return lambda point: np.asarray(plain(vector(*point), tape, 0), np.float64)
