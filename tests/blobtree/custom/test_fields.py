"""Custom direct fields: values, gradients, bounds, meshes, files, and what a definition is refused for."""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from blobtree import Node, check_kind, from_json, to_json
from blobtree._typing import Float32Array, Float64Array
from blobtree.custom import CustomField, define_field
from blobtree.errors import InvalidDefinition, InvalidFile, InvalidNode, UntranslatableFunction
from tests.blobtree.custom import field_kernels as kernels
from tests.blobtree.custom_kinds import Lump, Waves
from tests.oracles import direct_fields

LUMP = Lump((0.2, 0.0, 0.1), (3.0, 2.5, 3.0), (0.1, 0.2, 0.0), 0.6, color=(1, 0, 0))
WAVES = Waves((0.2, 0.0, 0.1), (3.0, 2.5, 3.0), 4.0, fade=0.4)
EACH = pytest.mark.parametrize("node", [LUMP, WAVES], ids=["lump", "waves"])


def value(node: Node, points: Float32Array | Float64Array) -> Float64Array:
    """The fields of LUMP and WAVES in float64."""
    assert isinstance(node, CustomField)
    q = points.astype(np.float64) - np.array(node.center)
    if node.kind == "lump":
        field = 1.0 / (
            1.0 + ((q - np.array(node.values["middle"])) ** 2).sum(axis=1) / node.values["breadth"] ** 2
        )
    else:
        rate = node.values["rate"]
        field = 0.5 + 0.25 * (np.sin(rate * q[:, 0]) + np.cos(rate * q[:, 1]))
    result: Float64Array = field * direct_fields.window(node, points.astype(np.float64))
    return result


@EACH
def test_all_laws_hold(node: Node) -> None:
    assert check_kind(type(node), value, sample=lambda _: node, samples=1, show=None).failed == ()


@EACH
def test_files_and_pickles_name_the_kind(node: CustomField) -> None:
    node = replace(node, weight=-0.5, attributes={"age": 3.0})
    assert from_json(to_json(node)) == node == pickle.loads(pickle.dumps(node))
    assert eval(repr(node), {"Lump": Lump, "Waves": Waves}) == node
    with pytest.raises(InvalidFile, match="import the module that defines it"):
        from_json(to_json(node).replace(f'"{node.kind}"'.encode(), b'"nothing"'))


def test_the_same_definition_is_the_same_class() -> None:
    again = define_field(kernels.lump, steepest=kernels.lump_slope, limits={"breadth": (0.1, None)})
    assert again is Lump


def test_parameters_of_a_leaf_are_checked() -> None:
    with pytest.raises(InvalidNode, match=r"breadth: expected a number from 0\.1"):
        Lump((0, 0, 0), (1, 1, 1), (0, 0, 0), 0.0)
    with pytest.raises(InvalidNode, match="offset: expected primitives with a radius, got a Waves"):
        WAVES.offset(0.1).tape  # noqa: B018


@pytest.mark.parametrize(
    ("function", "claims", "message"),
    [
        (kernels.negative, {"steepest": 1.0}, "negative, and a field is not"),
        (kernels.jumping, {"steepest": 1.0}, "claim a larger slope"),
        (kernels.waves, {"steepest": 0.1}, "more than lipschitz = 0.1 allows"),
        (kernels.not_finite, {"steepest": 1.0}, "not_finite: for q = .* it (fails|returns)"),
        (kernels.wrong_gradient, {"steepest": 1.0}, "∂f/∂x at .* by differences, but 1 is returned"),
        (kernels.returns_a_point, {"steepest": 1.0}, "expected it to return wp.float32"),
        (kernels.takes_no_point, {"steepest": 1.0}, "expected the point `q: wp.vec3`"),
        (
            kernels.takes_a_size,
            {"steepest": 1.0},
            "'size': every node of this sort has an attribute of that name",
        ),
        (kernels.imprecise, {"steepest": 2e6}, "in single precision"),
        (kernels.waves, {"steepest": -1.0}, "lipschitz: expected a number from 0"),
        (kernels.waves, {"steepest": float("nan")}, "lipschitz: expected a number from 0"),
        (kernels.waves, {"steepest": "steep"}, "or a typed function, got .steep."),
        (kernels.waves, {"steepest": kernels.of_other_parameters}, "lipschitz: expected a function of"),
        (
            kernels.waves,
            {"steepest": kernels.waves_slope, "interval": kernels.narrow_interval},
            "interval: f.* is not between 0.4 and 0.6",
        ),
        (kernels.waves, {"steepest": 1.0, "interval": kernels.waves_slope}, "expected it to return wp.vec2"),
        ("a wave", {"steepest": 1.0}, "write it with `def`"),
    ],
)
def test_wrong_definitions_are_refused(function: Any, claims: dict[str, Any], message: str) -> None:
    limits = {"rate": (-4.0, 4.0)} if function is kernels.waves else None
    with pytest.raises(InvalidDefinition, match=message):
        define_field(function, **claims, limits=limits, name="refused")


def test_a_function_outside_the_subset_is_refused() -> None:
    with pytest.raises(UntranslatableFunction, match="List expression"):
        define_field(kernels.makes_a_list, steepest=1.0)


def test_a_function_that_raises_is_refused() -> None:
    with pytest.raises(InvalidDefinition, match="divides_by_zero: for q = "):
        define_field(kernels.divides_by_zero, steepest=1.0)
