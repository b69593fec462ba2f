"""Warp kernels of seams: how far both sides differ, what lies around, and changes point by point."""

# ruff: noqa: SIM102  (Warp evaluates both sides of `and`)
# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

from typing import Any

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.baking.srgb import decoded, decoded64, decoded_slope, decoded_slope64, encoded, encoded64

wp.set_module_options(KERNEL_OPTIONS)

FINENESS = 1024.0
"""Steps into which the square of a texel's width is divided."""

MAX_SQUARE = 4095
"""Most such steps between a point and the middle of a texel; those of the four around it lie within half."""

POINT_BITS = 40
"""Bits of a number in which the number of a point lies."""

SQUARE = 36
"""Numbers in the lower triangle of a symmetric matrix of eight rows."""

MIN_POWER = 1.0e-6
"""Sum of squared slopes of a point from which on its texels can move it."""


@wp.func
def light_of(level: wp.float32, srgb: wp.bool) -> wp.float32:
    """Return the linear light of a level from 0 to 1."""
    if srgb:
        return decoded(level)
    return level


@wp.func
def level_of(light: wp.float32, srgb: wp.bool) -> wp.float32:
    """Return the level of linear light."""
    if srgb:
        return encoded(light)
    return light


@wp.func
def slope(level: wp.float32, light: wp.float32, srgb: wp.bool) -> wp.float32:
    """Return the derivative of light by the level."""
    if srgb:
        return decoded_slope(level, light)
    return wp.float32(1.0)


@wp.kernel
def change_levels(
    first: wp.int32,
    numbers: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.float64),
    srgb: wp.bool,
    levels: wp.array(dtype=wp.float64),
    light: wp.array(dtype=wp.float64),
):
    """Write the levels of some texels, and their linear light."""
    i = first + wp.tid()
    at = numbers[i]
    levels[at] = values[i]
    light[at] = values[i]
    if srgb:
        light[at] = decoded64(values[i])


@wp.func
def mixed_weights(places: wp.array(dtype=wp.vec2d)):
    """Return the weights of the four texels that are mixed on each side of a point."""
    weights = wp.vector(length=8, dtype=wp.float64)
    half = wp.float64(0.5)
    one = wp.float64(1.0)
    for side in range(2):
        x = places[side][0] - half - wp.floor(places[side][0] - half)
        y = places[side][1] - half - wp.floor(places[side][1] - half)
        weights[4 * side] = (one - x) * (one - y)
        weights[4 * side + 1] = x * (one - y)
        weights[4 * side + 2] = (one - x) * y
        weights[4 * side + 3] = x * y
    return weights


@wp.func
def merged(slopes: Any, texels: wp.array(dtype=wp.int32)):
    """Return derivatives by eight texels, where those of a texel that comes twice lie at its first place."""
    sums = slopes
    for k in range(1, 8):
        at = wp.int32(k)
        for before in range(k):
            if at == k and texels[before] == texels[k]:
                at = before
        if at != k:
            sums[at] = sums[at] + sums[k]
            sums[k] = sums[k] - sums[k]
    return sums


@wp.kernel
def find_closest(
    first: wp.int32,
    starts: wp.array(dtype=wp.int32),
    index: wp.array2d(dtype=wp.int32),
    texels: wp.array(dtype=wp.int64),
    places: wp.array2d(dtype=wp.vec2d),
    size: wp.int64,
    keys: wp.array2d(dtype=wp.int64),
):
    """Write for each texel of a run the closest point, as a number that has its distance and side first."""
    run = first + wp.tid()
    for k in range(8):
        texel = texels[index[run, k]]
        column = wp.float64(texel % size) + wp.float64(0.5)
        row = wp.float64(texel / size % size) + wp.float64(0.5)
        best = wp.int64(-1)
        for point in range(starts[run], starts[run + 1]):
            at = places[point, k / 4]
            x = column - at[0]
            y = row - at[1]
            away = wp.min(int((x * x + y * y) * wp.float64(FINENESS)), MAX_SQUARE)
            key = (wp.int64(2 * away + k / 4) << wp.int64(POINT_BITS)) + wp.int64(point)
            if best < wp.int64(0) or key < best:
                best = key
        keys[run, k] = best


@wp.kernel
def linearize(
    first: wp.int32,
    runs: wp.array(dtype=wp.int32),
    rows: wp.array(dtype=wp.int32),
    index: wp.array2d(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    places: wp.array2d(dtype=wp.vec2d),
    smooth: wp.array(dtype=wp.uint8),
    srgb: wp.bool,
    levels: wp.array(dtype=wp.float64),
    light: wp.array(dtype=wp.float64),
    gaps: wp.array(dtype=wp.float64),
    slopes: wp.array2d(dtype=wp.float64),
):
    """Write how far both sides differ at the points of runs, from a row on, and 0 where they may.

    The derivatives by the eight levels are written too if there is room.
    """
    i = first + wp.tid()
    run = runs[i]
    for row in range(rows[i], rows[i + 1]):
        point = starts[run] + row - rows[i]
        gaps[row] = wp.float64(0.0)
        if smooth[point] != wp.uint8(0):
            weights = mixed_weights(places[point])
            mixed = wp.vec2d()
            for k in range(8):
                mixed[k / 4] += weights[k] * light[index[run, k]]
            seen = mixed
            if srgb:
                for side in range(2):
                    mixed[side] = wp.clamp(mixed[side], wp.float64(0.0), wp.float64(1.0))
                    seen[side] = encoded64(mixed[side])
            gaps[row] = seen[0] - seen[1]
            if slopes.shape[0] > 0:
                for k in range(8):
                    if srgb:
                        at = index[run, k]
                        weights[k] = weights[k] * decoded_slope64(levels[at], light[at])
                        weights[k] = weights[k] / decoded_slope64(seen[k / 4], mixed[k / 4])
                    if k >= 4:
                        weights[k] = -weights[k]
                weights = merged(weights, index[run])
                for k in range(8):
                    slopes[row, k] = weights[k]


@wp.func
def root_of(level: wp.int32, parents: wp.array(dtype=wp.int32)) -> wp.int32:
    """Return the first level of a component, and shorten the way to it."""
    at = level
    while parents[at] != at:
        parents[at] = parents[parents[at]]
        at = parents[at]
    return at


@wp.kernel
def join_levels(first: wp.int32, columns: wp.array2d(dtype=wp.int32), parents: wp.array(dtype=wp.int32)):
    """Write the first level of the component of each level; the levels of one run are in one component."""
    for run in range(columns.shape[0]):
        for k in range(1, 8):
            one = root_of(columns[run, 0], parents)
            other = root_of(columns[run, k], parents)
            parents[wp.max(one, other)] = wp.min(one, other)
    for level in range(parents.shape[0]):
        parents[level] = parents[parents[level]]


@wp.kernel
def find_lowest(
    first: wp.int32,
    runs: wp.array(dtype=wp.int32),
    columns: wp.array2d(dtype=wp.int32),
    lowest: wp.array(dtype=wp.int32),
):
    """Lower ``lowest`` of each level to the lowest one that is mixed with it, for parts of runs."""
    part = first + wp.tid()
    for run in range(runs[part], runs[part + 1]):
        least = columns[run, 0]
        for k in range(8):
            least = wp.min(least, columns[run, k])
        for k in range(8):
            lowest[columns[run, k]] = wp.min(lowest[columns[run, k]], least)


@wp.kernel
def square_runs(
    first: wp.int32,
    rows: wp.array(dtype=wp.int32),
    columns: wp.array2d(dtype=wp.int32),
    chosen: wp.array(dtype=wp.uint8),
    force: wp.array(dtype=wp.float64),
    gaps: wp.array(dtype=wp.float64),
    slopes: wp.array2d(dtype=wp.float64),
    levels: wp.array(dtype=wp.float64),
    squares: wp.array2d(dtype=wp.float64),
):
    """Write the normal equations of the chosen rows of runs: the lower triangle, then the right side."""
    run = first + wp.tid()
    for k in range(SQUARE + 8):
        squares[run, k] = wp.float64(0.0)
    for row in range(rows[run], rows[run + 1]):
        if chosen[row] != wp.uint8(0):
            target = -gaps[row]
            for k in range(8):
                target += slopes[row, k] * levels[columns[run, k]]
            at = wp.int32(0)
            for a in range(8):
                weighted = force[row] * force[row] * slopes[row, a]
                squares[run, SQUARE + a] += weighted * target
                for b in range(a + 1):
                    squares[run, at] += weighted * slopes[row, b]
                    at += 1


@wp.kernel
def solve_parts(
    first: wp.int32,
    parts: wp.array(dtype=wp.int32),
    runs: wp.array(dtype=wp.int32),
    bounds: wp.array(dtype=wp.int32),
    columns: wp.array2d(dtype=wp.int32),
    lowest: wp.array(dtype=wp.int32),
    diagonal: wp.array(dtype=wp.int64),
    squares: wp.array2d(dtype=wp.float64),
    held: wp.array(dtype=wp.float64),
    aims: wp.array(dtype=wp.float64),
    factors: wp.array(dtype=wp.float64),
    solution: wp.array(dtype=wp.float64),
):
    """Solve the normal equations of some parts by Cholesky's method, from those of their runs.

    Row i of the factor has the columns from ``lowest[i]`` to i, the last of them at ``diagonal[i]``.
    """
    part = parts[first + wp.tid()]
    begin = bounds[part]
    end = bounds[part + 1]
    for i in range(begin, end):
        base = diagonal[i] - wp.int64(i)
        for j in range(lowest[i], i):
            factors[base + wp.int64(j)] = wp.float64(0.0)
        factors[diagonal[i]] = held[i]
        solution[i] = held[i] * aims[i]
    for run in range(runs[part], runs[part + 1]):
        at = wp.int32(0)
        for a in range(8):
            i = columns[run, a]
            solution[i] += squares[run, SQUARE + a]
            for b in range(a + 1):
                j = columns[run, b]
                row = wp.max(i, j)
                factors[diagonal[row] - wp.int64(row - wp.min(i, j))] += squares[run, at]
                at += 1
    for i in range(begin, end):
        base = diagonal[i] - wp.int64(i)
        low = lowest[i]
        rest = solution[i]
        power = factors[diagonal[i]]
        for j in range(low, i):
            other = diagonal[j] - wp.int64(j)
            total = factors[base + wp.int64(j)]
            for k in range(wp.max(low, lowest[j]), j):
                total -= factors[base + wp.int64(k)] * factors[other + wp.int64(k)]
            total = total / factors[diagonal[j]]
            factors[base + wp.int64(j)] = total
            rest -= total * solution[j]
            power -= total * total
        factors[diagonal[i]] = wp.sqrt(power)
        solution[i] = rest / wp.sqrt(power)
    for back in range(end - begin):
        i = end - 1 - back
        base = diagonal[i] - wp.int64(i)
        value = solution[i] / factors[diagonal[i]]
        solution[i] = value
        for j in range(lowest[i], i):
            solution[j] -= factors[base + wp.int64(j)] * value


@wp.func
def settle_point(
    places: wp.array(dtype=wp.vec2d),
    columns: wp.array(dtype=wp.int32),
    srgb: wp.bool,
    aim: wp.float32,
    limit: wp.float32,
    sweep: wp.int32,
    levels: wp.array(dtype=wp.float32),
    light: wp.array(dtype=wp.float32),
    changed: wp.array(dtype=wp.int32),
) -> wp.bool:
    """Change the eight levels at a point, see `settle`; return False if nothing can or need change."""
    weights = mixed_weights(places)
    lights = wp.vec2(0.0, 0.0)
    for k in range(8):
        lights[k / 4] += float(weights[k]) * light[columns[k]]
    sides = wp.vec2(level_of(lights[0], srgb), level_of(lights[1], srgb))
    gap = sides[0] - sides[1]
    if wp.abs(gap) <= limit:
        return False
    slopes = wp.vector(length=8, dtype=wp.float32)
    power = wp.float32(0.0)
    for k in range(8):
        level = levels[columns[k]]
        side = k / 4
        slopes[k] = float(weights[k]) * slope(level, light[columns[k]], srgb)
        slopes[k] = slopes[k] / slope(sides[side], lights[side], srgb)
        if side == 1:
            slopes[k] = -slopes[k]
    slopes = merged(slopes, columns)
    for k in range(8):
        level = levels[columns[k]]
        down = slopes[k] * gap > 0.0
        if (down and level > 0.0) or (not down and level < 1.0):
            power += slopes[k] * slopes[k]
    if power <= MIN_POWER:
        return False
    step = (gap - wp.clamp(gap, -aim, aim)) / power
    for k in range(8):
        texel = columns[k]
        level = wp.clamp(levels[texel] - step * slopes[k], 0.0, 1.0)
        if level != levels[texel]:
            levels[texel] = level
            light[texel] = light_of(level, srgb)
            changed[texel] = sweep
    return True


@wp.kernel
def settle(
    first: wp.int32,
    bounds: wp.array(dtype=wp.int32),
    runs: wp.array(dtype=wp.int32),
    columns: wp.array2d(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    places: wp.array2d(dtype=wp.vec2d),
    smooth: wp.array(dtype=wp.uint8),
    srgb: wp.bool,
    sweeps: wp.int32,
    aim: wp.float32,
    limit: wp.float32,
    levels: wp.array(dtype=wp.float32),
    light: wp.array(dtype=wp.float32),
    changed: wp.array(dtype=wp.int32),
    seen: wp.array(dtype=wp.int32),
):
    """Change levels at each point of runs, forth and back, where both sides differ by more than ``limit``.

    The change is about the smallest after which both sides differ by ``aim`` (the method of Kaczmarz). Runs
    whose levels have not changed since the sweep ``seen`` are left out; ``changed`` has the sweep of each
    level, and ``light`` its linear light. One thread has the runs from one of ``bounds`` to the next, since
    each step needs the steps before; runs of different threads have no level in common.
    """
    part = first + wp.tid()
    begin = bounds[part]
    count = bounds[part + 1] - begin
    for i in range(begin, begin + count):
        for k in range(8):
            light[columns[i, k]] = light_of(levels[columns[i, k]], srgb)
    for sweep in range(sweeps):
        updates = wp.int32(0)
        for at in range(count):
            i = begin + at
            if sweep % 2 == 1:
                i = begin + count - 1 - at
            newest = wp.int32(-1)
            for k in range(8):
                newest = wp.max(newest, changed[columns[i, k]])
            if newest >= seen[i]:
                seen[i] = sweep
                run = runs[i]
                for number in range(starts[run + 1] - starts[run]):
                    point = starts[run] + number
                    if sweep % 2 == 1:
                        point = starts[run + 1] - 1 - number
                    if smooth[point] != wp.uint8(0):
                        if settle_point(
                            places[point], columns[i], srgb, aim, limit, sweep, levels, light, changed
                        ):
                            updates += 1
        if updates == 0:
            break
