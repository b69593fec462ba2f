"""Warp kernels of one step: energy test, proposal, projection."""

# mypy: disable-error-code="call-overload"
# (Warp declares no arithmetic of vectors)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.scattering.repulsion_kernels import StepTerms
from decals.scattering.search_kernels import Particles

wp.set_module_options(KERNEL_OPTIONS)

BACKTRACKING_FACTOR, RECOVERY_FACTOR = 0.5, 1.25
"""Factors of a particle's step scale after a step that raised its energy, and after an accepted step."""


@wp.kernel
def offset_points(
    first: wp.int32,
    height: wp.float32,
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    points: wp.array(dtype=wp.vec3),
) -> None:
    """Offset positions along their normals by a height."""
    i = first + wp.tid()
    points[i] = positions[i] + normals[i] * height


@wp.kernel
def propose_moves(
    first: wp.int32,
    particles: Particles,
    moves: wp.array(dtype=wp.vec3),
    step_scales: wp.array(dtype=wp.float32),
    movable: wp.array(dtype=wp.int32),
    targets: wp.array(dtype=wp.vec3),
    lengths: wp.array(dtype=wp.float32),
    reaches: wp.array(dtype=wp.float32),
) -> None:
    """Write each particle's next position before projection, its distance, and a bound for the projection."""
    i = first + wp.tid()
    move = wp.vec3(0.0, 0.0, 0.0)
    if movable[i] == 1:
        move = moves[i] * step_scales[i]
    targets[i] = particles.positions[i] + move
    lengths[i] = wp.length(move)
    # a particle on its surface that moves by some length is no farther than that from the surface
    reaches[i] = 1.01 * lengths[i] + 1.0e-4 * particles.sizes[i]


@wp.kernel
def project_or_reject(
    first: wp.int32,
    facing_limit: wp.float32,
    current: Particles,
    lengths: wp.array(dtype=wp.float32),
    projected: Particles,
    forbidden: wp.array(dtype=wp.int32),
    proposed: Particles,
) -> None:
    """Propose the projected position, or the current one if that is forbidden or faces another way."""
    i = first + wp.tid()
    turned = wp.dot(projected.normals[i], current.normals[i]) <= facing_limit
    if lengths[i] == 0.0 or turned or forbidden[i] == 1:
        proposed.positions[i] = current.positions[i]
        proposed.normals[i] = current.normals[i]
    else:
        proposed.positions[i] = projected.positions[i]
        proposed.normals[i] = projected.normals[i]


@wp.kernel
def compare_energy(
    proposed: wp.array(dtype=wp.float64),
    accepted: wp.array(dtype=wp.float64),
    rejected: wp.array(dtype=wp.int32),
) -> None:
    """Reject a step (1) if the proposed energy is above the accepted one; else accept its energy (0)."""
    if proposed[0] > accepted[0]:
        rejected[0] = 1
    else:
        rejected[0] = 0
        accepted[0] = proposed[0]


@wp.kernel
def accept_or_backtrack(
    first: wp.int32,
    rejected: wp.array(dtype=wp.int32),
    proposed: Particles,
    proposed_terms: StepTerms,
    current: Particles,
    current_terms: StepTerms,
    step_scales: wp.array(dtype=wp.float32),
) -> None:
    """Accept the proposed state, or shorten the steps of the particles whose energy rose."""
    i = first + wp.tid()
    if rejected[0] == 0:
        current.positions[i] = proposed.positions[i]
        current.normals[i] = proposed.normals[i]
        current_terms.moves[i] = proposed_terms.moves[i]
        current_terms.pair_energies[i] = proposed_terms.pair_energies[i]
        current_terms.energies[i] = proposed_terms.energies[i]
        step_scales[i] = wp.min(1.0, RECOVERY_FACTOR * step_scales[i])
    elif proposed_terms.pair_energies[i] > current_terms.pair_energies[i]:
        step_scales[i] = BACKTRACKING_FACTOR * step_scales[i]


@wp.kernel
def scatter_rows(
    first: wp.int32,
    rows: wp.array(dtype=wp.int32),
    new_positions: wp.array(dtype=wp.vec3),
    new_normals: wp.array(dtype=wp.vec3),
    particles: Particles,
) -> None:
    """Write positions and normals to the rows of some particles."""
    k = first + wp.tid()
    particles.positions[rows[k]] = new_positions[k]
    particles.normals[rows[k]] = new_normals[k]
