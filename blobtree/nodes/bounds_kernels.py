"""Boxes around skeletons of which only the closest point is known.

Seen from q = m + R u, m being a point of the skeleton and R large, the skeleton keeps the distance
d = |q − closest(q)|, so no point p of it lies in that ball: (p − m)·u ≤ (R² − d² + |p − m|²) / 2R. Fourteen
such balls around m leave a small ball and what lies beyond them all; the search starts from a ball
FARTHEST times as large as the parameters and shrinks it. A skeleton that still reaches that far is refused.
"""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.declare.skeleton import FARTHEST, INFLUENCE_SLOT, Skeleton
from blobtree.device import known_device, launch
from blobtree.errors import InvalidNode
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.dispatch import closest, stride
from blobtree.tape.instruction_set import single_skeleton_set
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

LARGEST_REACH = 1e18
"""Beyond it float32 squares overflow."""

DIRECTIONS = 14
NARROWEST = wp.constant(0.8)
"""Cosine of an angle that every direction keeps with one of the fourteen; the worst has 0.807."""

MARGIN = wp.constant(2e-6)
"""What rounding may do to a distance, relative to the numbers in it."""

SHRINKINGS = 8
ASIDE = wp.constant(256.0)
"""From how many radii the box is measured: what is not seen of it is 1/512 of the radius."""

Floats = NDArray[np.float64]


@wp.func
def direction_of(number: wp.int32) -> wp.vec3:
    """Six along the axes, then eight to the corners of a cube."""
    if number < 6:
        axis = wp.vec3(0.0, 0.0, 0.0)
        axis[number // 2] = float(1 - 2 * (number % 2))
        return axis
    corner = number - 6
    x = float(1 - 2 * (corner & 1))
    y = float(1 - (corner & 2))
    z = float(1 - ((corner >> 1) & 2))
    return wp.normalize(wp.vec3(x, y, z))


@wp.kernel
def _measure_boxes(
    first: wp.int32,
    tape: Texels,
    reaches: wp.array(dtype=wp.float32),
    shrinkings: wp.int32,
    directions: wp.int32,
    lower: wp.array(dtype=wp.vec3),
    upper: wp.array(dtype=wp.vec3),
) -> None:
    i = first + wp.tid()
    at = i * stride(0)
    start = closest(0, wp.vec3(0.0, 0.0, 0.0), tape, at)
    middle = wp.vec3(start[0], start[1], start[2])
    radius = reaches[i]
    for step in range(shrinkings):
        away = radius
        if step > 0:
            away = 4.0 * radius
        extent = MARGIN * (away + wp.length(middle))
        farthest = float(0.0)
        for number in range(directions):
            q = middle + direction_of(number) * away
            c = closest(0, q, tape, at)
            farthest = wp.max(farthest, away - wp.length(q - wp.vec3(c[0], c[1], c[2])))
        extent += farthest
        apart = away * NARROWEST
        rest = apart * apart - 2.0 * away * extent + extent * extent
        if rest < 0.0:
            if step == 0:
                radius = wp.inf
        elif apart - wp.sqrt(rest) < radius:
            radius = apart - wp.sqrt(rest)
    low = wp.vec3()
    high = wp.vec3()
    away = radius * ASIDE
    unseen = radius / (2.0 * ASIDE) + MARGIN * (away + wp.length(middle))
    for number in range(directions - 8):
        q = middle + direction_of(number) * away
        c = closest(0, q, tape, at)
        d = wp.length(q - wp.vec3(c[0], c[1], c[2]))
        support = (away - d) * (away + d) / (2.0 * away) + unseen
        if number % 2 == 0:
            high[number // 2] = middle[number // 2] + support
        else:
            low[number // 2] = middle[number // 2] - support
    lower[i] = low
    upper[i] = high


def far_hulls(kind: Any, primitives: Sequence[Any]) -> Floats:
    """Return the corners (n, 8, 3) of boxes that hold the skeletons of primitives of a user's kind."""
    texels = kind.packed(primitives, np.ones_like(kind.radii(primitives)), None)
    numbers = np.delete(texels.reshape(len(texels), -1), INFLUENCE_SLOT, axis=1)
    sizes = np.abs(numbers).max(axis=1, initial=0.0)
    lower, upper = skeleton_boxes(kind.skeleton, texels, sizes)
    unbounded = ~np.isfinite(lower).all(axis=1) | ~np.isfinite(upper).all(axis=1)
    if unbounded.any():
        raise InvalidNode(
            f"{primitives[int(np.argmax(unbounded))]!r}: its skeleton is unbounded or too large for "
            "float32, or a closest point is not finite; a skeleton must be bounded"
        )
    boxes = np.stack([lower, upper])
    corners = [boxes[list(sides), :, range(3)].T for sides in product((0, 1), repeat=3)]
    return np.stack(corners, axis=1)


def skeleton_boxes(skeleton: Skeleton, texels: Floats, sizes: Floats) -> tuple[Floats, Floats]:
    """Corners (n, 3), (n, 3) of boxes that hold skeletons, in their own space; not finite where unbounded.

    Parameters
    ----------
    texels
        Parameters (n, ·, 4) as on the tape, colours left out.
    sizes
        Largest number (n,) among the parameters of each.
    """
    device = known_device()
    count = len(texels)
    tape = np.concatenate([texels, np.zeros((count, 1, 4))], axis=1).reshape(-1, 4)
    reaches = np.clip(FARTHEST * np.maximum(sizes, 1.0), None, LARGEST_REACH)
    corners: list[Any] = [wp.empty(count, dtype=wp.vec3, device=device) for _ in range(2)]
    # Loops of a length known to the compiler would be unrolled, with a copy of the skeleton in every turn.
    inputs: list[Any] = [
        wp.array(tape.astype(np.float32), dtype=wp.vec4, device=device),
        wp.array(reaches.astype(np.float32), dtype=wp.float32, device=device),
        SHRINKINGS,
        DIRECTIONS,
    ]
    launch(single_skeleton_set(skeleton).kernel_for(_measure_boxes), count, inputs, corners, device)
    lower, upper = (corner.numpy().astype(np.float64) for corner in corners)
    return lower, upper
