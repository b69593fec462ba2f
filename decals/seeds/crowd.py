"""Particles in the memory of one Warp device, moved, compared and moved elsewhere without leaving it."""

from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.launch import launch
from decals.model import FACING_LIMIT
from decals.seeds.crowd_kernels import aim, arrive, judge, resolve, scatter
from decals.seeds.population import Sites, World
from decals.seeds.repulsion import CUTOFF, SKIN, Law, Repulsion
from decals.seeds.rims import Walls
from decals.seeds.settling import spans_of
from decals.surfaces.ground import Scalars, Vectors, vectors
from decals.surfaces.surface import Flags, Floats

OLDEST = 12
"""Steps after which neighbours are listed anew in any case."""

DRIFTERS = 0.02
"""Part of the particles, the fastest, for whose sake alone no new list is made."""

LASTING = 4
"""Steps that lists last on a graphics card, once particles are calm: there it costs less to list neighbours
than to ask who drifted how far."""

CALM = 40
"""Steps after which they are."""


class _State(NamedTuple):
    """Where particles are, where they want to go, and what that place costs them."""

    positions: Vectors
    normals: Vectors
    moves: Vectors
    works: Scalars
    energies: Scalars


class Crowd:
    """Particles that repel each other, step by step, on one device.

    An epoch lasts as long as the lists of neighbours, the spacings and the law of repulsion stay the same.
    Within it the total energy never rises: a step that would raise it is taken back, and those particles to
    whom it did harm go half as far next time (backtracking, particle by particle).

    Parameters
    ----------
    world
        The surfaces.
    sites
        The particles, sorted by surface.
    movable
        Which of them may move.
    sizes
        The spacing wished for around each, ``float32[n]``.
    """

    def __init__(self, world: World, sites: Sites, movable: Flags, sizes: Floats) -> None:
        self.world, self.device = world, world.device
        self.count = len(sites)
        self.surface_ids = sites.surface_ids
        self.movable = movable
        self.spans = spans_of(sites.surface_ids)
        self.epoch = 0
        self._here, self._tried = self._state(sites), self._state(sites)
        self.may_move: Any = wp.array(movable.astype(np.int32), dtype=wp.int32, device=self.device)
        self.owners: Any = wp.array(sites.surface_ids, dtype=wp.int32, device=self.device)
        self._found, self._found_normals, self._targets = (self._empty(wp.vec3) for _ in range(3))
        self._lengths, self._reaches = self._empty(wp.float32), self._empty(wp.float32)
        self._forbidden = self._empty(wp.int32)
        self._shares: Any = wp.full(self.count, 1.0, dtype=wp.float32, device=self.device)
        self._totals: tuple[Any, Any] = (self._one(wp.float64), self._one(wp.float64))
        self._verdict = self._one(wp.int32)
        self._repulsion = Repulsion(self.count, device=self.device)
        self._law = Law(0.0, 0.0)
        self._steps = self._age = 0
        self._drift = 0.0
        self._judged, self._listed = True, False
        self.resize(sizes)

    @property
    def positions(self) -> Vectors:
        """Where the particles are, on the device."""
        self.settle()
        return self._here.positions

    @property
    def normals(self) -> Vectors:
        """Normals of the surfaces there, on the device."""
        self.settle()
        return self._here.normals

    @property
    def energies(self) -> Floats:
        """How crowded each particle is, ``float32[n]``."""
        self.settle()
        energies: Floats = self._here.energies.numpy().copy()
        return energies

    @property
    def energy(self) -> float:
        """Energy of all pairs together, by the law and the lists of this epoch."""
        self.settle()
        return float(self._totals[1].numpy()[0])

    @property
    def lists(self) -> tuple[Any, ...]:
        """Number of neighbours of each particle, who they are, and what they count."""
        return self._repulsion.lists

    def sites(self) -> Sites:
        """Where the particles are, on the host."""
        return Sites(self.positions.numpy().copy(), self.normals.numpy().copy(), self.surface_ids)

    def resize(self, sizes: Floats) -> None:
        """Take other spacings; a new epoch begins."""
        self.settle()
        self.sizes: Any = wp.array(sizes, dtype=wp.float32, device=self.device)
        self.host_sizes = sizes
        self.spacing = float(np.median(sizes)) if len(sizes) else 1.0
        self.varied = bool(len(sizes) and sizes.min() != sizes.max())
        self._listed = False

    def forget(self) -> None:
        """Particles have been put elsewhere: a new epoch begins."""
        self._listed = False

    def place(self, rows: NDArray[np.int64], positions: Floats, normals: Floats) -> None:
        """Put some particles elsewhere on their surfaces."""
        self.settle()
        if len(rows) == 0:
            return
        numbers: Any = wp.array(rows.astype(np.int32), dtype=wp.int32, device=self.device)
        inputs = [numbers, vectors(positions, self.device), vectors(normals, self.device)]
        launch(scatter, len(rows), inputs, [self._here.positions, self._here.normals], device=self.device)
        self.forget()

    def walls(
        self, places: Vectors, normals: Vectors, sizes: Scalars, owners: Scalars, wanted: Scalars
    ) -> Walls:
        """Open rims near places on the surfaces `owners`, where they are wanted (1).

        Particles that may not move want none: they may lie on the very rim.
        """
        rims = self.world.rims(self.spacing)
        return rims.walls(places, normals, sizes, owners, wanted, reach=CUTOFF)

    @property
    def stale(self) -> bool:
        """Whether a new epoch must begin before the next step."""
        if not self._listed:
            return True
        if not wp.get_device(self.device).is_cpu:
            return self._age >= min(LASTING, 1 + self._steps * LASTING // CALM)
        return self._age >= OLDEST or self._drift >= 0.5 * SKIN

    def begin(self, law: Law) -> None:
        """Begin an epoch: list neighbours, and take another law."""
        self.settle()
        self._law, self._listed = law, True
        self._age, self._drift = 0, 0.0
        self.epoch += 1
        here = self._here
        self._repulsion.relist(
            here.positions,
            here.normals,
            self.sizes,
            spacing=self.spacing,
            varied=self.varied,
            walls=self.walls(here.positions, here.normals, self.sizes, self.owners, self.may_move),
        )
        if law.evening:
            self._repulsion.level(here.positions)
        self._evaluate(here, self._totals[1])

    def step(self) -> None:
        """Move everybody who wants to and may."""
        self.settle()
        here, tried = self._here, self._tried
        inputs = [here.positions, here.moves, self._shares, self.sizes, self.may_move]
        launch(aim, self.count, inputs, [self._targets, self._lengths, self._reaches], device=self.device)
        self.world.settling.settle(
            self._targets, self._reaches, self.spans, self._found, self._found_normals, self._forbidden
        )
        inputs = [FACING_LIMIT, here.positions, here.normals, self._lengths]
        inputs += [self._found, self._found_normals, self._forbidden]
        launch(arrive, self.count, inputs, [tried.positions, tried.normals], device=self.device)
        self._judged = False
        self._steps += 1
        self._age += 1
        if wp.get_device(self.device).is_cpu:
            self._drift += _speed(self._lengths.numpy() / self.host_sizes)

    def settle(self) -> None:
        """Decide whether the last step is taken."""
        if self._judged:
            return
        self._judged = True
        here, tried = self._here, self._tried
        self._evaluate(tried, self._totals[0])
        wp.launch(judge, dim=1, inputs=[*self._totals, self._verdict], device=self.device)
        launch(resolve, self.count, [self._verdict, *tried], [*here, self._shares], device=self.device)

    def _evaluate(self, state: _State, total: Any) -> None:
        self._repulsion.evaluate(
            state.positions,
            state.normals,
            self._law,
            moves=state.moves,
            energies=state.energies,
            works=state.works,
        )
        wp.utils.array_sum(state.works, out=total)

    def _state(self, sites: Sites) -> _State:
        return _State(
            wp.array(sites.positions, dtype=wp.vec3, device=self.device),
            wp.array(sites.normals, dtype=wp.vec3, device=self.device),
            self._empty(wp.vec3),
            self._empty(wp.float64),
            self._empty(wp.float32),
        )

    def _empty(self, dtype: Any) -> Any:
        return wp.zeros(self.count, dtype=dtype, device=self.device)

    def _one(self, dtype: Any) -> Any:
        return wp.zeros(1, dtype=dtype, device=self.device)


def _speed(lengths: Floats) -> float:
    """Length of the longest move but for the few fastest."""
    rank = int((1.0 - DRIFTERS) * (len(lengths) - 1))
    return float(np.partition(lengths, rank)[rank])
