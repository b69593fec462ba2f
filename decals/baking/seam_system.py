"""Least squares of seams: small changes of levels after which both sides differ little."""

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float64Array, Int32Array, Int64Array
from blobtree.device import array_on, launch
from decals.baking.seam_kernels import SQUARE, find_lowest, solve_parts, square_runs

CPU = "cpu"
"""Device on which seams are settled and layouts are checked; all else is done on the default device."""

FIRST_WEIGHT, MAX_WEIGHT, MAX_GROWTH = 3.0, 300.0, 4.0
"""Weight of a point of a seam beside that of a texel, its limit, and its growth in a step at most."""

BOUND_WEIGHT, BOUND_DECAY = 30.0, 0.5
"""Weight of the bound on a texel that a step would darken below 0 or lighten above 1, and its decay."""

MAX_CHANGE = 0.25
"""Largest change of a texel in a step."""

MAX_WIDTH = 64
"""Mean width of a part's envelope from which on SuperLU solves it, whose factors then hold fewer numbers."""


class SeamSystem:
    """Changes of levels, and weighted differences at rows that mix eight of them.

    Rows of one run mix the same levels. Runs and levels form parts: no run mixes levels of two. The levels
    of a part come in an order in which those of a run are close to each other.

    Parameters
    ----------
    first : float64[n]
        The levels at first.
    columns : int32[s, 8]
        The levels that each run mixes.
    chosen : bool[k]
        True for the rows that take part from the first.
    rows : int64[s + 1]
        The first row of each run, and the end.
    parts, levels : int64[c + 1]
        The first run and the first level of each part, and the ends.
    device : str
        Where the equations are made; a processor solves them, since each step needs the steps before.

    Attributes
    ----------
    slopes : array of float64[k, 8] on the device
        Derivatives of the differences by the levels, which the caller writes before each step.
    """

    def __init__(
        self,
        first: Float64Array,
        columns: Int32Array,
        chosen: BoolArray,
        rows: Int64Array,
        parts: Int64Array,
        levels: Int64Array,
        device: str,
    ) -> None:
        self._first, self._columns, self._chosen = first, columns, chosen
        self._rows, self._parts, self._levels = rows, parts, levels
        self._held, self._aims = np.ones(len(first)), first.copy()
        self._force = np.full(len(chosen), FIRST_WEIGHT)
        self._device = device
        self.slopes: Any = wp.empty((len(chosen), 8), dtype=wp.float64, device=device)
        lowest: Int32Array = np.arange(len(first), dtype=np.int32)
        inputs = [array_on(CPU, of, wp.int32) for of in (parts, columns)]
        launch(find_lowest, len(parts) - 1, inputs, [array_on(CPU, lowest, wp.int32)], CPU)
        widths = np.arange(1, len(first) + 1) - lowest
        sizes = np.diff(levels)
        wide = np.add.reduceat(widths**2.0, levels[:-1]) > MAX_WIDTH**2 * sizes
        self._narrow, self._wide = np.flatnonzero(~wide), np.flatnonzero(wide)
        kept = np.where(np.repeat(wide, sizes), 0, widths)
        self._there = [array_on(device, of, wp.int32) for of in (rows, columns)]
        self._shapes = [array_on(CPU, of, wp.int32) for of in (parts, levels, columns, lowest)]
        self._shapes.append(array_on(CPU, np.cumsum(kept) - 1, wp.int64))
        self._squares: Any = wp.empty((len(columns), SQUARE + 8), dtype=wp.float64, device=device)
        self._factors: Any = wp.empty(int(kept.sum()), dtype=wp.float64, device=CPU)

    def strengthen(self, off: Float64Array) -> None:
        """Give more weight to rows that differ; ``off`` are their differences beside that aimed at."""
        self._chosen |= off > 1.0
        grown = np.minimum(self._force * np.clip(off, 1.0, MAX_GROWTH), MAX_WEIGHT)
        self._force = np.where(off > 1.0, grown, self._force)

    def stepped(self, levels: Float64Array, gaps: Any, tick: Callable[[], None]) -> Float64Array:
        """Return the levels after a step, from the differences at the rows, ``float64[k]`` on the device.

        ``tick`` is called often; an error that it raises ends the work.
        """
        solution = levels.copy()
        self._solve_narrow(levels, gaps, solution)
        self._solve_wide(levels, gaps, solution, tick)
        outside = (solution < 0.0) | (solution > 1.0)
        self._held = held = np.where(outside, BOUND_WEIGHT, 1.0 + (self._held - 1.0) * BOUND_DECAY)
        aims = np.where(held > 1.5, self._aims, self._first)
        self._aims = np.where(outside, np.clip(solution, 0.0, 1.0), aims)
        step = np.clip(solution - levels, -MAX_CHANGE, MAX_CHANGE)
        changed: Float64Array = np.clip(levels + step, 0.0, 1.0)
        return changed

    def _solve_narrow(self, levels: Float64Array, gaps: Any, solution: Float64Array) -> None:
        """Write the solutions of narrow parts, each by Cholesky's method within its envelope."""
        if not len(self._narrow):
            return
        chosen = array_on(self._device, self._chosen, wp.uint8)
        force, given = (array_on(self._device, of, wp.float64) for of in (self._force, levels))
        inputs = [*self._there, chosen, force, gaps, self.slopes, given]
        launch(square_runs, len(self._columns), inputs, [self._squares], self._device)
        listed = array_on(CPU, self._narrow, wp.int32)
        numbers = [array_on(CPU, of, wp.float64) for of in (self._squares.numpy(), self._held, self._aims)]
        outputs = [self._factors, array_on(CPU, solution, wp.float64)]
        launch(solve_parts, len(self._narrow), [listed, *self._shapes, *numbers], outputs, CPU)

    def _solve_wide(
        self, levels: Float64Array, gaps: Any, solution: Float64Array, tick: Callable[[], None]
    ) -> None:
        """Write the solutions of wide parts, each by SuperLU."""
        if not len(self._wide):
            return
        from scipy.sparse import csc_array, csr_array, diags_array  # most parts are narrow

        all_slopes, all_gaps = self.slopes.numpy(), gaps.numpy()
        for part in self._wide.tolist():
            tick()
            own = slice(*self._levels[part : part + 2])
            begin, end = self._rows[self._parts[part : part + 2]]
            of = np.flatnonzero(self._chosen[begin:end]) + begin
            runs = np.searchsorted(self._rows, of, side="right") - 1
            ends, columns = np.arange(0, 8 * len(of) + 1, 8), (self._columns[runs] - own.start).reshape(-1)
            slopes, held = all_slopes[of], self._held[own]
            weights = slopes * self._force[of, None] ** 2
            change = csr_array((slopes.reshape(-1), columns, ends), (len(of), len(held)))
            weighted = csc_array((weights.reshape(-1), columns, ends), (len(held), len(of))).tocsr()
            matrix = (weighted @ change + diags_array(held)).tocsc()
            right = held * self._aims[own] + weighted @ (change @ levels[own] - all_gaps[of])
            solution[own] = _solved(matrix, right)


def _solved(matrix: Any, right: Float64Array) -> Float64Array:
    """Return the solution of a symmetric sparse system; its unknowns lie along lines: few others fill in."""
    from scipy.sparse.linalg import splu

    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    solution: Float64Array = factors.solve(right)
    return solution
