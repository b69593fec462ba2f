"""Clauses of an expression in x, y and z: their text, the parts between min and max, and their tape.

The text has one clause a line, ``name operation operands``, as libfive, Fidget and MPR write it::

    _0 var-x
    _1 const 0.5
    _2 sub _0 _1

The last clause is the value, below 0 inside. Operands name earlier clauses, so no text holds a cycle. Where
min and max are outermost, the expression is a tree of *parts*, which are united and intersected like nodes.
An expression that reads a part several times holds it once.

On a tape a clause is one texel: (operation + 2⁶ · output, first register, second register, number). A
register below 0 stands for the number. Registers 0, 1 and 2 hold x, y and z.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from blobtree.declare.parameters import CHECKS, Parameter, Quantity
from blobtree.errors import InvalidNode
from blobtree.validation import describe, texts

MOST_CLAUSES = 200_000
"""Most clauses of an expression."""

MOST_PARTS = 50_000
"""Most places at which min and max read parts; an expression with more is one part."""

LARGEST_CONSTANT = 1e15
"""Largest constant and factor, far below the largest number of float32; 1 over it is the least factor."""

LEAST_OF_LOGARITHM = 1e-18
"""Number whose logarithm is that of smaller ones."""

REGISTERS = 32
"""Registers of a part, three of which hold x, y and z."""

CODE_BITS = 6
"""Bits of the code of an operation on the tape, below the output's register."""

VARIABLES = ("var-x", "var-y", "var-z")

UNARY = (
    "copy", "neg", "abs", "square", "sqrt", "recip", "sin", "cos", "tan", "asin", "acos", "atan", "exp", "ln",
    "floor", "ceil", "round",
)  # fmt: skip
"""Operations of one operand, in the order of their codes; `copy` stands only on tapes."""

BINARY = ("add", "sub", "mul", "div", "min", "max", "hypot", "atan2", "mod", "compare", "pow", "nth-root")
"""Operations of two operands, whose codes follow."""

CODES = {name: code for code, name in enumerate((*UNARY, *BINARY))}

ARITIES = {
    **dict.fromkeys(VARIABLES, 0),
    "const": 1,
    **dict.fromkeys(UNARY[1:], 1),
    **dict.fromkeys(BINARY, 2),
}
"""Number of operands, by operation."""

FOLDS: dict[str, Callable[..., float]] = {
    "neg": np.negative, "abs": np.abs, "square": np.square, "recip": np.reciprocal,
    "sqrt": lambda a: np.sqrt(np.maximum(a, 0.0)), "sin": np.sin, "cos": np.cos, "tan": np.tan,
    "asin": lambda a: np.arcsin(np.clip(a, -1.0, 1.0)), "acos": lambda a: np.arccos(np.clip(a, -1.0, 1.0)),
    "atan": np.arctan, "exp": np.exp, "ln": lambda a: np.log(np.maximum(a, LEAST_OF_LOGARITHM)),
    "floor": np.floor, "ceil": np.ceil, "round": lambda a: np.trunc(a + np.copysign(0.5, a)),
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "min": np.minimum,
    "max": np.maximum, "hypot": np.hypot, "atan2": np.arctan2, "mod": lambda a, b: np.mod(a, np.abs(b)),
    "compare": lambda a, b: np.sign(a - b),
    "pow": lambda a, b: np.power(a if b == np.round(b) else np.maximum(a, 0.0), b),
    "nth-root": lambda a, n: (
        np.copysign(np.abs(a) ** (1.0 / n), a) if n % 2.0 else np.maximum(a, 0.0) ** (1.0 / n)
    ),
}  # fmt: skip
"""What operations return for numbers."""

OTHER_END = {"min": "max", "max": "min"}


class Clause(NamedTuple):
    """One operation; operands are the numbers of earlier clauses, and a constant has a value."""

    operation: str
    operands: tuple[int, ...] = ()
    value: float = 0.0


class Scaled(NamedTuple):
    """The value of a clause, times a factor, plus a number."""

    clause: int
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Joint:
    """The least or the largest of several values."""

    operation: str
    operands: tuple[Scaled, ...]


Texel = tuple[float, float, float, float]


class Clauses:
    """Clauses under construction, each distinct one once; constants are folded."""

    def __init__(self) -> None:
        self.rows: list[Clause] = []
        self._numbers: dict[Clause, int] = {}

    def constant(self, value: float) -> int:
        """Return the number of a constant."""
        return self._number(Clause("const", (), value))

    def add(self, operation: str, *operands: int) -> int:
        """Return the number of the clause of an operation."""
        values = [self.rows[number] for number in operands]
        if operands and all(row.operation == "const" for row in values):
            return self.constant(_folded(operation, [row.value for row in values]))
        if operation in OTHER_END and operands[0] == operands[1]:
            return operands[0]
        if operation == "mul" and operands[0] == operands[1]:
            return self.add("square", operands[0])
        if operation == "pow" and values[1].operation == "const":
            return self._power(operands[0], values[1].value)
        if operation == "sqrt" and (legs := self._legs(operands[0])):
            return self._norm(legs)
        return self._number(Clause(operation, operands))

    def copy(self, number: int) -> int:
        """Return the number of a clause that repeats another one."""
        return self._number(Clause("copy", (number,)))

    def _number(self, row: Clause) -> int:
        if row not in self._numbers:
            self._numbers[row] = len(self.rows)
            self.rows.append(row)
        return self._numbers[row]

    def _power(self, base: int, exponent: float) -> int:
        """Return a power as products if the exponent is a whole number."""
        if exponent != round(exponent):
            return self._number(Clause("pow", (base, self.constant(exponent))))
        if exponent < 0.0:
            return self.add("recip", self._power(base, -exponent))
        if exponent <= 1.0:
            return base if exponent else self.constant(1.0)
        half = self.add("square", self._power(base, exponent // 2.0))
        return self.add("mul", half, base) if exponent % 2.0 else half

    def _legs(self, number: int) -> list[int]:
        """Return a, b, … of a² + b² + …; none if a summand is no square."""
        pending, legs = [number], list[int]()
        while pending:
            row = self.rows[pending.pop()]
            if row.operation == "add":
                pending += row.operands
            elif row.operation == "square":
                legs += row.operands
            else:
                return []
        return legs

    def _norm(self, legs: list[int]) -> int:
        """Return the length √(a² + b² + …), whose slope is bounded where that of a root is not."""
        norm = self.add("abs", legs[0]) if len(legs) == 1 else self.add("hypot", *legs[:2])
        for leg in legs[2:]:
            norm = self.add("hypot", norm, leg)
        return norm


def checked_clauses(name: str, value: Any) -> tuple[str, ...]:
    """Return the clauses in a text or in several, without comments, which begin with #."""
    if not isinstance(value, str):
        value = "\n".join(texts(name, value))
    lines = tuple(" ".join(line.split()) for line in value.splitlines())
    clauses = tuple(line for line in lines if line and not line.startswith("#"))
    if not 0 < len(clauses) <= MOST_CLAUSES:
        raise InvalidNode(f"{name}: expected 1 to {MOST_CLAUSES:,} clauses, got {describe(value)}")
    return clauses


CHECKS[Quantity.CLAUSES] = checked_clauses

if TYPE_CHECKING:

    class ClauseTexts:
        """For type checkers: a field that takes a text or several, and holds the clauses."""

        def __get__(self, instance: object, owner: Any) -> tuple[str, ...]: ...

        def __set__(self, instance: object, value: str | Sequence[str]) -> None: ...

else:
    ClauseTexts = Annotated[
        tuple[str, ...],
        Parameter(
            Quantity.CLAUSES, "texts of the clauses, each after those that it reads; or one text of lines"
        ),
    ]


def parsed(lines: Sequence[str]) -> list[Clause]:
    """Return the clauses of checked texts.

    Raises
    ------
    InvalidNode
        A clause has an unknown operation or name, or a wrong number of operands; the message names its line.
    """
    clauses, numbers = Clauses(), dict[str, int]()
    last = -1
    for place, line in enumerate(lines):
        words = line.split()
        try:
            last = _clause(clauses, numbers, words)
        except ValueError as error:
            raise InvalidNode(f"clauses[{place}]: {error}") from None
        numbers[words[0]] = last
    return _reached(clauses.rows, last)


def _clause(clauses: Clauses, numbers: dict[str, int], words: list[str]) -> int:
    """Add the clause of a line and return its number; raise `ValueError` for a line that is no clause."""
    if words[0] in numbers:
        raise ValueError(f"expected a name of its own, got {words[0][:40]!r} again")
    operation = words[1] if len(words) > 1 else ""
    if operation not in ARITIES:
        raise ValueError(f"expected one of {', '.join(ARITIES)}; got {operation[:40]!r}")
    operands = words[2:]
    if len(operands) != ARITIES[operation]:
        raise ValueError(f"expected {ARITIES[operation]} operands of {operation}, got {len(operands)}")
    if operation == "const":
        try:
            value = float(operands[0])
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST_CONSTANT:
            raise ValueError(f"expected a number up to {LARGEST_CONSTANT:g}, got {operands[0][:40]!r}")
        return clauses.constant(value)
    unknown = [name for name in operands if name not in numbers]
    if unknown:
        raise ValueError(f"expected names of earlier clauses, got {unknown[0][:40]!r}")
    return clauses.add(operation, *(numbers[name] for name in operands))


def _reached(rows: list[Clause], last: int) -> list[Clause]:
    """Return the clauses that the last one reads, in their order."""
    needed = {last}
    for number in range(last, -1, -1):
        if number in needed:
            needed.update(rows[number].operands)
    order = sorted(needed)
    places = {number: place for place, number in enumerate(order)}
    return [
        rows[number]._replace(operands=tuple(places[operand] for operand in rows[number].operands))
        for number in order
    ]


def _folded(operation: str, values: list[float]) -> float:
    """Return an operation of numbers; raise `ValueError` if that is no number."""
    with np.errstate(all="ignore"):
        result = float(FOLDS[operation](*map(np.float64, values)))
    if not abs(result) <= LARGEST_CONSTANT:
        raise ValueError(f"{operation} of {', '.join(f'{value:g}' for value in values)} is no number here")
    return result


def joints(rows: Sequence[Clause]) -> tuple[Scaled, dict[Scaled, Joint]]:
    """Return the value of clauses, and the joints in it, operands first; other values are parts.

    Factors and offsets of a joint are those of its operands. A negative factor exchanges min and max.
    """
    root = _unwrapped(rows, Scaled(len(rows) - 1))
    found: dict[Scaled, Joint | None] = {}
    uses: dict[Scaled, int] = {}
    pending = [(root, False)]
    while pending:
        value, is_done = pending.pop()
        joint = found.get(value)
        if is_done:
            assert joint is not None
            uses[value] = sum(uses[operand] for operand in joint.operands)
        elif value not in found:
            found[value] = joint = _joint(rows, value)
            if joint is None:
                uses[value] = 1
            else:
                pending.append((value, True))
                pending += [(operand, False) for operand in joint.operands]
    if uses[root] > MOST_PARTS:
        return root, {}
    return root, {value: joint for value in uses if (joint := found[value]) is not None}


def _joint(rows: Sequence[Clause], value: Scaled) -> Joint | None:
    """Return the joint that a value is; None for a part."""
    operation, operands, _ = rows[value.clause]
    if operation not in OTHER_END:
        return None
    if value.factor < 0.0:
        operation = OTHER_END[operation]
    distinct: dict[Scaled, None] = {}
    pending = [value._replace(clause=number) for number in reversed(operands)]
    seen: set[Scaled] = set()
    while pending:
        operand = _unwrapped(rows, pending.pop())
        if operand in seen:
            continue
        seen.add(operand)
        row = rows[operand.clause]
        same = row.operation == (operation if operand.factor > 0.0 else OTHER_END[operation])
        if same:
            pending += [operand._replace(clause=number) for number in reversed(row.operands)]
        else:
            distinct[operand] = None
    return Joint(operation, tuple(distinct))


def _unwrapped(rows: Sequence[Clause], value: Scaled) -> Scaled:
    """Return the same value by a clause that a number is neither added to nor multiplied with.

    A number that would make the factor or the offset too large or too small stays in the clause.
    """
    while True:
        operation, operands, _ = rows[value.clause]
        constants = [rows[operand].value for operand in operands if rows[operand].operation == "const"]
        others = [operand for operand in operands if rows[operand].operation != "const"]
        _, factor, offset = value
        if operation == "neg":
            inner = Scaled(others[0], -factor, offset)
        elif operation not in ("add", "sub", "mul") or not constants or not constants[0]:
            return value
        elif operation == "mul":
            inner = Scaled(others[0], factor * constants[0], offset)
        elif operation == "add":
            inner = Scaled(others[0], factor, offset + factor * constants[0])
        elif operands[0] == others[0]:
            inner = Scaled(others[0], factor, offset - factor * constants[0])
        else:
            inner = Scaled(others[0], -factor, offset + factor * constants[0])
        if not 1.0 / LARGEST_CONSTANT <= abs(inner.factor) <= LARGEST_CONSTANT >= abs(inner.offset):
            return value
        value = inner


def part_texels(rows: Sequence[Clause], value: Scaled) -> tuple[Texel, ...]:
    """Return the tape of a part.

    Raises
    ------
    ValueError
        It needs more registers than there are, or is a constant that is too large.
    """
    own = Clauses()
    places: dict[int, int] = {}
    for number in _order(rows, value.clause):
        row = rows[number]
        places[number] = (
            own.constant(row.value) if row.operation == "const"
            else own.add(row.operation, *(places[operand] for operand in row.operands))
        )  # fmt: skip
    last = places[value.clause]
    if value.factor == -1.0:
        last = own.add("sub", own.constant(value.offset), last) if value.offset else own.add("neg", last)
    else:
        last = last if value.factor == 1.0 else own.add("mul", last, own.constant(value.factor))
        last = own.add("add", last, own.constant(value.offset)) if value.offset else last
    if own.rows[last].operation in (*VARIABLES, "const"):
        last = own.copy(last)
    return _allocated(own.rows, _order(own.rows, last))


def _order(rows: Sequence[Clause], last: int) -> list[int]:
    """Return what a clause reads and itself, operands first; the operand that needs more registers leads."""
    needs: dict[int, int] = {}
    order: list[int] = []
    pending = [(last, False)]
    while pending:
        number, is_known = pending.pop()
        if number in needs:
            continue
        operands = rows[number].operands
        if is_known:
            ordered = sorted((needs[operand] for operand in operands), reverse=True)
            needs[number] = max([1, *(need + place for place, need in enumerate(ordered))])
        else:
            pending.append((number, True))
            pending += [(operand, False) for operand in operands]
    seen: set[int] = set()
    pending = [(last, False)]
    while pending:
        number, is_done = pending.pop()
        if is_done:
            order.append(number)
        elif number not in seen:
            seen.add(number)
            pending.append((number, True))
            pending += [(operand, False) for operand in sorted(rows[number].operands, key=needs.__getitem__)]
    return order


def _allocated(rows: Sequence[Clause], order: list[int]) -> tuple[Texel, ...]:
    """Return clauses in their order as texels, each with a register that no later one reads any more."""
    steps = [number for number in order if rows[number].operation not in (*VARIABLES, "const")]
    last_use = {operand: step for step in steps for operand in rows[step].operands}
    places = {number: VARIABLES.index(rows[number].operation) for number in order
              if rows[number].operation in VARIABLES}  # fmt: skip
    free = list(range(REGISTERS - 1, len(VARIABLES) - 1, -1))
    texels: list[Texel] = []
    for number in steps:
        operation, operands, _ = rows[number]
        constants = [rows[operand].value for operand in operands if rows[operand].operation == "const"]
        first, second, *_ = [*(float(places.get(operand, -1)) for operand in operands), -1.0, -1.0]
        ended = [operand for operand in {*operands} if last_use[operand] == number]
        free += [places[operand] for operand in ended if places.get(operand, 0) >= len(VARIABLES)]
        if not free:
            raise ValueError(
                f"expected parts between min and max that need at most {REGISTERS - len(VARIABLES)} "
                f"values at once, got more in one of {len(steps)} clauses"
            )
        places[number] = free.pop()
        code = float(CODES[operation] + (places[number] << CODE_BITS))
        texels.append((code, first, second, constants[0] if constants else 0.0))
    return tuple(texels)
