"""The iso surface of a BlobTree in the memory of a Warp device."""

from typing import Any

import warp as wp

from blobtree import ISO, Node
from blobtree.launch import launch
from decals.surfaces.ground import Scalars, Vectors
from decals.surfaces.mesh_ground import MeshGround
from decals.surfaces.tree_queries import descend, mark_above

ARRIVED = 1e-4
"""Largest field error, in units of the iso value, of a point that has reached the surface."""


class TreeGround:
    """A tape, and the coarse mesh from which lost points start again, on one device."""

    def __init__(self, tree: Node, coarse: MeshGround, longest_step: float) -> None:
        self.device = coarse.device
        self._tape = tree.tape.on(self.device)
        speak = tree.tape.vocabulary.kernel
        self._descend, self._mark_above = speak(descend), speak(mark_above)
        self._coarse, self._longest_step = coarse, longest_step
        low, high = tree.bounds
        self._low, self._high = wp.vec3(*low), wp.vec3(*high)

    def project(self, points: Vectors, reaches: Scalars, positions: Vectors, normals: Vectors) -> None:
        """Write the points that Newton's method leads to, and the normals of the field there."""
        inputs: list[Any] = [self._tape.data, self._tape.span, self._longest_step, ARRIVED * ISO]
        inputs += [*self._coarse.backing, points]
        launch(self._descend, len(points), inputs, [positions, normals], device=self.device)

    def mark_inside(self, points: Vectors, flags: Scalars) -> None:
        """Write 1 where the field is above the iso value."""
        inputs = [self._tape.data, self._tape.span, self._low, self._high, points]
        launch(self._mark_above, len(points), inputs, [flags], device=self.device)
