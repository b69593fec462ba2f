"""Falloffs: how a field falls off with the distance. A falloff is a class with one formula."""

from dataclasses import Field
from typing import Any, ClassVar, Self, cast

import warp as wp

from blobtree.declare.falloff_checks import check_falloff, find_distance, find_numbers
from blobtree.declare.formula import (
    Formula,
    declared_formulas,
    derived,
    is_own,
    require_claims,
    tag_of,
)
from blobtree.declare.registry import LIBRARY_ROWS, Definitions, load_libraries
from blobtree.errors import InvalidDefinition
from blobtree.identity import content_hash
from blobtree.iso import ISO
from blobtree.lazy import Lazy

_SLOPE = '''\
def {name}({typed}) -> wp.float32:
    """The derivative of a falloff."""
    value, slope = {partials}
    return slope
'''


class Falloff:
    """A falloff: a field over the normalised distance d, which falls from g(0) = 1 to g(1) = 0.

    A falloff is a subclass with the formula ``value(d: wp.float32) -> wp.float32``, g(d) for 0 ≤ d ≤ 1, which
    never rises. A field is smooth where g'(0) = g'(1) = 0. The class attribute `tag` is its name in files; by
    default that is the name of the class, in lower case with underscores. Primitives take the class, or its
    name, as `falloff`. The names of all falloffs are in `FALLOFF_NAMES`. The class has one instance.

    Attributes
    ----------
    name
        Its name in files.
    value, slope
        Typed functions of the distance from 0 to 1: g ≥ 0 and g' ≤ 0. The formula `slope` is derived unless
        the class has it.
    rim
        The distance with g = ISO. A primitive of visible radius r reads the distance r there.
    steepest_distance
        Where the slope is steepest, if it rises up to there and falls after it; otherwise −1.
    steepest_slope
        A bound on the magnitude of the slope.
    digest
        Digest of the sources of a falloff that this package does not define.

    Raises
    ------
    InvalidDefinition
        At the definition of a subclass: it has no `value`, a formula has no types or no source, the name is
        that of a built-in falloff, or samples contradict the above. Nothing has been compiled by then.
    UntranslatableFunction
        A formula leaves the shared subset; the message names file and line.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import Falloff, Point, formula
    >>> class Ramp(Falloff):
    ...     @formula
    ...     def value(d: wp.float32) -> wp.float32:
    ...         return 1.0 - d
    >>> Point((0, 0, 0), radius=1.0, falloff=Ramp)
    Point(center=(0.0, 0.0, 0.0), radius=1.0, color=(0.8, 0.8, 0.8), falloff='ramp')
    >>> Point((0, 0, 0), radius=1.0, falloff="gaussian").falloff.name
    'gaussian'
    """

    name: ClassVar[str]
    digest: ClassVar[str] = ""
    value: ClassVar[wp.Function]
    _formulas: ClassVar[dict[str, Formula]]
    _instance: ClassVar["Falloff"]

    def __init_subclass__(cls) -> None:
        tag = tag_of(cls)
        cls._formulas = declared_formulas(cls, tag, {"value": wp.float32, "slope": wp.float32})
        fields = [name for name, value in vars(cls).items() if isinstance(value, Field)]
        if fields:
            raise InvalidDefinition(f"{cls.__qualname__}: {fields[0]!r}: a falloff has no parameters")
        if "value" not in cls._formulas:
            raise InvalidDefinition(f"{cls.__qualname__}: expected a falloff with the formula `value`")
        if not is_own(cls):
            require_claims(cls, "a falloff")
        cls.name = tag
        for name, declared in cls._formulas.items():
            setattr(cls, name, declared.function)
        falloff = object.__new__(cls)
        if is_own(cls):
            LIBRARY_ROWS.append(falloff)
        else:
            falloff = falloff._checked()
        cls._instance = FALLOFF_NAMES[cls.name] = falloff

    def __new__(cls) -> Self:
        """Return the instance of the class."""
        if cls is Falloff:
            raise TypeError("expected a subclass of Falloff with the formula `value`")
        return cast(Self, cls._instance)

    def __repr__(self) -> str:
        return repr(self.name)

    def __reduce__(self) -> tuple[Any, ...]:
        return unpickled, (self.name, type(self).__module__)

    @property
    def content_hash(self) -> str:
        """Content hash, see `blobtree.content_hash`: that of its name, and of the sources of a custom one."""
        return content_hash((Falloff.__name__, self.name, self.digest))

    @Lazy
    def _slope(self) -> Formula:
        value = self._formulas["value"]
        return self._formulas.get("slope") or derived(value, list(value.parameters), _SLOPE)

    @property
    def slope(self) -> wp.Function:
        """The derivative g'(d), a typed function."""
        return self._slope.function

    @Lazy
    def numbers(self) -> tuple[float, float, float]:
        """Rim, steepest distance and steepest slope, found from samples unless the class states them."""
        return find_numbers(self._formulas["value"], self._slope)

    @property
    def rim(self) -> float:
        """The distance with g = ISO."""
        return self.numbers[0]

    def at(self, distance: float) -> float:
        """Return g in double precision, also for distances below 0 or above 1."""
        return float(self._formulas["value"].reference()(min(max(distance, 0.0), 1.0)))

    def distance_of(self, level: float) -> float:
        """Return the distance with g = level, between 0 and 1."""
        return self.rim if level == ISO else find_distance(self.at, level)

    @property
    def steepest_distance(self) -> float:
        """Where the slope is steepest, −1 if it has several peaks."""
        return self.numbers[1]

    @property
    def steepest_slope(self) -> float:
        """A bound on the magnitude of the slope."""
        return self.numbers[2]

    def _checked(self) -> "Falloff":
        """Return a user's falloff after checks, or the known one of the same sources."""
        load_libraries()
        value, slope = self._formulas["value"], self._slope
        for source in (value, slope):
            if list(source.parameters.values()) not in ([wp.float32], [float]):
                raise source.refusal("expected the distance `d: wp.float32` as its only parameter")
        known = FALLOFF_NAMES.get(self.name)
        if known is not None and not known.digest:
            raise value.refusal(f"name: {self.name!r} is a built-in falloff; choose another name")
        type(self).digest = value.digest_with(self.name, slope.digest)
        if known is not None and known.digest == self.digest:
            return known
        if "numbers" in vars(type(self)):
            raise value.refusal("numbers: expected none, they are found from samples")
        check_falloff(value, slope)
        return self


FALLOFF_NAMES: Definitions[Falloff] = Definitions("falloff")
"""Every falloff by its name in files; the definition of a subclass adds to it."""


def unpickled(name: str, module: str) -> Falloff:
    """Return the falloff that a pickle names."""
    return FALLOFF_NAMES.unpickled(name, module)
