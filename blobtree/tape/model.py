"""A tree as a field: its program, its tape, and the values, gradients and colours that follow from them."""

import reprlib

from numpy.typing import ArrayLike

from blobtree._typing import Float32Array
from blobtree.errors import InvalidNode
from blobtree.lazy import Lazy
from blobtree.tape.bounds import influence_bounds
from blobtree.tape.evaluate import colors_at, gradients_at, values_at
from blobtree.tape.program import Instruction, ProgramNode, compile_program
from blobtree.tape.tape import Tape, compile_tape


class ImplicitModel(ProgramNode):
    """A field that is 0 far away and larger than ISO inside; `blobtree.Node` is the class to use.

    Sparse cells, meshing, tracing and views take any such model, so they need no class of nodes.
    """

    @Lazy
    def _program(self) -> list[Instruction]:
        return compile_program(self)

    @Lazy
    def tape(self) -> Tape:
        """Return the flat form of this tree that every evaluator reads."""
        return compile_tape(self._program)

    @Lazy
    def bounds(self) -> tuple[Float32Array, Float32Array]:
        """Lower and upper corner, float32[3] each, of a box outside which the field is exactly 0."""
        return influence_bounds(self._program)

    def __call__(self, points: ArrayLike) -> Float32Array:
        """Return the field values (n,) at `points` (n, 3)."""
        return values_at(self.tape, points)

    def gradient(self, points: ArrayLike) -> Float32Array:
        """Return the exact field gradients (n, 3) at `points` (n, 3)."""
        return gradients_at(self.tape, points)[:, 1:]

    def colors(self, points: ArrayLike) -> Float32Array:
        """Return the blended colours (n, 3) at `points` (n, 3), black outside every primitive's influence."""
        return colors_at(self.tape, points)


def checked_tree(tree: object) -> ImplicitModel:
    """Return `tree` if it is a model; raise `InvalidNode` otherwise."""
    if not isinstance(tree, ImplicitModel):
        raise InvalidNode(f"tree: expected a BlobTree node such as Point(...), got {reprlib.repr(tree)}")
    return tree
