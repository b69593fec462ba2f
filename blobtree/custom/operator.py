"""Custom operators: a combination from one typed function of two operands.

    @wp.func
    def soft(a: wp.float32, b: wp.float32, hardness: wp.float32) -> wp.float32:
        ...
        return f

    Soft = define_operator(soft, steepest=1.0, like="blend", monotone=True, limits={"hardness": (0.0, 1.0)})
    model = Soft((Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)), 0.3)

`blobtree.nodes.operator.Operator` is the class that it makes.
"""

from collections.abc import Mapping
from typing import Any

import warp as wp

from blobtree.custom.definition import Limits, custom_parameters, short_form
from blobtree.declare.claims import Like
from blobtree.declare.formula import formula_of, kind_name, returned_type
from blobtree.nodes.operator import Operator

CustomCombination = Operator
"""The former name of the base of the classes that `define_operator` returns."""


def define_operator(
    function: Any,
    *,
    steepest: Any = None,
    like: Like | None = None,
    monotone: bool = False,
    order_free: bool = False,
    name: str | None = None,
    limits: Mapping[str, Limits] | None = None,
    gradients: bool = False,
    envelope: Any = None,
) -> type[Operator]:
    """Return a class of operators from a function of two field values: a short form of `Operator`.

    Parameters
    ----------
    function
        ``(a: wp.float32, b: wp.float32) -> wp.float32``, or with any number of wp.float32 more, its
        parameters; with or without ``@wp.func``. F must be continuous, nowhere negative, and 0 where both
        operands are. ∂F/∂a and ∂F/∂b are derived from its source. A function that returns
        ``wp.vec3(F, ∂F/∂a, ∂F/∂b)`` gives them itself: faster, or more exact in single precision.
    steepest
        Upper bound of ``abs(∂F/∂a)`` and ``abs(∂F/∂b)`` for all operands; or a typed function
        ``(max_a, max_b, parameters if any) -> wp.vec2`` of the largest values that the operands may have.
    like
        What F is where an operand is absent (0): with "blend" it is the other operand, with "intersection" 0,
        with "difference" a where b is absent and 0 where a is. Cells and boxes are pruned by it.
    monotone
        F never falls as an operand grows; with ``like="difference"``, never falls with a nor rises with b.
    order_free
        F(a, b) = F(b, a) and F(F(a, b), c) = F(a, F(b, c)): it takes any number of operands.
    name
        Name of the kind in files; by default the function's name. The class has the same name in CamelCase.
    limits
        ``{parameter: (smallest or None, largest or None)}``.
    gradients
        The function reads the gradients of its operands: its parameters are ``(a: wp.float32, b: wp.float32,
        gradient_a: wp.vec3, gradient_b: wp.vec3, ...)``, and ∂F/∂a and ∂F/∂b are those for fixed gradients.
        The gradient of the field also takes the change of the operands' gradients into account, exactly. F
        should be continuous in the gradients too. Give `envelope` in place of `steepest`; `monotone` and
        `order_free` cannot be claimed. Where rays cross such a blend, they take small steps.
    envelope
        With `gradients`: a typed function ``(a, b, parameters if any) -> wp.vec2`` of the smallest and the
        largest F for any gradients. Neither falls as an operand grows; with ``like="difference"`` neither
        falls with a nor rises with b.

    Returns
    -------
    type[Operator]
        A node class: a tuple of operands, then the parameters by position or name.

    Raises
    ------
    InvalidDefinition
        The function has no types or no source, or sampled operands contradict a claim. Nothing has been
        compiled by then.
    UntranslatableFunction
        The function leaves the shared subset; the message names file and line.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree.custom import define_operator
    >>> @wp.func
    ... def average(a: wp.float32, b: wp.float32) -> wp.float32:
    ...     return 0.5 * (a + b)
    >>> Average = define_operator(average, steepest=0.5)  # doctest: +SKIP
    """
    value_alone = returned_type(function) in (wp.float32, float)
    source = formula_of(function, returns=wp.float32 if value_alone else wp.vec3)
    if gradients != (list(source.parameters.values())[2:4] == [wp.vec3, wp.vec3]):
        several = ", gradient_a: wp.vec3, gradient_b: wp.vec3" if gradients else ""
        raise source.refusal(
            f"expected (a: wp.float32, b: wp.float32{several}), and parameters of type wp.float32"
        )
    parameters = custom_parameters(source, list(source.parameters)[4 if gradients else 2 :], limits, Operator)
    kind = kind_name(source, name)
    node: type[Operator] = short_form(
        Operator,
        kind,
        source,
        parameters,
        {"value" if value_alone else "partials": source, "lipschitz": steepest, "envelope": envelope},
        like=like,
        monotone=monotone,
        associative=order_free,
    )
    return node
