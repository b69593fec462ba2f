"""Unions of filled shapes in a plane that cross, overlap or touch, by winding numbers.

Curves become chords on a grid of whole numbers, so that all decisions are exact. Chords are split where they
meet, until none meet but at their ends (snap rounding, Hobby 1999). Those with the filled area on one side
alone are its border. Parts of curves between splits are curves again.
"""

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from blobtree._typing import Float64Array, IndexArray
from blobtree.errors import InvalidNode
from blobtree.nodes.crossings import area_of, cross_products

GRID = 1 << 24
"""Steps of the grid along the larger side of the shapes' box."""

MOST_ROUNDS = 20
"""Most rounds of splits."""

NEAR = 0.75
"""Distance in steps of the grid up to which an end of a chord lies on another one."""

THINNEST = 8.0
"""Area of a loop over its length, in steps, up to which it is left out."""

RETREAT = 16.0
"""Steps by which corners that touch move apart, at most."""

CHUNK = 256
"""Chords that are tried against all others at a time, so that memory suffices."""

Curve = Float64Array


class Chords(NamedTuple):
    """Chords of curves on the grid, from `start` to `end`."""

    start: IndexArray
    end: IndexArray
    curve: IndexArray
    """Numbers of their curves."""
    first: Float64Array
    last: Float64Array
    """Parameters of the curves at both ends."""

    def chosen(self, which: Any) -> "Chords":
        """Return some of the chords."""
        start, end, curve, first, last = (column[which] for column in self)
        return Chords(start, end, curve, first, last)


def united(
    curves: Sequence[Curve], points: Sequence[Float64Array], shapes: Sequence[int], rules: Sequence[str]
) -> tuple[list[list[Curve]], list[list[Curve]]]:
    """Return loops around the area that shapes fill: of curves, and of the lines that stand for them.

    `points` are those of the chords of each curve without its end, at even parameters. `shapes` are the
    numbers of the shape to which each curve belongs, and `rules` the fill rules of the shapes.
    """
    counts = np.array([len(chords) for chords in points])
    starts = np.concatenate(points)
    ends = np.concatenate([[*chords[1:], curve[-1]] for chords, curve in zip(points, curves, strict=True)])
    number = np.repeat(np.arange(len(curves)), counts)
    steps = np.arange(len(starts)) - np.repeat(np.cumsum(counts) - counts, counts)
    unit = 2.0 ** math.ceil(math.log2(float(np.ptp(starts, axis=0).max()) / GRID))  # font units stay exact
    low = np.floor(starts.min(axis=0) / unit) * unit
    on_grid = [np.rint((places - low) / unit).astype(np.int64) for places in (starts, ends)]
    shares = counts[number]
    chords = Chords(on_grid[0], on_grid[1], number, steps / shares, (steps + 1) / shares)
    border = _border(_split(chords), np.array(shapes), np.array([rule == "evenodd" for rule in rules]))
    loops = [loop for loop in _loops(border) if _is_thick(border.start[loop])]
    corners = _apart([border.start[loop] for loop in loops])
    placed = [low + unit * loop for loop in corners]
    parts = [_parts(curves, border.chosen(loop), there) for loop, there in zip(loops, placed, strict=True)]
    lines = [[*np.stack([there, np.roll(there, -1, axis=0)], axis=1)] for there in placed]
    return parts, lines


def _split(chords: Chords) -> Chords:
    """Return the chords, split until they meet at their ends alone."""
    for _ in range(MOST_ROUNDS):
        chords = chords.chosen((chords.start != chords.end).any(axis=1))
        owners, places = _meetings(chords)
        if not len(owners):
            return chords
        way = (chords.end - chords.start)[owners].astype(np.float64)
        share = ((places - chords.start[owners]) * way).sum(axis=1) / (way**2).sum(axis=1)
        order = np.lexsort((share, owners))
        owners, places, share = owners[order], places[order], share[order]
        t = chords.first[owners] + share * (chords.last - chords.first)[owners]
        at = np.searchsorted(owners, np.arange(len(chords.curve)), side="right")
        before = np.searchsorted(owners, np.arange(len(chords.curve)))
        chords = Chords(
            np.insert(places, before, chords.start, axis=0),
            np.insert(places, at, chords.end, axis=0),
            np.insert(chords.curve[owners], before, chords.curve),
            np.insert(t, before, chords.first),
            np.insert(t, at, chords.last),
        )
    raise InvalidNode("outline: expected shapes that can be united, got edges too close together")


def _meetings(chords: Chords) -> tuple[IndexArray, IndexArray]:
    """Return chords (k,) and places (k, 2) strictly inside them where others meet them, without doubles."""
    lower, upper = np.minimum(chords.start, chords.end), np.maximum(chords.start, chords.end)
    order = np.argsort(lower[:, 0], kind="stable")
    found: list[tuple[IndexArray, IndexArray]] = []
    for begin in range(0, len(order), CHUNK):
        these = order[begin : begin + CHUNK]
        others = order[: np.searchsorted(lower[order, 0], upper[these, 0].max() + 1, side="right")]
        others = others[upper[others, 0] >= lower[these, 0].min() - 1]
        near = np.ones((len(these), len(others)), bool)
        for axis in range(2):
            near &= lower[these, None, axis] <= upper[None, others, axis] + 1
            near &= lower[None, others, axis] <= upper[these, None, axis] + 1
        one, other = np.nonzero(near)
        one, other = these[one], others[other]
        pairs = one != other
        found += _crossings(chords, one[pairs], other[pairs])
    owners, places = (np.concatenate(column) for column in zip(*found, strict=True))
    rows = np.unique(np.column_stack([owners, places]), axis=0)
    return rows[:, 0], rows[:, 1:]


def _crossings(chords: Chords, one: IndexArray, other: IndexArray) -> list[tuple[IndexArray, IndexArray]]:
    """Return where pairs of chords cross, and where ends of the others lie on the first ones."""
    a, b = chords.start[one], chords.end[one]
    c, d = chords.start[other], chords.end[other]
    of_c, of_d = cross_products(b - a, c - a), cross_products(b - a, d - a)
    of_a, of_b = cross_products(d - c, a - c), cross_products(d - c, b - c)
    crosses = (np.sign(of_c) * np.sign(of_d) < 0) & (np.sign(of_a) * np.sign(of_b) < 0)
    share = of_a[crosses] / (of_a - of_b)[crosses]
    places = np.rint(a[crosses] + share[:, None] * (b - a)[crosses]).astype(np.int64)
    found = [(one[crosses], places)]
    length = np.linalg.norm(b - a, axis=1)
    for end, side in ((c, of_c), (d, of_d)):
        along = ((end - a) * (b - a)).sum(axis=1)
        on = (np.abs(side) <= NEAR * length) & (along > 0) & (along < length**2)
        found.append((one[on], end[on]))
    return [
        (owners[inner], places[inner])
        for owners, places in found
        for inner in [
            ((places != chords.start[owners]).any(axis=1)) & (places != chords.end[owners]).any(axis=1)
        ]
    ]


def _border(chords: Chords, shapes: IndexArray, even_odd: IndexArray) -> Chords:
    """Return the chords between the filled area, on their left, and the rest."""
    upward = np.where(
        chords.start[:, 1] == chords.end[:, 1],
        chords.start[:, 0] < chords.end[:, 0],
        chords.start[:, 1] < chords.end[:, 1],
    )
    low, high = (np.where(upward[:, None], *ends) for ends in ((chords.start, chords.end),
                                                              (chords.end, chords.start)))  # fmt: skip
    _, first, same = np.unique(np.column_stack([low, high]), axis=0, return_index=True, return_inverse=True)
    sign, owner = np.where(upward, 1, -1), shapes[chords.curve]
    by_shape = np.argsort(owner, kind="stable")
    own = np.zeros((len(first), len(even_odd)), np.int64)
    np.add.at(own, (same.ravel(), owner), sign)
    kept, turned = list[IndexArray](), list[IndexArray]()
    level = low[first, 1] == high[first, 1]
    for flat in (False, True):
        edges = np.flatnonzero(level == flat)
        axes = [1, 0] if flat else [0, 1]
        bottom, top = (2 * ends[by_shape][:, axes] for ends in (low, high))
        flips = bottom[:, 1] > top[:, 1]
        bottom[flips], top[flips] = top[flips], bottom[flips]
        signs = np.where(flips, -1, 1) * sign[by_shape]
        middle = (low[first[edges]] + high[first[edges]])[:, axes]
        order = np.argsort(middle[:, 1], kind="stable")
        for begin in range(0, len(order), CHUNK):
            these = order[begin : begin + CHUNK]
            p = middle[these]
            near = np.flatnonzero((bottom[:, 1] <= p[:, 1].max()) & (top[:, 1] > p[:, 1].min()))
            beyond = _windings(p, bottom[near], top[near], signs[near], owner[by_shape][near], len(even_odd))
            before = beyond + own[edges[these]]
            here, there = _fills(before, even_odd), _fills(beyond, even_odd)
            kept.append(edges[these][here != there])
            turned.append((there if flat else here)[here != there])
    which, forward = np.concatenate(kept), np.concatenate(turned)
    border = chords.chosen(first[which])
    back = forward != upward[first[which]]
    return Chords(
        np.where(back[:, None], border.end, border.start),
        np.where(back[:, None], border.start, border.end),
        border.curve,
        np.where(back, border.last, border.first),
        np.where(back, border.first, border.last),
    )


def _windings(
    p: IndexArray, bottom: IndexArray, top: IndexArray, signs: IndexArray, owner: IndexArray, count: int
) -> IndexArray:
    """Return the winding numbers (n, shapes) just beyond points on chords, by chords ordered by shape."""
    numbers = np.zeros((len(p), count), np.int64)
    if not len(bottom):
        return numbers
    level = (bottom[None, :, 1] <= p[:, None, 1]) & (top[None, :, 1] > p[:, None, 1])
    (x, y), (u, v) = (top - bottom).T, np.moveaxis(p[:, None] - bottom, 2, 0)
    crossed = (level & (x * v - y * u > 0)) * signs
    starts = np.flatnonzero(np.diff(owner, prepend=-1))
    numbers[:, owner[starts]] = np.add.reduceat(crossed, starts, axis=1)
    return numbers


def _fills(windings: IndexArray, even_odd: IndexArray) -> IndexArray:
    """Return True where a shape has an odd winding number, or one that is not 0, as its rule says."""
    return np.asarray(np.where(even_odd, windings % 2, windings).any(axis=1))


def _loops(border: Chords) -> list[IndexArray]:
    """Return the numbers of the chords of each loop; areas that touch in a point have loops of their own."""
    leaving: dict[tuple[int, int], list[int]] = defaultdict(list)
    for number, place in enumerate(map(tuple, border.start.tolist())):
        leaving[place].append(number)
    way = (border.end - border.start).astype(np.float64)
    angle = np.arctan2(way[:, 1], way[:, 0])
    loops, left = list[IndexArray](), set(range(len(border.curve)))
    while left:
        at = start = min(left)
        loop = list[int]()
        while at != start or not loop:
            loop.append(at)
            back = angle[at] + np.pi
            ahead = [number for number in leaving[tuple(border.end[at].tolist())] if number in left]
            at = max(ahead, key=lambda number: (angle[number] - back) % (2.0 * np.pi))
            left.remove(at)
        loops.append(np.array(loop))
    return loops


def _is_thick(corners: IndexArray) -> bool:
    """Return True for a loop that encloses more than rounding errors."""
    length = float(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1).sum())
    return abs(area_of(corners)) > THINNEST * length


def _apart(loops: Sequence[IndexArray]) -> list[Float64Array]:
    """Return the corners of loops, those at which several meet moved into the filled area."""
    if not loops:
        return []
    _, same, counts = np.unique(np.concatenate(loops), axis=0, return_inverse=True, return_counts=True)
    touching = np.split(counts[same.ravel()] > 1, np.cumsum([len(loop) for loop in loops])[:-1])
    moved = []
    for loop, touches in zip(loops, touching, strict=True):
        corners = loop.astype(np.float64)
        ways = np.roll(corners, -1, axis=0) - corners
        lengths = np.linalg.norm(ways, axis=1)
        ways /= lengths[:, None]
        inward = np.stack([-ways[:, 1], ways[:, 0]], axis=1)
        inward = inward + np.roll(inward, 1, axis=0)
        norms = np.linalg.norm(inward, axis=1, keepdims=True)
        inward = np.where(norms > 1e-6, inward / np.maximum(norms, 1e-6), -ways)
        retreat = touches * np.minimum(RETREAT, 0.2 * np.minimum(lengths, np.roll(lengths, 1)))
        moved.append(corners + retreat[:, None] * inward)
    return moved


def _parts(curves: Sequence[Curve], chords: Chords, corners: Float64Array) -> list[Curve]:
    """Return a loop of chords as parts of their curves, which begin and end at the given corners."""
    goes_on = (chords.curve == np.roll(chords.curve, 1)) & (chords.first == np.roll(chords.last, 1))
    begins = np.flatnonzero(~goes_on) if not goes_on.all() else np.array([0])
    loop = []
    for begin, after in zip(begins, [*begins[1:], begins[0] + len(corners)], strict=True):
        last = (after - 1) % len(corners)
        part = _part(curves[chords.curve[begin]], float(chords.first[begin]), float(chords.last[last]))
        part[0], part[-1] = corners[begin], corners[after % len(corners)]
        loop.append(part)
    return loop


def _part(curve: Curve, first: float, last: float) -> Curve:
    """Return the control points of a part of a curve, by its polar form."""
    degree = len(curve) - 1

    def polar(arguments: Sequence[float]) -> Float64Array:
        points = curve
        for t in arguments:
            points = points[:-1] + t * np.diff(points, axis=0)
        place: Float64Array = points[0]
        return place

    return np.array([polar([first] * (degree - k) + [last] * k) for k in range(degree + 1)])
