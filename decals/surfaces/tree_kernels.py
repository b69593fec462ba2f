"""Warp kernels of queries of a BlobTree: projection onto its surface, containment."""

# mypy: disable-error-code="attr-defined"
# (Warp does not declare the fields of its query results)

import warp as wp

from blobtree.cells.refine_kernels import SURELY_INSIDE
from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.evaluate_kernels import ARRIVED, NEWTON_STEPS, WORSE, newton_step, project_to_surface
from blobtree.tape.interpreter import field_gradient, field_value
from blobtree.tracing.ray_kernels import RayCells, block_at, tape_at, tape_of_block

wp.set_module_options(KERNEL_OPTIONS)


OFFSETS = wp.constant(6)
"""Distances from the mesh from which points look for a part that the mesh misses by its thickness."""


@wp.func
def has_converged(f: wp.vec4, tolerance: wp.float32) -> wp.bool:
    """Return True if a point with this field and gradient lies on the surface and has a normal."""
    return wp.abs(f[0] - ISO) <= tolerance and wp.length_sq(wp.vec3(f[1], f[2], f[3])) > 0.0


@wp.func
def project_in_cells(p: wp.vec3, longest_step: wp.float32, cells: RayCells) -> tuple[wp.vec3, wp.vec4]:
    """Return what `project_to_surface` returns; each step reads the tape of its cell."""
    best = p
    f_best = wp.vec4()
    gap = float(0.0)
    q = p
    for step in range(NEWTON_STEPS + 1):
        f = field_gradient(q, cells.tape, tape_at(q, cells))
        way, state = newton_step(f, gap, step, longest_step)
        if state == WORSE:
            break
        gap = ISO - f[0]
        best = q
        f_best = f
        if state == ARRIVED:
            break
        q += way
    return best, f_best


@wp.kernel
def project(
    first: wp.int32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
    max_step: wp.float32,
    tolerance: wp.float32,
    points: wp.array(dtype=wp.vec3),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    converged: wp.array(dtype=wp.int32),
) -> None:
    """Project points by Newton's method: write positions, normals, and 1 where it converges."""
    i = first + wp.tid()
    p, f = project_to_surface(points[i], max_step, tape, span)
    positions[i] = p
    normals[i] = -wp.normalize(wp.vec3(f[1], f[2], f[3]))
    if has_converged(f, tolerance):
        converged[i] = 1


@wp.kernel
def project_with_mesh(
    first: wp.int32,
    cells: RayCells,
    max_step: wp.float32,
    tolerance: wp.float32,
    mesh: wp.uint64,
    face_normals: wp.array(dtype=wp.vec3),
    center: wp.vec3,
    radius: wp.float32,
    least_way: wp.float32,
    points: wp.array(dtype=wp.vec3),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
) -> None:
    """Project points by Newton's method: write positions and normals.

    A point without convergence starts again at the closest point of the coarse mesh. So does a point that
    went farther than `least_way` although the mesh is less than half as far: beside a thin part, the field is
    that of a larger one. Where the way from the mesh is longer too, the point also starts above and below the
    mesh, which may miss a thin part by more than its thickness, at distances that double. The shortest way
    counts, up to `max_step`. If all fails, the point takes the closest point of the mesh, and the normal of
    its face.
    """
    i = first + wp.tid()
    start = points[i]
    p = start
    normal = wp.vec3()
    closest = start
    mesh_normal = wp.vec3()
    nearest = wp.where(least_way == wp.inf, least_way, max_step)
    for turn in range(2 + 2 * OFFSETS):  # one call for all starts: a copy of it compiles as long again
        q, f = project_in_cells(start, max_step, cells)
        found = has_converged(f, tolerance)
        if turn == 0:
            p = q
            normal = -wp.normalize(wp.vec3(f[1], f[2], f[3]))
            way = wp.length(q - start)
            if found and way > least_way:
                nearer = wp.mesh_query_point_no_sign(mesh, start, 0.5 * way)
                found = not nearer.result
            if found:
                break
            far = 1.01 * (wp.length(start - center) + radius)
            query = wp.mesh_query_point_no_sign(mesh, start, far)
            if not query.result:
                break
            closest = wp.mesh_eval_position(mesh, query.face, query.u, query.v)
            p = closest
            normal = face_normals[query.face]
            start = closest
            mesh_normal = normal
        else:
            distance = wp.length(q - closest)
            if found and distance <= nearest:
                p = q
                normal = -wp.normalize(wp.vec3(f[1], f[2], f[3]))
                nearest = distance
            if least_way == wp.inf or nearest <= least_way:
                break
            side = float(1 - 2 * (turn & 1))
            start = closest + mesh_normal * (side * least_way * wp.pow(2.0, float(turn // 2 - OFFSETS)))
    positions[i] = p
    normals[i] = normal


@wp.kernel
def mark_above(
    first: wp.int32,
    cells: RayCells,
    least: wp.float32,
    points: wp.array(dtype=wp.vec3),
    flags: wp.array(dtype=wp.int32),
) -> None:
    """Write 1 where the field is at least `least`, the iso value or the next number."""
    i = first + wp.tid()
    block = block_at((points[i] - cells.lower) / cells.block_size, cells)
    if block == SURELY_INSIDE:
        flags[i] = 1
    elif block >= 0:
        f = field_value(
            points[i], cells.tape, tape_of_block(block, cells)
        )  # Warp works out both sides of `and`
        if f >= least:
            flags[i] = 1
