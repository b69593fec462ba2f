"""Readers: functions of rows that read the numbers of a formula from the tape and call it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import warp as wp

from blobtree.declare.formula import Formula, generated, spelled
from blobtree.texels import Texels
from blobtree.transpile.derivative import partial_derivatives

SIZES: dict[Any, int] = {
    wp.float32: 1,
    float: 1,
    wp.int32: 1,
    int: 1,
    wp.vec2: 2,
    wp.vec3: 3,
    wp.vec4: 4,
}
"""The types of a formula's numbers, with their sizes."""

PLACE = {"tape": Texels, "at": wp.int32}
"""The parameters of a formula that reads the tape itself."""


def number_types(formula: Formula, leading: int) -> dict[str, Any]:
    """Return the types of what a formula takes behind its leading parameters, by name."""
    return dict(list(formula.parameters.items())[leading:])


def require_numbers(
    source: Formula,
    given: Mapping[str, Formula],
    leading: Mapping[str, Mapping[str, Any]],
    declared: Sequence[str] | None,
) -> None:
    """Raise `InvalidDefinition` unless all formulas of a kind take a point, and then the same numbers.

    `leading` has what formulas take in front of the numbers; the bound `lipschitz` may take the numbers
    alone. `declared` are the names of the parameters that formulas take, None for other numbers.
    """
    first, *names = source.parameters or {"": None}
    if source.parameters.get(first) is not wp.vec3:
        raise source.refusal("expected the point `q: wp.vec3` as its first parameter")
    if declared is not None and names != [*declared]:
        raise source.refusal(
            f"expected the parameters of the class, {', '.join(declared) or 'none'}, behind the point; "
            f"got {', '.join(names) or 'none'}"
        )
    own = [_plain(kind) for kind in number_types(source, 1).values()]
    for name, part in given.items():
        front, types = leading.get(name, {}), [_plain(kind) for kind in part.parameters.values()]
        alone = name == "lipschitz" and types == own
        if part is not source and not alone and types != [*front.values(), *own]:
            wanted = ", ".join([*(f"{key}: {spelled(kind)}" for key, kind in front.items()), *names])
            raise source.refusal(
                f"{name}: expected a function of ({wanted}), got one of ({', '.join(part.parameters)})"
            )


def _plain(kind: Any) -> Any:
    """Return the type that Warp takes for a Python number."""
    return {float: wp.float32, int: wp.int32}.get(kind, kind)


def named_values(types: Mapping[str, Any], numbers: Sequence[float]) -> dict[str, Any]:
    """Return numbers that lie one after the other as values of their types, by name."""
    found: dict[str, Any] = {}
    for name, kind in types.items():
        taken, numbers = tuple(numbers[: SIZES[kind]]), numbers[SIZES[kind] :]
        if taken:
            found[name] = taken if SIZES[kind] > 1 else int(taken[0]) if kind in (wp.int32, int) else taken[0]
    return found


@dataclass(frozen=True)
class Reader:
    """Where the numbers that a kind's formulas take lie on the tape: one after the other."""

    kind: str
    digest: str
    numbers: dict[str, Any]
    """Their types, by name."""
    first: int = 0
    """Place of the first, in floats."""
    named: dict[str, int] = field(default_factory=dict)
    """Places of numbers that stand elsewhere, by name, in floats."""
    taken: int = -1
    """A place that they leave out."""
    module: str = ""
    """Name of the module of what is written, for a kind of this package."""

    @property
    def places(self) -> dict[str, list[int]]:
        """The places of the components of each number."""
        places, place = {}, self.first
        for name, kind in self.numbers.items():
            if name in self.named:
                places[name] = [self.named[name]]
                continue
            places[name] = []
            for _ in range(SIZES[kind]):
                place += place == self.taken
                places[name].append(place)
                place += 1
        return places

    @property
    def texels(self) -> int:
        """The number of texels up to the last number."""
        last = max(
            [self.first - 1, self.taken, *(place for found in self.places.values() for place in found)]
        )
        return last // 4 + 1

    @property
    def readings(self) -> list[str]:
        """The expressions of the numbers."""
        found = []
        for name, places in self.places.items():
            kind = self.numbers[name]
            parts = ", ".join(f"t{place // 4}[{place % 4}]" for place in places)
            if SIZES[kind] > 1:
                parts = f"wp.vec{SIZES[kind]}({parts})"
            found.append(f"int({parts})" if kind in (wp.int32, int) else parts)
        return found

    def call(self, formula: Formula, *leading: str) -> str:
        """Return the call of a formula with leading arguments, and with the numbers if it takes any."""
        rest = self.readings if len(formula.parameters) > len(leading) else []
        return f"{formula.function.key}({', '.join([*leading, *rest])})"

    def around(
        self, part: str, formula: Formula, leading: dict[str, Any], returns: Any, *arguments: str
    ) -> wp.Function:
        """Return the typed function that calls a formula with arguments in front of the numbers."""
        lines = f"    return {self.call(formula, *arguments)}\n"
        return self.written(part, leading, returns, lines, formula.function)

    def derivative(self, formula: Formula, point: str) -> tuple[str, wp.Function]:
        """Return the call of the value and the derivatives of a formula along the axes, and its function."""
        partials = partial_derivatives(formula.function, [next(iter(formula.parameters))])
        return f"{partials.key}({', '.join([point, *self.readings])})", partials

    def written(
        self,
        part: str,
        leading: dict[str, Any],
        returns: Any,
        lines: str,
        *called: wp.Function,
        tape_first: bool = False,
    ) -> wp.Function:
        """Return the typed function of some lines, which read texels t0, t1 and so on."""
        typed = [f"{name}: {spelled(kind)}" for name, kind in leading.items()]
        place = ["tape: wp.array(dtype=wp.vec4)", "at: wp.int32"]
        parameters = ", ".join(place + typed if tape_first else typed + place)
        text = f"def {{name}}({parameters}) -> {spelled(returns)}:\n"
        reads = "".join(f"    t{i} = tape[at + {i}]\n" for i in range(self.texels) if f"t{i}[" in lines)
        scope: dict[str, Any] = {function.key: function for function in called}
        if self.module:
            scope["__name__"] = self.module
        return generated(self.kind, self.digest, part, text + reads + lines, scope)


@dataclass(frozen=True)
class PointFormulas:
    """The formulas of a kind that take a point and then the same numbers; one of them is its `source`."""

    kind: str
    given: Mapping[str, Formula]
    sources: ClassVar[tuple[str, ...]]
    """Names of formulas of which a kind has one."""

    @property
    def source(self) -> Formula:
        """The formula that all others belong to."""
        return next(self.given[name] for name in self.sources if name in self.given)

    @property
    def numbers(self) -> dict[str, Any]:
        """The types of the numbers that the formulas take, by name."""
        return number_types(self.source, 1)

    def reader(self, digest: str, first: int = 0, **places: Any) -> Reader:
        """Return the reader of the numbers; what it writes for a kind of this package is in its module."""
        module = "" if digest else self.source.python.__module__
        return Reader(self.kind, digest, self.numbers, first, module=module, **places)
