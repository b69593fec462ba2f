"""Part the last few pairs that repulsion leaves too close, at sharp tips above all."""

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.launch import launch
from decals.seeds.crowd import Crowd
from decals.seeds.looking import Lookout, outstanding, whole_numbers
from decals.seeds.population import crosses_edge
from decals.seeds.search_kernels import choose_best, places_around
from decals.seeds.settling import spans_of
from decals.surfaces.surface import Flags, Floats

CLOSE = 0.89
"""A particle is too close to its neighbour below this many spacings."""

TRIALS, BUDGET = 60, 1000
"""Places tried in each round: for each particle at least so many, and for all together."""

REACH = (0.03, 0.9)
"""Shortest and longest way to a trial, in spacings."""

ALONE = 2.5
"""Least distance between particles that move in the same round, in spacings, so that they do not meet."""

LOTS = 0.05
"""Chance in who moves among the close ones, in spacings: the closest may have nowhere to go."""

SIGHT = 2.0
"""Trials farther than this many spacings from all particles are equally lonely."""

RING = 1.0
"""Mean distance to six neighbours in a perfect tiling, in spacings."""

GAIN = 1.001
"""A move must multiply the distance to the nearest neighbour by this."""

LOOK_ROUND = 5
"""Rounds after which all particles are looked at, and not those alone that were close before."""

GIVE_UP = 30
"""Rounds without any move after which the search ends."""


def polish(
    crowd: Crowd, *, rounds: int, seed: int, sizes_at: Callable[[Floats], Floats], close: float = CLOSE
) -> None:
    """Move particles that are too close to a neighbour to better ones of some places around them.

    After farthest-point optimisation (Schlömer, Heck and Deussen 2011), by trial because normals, and with
    them who is whose neighbour, jump at sharp edges. The least distance, in spacings, never falls. Nobody
    crosses an edge of the density; `sizes_at` are the spacings wished for at other places.
    """
    rng = np.random.default_rng(seed)
    lookout = Lookout(crowd, SIGHT)
    everybody = np.arange(crowd.count)
    watched, idle = everybody, 0
    for turn in range(rounds):
        if turn % LOOK_ROUND == 0:  # who got close to somebody on the move may have to move instead
            watched = everybody
        nearest = lookout.nearness_of(watched)
        watched, nearest = watched[nearest < close], nearest[nearest < close]
        movers, nearest = _movers(crowd, watched, nearest, rng)
        if len(movers) == 0 or idle == GIVE_UP:
            break
        lot = int(rng.integers(2**31))
        went = _try_places(crowd, lookout, movers, nearest, seed=lot, close=close, sizes_at=sizes_at)
        idle = 0 if went.any() else idle + 1
        if went.any():
            lookout.refresh()
    crowd.forget()


def _movers(
    crowd: Crowd, close: NDArray[np.int64], nearest: Floats, rng: np.random.Generator
) -> tuple[NDArray[np.int64], Floats]:
    """Choose among the close ones the closest around, sorted by number; their nearness comes along."""
    nearest, close = nearest[crowd.movable[close]], close[crowd.movable[close]]
    lots = (LOTS * rng.random(len(close))).astype(np.float32)
    points = crowd.positions.numpy()[close]
    alone = outstanding(points, -nearest - lots, ALONE * crowd.host_sizes[close], device=crowd.device)
    return close[alone], nearest[alone]


def _try_places(
    crowd: Crowd,
    lookout: Lookout,
    movers: NDArray[np.int64],
    nearest: Floats,
    *,
    seed: int,
    close: float,
    sizes_at: Callable[[Floats], Floats],
) -> Flags:
    """Move each mover to the best of some random places around it; who went."""
    device, count = crowd.device, len(movers)
    tries = max(TRIALS, BUDGET // count)
    rows, own = whole_numbers(movers, device), whole_numbers(np.repeat(movers, tries), device)
    centers, center_sizes = crowd.positions[rows].contiguous(), crowd.sizes[rows].contiguous()
    targets, places, normals = (_new(wp.vec3, count * tries, device) for _ in range(3))
    reaches, forbidden = _new(wp.float32, count * tries, device), _new(wp.int32, count * tries, device)
    shortest, longest = np.log(REACH)
    inputs = [seed, tries, float(shortest), float(longest), centers, center_sizes]
    launch(places_around, count * tries, inputs, [targets, reaches], device=device)
    spans = [
        (surface, tries * first, tries * last) for surface, first, last in spans_of(crowd.surface_ids[movers])
    ]
    crowd.world.settling.settle(targets, reaches, spans, places, normals, forbidden)
    sizes = crowd.sizes[own].contiguous()
    if crowd.varied:
        there = sizes_at(places.numpy())
        barred = crosses_edge(sizes.numpy(), there) | (forbidden.numpy() == 1)
        forbidden.assign(barred.astype(np.int32))
        sizes.assign(there)
    walls = crowd.walls(
        places, normals, sizes, crowd.owners[own].contiguous(), crowd.may_move[own].contiguous()
    )
    nearness, rings = lookout.rings(places, normals, sizes, own, walls)
    present: Any = wp.array(nearest, dtype=wp.float32, device=device)
    went = _new(wp.int32, count, device)
    inputs = [tries, GAIN, close, RING, rows, present, places, normals, forbidden, nearness, rings]
    launch(choose_best, count, inputs, [crowd.positions, crowd.normals, went], device=device)
    gone: Flags = went.numpy() == 1
    return gone


def _new(dtype: Any, count: int, device: str) -> Any:
    return wp.zeros(count, dtype=dtype, device=device)
