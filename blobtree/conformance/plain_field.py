"""The evaluators of a tape in plain Python: slow, but in double precision and without a compiler."""

from collections.abc import Callable
from functools import lru_cache
from types import FunctionType
from typing import Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from blobtree.cells.prune_kernels import prune
from blobtree.tape.instruction_set import InstructionSet
from blobtree.tape.interpreter import field_bound, field_gradient, field_value
from blobtree.tape.tape import Tape
from blobtree.transpile.python import Precision, PythonTranslation, Vector, vector


@lru_cache(maxsize=8)
def _translation(_instruction_set: InstructionSet, precision: Precision) -> PythonTranslation:
    return PythonTranslation(precision)


class PlainField:
    """The field of a tape, computed as kernels do it, in double or in single precision."""

    def __init__(self, tape: Tape, precision: Precision = np.float64) -> None:
        self._instruction_set, self._precision = tape.instruction_set, precision
        self._texels = tape.data.astype(precision).view(Vector)
        self._span = (tape.start, len(tape.data))

    def values(self, points: ArrayLike) -> Float64Array:
        """Return the field (n,) at points (n, 3)."""
        return self._rows(field_value, [(q,) for q in self._vectors(points)])

    def gradients(self, points: ArrayLike) -> Float64Array:
        """Return the gradients (n, 3) at points (n, 3)."""
        return self._rows(field_gradient, [(q,) for q in self._vectors(points)])[:, 1:]

    def bounds(self, points: ArrayLike, directions: ArrayLike, reach: ArrayLike) -> Float64Array:
        """Return (value, bound on the rise, bound on the fall) along rays, as `interpreter.field_bound`."""
        lengths = [self._precision(length) for length in np.ravel(np.asarray(reach))]
        rays = zip(self._vectors(points), self._vectors(directions), lengths, strict=True)
        return self._rows(field_bound, rays)

    def pruned(self, center: ArrayLike, half: float) -> tuple[tuple[float, float], Self]:
        """Return the range of the field over the cube center ± half, and the field of its pruned tape."""
        (middle,), texels, size = self._vectors([center]), self._texels, self._precision(half)
        run = self._python(prune)
        peak = int(run(middle, size, texels, self._span, texels, 0, False)[2])
        room = np.zeros((peak, 4), self._precision)
        pruned = object.__new__(type(self))
        pruned._instruction_set, pruned._precision = self._instruction_set, self._precision
        pruned._texels = np.concatenate([texels, room]).view(Vector)
        smallest, largest, _, count = run(
            middle, size, pruned._texels, self._span, pruned._texels, len(texels), True
        )
        pruned._span = (len(texels), len(texels) + int(count))
        return (float(smallest), float(largest)), pruned

    def _vectors(self, rows: Any) -> list[Vector]:
        return [vector(*row, precision=self._precision) for row in np.asarray(rows)]

    def _python(self, function: Any) -> Callable[..., Any]:
        instance = self._instruction_set.function_for(function).func
        assert isinstance(instance, FunctionType)
        translation: PythonTranslation = _translation(self._instruction_set, cast(Any, self._precision))
        return translation.function(instance)

    def _rows(self, function: Any, arguments: Any) -> Float64Array:
        plain = self._python(function)
        with np.errstate(all="ignore"):
            rows = [plain(*given, self._texels, self._span) for given in arguments]
        return np.array(rows, np.float64)
