"""Hessians of fields, and curvatures of their level sets."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from blobtree._typing import Float32Array, Float64Array
from blobtree.kernels import loaded
from blobtree.progress import reporting
from blobtree.tape.tape import Tape


@dataclass(frozen=True, eq=False)
class Curvatures:
    """Curvatures of the level sets of a field through n points.

    The normal points out of the model, against the gradient. A curvature is positive where the surface bends
    away from its normal: a ball of radius r has the principal curvatures 1 / r, a saddle one of each sign, a
    hollow two negative ones. The unit is one per model unit. Where the gradient is 0 there is no level set
    with a normal, and everything is NaN.

    Attributes
    ----------
    mean, gauss
        float64[n]: (k₁ + k₂) / 2 and k₁ k₂.
    principal
        float64[n, 2]: k₁ ≥ k₂.
    directions
        float64[n, 2, 3]: unit tangents along which the curvature is k₁ and k₂. Where both are equal they are
        any two perpendicular tangents.

    Examples
    --------
    >>> import numpy as np
    >>> from blobtree import Curvatures, Segment
    >>> limb = Segment((0, 0, -2), (0, 0, 2), radius=0.5)
    >>> curvatures = limb.curvatures([[0.5, 0, 0]])
    >>> isinstance(curvatures, Curvatures), curvatures.mean.round(3).tolist()
    (True, [1.0])
    >>> np.allclose(curvatures.principal, [[2.0, 0.0]], atol=1e-3)
    True
    """

    mean: Float64Array
    gauss: Float64Array
    principal: Float64Array
    directions: Float64Array


def hessians_at(tape: Tape, points: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Return values and gradients (n, 4), and symmetric Hessians (n, 3, 3), at points float32[n, 3]."""
    with reporting() as report:
        report("deriving the formulas", 0.0)
        from blobtree.derivatives.hessian_kernels import evaluate_hessians  # made at the first use

        kernel = loaded(tape.instruction_set.kernel_for(evaluate_hessians))
    uploaded = tape.on()
    gradients: wp.array[wp.vec4] = wp.empty(len(points), dtype=wp.vec4)
    hessians: wp.array[wp.vec4] = wp.empty((len(points), 3), dtype=wp.vec4)
    wp.launch(
        kernel,
        dim=(len(points), 3),
        inputs=[wp.array(points, dtype=wp.vec3), uploaded.data, uploaded.span],
        outputs=[gradients, hessians],
    )
    rows = hessians.numpy()[:, :, 1:]
    return gradients.numpy(), 0.5 * (rows + rows.transpose(0, 2, 1))


def curvatures_of(gradients: Float64Array, hessians: Float64Array) -> Curvatures:
    """Return the curvatures of level sets with these gradients (n, 3) and Hessians (n, 3, 3).

    With the unit normal n = −∇f / |∇f|, the shape operator dn is −H / |∇f| on the tangent plane (Goldman
    2005, Curvature formulas for implicit curves and surfaces).
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        slopes = np.linalg.norm(gradients, axis=1)
        normals = -gradients / slopes[:, None]
        tangents = _tangents(normals)
        shapes = -np.einsum("nai,nij,nbj->nab", tangents, hessians, tangents) / slopes[:, None, None]
    flat = ~np.isfinite(shapes).all(axis=(1, 2))
    shapes[flat] = 0.0
    principal, vectors = np.linalg.eigh(shapes)  # in rising order
    principal, vectors = principal[:, ::-1].copy(), vectors[:, :, ::-1]
    principal[flat] = np.nan
    directions = np.einsum("nak,nai->nki", vectors, tangents)
    return Curvatures(principal.mean(axis=1), principal.prod(axis=1), principal, directions)


def _tangents(normals: Float64Array) -> Float64Array:
    """Return two perpendicular unit tangents (n, 2, 3) for each of n unit normals."""
    axes = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, axes)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normals, first)], axis=1)
