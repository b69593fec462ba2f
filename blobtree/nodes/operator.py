"""Operators: combinations of the fields of operands. A kind is a class with formulas and claims."""

from collections.abc import Iterable
from dataclasses import MISSING, dataclass
from typing import Any, ClassVar, dataclass_transform

from blobtree import par
from blobtree.declare.claims import Like, OperatorRow
from blobtree.declare.operator import RESULTS, Claims, OperatorFormulas
from blobtree.declare.operator_checks import check_operator
from blobtree.declare.parameters import fields_of, parameters_of
from blobtree.errors import InvalidNode
from blobtree.nodes.declared import DeclaredNode
from blobtree.nodes.node import Node


class Combination(DeclaredNode):
    """An operator folded over its operands from left to right, see `Operator`.

    The operator takes the parameters that the class declares, in their order.
    """

    combines = True
    sort = "an operator"
    hash_name = "CustomCombination"
    row_name = "operator"
    formula_results = RESULTS
    needed = ("value", "partials")
    operator: ClassVar[OperatorRow]
    like: ClassVar[Like | None] = None
    monotone: ClassVar[bool] = False
    associative: ClassVar[bool] = False
    lipschitz: ClassVar[float | None] = None
    paints: ClassVar[bool] = True
    _signed: ClassVar[bool] = False
    """Operands below 0, of primitives with a negative weight, act as they are."""

    @classmethod
    def _declaration(cls, tag: str) -> OperatorFormulas:
        claims = Claims(cls.like, cls.monotone, cls.associative, cls.lipschitz, cls.paints, cls._signed)
        return OperatorFormulas(tag, cls._formulas, claims)

    @classmethod
    def _check(cls, declaration: OperatorFormulas) -> None:
        check_operator(declaration, cls.parameters)

    @property
    def operator_parameters(self) -> tuple[float, ...]:
        """The numbers that the operator takes besides its operands."""
        values = ((p, getattr(self, name)) for name, p in parameters_of(type(self)).items())
        return tuple(number for p, value in values for number in p.components(value))


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(par.factor,))
class Pair(Combination):
    """A combination of two operands, which have names."""


@dataclass(frozen=True, eq=False, repr=False, init=False)
class ManyOperands(Node):
    """A node with any number of `operands`, which come one by one or as one iterable.

    Its parameters follow them, best by name.
    """

    has_init: ClassVar[bool] = True
    operands: tuple[Node, ...]

    def __init__(self, *arguments: "Node | Iterable[Node] | float", **named: Any) -> None:
        for name, value in _bound(type(self), arguments, named).items():
            object.__setattr__(self, name, value)
        self.__post_init__()


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Operator(ManyOperands, Combination):
    """A combination of `operands`: any number of them, or two if their order matters to the operator.

    A kind of operator is a subclass with typed formulas, claims and parameters. Fields that a specifier of
    `blobtree.par` fills, such as ``width: float = par.factor("…", low=0.0)``, are its parameters. In formulas
    they follow the operands as wp.float32, in the same order. Operands are field values from 0: ½ on a
    surface, larger inside. The formulas are static functions after `@formula`:

    * ``value(a, b)`` returns F as wp.float32, for a and b as wp.float32. F is continuous, nowhere negative,
      and 0 where both operands are. Its derivatives are derived.
    * ``partials(a, b)``, in place of it, returns ``wp.vec3(F, ∂F/∂a, ∂F/∂b)``.
    * ``lipschitz(max_a, max_b)``, in place of the number `lipschitz`, returns bounds of ``abs(∂F/∂a)`` and
      ``abs(∂F/∂b)`` as wp.vec2, for operands up to these values.
    * ``slope(rise, most)``, in place of that, returns a bound on the slope of F as wp.float32, where the
      operands have slopes up to those in `rise`, and values up to those in `most`, both wp.vec2.
    * ``interval(a, b)``, optional, returns bounds of F as wp.vec2, for operands within two ranges as wp.vec2.
    * ``keeps(a, b)``, optional, returns for such ranges the operands on which F depends, as wp.int32: 0 for
      both, 1 if F is the first operand, 2 if F is the second, 3 if F is 0.

    An operator that reads gradients takes ``gradient_a`` and ``gradient_b`` as wp.vec3 behind its operands.
    ∂F/∂a and ∂F/∂b are then those for fixed gradients. In place of bounds it has ``envelope(a, b)``: the
    smallest and the largest F for any gradients, as wp.vec2. Neither falls as an operand grows; with
    ``like = "difference"`` neither falls with a nor rises with b.

    Attributes
    ----------
    tag
        Name of the kind in files; by default that of the class, in lower case with underscores.
    like
        What F is where an operand is absent (0): with "blend" it is the other operand, with "intersection" 0,
        with "difference" a where b is absent and 0 where a is. Cells and boxes are pruned by it.
    monotone
        F never falls as an operand grows; with ``like = "difference"``, never falls with a nor rises with b.
    associative
        F(a, b) = F(b, a) and F(F(a, b), c) = F(a, F(b, c)): it takes any number of operands.
    lipschitz
        Upper bound of ``abs(∂F/∂a)`` and ``abs(∂F/∂b)`` for all operands.
    paints
        False if F has the colour of its first operand alone.

    Raises
    ------
    InvalidDefinition
        At the definition of a subclass: a formula has no types or no source, or sampled operands contradict a
        claim. Nothing has been compiled by then.
    UntranslatableFunction
        A formula leaves the shared subset; the message names file and line.
    InvalidNode
        For a node: two operands are expected, because the operator is not associative.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import Operator, Point, formula, par
    >>> class Mixture(Operator):
    ...     lipschitz = 1.0
    ...     share: float = par.factor("share of the second operand", low=0.0, high=1.0)
    ...     @formula
    ...     def value(a: wp.float32, b: wp.float32, share: wp.float32) -> wp.float32:
    ...         return (1.0 - share) * a + share * b
    >>> Mixture(Point((0, 0, 0), radius=1.0), Point((3, 0, 0), radius=1.0), share=0.25)([[0, 0, 0]]).tolist()
    [0.75]
    """

    custom_tags = ("custom_operator", "own operator")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.operator.commutes and len(self.operands) != 2:
            raise InvalidNode(
                f"operands: expected two, got {len(self.operands)}; {type(self).__name__} does not "
                "claim that operands may come in any order, so nest it"
            )


def _bound(kind: type[Node], arguments: tuple[Any, ...], named: dict[str, Any]) -> dict[str, Any]:
    """Return the values of a combination's fields; nodes in front of all other arguments are its operands."""
    names = [item.name for item in fields_of(kind)]
    values = {item.name: item.default for item in fields_of(kind) if item.default is not MISSING}
    count = next((i for i, item in enumerate(arguments) if not isinstance(item, Node)), len(arguments))
    positional = (arguments[:count], *arguments[count:]) if count else arguments
    given = dict(zip(names, positional, strict=False)) | named
    missing = [name for name in names if name not in values | given]
    unknown = [name for name in named if name not in names]
    if missing or unknown or len(positional) > len(names) or len(given) < len(positional) + len(named):
        expected = ", ".join(f"{name}=…" for name in names[1:]) or "nothing else"
        problem = f"got {len(positional)} arguments by position and {', '.join(named) or 'none'} by name"
        if missing:
            problem = f"{', '.join(missing)} missing"
        elif unknown:
            problem = f"{', '.join(unknown)} unknown"
        raise TypeError(f"{kind.__name__}: expected operands and {expected}; {problem}")
    return values | given
