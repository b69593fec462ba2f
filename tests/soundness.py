"""Soundness of random trees of all classes of nodes: meshes and rays against dense evaluation."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from blobtree import Box, Mesh, Node, polygonize
from blobtree.conformance.samples import Rng
from blobtree.errors import InvalidNode
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.tape.bounds import is_endless
from blobtree.tracing.trace import trace
from blobtree.tracing.tree_cells import trace_tolerance
from tests.blobtree.trees import random_leaf, random_profile
from tests.conformance import sample
from tests.oracles import dense_polygonize

RESOLUTION = 20
RAYS, STEPS = 40, 400
FAR = 1e-3
"""Distance of a hit from the surface, over the model's size, at which it is false."""


WEIGHTS = (1.0, 1.0, 0.6, 1.5, -0.5)
PROFILED = 0.3
"""Probability that an operand with a falloff has another one, another width and weight."""


def random_tree(rng: Rng, depth: int = 2) -> Node:
    """Return a tree whose nodes are of any class, all equally probable."""
    kinds = [NODE_KINDS[tag] for tag in sorted(NODE_KINDS)]  # their own order is that of imports

    def operand(rng: Rng) -> Node:
        node = random_tree(rng, depth - 1) if depth and rng.random() < 0.5 else random_leaf(rng)
        return random_profile(rng, node, WEIGHTS) if rng.random() < PROFILED else node

    while True:
        try:
            return ended(sample(kinds[int(rng.integers(len(kinds)))], rng, operand))
        except InvalidNode:  # a combination that no class accepts
            continue


def ended(tree: Node) -> Node:
    """Return a tree, a part of it if it has no end."""
    return tree & Box((0, 0, 0), (3, 3, 3), radius=0) if is_endless(tree.field_box) else tree


def failures_by_seed(seed: int, count: int) -> Iterator[tuple[int, Node, list[str]]]:
    """Yield the numbers of random trees that violate something, the trees, and what they violate."""
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        tree = random_tree(rng)
        if failures := failures_of(tree, rng):
            yield number, tree, failures


def failures_of(tree: Node, rng: Rng) -> list[str]:
    """Return what a tree violates."""
    lower, upper = tree.support
    cell = float((upper - lower).max()) / RESOLUTION
    mesh = polygonize(tree, cell_size=cell)
    dense = dense_polygonize.polygonize(tree, cell_size=cell)
    found: list[str] = []
    if _differ(mesh, dense, cell):
        found.append(f"{len(mesh.faces)} triangles, by dense evaluation {len(dense.faces)}, or others")
    if _open_edges(mesh):
        found.append(f"{_open_edges(mesh)} open or non-manifold edges")
    return found + _ray_failures(tree, rng)


def _differ(sparse: Mesh, dense: Mesh, cell: float) -> bool:
    """Return True if two meshes have other quads, or vertices farther apart than a hundredth of a cell."""
    if (len(sparse.vertices), len(sparse.faces)) != (len(dense.vertices), len(dense.faces)):
        return True
    if not len(dense.vertices):
        return False
    distance, label = cKDTree(dense.vertices).query(sparse.vertices)
    if distance.max() > 1e-2 * cell:
        return True
    if len(np.unique(label)) < len(label):  # sheets that meet in a point: quads alone tell them apart
        return False
    return _quads(sparse, label) != _quads(dense, np.arange(len(label)))


def _quads(mesh: Mesh, labels: NDArray[np.intp]) -> set[tuple[int, ...]]:
    """Return every pair of triangles as the set of its corners, whichever diagonal splits it."""
    pairs = labels[mesh.faces].reshape(-1, 6)
    return {tuple(sorted(set(row))) for row in pairs.tolist()}


def _open_edges(mesh: Mesh) -> int:
    """Return the number of directed edges whose opposites do not occur once."""
    edges = np.concatenate([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)]).astype(np.int64)
    keys = edges[:, 0] << 32 | edges[:, 1]
    opposite = edges[:, 1] << 32 | edges[:, 0]
    return int((~np.isin(keys, opposite)).sum()) + len(keys) - len(np.unique(keys))


def _ray_failures(tree: Node, rng: Rng) -> list[str]:
    """Compare rays with samples along them."""
    lower, upper = (corner.astype(np.float64) for corner in tree.support)
    center, size = 0.5 * (lower + upper), float(np.linalg.norm(upper - lower))
    away = rng.normal(size=(RAYS, 3))
    origins = center + size * away / np.linalg.norm(away, axis=1, keepdims=True)
    directions = rng.uniform(lower, upper, (RAYS, 3)) - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    seen = trace(tree, origins, directions).astype(np.float64)
    places = np.linspace(0.0, 2.0 * size, STEPS)
    samples = origins[:, None] + places[:, None] * directions[:, None]
    inside = tree(samples.reshape(-1, 3)).reshape(RAYS, STEPS) > 0.5 + 1e-4
    first = np.where(inside.any(axis=1), places[inside.argmax(axis=1)], np.inf)
    found: list[str] = []
    missed = int((seen > first + FAR * size + 2.0 * trace_tolerance(tree.support)).sum())
    if missed:
        found.append(f"{missed} missed rays")
    hit = np.isfinite(seen)
    beside = seen[hit, None] + np.linspace(-FAR, FAR, 41) * size
    near = origins[hit, None] + beside[..., None] * directions[hit, None]
    largest = tree(near.reshape(-1, 3)).reshape(-1, 41).max(axis=1, initial=0.0)
    false = int((largest < 0.5 - 1e-4).sum())
    if false:
        found.append(f"{false} hits that are not at the surface")
    return found
