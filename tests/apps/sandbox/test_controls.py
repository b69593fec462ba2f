"""Controls of the sandbox: every parameter has one, and what a page sends back is the parameter's value."""

import importlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import decals
from blobtree import FALLOFF_NAMES, Node, Point, Polygon, Twist
from blobtree.custom import define_falloff
from blobtree.declare.parameters import parameters_of
from decals.apps.sandbox.controls import controls_of, hex_color, parsed, parsed_option
from decals.editing import new_nodes
from decals.errors import InvalidEdit

BALL = Point((1, 2, 3), radius=0.5, color=(1.0, 0.5, 0.0))
OPERANDS = BALL, Point((1.4, 2, 3), radius=0.4), Point((1, 2.4, 3), radius=0.4)
KINDS = list(new_nodes.built_in_kinds())


def made(name: str) -> Node:
    return new_nodes.new_node(name, OPERANDS[: new_nodes.operand_range(new_nodes.kinds()[name])[0]])


@pytest.mark.parametrize("name", KINDS)
def test_every_parameter_has_a_control_whose_value_comes_back(name: str) -> None:
    node = made(name)
    controls = {control["name"]: control for control in controls_of(node, 2.0)}
    assert list(controls) == [name for name in parameters_of(type(node)) if getattr(node, name) != {}]
    for control in controls.values():
        assert control["doc"]
        if control["kind"] == "text":
            continue
        value: Any = getattr(node, control["name"])
        sent = parsed(node, control["name"], control["value"])
        if control["kind"] == "color":
            assert sent == hex_color(value)
        elif control["kind"] == "choice":
            assert sent in control["choices"]
        else:
            assert sent == value


@pytest.mark.parametrize("name", KINDS)
def test_sliders_hold_the_value_and_stay_in_the_declared_range(name: str) -> None:
    node = made(name)
    for control in controls_of(node, 2.0):
        if control["kind"] != "number":
            continue
        parameter = parameters_of(type(node))[control["name"]]
        assert control["low"] < control["high"]
        assert parameter.low <= control["low"]
        assert control["high"] <= parameter.high
        assert control["value"] is None or control["low"] <= control["value"] <= control["high"]


def test_controls_of_a_ball() -> None:
    center, radius, color = controls_of(BALL, 2.0)[:3]
    assert (center["kind"], center["value"], center["unit"]) == ("vector", [1.0, 2.0, 3.0], "model units")
    assert (radius["kind"], radius["value"], radius["high"]) == ("number", 0.5, 2.0)
    assert (color["kind"], color["value"]) == ("color", "#ff8000")


def test_the_curve_of_a_falloff_falls_from_one_to_zero() -> None:
    for name, falloff in FALLOFF_NAMES.items():
        if falloff.digest:
            continue  # of another test
        node: Any = replace(BALL, falloff=name)
        text = next(control["curve"] for control in controls_of(node, 2.0) if control["name"] == "falloff")
        x, y = np.array([point.split(",") for point in text.split()], np.float64).T
        np.testing.assert_allclose((x[0], y[0], x[-1], y[-1]), (0, 0, 1, 1), atol=1e-3)
        assert (np.diff(y) >= 0).all()
        assert np.interp(falloff.rim, x, y) == pytest.approx(0.5, abs=0.02)


def test_a_falloff_whose_file_is_gone_has_no_curve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = ["import warp as wp", ""]
    for name, result in (("fading", "1.0 - d"), ("fading_slope", "-1.0")):
        lines += [f"def {name}(d: wp.float32) -> wp.float32:", f"    return {result}", ""]
    (tmp_path / "fading_module.py").write_text("\n".join(lines))
    monkeypatch.syspath_prepend(tmp_path)
    module = importlib.import_module("fading_module")
    falloff = define_falloff(module.fading, module.fading_slope)
    (tmp_path / "fading_module.py").unlink()
    controls = {control["name"]: control for control in controls_of(replace(BALL, falloff=falloff), 2.0)}
    assert (controls["falloff"]["value"], controls["falloff"]["curve"]) == ("fading", "")


def test_what_a_page_sends_is_parsed() -> None:
    square = Polygon(((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), radius=0.2)
    assert parsed(BALL, "radius", "0.75") == 0.75
    assert parsed(BALL, "width", "") is None
    assert parsed(square, "points", [["0", 1, "2.5"]]) == ((0.0, 1.0, 2.5),)
    assert parsed(new_nodes.new_node("Noise"), "seed", "7.0") == 7


@pytest.mark.parametrize(
    ("node", "name", "raw"),
    [
        (BALL, "radius", "thick"),
        (BALL, "radius", None),
        (BALL, "radius", "nan"),
        (BALL, "center", [0, "x", 0]),
        (BALL, "centre", 1),
        (BALL, 7, 1),
        (Twist(BALL, 20.0), "radius", 1),
        (new_nodes.new_node("Noise"), "seed", "inf"),
    ],
)
def test_wrong_values_are_refused(node: Node, name: Any, raw: Any) -> None:
    with pytest.raises(InvalidEdit, match="expected"):
        parsed(node, name, raw)


@pytest.mark.parametrize("raw", [1e308, "1e30", -(2**60), "many"])
def test_numbers_that_a_page_cannot_hold_are_refused(raw: Any) -> None:
    assert parsed_option(decals.scatter, "count", "12") == 12
    with pytest.raises(InvalidEdit, match="count: expected"):
        parsed_option(decals.scatter, "count", raw)
