"""Parameters of nodes: each field of a node class declares here what it means.

A node class annotates a field with its `Parameter`::

    center: Annotated[Vector, Parameter(Quantity.POINT, "centre of the ball")]

Validation, the documentation of the class, the file format, edits of a tree and the layout on the tape all
follow from this declaration. Fields without one hold operands.
"""

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, Field, dataclass, field, fields, replace
from enum import Enum
from functools import partial
from itertools import chain
from operator import attrgetter
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, get_args, get_origin, get_type_hints

import numpy as np

from blobtree._typing import Float64Array
from blobtree.colors import ColorLike, color_rgb
from blobtree.declare.falloff import FALLOFF_NAMES, Falloff
from blobtree.declare.registry import load_libraries
from blobtree.errors import InvalidDefinition, InvalidNode
from blobtree.validation import (
    Vector,
    affine_matrix,
    describe,
    finite_number,
    finite_numbers,
    finite_points,
    finite_vector,
    name_pairs,
    non_negative_vector,
    nonzero_vector,
    positive_number,
    positive_numbers,
    positive_vector,
    texts,
)

LARGEST_INTEGER = 1 << 24
"""Largest whole number up to which float32 holds every whole number."""


class Quantity(Enum):
    """Meaning of a parameter: how it is checked, and how maps and edits change it."""

    POINT = "point"
    """A point (3,) in the node's space; it moves with the node."""
    POINTS = "points"
    """Points (n, 3) in the node's space; they move with the node."""
    DIRECTION = "direction"
    """A vector (3,) of any length above 0; rotations turn it."""
    EXTENTS = "extents"
    """Lengths (3,) along the axes of the node's space, 0 or more."""
    LENGTH = "length"
    """A length above 0; it scales with the node."""
    RADIUS = "radius"
    """Visible radius around the skeleton, above 0, or from 0 on if that is the range; offsets and resizing
    change it."""
    SEMI_AXES = "semi_axes"
    """Visible radii (3,) along the axes of the node's space, above 0; resizing changes them."""
    RADII = "radii"
    """Visible radii (n,), one for each of the points, above 0; resizing changes them."""
    DISTANCE = "distance"
    """A signed length."""
    ANGLE = "angle"
    """An angle or a rate of turning, in degrees."""
    FACTOR = "factor"
    """A number without unit."""
    FACTORS = "factors"
    """Numbers without unit, any number of them; rows of a table one after the other."""
    DISTANCES = "distances"
    """Signed lengths, any number of them."""
    NAMES = "names"
    """Texts that are not empty, any number of them."""
    SAMPLES = "samples"
    """Numbers at the points of a grid."""
    OUTLINE = "outline"
    """A shape in a plane by the lines and curves around it."""
    CLAUSES = "clauses"
    """Texts of the clauses of an expression; no edit changes them."""
    COLOR = "color"
    """Red, green and blue (3,) from 0 to 1."""
    ATTRIBUTES = "attributes"
    """Numbers, vectors and labels of the user by name; no edit changes them."""
    MATRIX = "matrix"
    """An invertible affine map, three rows of four numbers."""
    NAME_PAIRS = "name_pairs"
    """Pairs of names."""
    FALLOFF = "falloff"
    """A `Falloff`, or the name of one."""
    CHOICE = "choice"
    """One of the texts that the declaration lists."""
    WIDTH = "width"
    """A length above 0, or None for the one that follows from other parameters."""
    NUMBERS = "numbers"
    """One to four numbers of a custom kind, whose meaning is unknown; no edit changes them."""


UNITS = {
    Quantity.POINT: "model units",
    Quantity.POINTS: "model units",
    Quantity.EXTENTS: "model units",
    Quantity.LENGTH: "model units",
    Quantity.RADIUS: "model units",
    Quantity.SEMI_AXES: "model units",
    Quantity.RADII: "model units",
    Quantity.DISTANCE: "model units",
    Quantity.DISTANCES: "model units",
    Quantity.WIDTH: "model units",
}
"""Units of quantities that have one."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of a node class.

    Attributes
    ----------
    quantity
        Its meaning.
    doc
        Its description, a noun phrase.
    low, high
        Range of the number; of the length of a vector in a custom kind.
    hint
        What to do about a value out of range.
    name
        Name of the field; filled in by `parameters_of`.
    size
        Number of components of `Quantity.NUMBERS`: 1 is a number, more a vector.
    whole
        `Quantity.NUMBERS` holds whole numbers.
    choices
        Texts that `Quantity.CHOICE` allows.
    natural
        Value of a new node in an editor.
    """

    quantity: Quantity
    doc: str = ""
    _: KW_ONLY
    low: float = -math.inf
    high: float = math.inf
    hint: str = ""
    name: str = ""
    size: int = 1
    whole: bool = False
    choices: tuple[str, ...] = ()
    natural: float | None = field(default=None, repr=False)

    @property
    def check(self) -> Callable[[Any], Any]:
        """A function that returns the checked value, or raises `InvalidNode`."""
        if self.quantity is Quantity.NUMBERS:
            return self._checked_numbers
        if self.quantity is Quantity.CHOICE:
            return self._checked_choice
        return self._checked_in_range if self.is_bounded else partial(CHECKS[self.quantity], self.name)

    def _checked_in_range(self, value: Any) -> Any:
        zero = self.quantity is Quantity.RADIUS and self.low == 0.0
        result = (finite_number if zero else CHECKS[self.quantity])(self.name, value)
        if self.low <= result <= self.high:
            return result
        ends = math.isfinite(self.low) and math.isfinite(self.high)
        span = f"{self.low:g} to {self.high:g}" if ends else f"a number {self.range}"
        raise InvalidNode(f"{self.name}: expected {span}, got {result!r}{self._advice}")

    @property
    def is_bounded(self) -> bool:
        """True if the declaration states a range of its own."""
        return self.low > -math.inf or self.high < math.inf

    @property
    def range(self) -> str:
        """The range in words."""
        if self.high == math.inf:
            return f"from {self.low:g}"
        return f"from {self.low:g} to {self.high:g}" if self.low > -math.inf else f"up to {self.high:g}"

    def components(self, value: Any) -> tuple[float, ...]:
        """Return a checked value as floats."""
        if self.quantity is Quantity.POINTS:
            return tuple(chain.from_iterable(value))
        return tuple(value) if isinstance(value, tuple) else (float(value),)

    def _checked_choice(self, value: Any) -> Any:
        if isinstance(value, str) and value in self.choices:
            return value
        raise InvalidNode(
            f"{self.name}: expected {' or '.join(map(repr, self.choices))}, got {describe(value)}"
        )

    def _checked_numbers(self, value: Any) -> Any:
        """Return `value` as a float, an int or a tuple of floats."""
        result: float | tuple[float, ...]
        if self.size == 1:
            number = finite_number(self.name, value)
            if self.whole and number != int(number):
                raise InvalidNode(f"{self.name}: expected a whole number, got {value!r}")
            measure, result = number, int(number) if self.whole else number
        else:
            try:
                components = tuple(finite_number(self.name, component) for component in value)
            except TypeError:
                components = ()
            if len(components) != self.size:
                raise InvalidNode(f"{self.name}: expected {self.size} finite numbers, got {value!r}")
            measure, result = math.hypot(*components), components
        if not self.low <= measure <= self.high:
            noun = "a number" if self.size == 1 else "a vector of length"
            raise InvalidNode(f"{self.name}: expected {noun} {self.range}, got {value!r}{self._advice}")
        if self.whole and abs(measure) > LARGEST_INTEGER:
            raise InvalidNode(
                f"{self.name}: expected a number up to {LARGEST_INTEGER:,}, got {value!r}; float32 counts no "
                "further"
            )
        return result

    @property
    def _advice(self) -> str:
        """The hint behind a message."""
        return f"; {self.hint}" if self.hint else ""


def _falloff(name: str, value: Any) -> Falloff:
    """Return a falloff, that of a class or of a name; raise `InvalidNode` otherwise."""
    if isinstance(value, type) and issubclass(value, Falloff) and value is not Falloff:
        return value()
    if isinstance(value, Falloff):
        return value
    load_libraries()
    if isinstance(value, str) and value in FALLOFF_NAMES:
        return FALLOFF_NAMES[value]
    raise InvalidNode(
        f"{name}: expected a falloff or one of {', '.join(FALLOFF_NAMES)}, got {describe(value)}; "
        "a subclass of Falloff makes another"
    )


def _width(name: str, value: Any) -> float | None:
    """Return None or a number above 0; raise `InvalidNode` otherwise."""
    return None if value is None else positive_number(name, value)


CHECKS: dict[Quantity, Callable[[str, Any], Any]] = {
    Quantity.POINT: finite_vector,
    Quantity.POINTS: finite_points,
    Quantity.DIRECTION: nonzero_vector,
    Quantity.EXTENTS: non_negative_vector,
    Quantity.LENGTH: positive_number,
    Quantity.RADIUS: positive_number,
    Quantity.SEMI_AXES: positive_vector,
    Quantity.RADII: positive_numbers,
    Quantity.DISTANCE: finite_number,
    Quantity.ANGLE: finite_number,
    Quantity.FACTOR: finite_number,
    Quantity.FACTORS: finite_numbers,
    Quantity.DISTANCES: finite_numbers,
    Quantity.NAMES: texts,
    Quantity.COLOR: color_rgb,
    Quantity.NAME_PAIRS: name_pairs,
    Quantity.FALLOFF: _falloff,
    Quantity.WIDTH: _width,
    Quantity.MATRIX: lambda _name, value: affine_matrix(value),
}
"""Functions (name, value) that return the checked value of each quantity; extras add theirs."""

Radius: TypeAlias = Annotated[float, Parameter(Quantity.RADIUS, "visible radius around the skeleton")]
if TYPE_CHECKING:

    class Color:
        """For type checkers: a field that takes any colour and holds numbers from 0 to 1."""

        def __get__(self, instance: object, owner: Any) -> Vector: ...

        def __set__(self, instance: object, value: ColorLike) -> None: ...

else:
    Color = Annotated[
        Vector, Parameter(Quantity.COLOR, "red, green and blue from 0 to 1, or the name of a colour")
    ]


OPTIONAL = "optional"
"""Key in the metadata of a field that comes last, and that texts and files leave out at its default."""


_FIELDS: dict[type, tuple["Field[Any]", ...]] = {}


def fields_of(kind: type) -> tuple["Field[Any]", ...]:
    """Return the fields of a class of nodes; those that texts may leave out come last."""
    if kind not in _FIELDS:
        _FIELDS[kind] = tuple(sorted(fields(kind), key=lambda field: OPTIONAL in field.metadata))
    return _FIELDS[kind]


SPECIFIED = "parameter"
"""Key in the metadata of a field that a specifier of `blobtree.par` made."""


def annotate(kind: type) -> None:
    """Move the parameters that specifiers declare in the body of a class into its annotations."""
    hints = dict(inspect.get_annotations(kind))
    for name, value in vars(kind).items():
        if isinstance(value, Field) and SPECIFIED in value.metadata:
            if name not in hints:
                raise InvalidDefinition(
                    f"{kind.__qualname__}: parameter {name!r}: expected a type, as in `{name}: float = …`"
                )
            hints[name] = Annotated[hints[name], value.metadata[SPECIFIED]]
    kind.__annotations__ = hints


_PARAMETERS: dict[type, dict[str, Parameter]] = {}


def parameters_of(kind: type) -> dict[str, Parameter]:
    """Return the parameters that a node class declares, by name and in order; operands are left out."""
    if kind not in _PARAMETERS:
        hints = get_type_hints(kind, include_extras=True)
        declared = {field.name: _declared(hints[field.name]) for field in fields_of(kind)}
        _PARAMETERS[kind] = {name: replace(p, name=name) for name, p in declared.items() if p is not None}
    return _PARAMETERS[kind]


def _declared(hint: Any) -> Parameter | None:
    """Return the `Parameter` in an annotation."""
    extras = get_args(hint)[1:] if get_origin(hint) is Annotated else ()
    return next((extra for extra in extras if isinstance(extra, Parameter)), None)


def columns_of(nodes: Sequence[Any], parameter: Parameter) -> Float64Array:
    """Return the values (n, size) of one parameter of n nodes of a kind."""
    first = getattr(nodes[0], parameter.name)
    values = map(attrgetter(parameter.name), nodes)
    numbers = chain.from_iterable(values) if isinstance(first, tuple) else values
    size = len(parameter.components(first))
    return np.fromiter(numbers, np.float64, size * len(nodes)).reshape(-1, size)


def unit_vectors(vectors: Float64Array) -> Float64Array:
    """Return vectors (n, 3) of any length above 0 at length 1; squares of tiny numbers would vanish."""
    scaled = vectors / np.abs(vectors).max(axis=1, keepdims=True)
    result: Float64Array = scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
    return result


def mapped(quantity: Quantity, values: Float64Array, matrices: Float64Array | None) -> Float64Array:
    """Return values (n, size) of a quantity under similarity maps (n, 4, 4), or under none."""
    if quantity is Quantity.DIRECTION:
        directions = unit_vectors(values)
        if matrices is None:
            return directions
        return unit_vectors(np.einsum("nij,nj->ni", matrices[:, :3, :3], directions))
    if matrices is None:
        return values
    if quantity is Quantity.POINT:
        placed: Float64Array = np.einsum("nij,nj->ni", matrices[:, :3, :3], values) + matrices[:, :3, 3]
        return placed
    if quantity is Quantity.LENGTH:
        scaled: Float64Array = values * np.linalg.norm(matrices[:, :3, 0], axis=1)[:, None]
        return scaled
    return values


def documented(doc: str, kind: type) -> str:
    """Return the docstring of a node class with a Parameters section of its declarations."""
    lines: list[str] = []
    hints: dict[str, Any] = {}
    for base in kind.__mro__:
        hints |= {n: hint for n, hint in inspect.get_annotations(base).items() if n not in hints}
    for name, hint in hints.items():
        parameter = _declared(hint)
        if parameter is not None and parameter.doc:
            lines += [f"{name} : {_type_name(hint)}", f"    {described(parameter)}"]
    return doc if not lines or "Parameters\n" in doc else with_parameters(doc, lines)


def with_parameters(doc: str, lines: Sequence[str]) -> str:
    """Return a docstring with a Parameters section of some lines in front of its examples."""
    head, examples, tail = inspect.cleandoc(doc).partition("\n\nExamples\n")
    return "\n".join([f"{head}\n", "Parameters", "----------", *lines]) + examples + tail


def described(parameter: Parameter) -> str:
    """Return the description of a parameter as a sentence with its unit and range."""
    unit = UNITS.get(parameter.quantity)
    parts = [parameter.doc[:1].upper() + parameter.doc[1:]]
    if unit:
        parts.append(f"in {unit}")
    if parameter.is_bounded:
        parts.append(parameter.range)
    return ", ".join(parts) + "."


def _type_name(hint: Any) -> str:
    inner = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    names = {
        float: "float",
        Vector: "(x, y, z)",
        float | None: "float or None",
        Falloff | str: "Falloff or str",
        str: "str",
    }
    return names.get(inner, "dict" if get_origin(inner) is Mapping else "array-like")
