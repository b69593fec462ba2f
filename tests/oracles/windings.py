"""Solids of closed parts whose windings are known by construction, and the same with parts turned.

A file has nests of shells, as balls in balls. A shell is a body, which winds outward, or a cavity, which
winds inward. All is float64 NumPy and knows nothing of the product.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.decals.meshes import icosphere

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MAX_DEPTH = 4
"""Shells inside each other, at most."""


@dataclass
class Shell:
    """A closed part as it should wind, and whether its file has it, or some of its faces, turned."""

    vertices: Floats
    faces: Ints
    turned: bool | NDArray[np.bool_] = False

    def faces_in_file(self) -> Ints:
        """Return the faces as they are in the file."""
        turned = np.broadcast_to(self.turned, len(self.faces))
        return np.where(turned[:, None], self.faces[:, ::-1], self.faces)


@dataclass
class Case:
    """A file of shells; `welded` files have one vertex at each position."""

    kind: str
    shells: list[Shell] = field(default_factory=list)
    welded: bool = False

    def arrays(self, *, right: bool) -> tuple[Floats, Ints]:
        """Return vertices and faces as they should be, or as they are in the file."""
        counts = [len(shell.vertices) for shell in self.shells]
        starts = np.cumsum([0, *counts[:-1]])
        vertices = np.concatenate([shell.vertices for shell in self.shells])
        faces = np.concatenate(
            [
                (shell.faces if right else shell.faces_in_file()) + start
                for shell, start in zip(self.shells, starts, strict=True)
            ]
        )
        if self.welded:
            vertices, same = np.unique(vertices, axis=0, return_inverse=True)
            faces = same.reshape(-1)[faces]
        return vertices, faces


def solid(rng: np.random.Generator, center: Floats, radius: float) -> tuple[Floats, Ints]:
    """Return a closed convex part between the ball of the radius and that of half the radius."""
    kind = rng.integers(3)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    if kind == 0:
        vertices, faces = block(-np.ones(3), np.ones(3))
        vertices = vertices * rng.uniform(0.9, 1.0, 3) / np.sqrt(3.0)
    else:
        vertices, faces = icosphere(int(kind))
        vertices = vertices * rng.uniform(0.65, 1.0, 3)
    return radius * vertices @ turn.T + center, faces


def block(low: Floats, high: Floats) -> tuple[Floats, Ints]:
    """Return a box, each side divided into two triangles."""
    signs = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([triangle for a, b, c, d in quads for triangle in ([a, b, c], [a, c, d])])
    return np.where(signs, high, low), faces


def nest(rng: np.random.Generator, center: Floats, radius: float, *, alternating: bool) -> list[Shell]:
    """Return shells inside each other, bodies and cavities by chance or in turn; the first is a body."""
    shells: list[Shell] = []

    def add(center: Floats, radius: float, depth: int, around: int, outward: bool) -> None:
        vertices, faces = solid(rng, center, radius)
        shells.append(Shell(vertices, faces if outward else faces[:, ::-1]))
        inside = around + (1 if outward else -1)
        if depth == MAX_DEPTH:
            return
        for side in (-1, 1)[: rng.integers(0 if depth else 1, 3)]:
            body = not outward if alternating else inside == 0 or bool(rng.random() < 0.5)
            shift = side * 0.24 * radius * np.eye(3)[rng.integers(3)]
            add(center + shift, 0.22 * radius, depth + 1, inside, body)

    add(center, radius, 1, 0, True)
    return shells


def nests(rng: np.random.Generator) -> Case:
    """Return nests apart from each other, of which some are turned as a whole."""
    case = Case("nests")
    for number in range(rng.integers(1, 4)):
        shells = nest(rng, np.array([2.5 * number, 0.0, 0.0]), 1.0, alternating=bool(rng.random() < 0.5))
        turned = bool(rng.random() < 0.5)
        case.shells += [Shell(shell.vertices, shell.faces, turned) for shell in shells]
    return case


def scrambled(rng: np.random.Generator) -> Case:
    """Return nests of which single faces are turned too: at most a third of the area of each shell."""
    case = nests(rng)
    case.kind = "scrambled"
    for shell in case.shells:
        a, b, c = np.moveaxis(shell.vertices[shell.faces], 1, 0)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        order = rng.permutation(len(areas))
        few = np.cumsum(areas[order]) < areas.sum() * rng.uniform(0.0, 1.0 / 3.0)
        shell.turned = shell.turned ^ np.isin(np.arange(len(areas)), order[few])
    return case


def disagreeing(rng: np.random.Generator) -> Case:
    """Return balls in balls, in turn bodies and cavities, turned so that one winds inward in empty space."""
    depth = int(rng.integers(3, MAX_DEPTH + 1))
    turned = rng.random(depth) < 0.5
    right = np.where(np.arange(depth) % 2, -1, 1)
    found = np.where(turned, -right, right)
    while (np.cumsum(found * found[0]) >= 0).all():
        turned = rng.random(depth) < 0.5
        found = np.where(turned, -right, right)
    case = Case("disagreeing")
    for number in range(depth):
        vertices, faces = solid(rng, np.zeros(3), 0.45**number)
        outward = faces if number % 2 == 0 else faces[:, ::-1]
        case.shells.append(Shell(vertices, outward, bool(turned[number])))
    return case


def touching(rng: np.random.Generator) -> Case:
    """Return boxes in a row that share their walls, each turned by chance."""
    case = Case("touching", welded=bool(rng.random() < 0.5))
    ends = np.cumsum(rng.uniform(0.5, 1.5, rng.integers(3, 6)))
    size = rng.uniform(0.5, 1.5, 2)
    for low, high in pairwise(ends):
        vertices, faces = block(np.array([low, 0.0, 0.0]), np.array([high, *size]))
        case.shells.append(Shell(vertices, faces, bool(rng.random() < 0.5)))
    return case


def crossing(rng: np.random.Generator) -> Case:
    """Return a ball that parts stick out of, each turned by chance."""
    case = Case("crossing")
    vertices, faces = icosphere(3)
    case.shells.append(Shell(vertices, faces, bool(rng.random() < 0.5)))
    for _ in range(rng.integers(1, 4)):
        direction = rng.normal(size=3)
        center = direction / np.linalg.norm(direction)
        vertices, faces = solid(rng, rng.uniform(0.8, 1.1) * center, float(rng.uniform(0.3, 0.6)))
        case.shells.append(Shell(vertices, faces, bool(rng.random() < 0.5)))
    return case


def mirrored(rng: np.random.Generator) -> Case:
    """Return a nest and mirror images of it, whose faces keep the order of the original's corners."""
    case = Case("mirrored", nest(rng, np.zeros(3), 1.0, alternating=bool(rng.random() < 0.5)))
    original = list(case.shells)
    for number in range(rng.integers(1, 3)):
        scale = np.ones(3)
        scale[rng.integers(3)] = -1.0
        shift = np.array([0.0, 2.5 * (number + 1), 0.0])
        case.shells += [
            Shell(shell.vertices * scale + shift, shell.faces[:, ::-1], True) for shell in original
        ]
    return case


KINDS: dict[str, Callable[[np.random.Generator], Case]] = {
    "nests": nests,
    "scrambled": scrambled,
    "disagreeing": disagreeing,
    "touching": touching,
    "crossing": crossing,
    "mirrored": mirrored,
}
"""Families of files."""


def volume(vertices: ArrayLike, faces: ArrayLike) -> float:
    """Return the signed volume."""
    wide = np.asarray(vertices, np.float64)
    a, b, c = np.moveaxis((wide - wide.mean(axis=0))[np.asarray(faces)], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def oriented_triangles(vertices: ArrayLike, faces: ArrayLike) -> Floats:
    """Return triangles as rows of nine numbers in an order that depends on places and windings alone."""
    corners: Floats = np.asarray(vertices, np.float64)[np.asarray(faces)]
    order = np.lexsort(np.moveaxis(corners, 2, 0)[::-1], axis=1)[:, :1]
    rolled = np.take_along_axis(corners, ((order + np.arange(3)) % 3)[:, :, None], axis=1).reshape(-1, 9)
    return rolled[np.lexsort(rolled.T)]
