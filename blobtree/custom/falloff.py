"""Custom falloffs: a falloff from one typed function of the normalised distance.

    @wp.func
    def tent(d: wp.float32) -> wp.float32:
        return 1.0 - d

    Tent = define_falloff(tent)
    model = Point((0, 0, 0), radius=1.0, falloff=Tent)

`blobtree.declare.falloff.Falloff` is the base of the class that it makes.
"""

from typing import Any

from blobtree.declare.falloff import Falloff
from blobtree.declare.formula import class_name, formula, python_function


def define_falloff(value: Any, slope: Any = None, *, name: str | None = None) -> Falloff:
    """Return a falloff from a function g: a short form of a subclass of `Falloff`.

    Parameters
    ----------
    value
        ``(d: wp.float32) -> wp.float32``, with or without ``@wp.func``: the formula `value`.
    slope
        The derivative g'(d), a function of the same type; by default it is derived from the source.
    name
        Name of the falloff in files; by default the name of `value`.

    Returns
    -------
    Falloff
        A value for the keyword `falloff` of primitives around a skeleton; so is its name.

    Raises
    ------
    InvalidDefinition
        See `Falloff`.
    UntranslatableFunction
        A function leaves the shared subset; the message names file and line.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import Point
    >>> from blobtree.custom import define_falloff
    >>> @wp.func
    ... def linear(d: wp.float32) -> wp.float32:
    ...     return 1.0 - d
    >>> falloff = define_falloff(linear)
    >>> round(falloff.rim, 6)
    0.5
    >>> Point((0, 0, 0), radius=1.0, falloff=falloff)
    Point(center=(0.0, 0.0, 0.0), radius=1.0, color=(0.8, 0.8, 0.8), falloff='linear')
    """
    python = python_function(value)
    tag = python.__name__ if name is None else name
    body = {"value": formula(value), "tag": tag, "__module__": python.__module__, "__doc__": python.__doc__}
    if slope is not None:
        body["slope"] = formula(slope)
    made: type[Falloff] = type(class_name(str(tag)), (Falloff,), body)
    return made()
