"""The numbers of a tree as a vector: every component of every numeric parameter, by path and name.

Colours, whole numbers and names are no such parameters: the field does not change smoothly with them.
"""

import reprlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from blobtree.declare.parameters import Parameter, Quantity, fields_of, parameters_of
from blobtree.errors import InvalidNode
from blobtree.nodes.values import left_out, parameter_values
from blobtree.tape.model import checked_tree
from blobtree.tape.program import ProgramNode
from blobtree.validation import finite_numbers, items

AnyNode = TypeVar("AnyNode", bound=ProgramNode)
Path = tuple[int, ...]


@dataclass(frozen=True)
class NumericParameter:
    """One number of a tree.

    Attributes
    ----------
    path
        Indices of children, from the root to the node.
    name
        Name of the node's parameter.
    index
        Place of the number in the parameter's value: () for a number, (i,) in a vector, (i, j) in a matrix.
    declaration
        What the node's class says about the parameter: meaning and range.

    Examples
    --------
    >>> from blobtree import NumericParameter, Point, numeric_parameters
    >>> last = numeric_parameters(Point((0, 0, 0), radius=1.0))[-1]
    >>> isinstance(last, NumericParameter), last.path, last.name, last.index
    (True, (), 'radius', ())
    """

    path: Path
    name: str
    index: tuple[int, ...]
    declaration: Parameter

    def __str__(self) -> str:
        place = "".join(f"[{i}]" for i in self.index)
        return f"{'.'.join(map(str, self.path)) or 'root'}: {self.name}{place}"


def numeric_parameters(tree: ProgramNode) -> list[NumericParameter]:
    """Return all numbers of a tree on which its field depends, node by node from the root, left to right.

    Widths and weights that texts leave out are left out too, and so are radii of 0 and numbers that may not
    change while the others stay, such as the scale at the end of a closed sweep.

    Parameters
    ----------
    tree : Node
        The tree.

    Returns
    -------
    list of NumericParameter
        A parameter for each number; each component of a vector is one.

    Examples
    --------
    >>> from blobtree import Point, numeric_parameters
    >>> pair = Point((0, 0, 0), radius=1.0) + Point((1, 0, 0), radius=0.5)
    >>> [str(parameter) for parameter in numeric_parameters(pair)][3:6]
    ['0: radius', '1: center[0]', '1: center[1]']
    """
    checked_tree(tree)
    return [parameter for path, node in nodes_with_paths(tree) for parameter in _numbers_of(path, node)]


def checked_parameters(parameters: Iterable[NumericParameter]) -> tuple[NumericParameter, ...]:
    """Return several parameters; raise `InvalidNode` for anything else."""
    found = items(parameters)
    if found is None or not all(isinstance(item, NumericParameter) for item in found):
        raise InvalidNode(
            f"parameters: expected some of numeric_parameters(tree), got {reprlib.repr(parameters)}"
        )
    return found


def numeric_values(tree: ProgramNode, parameters: Sequence[NumericParameter]) -> Float64Array:
    """Return the values (p,) of numbers of a tree.

    Parameters
    ----------
    tree : Node
        The tree.
    parameters : sequence of NumericParameter
        The p parameters, see `numeric_parameters`.

    Returns
    -------
    numpy.ndarray
        float64[p]: the values, in the units of the parameters.

    Raises
    ------
    InvalidNode
        The tree does not have one of the parameters.

    Examples
    --------
    >>> from blobtree import Point, numeric_parameters, numeric_values
    >>> ball = Point((0, 0, 2), radius=1.0)
    >>> numeric_values(ball, numeric_parameters(ball)).tolist()
    [0.0, 0.0, 2.0, 1.0]
    """
    checked_tree(tree)
    return np.array([_number(_value_of(tree, p), p.index) for p in checked_parameters(parameters)])


def with_numeric_values(tree: AnyNode, parameters: Sequence[NumericParameter], values: ArrayLike) -> AnyNode:
    """Return the tree with other values (p,) for some of its numbers.

    Parameters
    ----------
    tree : Node
        The tree, which stays as it is.
    parameters : sequence of NumericParameter
        The p parameters, see `numeric_parameters`.
    values : array-like (p,)
        Their new values, in the units of the parameters.

    Returns
    -------
    Node
        A tree of the same structure.

    Raises
    ------
    InvalidNode
        A node refuses its value, or the tree does not have one of the parameters.

    Examples
    --------
    >>> from blobtree import Point, numeric_parameters, with_numeric_values
    >>> ball = Point((0, 0, 0), radius=1.0)
    >>> *_, radius = numeric_parameters(ball)
    >>> with_numeric_values(ball, [radius], [2.5]).radius
    2.5
    """
    checked_tree(tree)
    parameters, numbers = checked_parameters(parameters), finite_numbers("values", values)
    if len(numbers) != len(parameters):
        raise InvalidNode(f"values: expected a number for each of {len(parameters)}, got {len(numbers)}")
    changed: dict[Path, dict[str, Any]] = {}
    for parameter, value in zip(parameters, numbers, strict=True):
        own = changed.setdefault(parameter.path, {})
        old = own.get(parameter.name, None)
        if old is None:
            old = _value_of(tree, parameter)
        own[parameter.name] = with_number(old, parameter.index, value)
    return rebuilt(tree, changed)


def rebuilt(tree: AnyNode, changed: dict[Path, dict[str, Any]]) -> AnyNode:
    """Return a tree whose nodes at these paths have other parameters, or are copies if no value is given."""
    above = {path[:length] for path in changed for length in range(len(path) + 1)}
    made: dict[Path, ProgramNode] = {}
    for path in sorted(above, key=len, reverse=True):
        node = node_along(tree, path)
        children = [made.get((*path, i), child) for i, child in enumerate(node.children)]
        made[path] = _copy(node, changed.get(path, {}), children)
    result: AnyNode = made[()] if made else tree  # type: ignore[assignment]  # a copy is of the same class
    return result


def without_sharing(tree: AnyNode) -> AnyNode:
    """Return a tree in which each path leads to a node object of its own."""
    paths = dict(nodes_with_paths(tree))
    if len({id(node) for node in paths.values()}) == len(paths):
        return tree
    return rebuilt(tree, {path: {} for path in paths})


def nodes_with_paths(tree: ProgramNode) -> Iterator[tuple[Path, ProgramNode]]:
    """Yield the paths and nodes of a tree from the root, left to right."""
    pending: list[tuple[Path, ProgramNode]] = [((), tree)]
    while pending:
        path, node = pending.pop()
        yield path, node
        pending.extend(((*path, i), child) for i, child in reversed(list(enumerate(node.children))))


def node_along(tree: ProgramNode, path: Path) -> ProgramNode:
    """Return the node at the end of a path; raise `InvalidNode` if the tree has no such path."""
    node = tree
    for step in path:
        if not 0 <= step < len(node.children):
            raise InvalidNode(f"expected a path through the tree, got {path}; {step} is no child there")
        node = node.children[step]
    return node


def with_number(value: Any, index: tuple[int, ...], number: float) -> Any:
    """Return nested tuples with another number at a place."""
    if not index:
        return number
    first, *rest = index
    return (*value[:first], with_number(value[first], tuple(rest), number), *value[first + 1 :])


def _numbers_of(path: Path, node: ProgramNode) -> Iterator[NumericParameter]:
    declared = parameters_of(type(node))
    for field in fields_of(type(node)):
        value = getattr(node, field.name)
        declaration = declared.get(field.name)
        if not declaration or declaration.quantity is Quantity.COLOR or left_out(field, value):
            continue
        if field.name in node.fixed_numbers:
            continue
        if declaration.quantity is not Quantity.RADIUS or value > 0.0:  # a sharp solid has no smaller radius
            for index in _places(value):
                yield NumericParameter(path, field.name, index, declaration)


def _places(value: Any) -> Iterator[tuple[int, ...]]:
    """Yield the places of all floats in nested tuples."""
    if isinstance(value, float):
        yield ()
    elif isinstance(value, tuple):
        for i, item in enumerate(value):
            yield from ((i, *rest) for rest in _places(item))


def _value_of(tree: ProgramNode, parameter: NumericParameter) -> Any:
    """Return the value that holds a parameter; raise `InvalidNode` if it is a parameter of another tree."""
    value = number = getattr(node_along(tree, parameter.path), parameter.name, None)
    for i in parameter.index:
        number = number[i] if isinstance(number, tuple) and 0 <= i < len(number) else None
    if not isinstance(number, float):
        raise InvalidNode(f"parameters: expected those of this tree, got {parameter}; list them again")
    return value


def _number(value: Any, index: tuple[int, ...]) -> float:
    for i in index:
        value = value[i]
    return float(value)


def _copy(node: ProgramNode, values: dict[str, Any], children: list[ProgramNode]) -> ProgramNode:
    """Return a node of the same class with other parameters and operands."""
    own = parameter_values(node)
    remaining = iter(children)
    arguments: dict[str, Any] = {}
    for item in fields(node):  # type: ignore[arg-type]  # every node is a dataclass
        value = getattr(node, item.name)
        if item.name in own:
            arguments[item.name] = values.get(item.name, value)
        elif isinstance(value, tuple):
            arguments[item.name] = tuple(next(remaining) for _ in value)
        else:
            arguments[item.name] = next(remaining)
    return type(node)(**arguments)
