"""Operators: combinations of the fields of operands. A kind is a class with formulas and claims."""

from collections.abc import Iterable
from dataclasses import MISSING, Field, dataclass
from typing import Any, ClassVar

from blobtree.declare.claims import Like, OperatorRow
from blobtree.declare.formula import Declared, Formula, declared_formulas, is_own, tag_of
from blobtree.declare.operator import RESULTS, Claims, OperatorFormulas
from blobtree.declare.operator_checks import check_operator
from blobtree.declare.parameters import Parameter, documented, fields_of, parameters_of
from blobtree.declare.registry import CUSTOM_KINDS, CustomKind, library_rows
from blobtree.errors import InvalidDefinition, InvalidNode
from blobtree.nodes.node import Node


class Combination(Node, metaclass=CustomKind):
    """An operator folded over its operands from left to right, see `Operator`.

    The operator takes the parameters that the class declares, in their order.
    """

    combines = True
    operator: ClassVar[OperatorRow]
    kind: ClassVar[str]
    digest: ClassVar[str] = ""
    """Digest of the formulas, claims and parameters of an operator that this package does not define."""
    parameters: ClassVar[tuple[Parameter, ...]]
    like: ClassVar[Like | None] = None
    monotone: ClassVar[bool] = False
    associative: ClassVar[bool] = False
    lipschitz: ClassVar[float | None] = None
    paints: ClassVar[bool] = True
    _formulas: ClassVar[dict[str, Formula]] = {}

    def __init_subclass__(cls) -> None:
        own, declares = is_own(cls), any(isinstance(value, Declared) for value in vars(cls).values())
        if not declares and (own or "operator" in vars(cls)):
            super().__init_subclass__()
            return
        tag = tag_of(cls)
        cls._formulas = given = {**cls._formulas, **declared_formulas(cls, tag, RESULTS)}
        if own:
            cls.file_tag = tag
        else:
            _require_free_names(cls)
        super().__init_subclass__()
        if issubclass(cls, ManyOperands):
            dataclass(frozen=True, eq=False, repr=False, init=False)(cls)
        claims = Claims(cls.like, cls.monotone, cls.associative, cls.lipschitz, cls.paints)
        formulas = OperatorFormulas(tag, given, claims)
        if own:
            cls.operator = formulas.row()
            if not cls.operator.gradients:
                library_rows(cls.operator)
        else:
            cls._define(formulas)

    @classmethod
    def _define(cls, formulas: OperatorFormulas) -> None:
        """Check a user's operator, unless it is known, and register it."""
        if not {"value", "partials"} & formulas.given.keys():
            raise InvalidDefinition(f"{cls.__qualname__}: expected an operator with the formula `value`")
        declared = parameters_of(cls)
        unknown = [item.name for item in fields_of(cls) if item.name not in ("operands", *declared)]
        if unknown:
            raise InvalidDefinition(
                f"{cls.__qualname__}: field {unknown[0]!r}: expected a specifier of blobtree.par, such as "
                f"`{unknown[0]}: float = par.factor('what it is')`"
            )
        cls.__doc__ = documented(cls.__doc__ or "", cls)
        cls.kind, cls.parameters = formulas.kind, tuple(declared.values())
        formulas.require([parameter.name for parameter in cls.parameters])
        cls.digest = formulas.digest(cls.parameters)
        known: Any = CUSTOM_KINDS.get(cls.kind)
        if known is not None and issubclass(known, Combination) and known.digest == cls.digest:
            cls.operator = known.operator
        else:
            check_operator(formulas, cls.parameters)
            cls.operator = formulas.row(cls.digest)
        CUSTOM_KINDS[cls.kind] = cls

    @property
    def operator_parameters(self) -> tuple[float, ...]:
        """The numbers that the operator takes besides its operands."""
        values = ((p, getattr(self, name)) for name, p in parameters_of(type(self)).items())
        return tuple(number for p, value in values for number in p.components(value))

    @classmethod
    def content_key(cls) -> tuple[str, ...]:
        """Return what names the kind in content hashes: with the digest of a user's formulas."""
        return ("CustomCombination", cls.kind, cls.digest) if cls.digest else super().content_key()

    @property
    def values(self) -> dict[str, Any]:
        """The parameters by name."""
        return {name: getattr(self, name) for name in parameters_of(type(self))}


@dataclass(frozen=True, eq=False, repr=False, init=False)
class ManyOperands(Node):
    """A node with any number of `operands`, which come one by one or as one iterable.

    Its parameters follow them, best by name.
    """

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

    def __post_init__(self) -> None:
        super().__post_init__()
        if type(self) is Operator:
            raise InvalidNode("Operator: expected a subclass of it with the formula `value`")
        if not self.operator.commutes and len(self.operands) != 2:
            raise InvalidNode(
                f"operands: expected two, got {len(self.operands)}; {type(self).__name__} does not "
                "claim that operands may come in any order, so nest it"
            )


def _require_free_names(kind: type[Combination]) -> None:
    """Raise `InvalidDefinition` if a parameter has the name of what each node has."""
    for name, value in vars(kind).items():
        if isinstance(value, Field) and (hasattr(Operator, name) or name in ("operands", *RESULTS)):
            raise InvalidDefinition(
                f"{kind.__qualname__}: parameter {name!r}: every node of this sort has an attribute of that "
                "name; choose another"
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
