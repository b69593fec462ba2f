"""Derivatives of typed functions, against differences in float64; then in Warp, in GLSL and refused."""

import importlib.util
import inspect
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from blobtree.errors import UntranslatableFunction
from blobtree.tape import interpreter
from blobtree.tape.instruction_set import core, library
from blobtree.transpile.derivative import (
    derivative_along,
    differentiated,
    directional_derivative,
    is_differentiable,
    partial_derivatives,
)
from blobtree.transpile.derivative_rules import RULES
from blobtree.transpile.glsl import translate_library
from blobtree.transpile.python import plain_python, vector
from tests.blobtree.transpile import derivative_samples as samples
from tests.blobtree.transpile.warp_functions import python_function, typed_functions

STEP = 1e-6
SEEDS = range(8)
Numbers = NDArray[np.float64]

FORMULAS = [
    typed
    for name in ("formulas.falloff", "nodes.tree")
    for typed in typed_functions(import_module(f"blobtree.{name}"))
    if is_differentiable(typed.returned)
]
SAMPLES: list[Any] = [
    samples.real_functions,
    samples.more_functions,
    samples.vectors,
    samples.four,
    samples.loops,
    samples.unpacking,
    samples.calls,
    samples.fetches,
]


def random_value(hint: Any, rng: np.random.Generator) -> Any:
    if isinstance(hint, wp.array):
        texels = [vector(*texel) for texel in rng.normal(size=(12, 4))]
        texels[0][3] = 2.25  # an index
        return texels
    if hint is wp.int32:
        return int(rng.integers(2, 7))
    size = getattr(hint, "_length_", 1)
    return vector(*rng.uniform(0.05, 1.4, size)) if size > 1 else np.float64(rng.uniform(0.05, 1.4))


def moved(value: Any, tangent: Any, distance: float) -> Any:
    if isinstance(value, list):
        return [texel + distance * step for texel, step in zip(value, tangent, strict=True)]
    return value + distance * tangent


def check(
    function: Any, varying: tuple[str, ...] | None, seed: int, arguments: dict[str, Any] | None = None
) -> None:
    """Compare the derivative of a function with central differences, both as plain Python in float64."""
    rng = np.random.default_rng(seed)
    hints = dict(python_function(function).__annotations__)
    hints.pop("return")
    values = {name: random_value(hint, rng) for name, hint in hints.items()} | (arguments or {})
    names = varying or tuple(name for name, hint in hints.items() if is_differentiable(hint))
    tangents = {name: random_value(hints[name], rng) for name in names}
    for name in names:
        if isinstance(values[name], list):
            tangents[name][0][3] = 0.0
    plain: Callable[..., Any] = plain_python(python_function(function))
    derivative = directional_derivative(function, varying)
    assert differentiated(derivative) == (function, (frozenset(names),))
    both = [
        item
        for name in values
        for item in ([values[name], tangents[name]] if name in names else [values[name]])
    ]
    with np.errstate(all="ignore"):
        value, slope = plain_python(python_function(derivative))(*both)
        ends = [
            np.asarray(
                plain(*(moved(values[n], tangents[n], d) if n in names else values[n] for n in values))
            )
            for d in (STEP, -STEP)
        ]
        np.testing.assert_array_equal(value, plain(*values.values()))
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2.0 * STEP), rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("function", SAMPLES, ids=lambda function: function.key)
def test_derivatives_are_limits_of_differences(function: Any) -> None:
    for seed in SEEDS:
        check(function, None, seed)


def check_partials(function: Any, names: list[str], seed: int, **arguments: Any) -> None:
    """Compare partial derivatives in one pass with those along one axis after the other, bit by bit."""
    rng = np.random.default_rng(seed)
    hints = dict(python_function(function).__annotations__)
    hints.pop("return")
    values = {name: random_value(hint, rng) for name, hint in hints.items()} | arguments
    plain: Callable[..., Any] = plain_python(python_function(function))
    with np.errstate(all="ignore"):
        value, *slopes = plain_python(python_function(partial_derivatives(function, names)))(*values.values())
        np.testing.assert_array_equal(value, plain(*values.values()))
        along = []
        for name in names:
            derivative = plain_python(python_function(directional_derivative(function, [name])))
            size = getattr(hints[name], "_length_", 1)
            for tangent in [vector(*row) for row in np.eye(size)] if size > 1 else [np.float64(1.0)]:
                both = [[values[n], tangent] if n == name else [values[n]] for n in values]
                along.append(derivative(*(item for items in both for item in items))[1])
    np.testing.assert_array_equal(slopes, along)


@pytest.mark.parametrize("function", SAMPLES, ids=lambda function: function.key)
def test_partial_derivatives_are_those_along_the_axes(function: Any) -> None:
    hints = python_function(function).__annotations__
    names = [name for name, hint in hints.items() if name != "return" and is_differentiable(hint)]
    for seed in SEEDS[:2]:
        check_partials(function, names, seed)
        check_partials(function, names[-1:], seed)


def test_partial_derivatives_compute_the_value_once() -> None:
    text = inspect.getsource(
        python_function(derivative_along(samples.counted, (frozenset("x"), frozenset("y"))))
    )
    assert text.count("wp.exp(") == 1
    assert text.count("inner_along_u_and_v(") == 1


def test_partial_derivatives_by_what_has_none_are_refused() -> None:
    for names in ([], ["turns"], ["missing"]):
        with pytest.raises(UntranslatableFunction, match="expected names of floats or vectors"):
            partial_derivatives(samples.loops, names)


def test_one_parameter_may_vary_alone() -> None:
    for seed in SEEDS:
        check(samples.vectors, ("w",), seed)
        check(samples.calls, ("x",), seed)
        check(samples.fetches, ("tape",), seed)
        check(samples.fetches, ("tape", "q"), seed)


def test_every_rule_is_tested() -> None:
    text = Path(samples.__file__).read_text(encoding="utf-8")
    for name in RULES:
        sign = {"negative": " -v"}.get(name, f" {name} ")
        assert f"wp.{name}(" in text or sign in text, name


@pytest.mark.parametrize("typed", FORMULAS, ids=lambda typed: typed.name)
def test_formulas_have_derivatives(typed: Any) -> None:
    for seed in SEEDS:
        exponent = {"exponent": 2.5} if "exponent" in typed.parameters else {}
        check(typed.function, None, seed, exponent)
    names = [name for name, hint in typed.parameters.items() if is_differentiable(hint)]
    check_partials(typed.function, names, SEEDS[0], **exponent)


OPERATOR_ROWS = [row for row in library().operators if not row.gradients]


@pytest.mark.parametrize("row", OPERATOR_ROWS, ids=lambda row: row.name)
def test_partials_written_by_hand_are_those_of_the_engine(row: Any) -> None:
    """The value is the first of three numbers that a row returns, so its derivatives are the other two."""
    tape = [vector(0.4, 0.3, 0.2, 0.1)] * 4
    partials = plain_python(python_function(partial_derivatives(row.partials, ["a", "b"])))
    count = len(inspect.signature(python_function(row.partials)).parameters)
    for a, b in np.random.default_rng(6).uniform(0.0, 1.0, (40, 2)):
        for parameter in (1.0, 2.5):
            with np.errstate(all="ignore"):
                result, by_a, by_b = partials(*(a, b, parameter, tape)[:count])
            np.testing.assert_allclose([by_a[0], by_b[0]], result[1:], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("row", library().falloffs, ids=lambda row: row.name)
def test_slopes_of_falloffs_are_those_of_the_engine(row: Any) -> None:
    derived = plain_python(python_function(partial_derivatives(row.value)))
    slope = plain_python(python_function(row.slope))
    for d in np.linspace(0.0, 1.0, 57)[:-1]:
        np.testing.assert_allclose(derived(d)[1], slope(d), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("skeleton", core().skeletons, ids=lambda skeleton: skeleton.name)
def test_skeletons_have_derivatives(skeleton: Any) -> None:
    for seed in SEEDS:
        check(skeleton.closest, ("q",), seed, {"at": 1})
        check(skeleton.closest, ("q", "tape"), seed, {"at": 1})
        check(skeleton.min_influence, ("tape",), seed, {"at": 1})


def test_a_derivative_can_be_differentiated_again() -> None:
    first = directional_derivative(samples.real_functions, ["x"])
    second = plain_python(python_function(directional_derivative(first, ["x"])))
    plain = plain_python(python_function(first))
    for x in np.linspace(0.15, 1.3, 7):
        value, slope, same_slope, curvature = second(x, 1.0, 1.0, 0.8)
        assert (value, slope) == plain(x, 1.0, 0.8)
        assert slope == same_slope
        ends = [plain(x + d, 1.0, 0.8)[1] for d in (STEP, -STEP)]
        np.testing.assert_allclose(curvature, (ends[0] - ends[1]) / (2.0 * STEP), rtol=1e-6)


def test_slopes_are_finite_where_functions_have_none() -> None:
    derivative = plain_python(python_function(directional_derivative(samples.vectors)))
    zero, one = vector(0.0, 0.0, 0.0), vector(1.0, 1.0, 1.0)
    with np.errstate(all="ignore"):
        assert np.isfinite(derivative(zero, one, zero, one, 0.0, 1.0)).all()


def random_source(rng: np.random.Generator, name: str) -> str:
    """Return a typed function of random expressions in branches and loops."""

    def scalar(depth: int) -> str:
        if depth == 0:
            return str(rng.choice(["x", "y", "s", "v[0]", "v.z", "0.7", "w[i % 3]"]))
        a, b = scalar(depth - 1), scalar(depth - 1)
        forms = [
            f"({a} + {b})",
            f"({a} - {b} * 0.3)",
            f"{a} * {b}",
            f"{a} / ({b} * {b} + 1.0)",
            f"wp.sin({a})",
            f"wp.max({a}, {b})",
            f"wp.dot({vectors(depth - 1)}, {vectors(depth - 1)})",
            f"wp.length({vectors(depth - 1)})",
            f"wp.where({a} > {b}, {a}, {b} * {b})",
            f"({a} if {b} > 0.3 else {b})",
            f"wp.sqrt({a} * {a} + 0.2)",
        ]
        return str(rng.choice(forms))

    def vectors(depth: int) -> str:
        if depth == 0:
            return str(rng.choice(["v", "w"]))
        a, b = vectors(depth - 1), vectors(depth - 1)
        forms = [f"wp.cross({a}, {b})", f"({a} - {b})", f"{a} * {scalar(depth - 1)}", f"wp.normalize({a})"]
        return str(rng.choice([*forms, f"wp.vec3({scalar(depth - 1)}, 1.0, {scalar(depth - 1)})"]))

    return f"""
@wp.func
def {name}(x: wp.float32, y: wp.float32, v: wp.vec3, n: wp.int32) -> wp.vec3:
    i = 0
    s = float(0.5)
    w = wp.vec3(0.3, 0.2, 0.1)
    for i in range(n):
        s = 0.5 * s + wp.sin({scalar(2)})
        if {scalar(1)} > {scalar(1)}:
            w = w * 0.5 + wp.normalize({vectors(2)})
        else:
            w[1] = wp.cos({scalar(2)})
        w[i % 3] += 0.1 * s
    return w * wp.cos({scalar(3)}) + wp.normalize({vectors(3)})
"""


def module_of(text: str, path: Path) -> ModuleType:
    path.write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_random_functions(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    sources = [random_source(rng, f"random_{number}") for number in range(25)]
    module = module_of("import warp as wp\n" + "".join(sources), tmp_path / "random_functions.py")
    for number in range(len(sources)):
        for seed in range(3):
            check(getattr(module, f"random_{number}"), None, seed)


def test_derivatives_are_translated_to_glsl() -> None:
    derivative = directional_derivative(samples.calls)
    text = translate_library([derivative])
    signature = (
        "void calls_along_v_x(float x, float d_x, vec3 v, vec3 d_v, out vec3 returned_0, out vec3 returned_1)"
    )
    assert signature in text
    assert "tuple" not in text


REFUSED = {
    "calls_the_unknown": ("return wp.erf", "wp.erf"),
    "raises_to_a_power": ("return x**2.0", "Pow"),
    "multiplies_lists": ("return sum", "sum is not known"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_derivative_is_refused_with_file_and_line(name: str) -> None:
    code, reason = REFUSED[name]
    lines = Path(samples.__file__).read_text(encoding="utf-8").splitlines()
    line = next(i + 1 for i, text in enumerate(lines) if text.strip().startswith(code))
    with pytest.raises(UntranslatableFunction, match=reason) as refusal:
        directional_derivative(getattr(samples, name))
    assert str(refusal.value).startswith(f"{samples.__file__}:{line}: ")


def test_parameters_that_cannot_vary_are_refused() -> None:
    with pytest.raises(UntranslatableFunction, match=r"expected names .* \(x, v\), got 'turns'"):
        directional_derivative(samples.loops, ["turns"])
    with pytest.raises(UntranslatableFunction, match="expected a parameter that varies, got none"):
        directional_derivative(samples.loops, [])
    with pytest.raises(UntranslatableFunction, match="got 'n'"):
        directional_derivative(samples.counts, ["n"])


def test_a_result_that_does_not_vary_has_the_derivative_0() -> None:
    derivative = plain_python(python_function(directional_derivative(samples.steps)))
    assert derivative(2.0, 1.0) == (1.0, 0.0)


def test_equal_requests_return_one_function() -> None:
    first = directional_derivative(interpreter.field_gradient, ["q"])
    assert directional_derivative(interpreter.field_gradient, ("q",)) is first
    assert differentiated(interpreter.field_gradient) is None


def test_names_do_not_depend_on_where_packages_lie(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels of a wheel are compiled in one environment, and found in others by their names."""
    names = []
    for folder in ("/one", "/two"):
        monkeypatch.setattr(wp.__spec__, "origin", f"{folder}/warp/__init__.py")
        assert folder in repr(wp)
        names.append(derivative_along(samples.sine_of(samples.halved), (frozenset({"x"}),)).key)
    assert names[0] == names[1]
    assert derivative_along(samples.sine_of(samples.doubled), (frozenset({"x"}),)).key != names[0]
