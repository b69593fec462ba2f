"""Particles of a test on a device, and one evaluation of their repulsion."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Float64Array
from decals.scattering.repulsion import Law, Repulsion, particle_struct
from decals.scattering.repulsion_kernels import StepTerms


def device_particles(positions: ArrayLike, normals: ArrayLike, sizes: ArrayLike, device: str) -> Any:
    """A `Particles` struct of arrays of the host."""
    vectors: list[Any] = [
        wp.array(np.asarray(rows, np.float32), dtype=wp.vec3, device=device) for rows in (positions, normals)
    ]
    spacings: Any = wp.array(np.asarray(sizes, np.float32), dtype=wp.float32, device=device)
    return particle_struct(vectors[0], vectors[1], spacings)


def evaluate(
    particles: Any, law: Law, mirrors: Any = None, *, varied: bool, device: str
) -> tuple[Float32Array, Float32Array, Float64Array]:
    """Moves, energies and pair energies of particles by a law, their mean ring taken from themselves."""
    count = len(particles.sizes)
    out: Any = StepTerms()
    out.moves = wp.zeros(count, dtype=wp.vec3, device=device)
    out.energies = wp.zeros(count, dtype=wp.float32, device=device)
    out.pair_energies = wp.zeros(count, dtype=wp.float64, device=device)
    repulsion = Repulsion(count, device=device)
    spacing = float(np.median(particles.sizes.numpy()))
    if mirrors is not None:
        repulsion.mirrors = mirrors
    repulsion.list_neighbors(particles, spacing=spacing, varied=varied)
    repulsion.set_mean_ring(particles)
    repulsion.evaluate(particles, law, out)
    return out.moves.numpy(), out.energies.numpy(), out.pair_energies.numpy()
