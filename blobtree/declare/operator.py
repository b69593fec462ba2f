"""Operators from formulas: the row of an operator, with functions generated around its formulas."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import warp as wp

from blobtree.declare.claims import UNBOUNDED, Like, OperatorRow, widened_range
from blobtree.declare.formula import Formula, derived, generated, spelled
from blobtree.errors import InvalidNode
from blobtree.transpile.derivative import directional_derivative
from blobtree.transpile.specialize import parameter_count
from blobtree.validation import positive_number

LEAST_OPERAND = 1e-18
"""Operands below are raised to it where partial derivatives are derived: quotients of them stay finite."""

TEXEL = 4
"""Numbers of a texel."""

RESULTS: dict[str, Any] = {
    "value": wp.float32,
    "partials": wp.vec3,
    "lipschitz": wp.vec2,
    "slope": wp.float32,
    "interval": wp.vec2,
    "keeps": wp.int32,
    "envelope": wp.vec2,
}
"""The formulas of an operator, and the types of their results."""

_NUMBERS = dict.fromkeys(("a", "b"), wp.float32)
_RANGES = dict.fromkeys(("a", "b"), wp.vec2)
_DIRECTIONS = dict.fromkeys(("direction_a", "direction_b"), wp.vec3)
_LEADING: dict[str, dict[str, Any]] = {
    "value": _NUMBERS,
    "partials": _NUMBERS,
    "lipschitz": _NUMBERS,
    "slope": dict.fromkeys(("rise", "most"), wp.vec2),
    "interval": _RANGES,
    "keeps": _RANGES,
    "envelope": _NUMBERS,
}
"""The parameters in front of those of the operator."""

_SLOPES = dict.fromkeys(("slope_a", "slope_b", "max_a", "max_b"), wp.float32)
"""What a row's function of the slope takes in place of `rise` and `most`."""

_PARAMETER = {"parameter": wp.float32}
_BEHIND: dict[str, dict[str, Any]] = {
    "value": _DIRECTIONS,
    "partials": _DIRECTIONS,
    "slope": {"turn": wp.float32},
}
"""What these functions also take for an operator that reads gradients; formulas take it before parameters."""


@dataclass(frozen=True)
class _Shape:
    """What a claim `like` implies."""

    absent: str
    """Lines that return the exact result where an operand is absent."""
    alone: str
    """Lines that return the slope where the result does not depend on the gradient of an absent operand."""
    corners: tuple[str, str] = ("a[0], b[0]", "a[1], b[1]")
    """Operands of the smallest and of the largest F, where it is monotone."""


_KEEP_A = "    if b <= 0.0:\n        return wp.vec3(a, 1.0, 0.0)\n"
_KEEP_B = "    if a <= 0.0:\n        return wp.vec3(b, 0.0, 1.0)\n"
_NOTHING = "    if {}:\n        return wp.vec3(0.0, 0.0, 0.0)\n"
_SLOPE_ALONE = "    if {}:\n        return {}\n"
_SHAPES: dict[str | None, _Shape] = {
    "blend": _Shape(
        _KEEP_A + _KEEP_B,
        _SLOPE_ALONE.format("max_b <= 0.0", "slope_a") + _SLOPE_ALONE.format("max_a <= 0.0", "slope_b"),
    ),
    "intersection": _Shape(
        _NOTHING.format("a <= 0.0 or b <= 0.0"),
        _SLOPE_ALONE.format("max_a <= 0.0 or max_b <= 0.0", "0.0"),
    ),
    "difference": _Shape(
        _NOTHING.format("a <= 0.0") + _KEEP_A,
        _SLOPE_ALONE.format("max_a <= 0.0", "0.0") + _SLOPE_ALONE.format("max_b <= 0.0", "slope_a"),
        ("a[0], b[1]", "a[1], b[0]"),
    ),
    None: _Shape(
        _NOTHING.format("a <= 0.0 and b <= 0.0"),
        _SLOPE_ALONE.format("max_a <= 0.0 and max_b <= 0.0", "0.0"),
    ),
}

_WITH_PARTIALS = '''\
def {name}({typed}) -> wp.vec3:
    """The operator and its partial derivatives."""
    if {a} <= 0.0 and {b} <= 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    value, by_a, by_b = {partials}
    return wp.vec3(value, by_a, by_b)
'''

_SLOPE = """\
    k = {lipschitz}
    return k[0] * wp.max(slope_a, 0.0) + k[1] * wp.max(slope_b, 0.0)
"""
"""|F'| ≤ |∂F/∂a| |a'| + |∂F/∂b| |b'|; an operand that falls makes no F rise that rises with it."""

_RANGE = """\
    max_a = a[1]
    max_b = b[1]
    k = {lipschitz}
    middle = {partials}(0.5 * (a[0] + a[1]), 0.5 * (b[0] + b[1]){passed})[0]
    change = 0.5 * (k[0] * (a[1] - a[0]) + k[1] * (b[1] - b[0]))
    return widened_range(middle - change, middle + change)
"""
"""From the middle of the operands' ranges F changes no faster than the Lipschitz bounds say."""

_ENVELOPE = """\
    if a[1] <= 0.0 and b[1] <= 0.0:
        return wp.vec2(0.0, 0.0)
    return widened_range({envelope}({low}{extra})[0], {envelope}({high}{extra})[1])
"""
"""The envelope is monotone, so its extremes lie at corners."""


@dataclass(frozen=True)
class Claims:
    """What an operator claims besides its formulas."""

    like: Like | None
    monotone: bool
    associative: bool
    lipschitz: Any = None
    paints: bool = True
    signed: bool = False


@dataclass(frozen=True)
class OperatorFormulas:
    """The formulas of an operator, whose row they make."""

    kind: str
    given: Mapping[str, Formula]
    claims: Claims

    @property
    def source(self) -> Formula:
        """The formula of the field: `partials`, or `value`."""
        return self.given.get("partials") or self.given["value"]

    @property
    def reads_gradients(self) -> bool:
        """True if the formula has the gradients of both operands as its third and fourth parameter."""
        return list(self.source.parameters.values())[2:4] == [wp.vec3, wp.vec3]

    @property
    def names(self) -> list[str]:
        """The names of the operator's own parameters."""
        return list(self.source.parameters)[4 if self.reads_gradients else 2 :]

    def partials(self) -> Formula:
        """Return the formula of the value and the partial derivatives, derived from `value` if need be."""
        if "partials" in self.given:
            return self.given["partials"]
        a, b = list(self.source.parameters)[:2]
        template = _WITH_PARTIALS.replace("{a}", a).replace("{b}", b)
        return derived(self.source, (a, b), template, LEAST_OPERAND)

    def require(self, names: Sequence[str] | None) -> None:
        """Raise `InvalidDefinition` for formulas or claims that do not fit each other.

        `names` are those of the parameters that the class declares.
        """
        source, claims = self.source, self.claims
        names = names or ()
        if len(self.given.keys() & {"value", "partials"}) == 2:
            raise source.refusal("expected one of the formulas `value` and `partials`, got both")
        hints = [wp.float32 if hint is float else hint for hint in source.parameters.values()]
        gradients = ", gradient_a: wp.vec3, gradient_b: wp.vec3" if self.reads_gradients else ""
        leading = [wp.float32, wp.float32, *[wp.vec3] * (2 if gradients else 0)]
        if hints[:2] != leading[:2] or any(hint is not wp.float32 for hint in hints[len(leading) :]):
            raise source.refusal(
                f"expected (a: wp.float32, b: wp.float32{gradients}), and parameters of type wp.float32"
            )
        if self.names != list(names):
            raise source.refusal(
                f"expected the parameters of the class, {', '.join(names) or 'none'}, behind the operands; "
                f"got {', '.join(self.names) or 'none'}"
            )
        for name, part in self.given.items():
            wanted = [*_LEADING[name].values(), *[wp.float32] * len(names)]
            types = [wp.float32 if hint is float else hint for hint in part.parameters.values()]
            if part is not source and types != wanted:
                raise part.refusal(
                    f"{name}: expected ({', '.join([*_LEADING[name], *names])}) of the same types as "
                    f"{source.python.__name__}"
                )
        if claims.like is not None and claims.like not in get_args(Like):
            known_likes = ", ".join(map(repr, get_args(Like)))
            raise source.refusal(f"like: expected one of {known_likes} or None, got {claims.like!r}")
        if claims.associative and claims.like == "difference":
            raise source.refusal("associative: a difference depends on the order of its operands")
        if gradients:
            self._require_envelope()
        else:
            self._require_bound()

    def _require_envelope(self) -> None:
        others = {"lipschitz", "slope", "interval"} & self.given.keys()
        if others or self.claims.lipschitz is not None or "envelope" not in self.given:
            raise self.source.refusal(
                "gradients: expected envelope, a formula of the smallest and largest F, and no lipschitz, "
                "slope or interval"
            )
        if self.claims.monotone or self.claims.associative:
            raise self.source.refusal(
                "an operator that reads gradients can claim neither `monotone` nor `associative`"
            )
        directional_derivative(
            self.partials().function, list(self.source.parameters)[:4]
        )  # or refuse it here

    def _require_bound(self) -> None:
        claim, source = self.claims.lipschitz, self.source
        if "envelope" in self.given:
            raise source.refusal("envelope: it is for operators that read gradients; give `lipschitz`")
        if claim is not None:
            try:
                positive_number("lipschitz", claim)
            except InvalidNode as error:
                raise source.refusal(str(error)) from None
        elif not {"lipschitz", "slope"} & self.given.keys():
            raise source.refusal("lipschitz: expected a bound on the partial derivatives, got none")

    def digest(self, parameters: Sequence[Any]) -> str:
        """Return a digest of the formulas, the claims, and the declared parameters."""
        bound = self.given.get("lipschitz") or self.given.get("envelope")
        claim = None if self.claims.lipschitz is None else float(self.claims.lipschitz)
        more = {
            name: self.given[name].digest for name in ("slope", "interval", "keeps") if name in self.given
        }
        return self.source.digest_with(
            self.kind,
            tuple(parameters),
            bound.digest if bound else claim,
            self.claims.like,
            self.claims.monotone,
            self.claims.associative,
            *(["gradients"] * self.reads_gradients),
            *more,
            *(["paints no"] * (not self.claims.paints)),
        )

    def row(self, digest: str = "") -> OperatorRow:
        """Return the row of the operator; one with a digest is a user's.

        A user's partial derivatives, and derived ones, are made exact where an operand is absent.
        """
        claims, shape = self.claims, _SHAPES[self.claims.like]
        module = {} if digest else {"__name__": self.source.python.__module__}
        rows = _Functions(self.kind, digest, len(self.names), self.reads_gradients, module)
        partials = rows.around(
            "partials", self.partials(), shape.absent if digest or "value" in self.given else ""
        )
        lipschitz, bound = self._lipschitz(rows.extra)
        if "slope" in self.given:
            slope = rows.around("slope", self.given["slope"])
        elif rows.gradients:
            slope = rows.written("slope", shape.alone + "    return UNBOUNDED\n", {"UNBOUNDED": UNBOUNDED})
        else:
            slope = rows.written("slope", _SLOPE.format(lipschitz=lipschitz), bound)
        scope = {"widened_range": widened_range, partials.key: partials, **bound}
        interval: wp.Function | None = None
        if "interval" in self.given:
            interval = rows.around("interval", self.given["interval"])
        elif rows.gradients:
            envelope = self.given["envelope"].function
            low, high = shape.corners
            lines = _ENVELOPE.format(envelope=envelope.key, low=low, high=high, extra=rows.extra)
            interval = rows.written("interval", lines, scope | {envelope.key: envelope})
        elif not claims.monotone:
            passed = "".join([", parameter", ", tape"][: parameter_count(partials) - 2])
            lines = _RANGE.format(lipschitz=lipschitz, partials=partials.key, passed=passed)
            interval = rows.written("interval", lines, scope)
        return OperatorRow(
            self.kind,
            partials,
            slope,
            claims.like,
            interval,
            rows.around("keeps", self.given["keeps"]) if "keeps" in self.given else None,
            commutes=claims.associative,
            monotone=claims.monotone and claims.like != "difference",
            paints=claims.paints,
            signed=claims.signed,
            gradients=rows.gradients,
            digest=digest,
        )

    def _lipschitz(self, extra: str) -> tuple[str, dict[str, Any]]:
        """Return the expression of the bounds of both partial derivatives, and what it calls."""
        if "lipschitz" in self.given:
            function = self.given["lipschitz"].function
            return f"{function.key}(max_a, max_b{extra})", {function.key: function}
        if self.claims.lipschitz is None and "slope" in self.given:
            function = self.given["slope"].function
            rises = ("1.0, 0.0", "0.0, 1.0")
            calls = [f"{function.key}(wp.vec2({x}), wp.vec2(max_a, max_b){extra})" for x in rises]
            return f"wp.vec2({', '.join(calls)})", {function.key: function}
        return "wp.vec2({0!r}, {0!r})".format(float(self.claims.lipschitz or 0.0)), {}


@dataclass(frozen=True)
class _Functions:
    """Functions of a row around formulas.

    One parameter is the number `parameter` itself; several are on the tape from texel `parameter` on.
    """

    kind: str
    digest: str
    count: int
    gradients: bool
    module: Mapping[str, str]
    """The name of their module, under ``__name__``, if it is not that of users' kinds."""

    @property
    def extra(self) -> str:
        """The expressions of the operator's parameters."""
        if self.count <= 1:
            return ", parameter" * self.count
        return "".join(f", tape[int(parameter) + {n // TEXEL}][{n % TEXEL}]" for n in range(self.count))

    def around(self, part: str, formula: Formula, before: str = "") -> wp.Function:
        """Return the function of a formula; itself if it reads no tape and no lines stand before."""
        behind = _BEHIND.get(part, {}) if self.gradients else {}
        leading = (
            ["wp.vec2(slope_a, slope_b)", "wp.vec2(max_a, max_b)"] if part == "slope" else _LEADING[part]
        )
        if not (self.digest or before or self.count > 1 or behind or part == "slope"):
            return formula.function
        call = f"{formula.function.key}({', '.join([*leading, *behind])}{self.extra})"
        return self.written(part, f"{before}    return {call}\n", {formula.function.key: formula.function})

    def written(self, part: str, lines: str, scope: dict[str, Any]) -> wp.Function:
        """Return the function of some lines."""
        leading = _SLOPES if part == "slope" else _LEADING[part]
        behind = _BEHIND.get(part, {}) if self.gradients else {}
        typed = [f"{name}: {spelled(kind)}" for name, kind in (leading | _PARAMETER).items()]
        typed += ["tape: wp.array(dtype=wp.vec4)"] * (self.count > 1 or bool(behind))
        typed += [f"{name}: {spelled(kind)}" for name, kind in behind.items()]
        text = f"def {{name}}({', '.join(typed)}) -> {spelled(RESULTS[part])}:\n{lines}"
        return generated(self.kind, self.digest, part, text, {**scope, **self.module})
