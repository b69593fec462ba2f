"""Warps: nodes that deform the space of their child. A kind is a class with formulas and claims."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import chain
from typing import Any, ClassVar, dataclass_transform

from blobtree import par
from blobtree.declare.parameters import parameters_of
from blobtree.declare.warp import RESULTS, Claim, SpaceWarp, WarpFormulas
from blobtree.declare.warp_checks import check_warp
from blobtree.lazy import Lazy
from blobtree.nodes.declared import DeclaredNode
from blobtree.nodes.node import Node


@dataclass(frozen=True, eq=False, repr=False)
class Placed(Node):
    """A node with one `child`, which it moves, grows or deforms."""

    child: Node


@dataclass_transform(
    frozen_default=True,
    eq_default=False,
    field_specifiers=(
        field,
        par.factor,
        par.angle,
        par.length,
        par.distance,
        par.point,
        par.direction,
        par.whole,
    ),
)
class Warp(Placed, DeclaredNode):
    """`child` under a map of space: a node whose field at q is that of its child at T(q).

    A kind is a subclass with typed formulas, claims and parameters, which specifiers of `blobtree.par`
    declare. Formulas are static functions after `@formula`. Behind the point q they take the parameters as
    they are declared, or else the numbers that the class method `numbers` returns:

    * ``forward(q)`` returns T(q), for q as wp.vec3: the point of the child's space that the deformation takes
      to q. It must be continuous.
    * ``pullback(q, g)``, optional, returns the transposed Jacobian at q times g, both wp.vec3. By default it
      is derived from `forward`.
    * ``lipschitz()`` or ``lipschitz(q, reach)``, in place of the number `lipschitz`, returns a bound on the
      norm of the Jacobian as wp.float32: everywhere, or in the ball of radius `reach` around q.
    * ``image_box(q, half)``, optional, returns half the size of a box around T(q). That box holds the
      images of all points of the box q ± half. It saves time where `lipschitz` is far above 1 in one
      direction alone.

    Attributes
    ----------
    tag
        Name of the kind in files; by default that of the class, in lower case with underscores.
    lipschitz
        Upper bound of the norm of the Jacobian.
    motion
        Largest distance by which `forward` moves a point. In its place a class may have a class method
        ``outer_box(lower, upper, …) -> (lower, upper)``, which takes the numbers of the formulas by name. It
        returns a box that holds every point which `forward` takes into the box from lower to upper.
    trial_extent
        Half side of the cube around the origin in which samples try the claims.

    Raises
    ------
    InvalidDefinition
        At the definition of a subclass: a formula has no types or no source; or samples contradict a claim,
        or show a singular Jacobian. Nothing has been compiled by then.
    UntranslatableFunction
        A formula leaves the shared subset; the message names file and line.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import Point, Warp, formula, par
    >>> class Lean(Warp):
    ...     lipschitz = 1.11
    ...     motion = 0.2
    ...     height: float = par.distance("height where nothing moves")
    ...     @formula
    ...     def forward(q: wp.vec3, height: wp.float32) -> wp.vec3:
    ...         return wp.vec3(q[0] - 0.2 * wp.sin(q[2] - height), q[1], q[2])
    >>> round(float(Lean(Point((0, 0, 0), radius=1.0), height=0.5)([0, 0, 1])), 3)
    0.496
    """

    sort = "a warp"
    hash_name = "CustomWarp"
    custom_tags = ("custom_warp",)
    row_name = "warp"
    formula_results = RESULTS
    needed = ("forward",)
    methods = ("numbers", "outer_box")
    warp: ClassVar[SpaceWarp]
    lipschitz: ClassVar[float | None] = None
    motion: ClassVar[float | None] = None
    trial_extent: ClassVar[float] = 4.0
    outer_box: ClassVar[Claim | None] = None
    room: ClassVar[Claim | None] = None
    """Return further numbers, those that depend on the inner box outside of which the child is 0."""

    @classmethod
    def _declaration(cls, tag: str) -> WarpFormulas:
        claims = cls.lipschitz, cls.motion, cls.outer_box, cls.room, cls.trial_extent
        return WarpFormulas(tag, cls._formulas, *claims)

    @classmethod
    def _check(cls, declaration: WarpFormulas) -> None:
        check_warp(declaration, cls.parameters, lambda values: tuple(cls.numbers(**values)))

    @Lazy
    def warp_parameters(self) -> tuple[float, ...]:
        """Return the numbers of the formulas, one after the other."""
        return tuple(self.numbers(**{name: getattr(self, name) for name in parameters_of(type(self))}))

    @classmethod
    def numbers(cls, *_: Any, **values: Any) -> Iterable[float]:
        """Return the numbers of the formulas for values of the parameters; by default the parameters."""
        declared = parameters_of(cls)
        return chain.from_iterable(declared[name].components(value) for name, value in values.items())
