"""Custom decal fields and contact laws: g and h of the paper's equations as typed functions of the user.

`define_contact` checks both by samples before anything is compiled. The result stands for a contact mode: the
formulas of PRODUCT or MIN, in which g and h are exchanged. Warp's kernels and the shaders get copies of their
functions in which the callees are replaced, so all backends evaluate the same formulas.
"""

# mypy: disable-error-code="operator, arg-type, return-value, no-any-return"
# (kernel code is Python only in form: its names have Warp types)

from functools import partial
from types import FunctionType
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.declare.falloff import Falloff
from blobtree.declare.falloff_checks import check_falling, find_rim
from blobtree.declare.formula import Formula, formula_of, kind_name, result_of, shown
from blobtree.errors import InvalidDefinition, UnknownKind
from blobtree.formulas.falloffs import FALLOFF_NAMES
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.transpile.specialize import rebind, referenced_values, warp_function
from decals.errors import InvalidScene
from decals.field.contact import contact_push, push_of, rim_distance
from decals.field.radial import RIM_SQUARED
from decals.field.rules import LAWS, ContactLaw
from decals.record import NEIGHBOR_REACH, RIM_RADIUS, Contact, field_complement
from decals.validation import member

wp.set_module_options({"enable_backward": False})

SAMPLES = 1001
LAW_SAMPLES = 41
"""Numbers of samples of g, and of h along each axis."""

TOLERANCE = 1e-5
SINGLE_TOLERANCE = 1e-4
"""Largest error of a value, and largest difference between single and double precision."""

LEAST_FALL = 1e-7
"""Least fall of g between two samples inside the rim, so that it has an inverse there."""

LARGEST_FALL = 0.1
"""Largest fall of g between two samples inside the rim; more is a jump."""

LARGEST_CUT = 5e-3
"""Largest change of F by a neighbour beyond the reach of the index, which is left out."""

HALVINGS = 26
"""Steps of the bisection that inverts g: two more than a float32 has bits of precision."""

FIELD_SCALE = 1.0

Floats = NDArray[np.float64]


# -- formulas; `field_of` and `law_of` stand for the user's functions ------------------------------------


@wp.func
def field_of(d: wp.float32) -> wp.float32:
    """Return g(d); a law replaces this function."""
    return 1.0 - d


@wp.func
def law_of(own: wp.float32, other: wp.float32) -> wp.float32:
    """Return the factor h of equation 5 of the owner's field, above ½, and a lower one of a neighbour."""
    return 1.0 - wp.pow((own + other - 1.0) / (2.0 * own - 1.0), 1.0 / wp.max(1.0 - own, 1.0e-6))


@wp.func
def custom_complement(z: wp.float32) -> wp.float32:
    """Return 1 − g for z = d², with the rim of g at that of all decals; see `field_complement`."""
    d = FIELD_SCALE * wp.sqrt(z)
    if d >= 1.0:
        return 1.0
    return 1.0 - field_of(d)


@wp.func
def custom_push(e_i: wp.float32, e_k: wp.float32) -> wp.float32:
    """Return 1 − h of neighbour i on the owner k; see `contact_push`."""
    if e_i + e_k >= 1.0:
        return 0.0
    if e_i <= e_k:
        return 1.0
    own = 1.0 - e_k
    other = wp.max(1.0 - e_i, 1.0000002 - own)  # their sum stays above 1 when it is rounded
    return wp.clamp(1.0 - law_of(own, other), 0.0, 1.0)


@wp.func
def custom_push_of(
    e: wp.float32, least: wp.float32, per_span: wp.float32, per_least: wp.float32
) -> wp.float32:
    """Return 1 − h of a neighbour, 0 for the owner; see `push_of`, whose reciprocals are not needed."""
    if e <= least:
        return 0.0
    return custom_push(e, least)


@wp.func
def custom_rim_distance(complement: wp.float32) -> wp.float32:
    """Return the distance r/r_h with g(r) = 1 − E, by bisection; see `rim_distance`."""
    low = float(0.0)
    high = float(1.0)
    for _step in range(HALVINGS):
        middle = 0.5 * (low + high)
        if custom_complement(middle * middle * RIM_SQUARED) < complement:
            low = middle
        else:
            high = middle
    return high


REPLACED: dict[Any, Any] = {
    field_complement: custom_complement,
    contact_push: custom_push,
    push_of: custom_push_of,
    rim_distance: custom_rim_distance,
}
"""The formulas that a law replaces."""


class Formulas:
    """Copies of the formulas and kernels of decals with other functions g and h, for Warp and GLSL.

    Parameters
    ----------
    replacements
        Values for `field_of`, `law_of` and `FIELD_SCALE`.
    digest
        Digest of their sources, which names the Warp modules of the copies.
    """

    def __init__(self, replacements: dict[str, Any], digest: str) -> None:
        self._replacements, self._digest = replacements, digest
        self._copies: dict[Any, Any] = {}

    def copy_of(self, formula: Any) -> Any:
        """Return a formula or a kernel of decals with this law; itself if it does not depend on it."""
        if formula not in self._copies:
            self._copies[formula] = self._copy(REPLACED.get(formula, formula))
        return self._copies[formula]

    def _copy(self, typed: Any) -> Any:
        source: FunctionType = typed.func
        module = f"{source.__module__}.{source.__name__}_{self._digest}"
        replaced = {
            name: new
            for name, value in referenced_values(source).items()
            if (new := self._substitute(name, value)) is not value
        }
        if not replaced:
            return typed
        wp.get_module(module).options.update(KERNEL_OPTIONS)
        make = wp.kernel if isinstance(typed, wp.Kernel) else warp_function
        return make(rebind(source, replaced, module=module))

    def _substitute(self, name: str, value: Any) -> Any:
        if value is field_of or value is law_of or (name == "FIELD_SCALE" and value is FIELD_SCALE):
            return self._replacements[name]
        known = isinstance(value, wp.Function) and not value.is_builtin()
        return self.copy_of(value) if known else value


_FORMULAS: dict[str, Formulas] = {}
"""The formulas of all laws, by digest: laws with equal functions share what is compiled."""


def _unpickled(name: str, base: str, digest: str, module: str) -> ContactLaw:
    """Return the law of this name; import its module first if it is not defined yet."""
    if name not in LAWS and name in FALLOFF_NAMES:
        define_contact(name, combine=base)
    LAWS.load(name, module)
    if name not in LAWS or LAWS[name].digest != digest:
        known = "another contact law of this name" if name in LAWS else "none"
        raise UnknownKind(
            f"expected the contact law {name!r} of the pickle in this process, got {known}; import the "
            "module that defines it first"
        )
    return LAWS[name]


def define_contact(
    field: Any = "wyvill", law: Any = None, *, combine: Contact | str = "product", name: str | None = None
) -> ContactLaw:
    """Return a contact law from a decal field g and a factor h.

    Parameters
    ----------
    field : str, Falloff or typed function
        ``(d: wp.float32) -> wp.float32``: g(d) for 0 ≤ d ≤ 1, which falls from g(0) = 1 to g(1) = 0, and
        strictly inside its rim, where it is ½. The rim lies at the visible radius of each decal. Or a falloff
        of blobtree, such as ``"gaussian"``.
    law : typed function, optional
        ``(own: wp.float32, other: wp.float32) -> wp.float32``: the factor h of the owner's field f_k ≥ ½ and
        a neighbour's lower field f_i, where f_i + f_k > 1. It falls with `other` from 1 at f_i = 1 − f_k to 0
        at f_i = f_k, and is 1 where f_k = 1. Default: that of equation 5.
    combine : Contact or str
        PRODUCT or MIN, for several neighbours.
    name : str, optional
        Name in files. Default: that of `law`, or of `field`.

    Returns
    -------
    ContactLaw
        A value for ``contact``.

    Raises
    ------
    InvalidDefinition
        A function has no types or no source, or samples contradict the above. Nothing has been compiled.
    UntranslatableFunction
        A function leaves the shared subset; the message names file and line.
    InvalidScene
        `combine` is another mode.

    Examples
    --------
    >>> import warp as wp
    >>> import decals
    >>> @wp.func
    ... def cosine(d: wp.float32) -> wp.float32:
    ...     return 0.5 + 0.5 * wp.cos(3.14159265 * d)
    >>> law = decals.define_contact(cosine)
    >>> pair = decals.Decals([[-0.6, 0, 0], [0.6, 0, 0]], [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, 1.0)
    >>> decals.evaluate(pair, [[-0.1, 0, 0]], [[0, 0, 1]], contact=law).field.round(2)
    array([0.76], dtype=float32)
    """
    base = member("combine", combine, Contact, InvalidScene, (Contact.PRODUCT, Contact.MIN))
    if isinstance(field, str) and field not in FALLOFF_NAMES:
        raise InvalidDefinition(
            f"field: expected a typed function or one of {', '.join(FALLOFF_NAMES)}, got {field!r}"
        )
    falloff = FALLOFF_NAMES[field] if isinstance(field, str) else field
    g_source = formula_of(falloff.value if isinstance(falloff, Falloff) else falloff, returns=wp.float32)
    h_source = formula_of(law_of if law is None else law, returns=wp.float32)
    _require_floats(g_source, 1, "the distance `d: wp.float32` as its only parameter")
    _require_floats(h_source, 2, "the fields `own: wp.float32, other: wp.float32` as its parameters")
    given = falloff.name if isinstance(falloff, Falloff) else g_source.name
    default = given if law is None else h_source.name
    kind = kind_name(h_source, default if name is None else name)
    digest = g_source.digest_with(kind, h_source.digest, int(base))
    known = LAWS.get(kind)
    if known is not None and known.digest == digest:
        return known
    rim = _check_field(g_source)
    _check_law(h_source, g_source, rim)
    functions = {
        "field_of": g_source.function,
        "law_of": h_source.function,
        "FIELD_SCALE": rim / RIM_RADIUS,
    }
    own = g_source.digest_with(h_source.digest)
    formulas = _FORMULAS.setdefault(own, Formulas(functions, own))
    module = (g_source if law is None else h_source).python.__module__
    LAWS[kind] = ContactLaw(kind, base, rim, digest, formulas, _unpickled, module)
    return LAWS[kind]


def _require_floats(source: Formula, count: int, expected: str) -> None:
    if len(source.parameters) != count or not set(source.parameters.values()) <= {wp.float32, float}:
        raise source.refusal(f"expected {expected}")


def _sampled(source: Formula, *arguments: Floats, single: bool = False) -> Floats:
    """Return the values of a function over arrays of arguments."""
    precision = np.float32 if single else np.float64
    reference = source.reference(precision)
    rows = [[precision(value) for value in row] for row in zip(*arguments, strict=True)]
    names = ", ".join(source.parameters)
    places = [partial(_place, f"({names})" if len(arguments) > 1 else names, row) for row in rows]
    values = [
        result_of(source, lambda *given: np.ravel(reference(*given)), row, place, 1)
        for row, place in zip(rows, places, strict=True)
    ]
    return np.ravel(values).astype(np.float64)


def _place(names: str, values: list[Any]) -> str:
    return f"{names} = {shown(values)}"


def _check_field(source: Formula) -> float:
    """Raise `InvalidDefinition` if samples show that g is no field of decals; return its rim."""
    distances = np.linspace(0.0, 1.0, SAMPLES)
    values = _sampled(source, distances)
    check_falling(source, distances, values, "the field of a decal")
    flat = (-np.diff(values) < LEAST_FALL) & (values[1:] > 0.45)
    if flat.any():
        raise source.refusal(
            f"g is flat at d = {distances[int(flat.argmax())]:.6g}, inside its rim, "
            "so it has no inverse there; let it fall"
        )
    jumps = (-np.diff(values) > LARGEST_FALL) & (values[:-1] > 0.5)
    if jumps.any():
        place = int(jumps.argmax())
        raise source.refusal(
            f"g jumps from {values[place]:.6g} at d = {distances[place]:.6g} to {values[place + 1]:.6g}, "
            "inside its rim, so images have a gap there; let it fall more slowly"
        )
    single = _sampled(source, distances, single=True)
    if np.abs(single - values).max() > SINGLE_TOLERANCE:
        worst = int(np.abs(single - values).argmax())
        raise source.refusal(
            f"for d = {distances[worst]:.6g} it returns {single[worst]:.6g} in single precision, "
            f"{values[worst]:.6g} in double"
        )
    return find_rim(partial(_sampled, source))


def _check_law(law: Formula, field: Formula, rim: float) -> None:
    """Raise `InvalidDefinition` if samples of h contradict the constraints of the paper's section 3.2."""
    owns = np.linspace(0.5, 1.0, LAW_SAMPLES + 1)[1:-1]
    shares = np.linspace(0.0, 1.0, LAW_SAMPLES)
    own, share = (grid.ravel() for grid in np.meshgrid(owns, shares, indexing="ij"))
    other = 1.0 - own + share * (2.0 * own - 1.0)
    h = _sampled(law, own, other)

    def refuse(wrong: NDArray[np.bool_], expected: str) -> None:
        if wrong.any():
            row = int(wrong.argmax())
            raise law.refusal(f"h({own[row]:.6g}, {other[row]:.6g}) = {h[row]:.6g}, expected {expected}")

    refuse((h < -TOLERANCE) | (h > 1.0 + TOLERANCE), "a factor from 0 to 1")
    refuse((share == 0.0) & (np.abs(h - 1.0) > SINGLE_TOLERANCE), "1 where own + other = 1")
    refuse((share == 1.0) & (np.abs(h) > SINGLE_TOLERANCE), "0 where the fields are equal")
    rises = np.diff(h.reshape(len(owns), -1), axis=1, prepend=1.0).ravel() > TOLERANCE
    refuse(rises, "less than for a lower field of the neighbour")
    near = np.full(LAW_SAMPLES, 1.0 - 1e-4)
    inner = np.linspace(0.01, 0.9, LAW_SAMPLES)
    at_center = _sampled(law, near, inner)
    if np.abs(at_center - 1.0).max() > 0.01:
        worst = int(np.abs(at_center - 1.0).argmax())
        raise law.refusal(
            f"h({near[0]:g}, {inner[worst]:.3g}) = {at_center[worst]:.6g}, expected 1 at the owner's centre"
        )
    beyond = float(_sampled(field, np.array([min(NEIGHBOR_REACH * rim / RIM_RADIUS, 1.0)]))[0])
    pushing = owns[owns + beyond > 1.0]
    cut = (pushing - 0.5) * (1.0 - _sampled(law, pushing, np.full(len(pushing), beyond)))
    if cut.max(initial=0.0) > LARGEST_CUT:
        raise law.refusal(
            f"a neighbour 1.27 radii away changes F by {cut.max():.2g}, expected at most {LARGEST_CUT:g}; "
            "let h rise to 1 sooner, or g fall faster outside its rim"
        )
