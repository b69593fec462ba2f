"""Warp kernels of one step of a crowd: was the last one good, where to next, who may stand there."""

# mypy: disable-error-code="call-overload"
# (Warp declares no arithmetic of vectors)

import warp as wp

wp.set_module_options({"enable_backward": False})

SHORTER, LONGER = 0.5, 1.25
"""What a particle's share of its move is multiplied by after a step that failed, or did not."""


@wp.kernel
def lift(
    first: wp.int32,
    height: wp.float32,
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    lifted: wp.array(dtype=wp.vec3),
) -> None:
    """Points a little above their surface."""
    i = first + wp.tid()
    lifted[i] = positions[i] + normals[i] * height


@wp.kernel
def judge(
    tried: wp.array(dtype=wp.float64),
    accepted: wp.array(dtype=wp.float64),
    verdict: wp.array(dtype=wp.int32),
) -> None:
    """Compare the energy of what was tried with that of what was accepted: verdict 1 if it rose."""
    if tried[0] > accepted[0]:
        verdict[0] = 1
    else:
        verdict[0] = 0
        accepted[0] = tried[0]


@wp.kernel
def resolve(
    first: wp.int32,
    verdict: wp.array(dtype=wp.int32),
    tried_positions: wp.array(dtype=wp.vec3),
    tried_normals: wp.array(dtype=wp.vec3),
    tried_moves: wp.array(dtype=wp.vec3),
    tried_works: wp.array(dtype=wp.float64),
    tried_energies: wp.array(dtype=wp.float32),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    moves: wp.array(dtype=wp.vec3),
    works: wp.array(dtype=wp.float64),
    energies: wp.array(dtype=wp.float32),
    shares: wp.array(dtype=wp.float32),
) -> None:
    """Take what was tried, or shorten the moves of those to whom it did harm."""
    i = first + wp.tid()
    if verdict[0] == 0:
        positions[i] = tried_positions[i]
        normals[i] = tried_normals[i]
        moves[i] = tried_moves[i]
        works[i] = tried_works[i]
        energies[i] = tried_energies[i]
        shares[i] = wp.min(1.0, LONGER * shares[i])
    elif tried_works[i] > works[i]:
        shares[i] = SHORTER * shares[i]


@wp.kernel
def aim(
    first: wp.int32,
    positions: wp.array(dtype=wp.vec3),
    moves: wp.array(dtype=wp.vec3),
    shares: wp.array(dtype=wp.float32),
    sizes: wp.array(dtype=wp.float32),
    movable: wp.array(dtype=wp.int32),
    targets: wp.array(dtype=wp.vec3),
    lengths: wp.array(dtype=wp.float32),
    reaches: wp.array(dtype=wp.float32),
) -> None:
    """Where each particle wants to be next, how far that is, and within what distance its surface is."""
    i = first + wp.tid()
    move = wp.vec3(0.0, 0.0, 0.0)
    if movable[i] == 1:
        move = moves[i] * shares[i]
    targets[i] = positions[i] + move
    lengths[i] = wp.length(move)
    # a particle on its surface that moves by some length is no farther than that from the surface
    reaches[i] = 1.01 * lengths[i] + 1.0e-4 * sizes[i]


@wp.kernel
def arrive(
    first: wp.int32,
    facing_limit: wp.float32,
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    lengths: wp.array(dtype=wp.float32),
    found: wp.array(dtype=wp.vec3),
    found_normals: wp.array(dtype=wp.vec3),
    forbidden: wp.array(dtype=wp.int32),
    tried_positions: wp.array(dtype=wp.vec3),
    tried_normals: wp.array(dtype=wp.vec3),
) -> None:
    """Go where that is allowed and does not lead to the other side of a wall; else stay."""
    i = first + wp.tid()
    turned = wp.dot(found_normals[i], normals[i]) <= facing_limit
    if lengths[i] == 0.0 or turned or forbidden[i] == 1:
        tried_positions[i] = positions[i]
        tried_normals[i] = normals[i]
    else:
        tried_positions[i] = found[i]
        tried_normals[i] = found_normals[i]


@wp.kernel
def scatter(
    first: wp.int32,
    rows: wp.array(dtype=wp.int32),
    new_positions: wp.array(dtype=wp.vec3),
    new_normals: wp.array(dtype=wp.vec3),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
) -> None:
    """Put some particles elsewhere."""
    k = first + wp.tid()
    positions[rows[k]] = new_positions[k]
    normals[rows[k]] = new_normals[k]
