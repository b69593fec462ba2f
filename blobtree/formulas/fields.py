"""Direct fields: leaves whose field is a function of position itself, not a falloff of a distance.

A kind is two typed functions, which read their parameters from `tape[at:]`:

* `value_gradient(q, tape, at) -> vec4(f, ∇f)`;
* `bounds(center, radius, tape, at) -> vec3(smallest f, largest f, largest |∇f|)` over a ball, or wider ones.
  Cells are pruned by the range, and rays take steps by the slope.

f is 0 far away, ½ on the surface and larger inside. It is exactly 0 outside a bounded box, which the node
class states, and there its bounds are 0 too as soon as the ball does not reach the box.

A kind with `distance` returns a distance u in place of f, which is RIM on the surface and 1 where the field
ends by default. The field is a falloff of u, which the leaf chooses. The field of a kind with `windowed` has
no end of its own: it is multiplied by the window of a box (`formulas.windows`). Both are done around these
functions, and so is the factor `weight` (`tape.evaluators.direct_value_gradient`).
"""

from dataclasses import dataclass

import warp as wp

wp.set_module_options({"enable_backward": False})


@dataclass(frozen=True, eq=False)
class FieldKind:
    """One row of the table: the name, functions and size on the tape of a direct field."""

    name: str
    value_gradient: wp.Function
    bounds: wp.Function
    parameters: int
    """Number of texels (vec4) of its parameters on the tape."""
    distance: bool = False
    """The functions return a distance, of which the field is a falloff."""
    windowed: bool = False
    """The field ends at a box with tape[at] = (middle, fade) and tape[at + 1] = (half lengths, ·)."""
    digest: str = ""
    """Digest of the sources of a custom kind."""

    @property
    def stride(self) -> int:
        """Number of texels on the tape behind the map: the parameters and the colour."""
        return self.parameters + 1


FIELDS: tuple[FieldKind, ...] = ()
"""Every kind of the core, none; further kinds are those of the library and of users."""
