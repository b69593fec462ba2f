"""Custom warps: fields against float64, bounds, meshes, rays, files, and refused definitions."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from blobtree import Point, Segment, formula
from blobtree._typing import Float64Array
from blobtree.custom import define_warp
from blobtree.errors import InvalidDefinition, InvalidNode
from tests.blobtree.custom.warp_kernels import (
    Swirl,
    broken,
    flat,
    folded,
    same_size,
    sway,
    sway_stretch,
    torn,
    wrong_pullback,
    wrong_stretch,
)
from tests.blobtree.custom_kinds import SWAY_LIMITS as LIMITS
from tests.blobtree.custom_kinds import GivenSway, Sway
from tests.conformance import broken_laws
from tests.oracles import blobtree as oracle
from tests.soundness import failures_of

ROD = Segment((0.2, 0, -2), (0.2, 0, 2), radius=0.3)
TREES = {
    "sway": Sway(ROD, 0.4, 2.0),
    "nested": Swirl(Sway(ROD, 0.4, 2.0) + Point((0.5, 0, 0), radius=0.4), (0.1, 0, 0.5), 3).twist(20),
}


def swayed(q: Float64Array) -> Float64Array:
    return q - 0.4 * np.stack([np.sin(2.0 * q[:, 2]), 0 * q[:, 0], 0 * q[:, 0]], axis=1)


def test_values_and_gradients_match_float64_with_derived_and_given_jacobians() -> None:
    points = np.random.default_rng(0).uniform((-1, -1, -2.5), (1, 1, 2.5), (300, 3))
    expected = oracle.value(ROD, swayed(points))
    step = 1e-6 * np.eye(3)
    slopes = [(oracle.value(ROD, swayed(points + h)) - oracle.value(ROD, swayed(points - h))) for h in step]
    for node in (Sway(ROD, 0.4, 2.0), GivenSway(ROD, 0.4, 2.0)):
        np.testing.assert_allclose(node(points), expected, atol=1e-5)
        np.testing.assert_allclose(node.gradient(points), np.stack(slopes, axis=1) / 2e-6, atol=2e-3)


@pytest.mark.parametrize("name", TREES)
def test_bounds_boxes_meshes_and_rays_agree_with_the_field(name: str) -> None:
    tree, rng = TREES[name], np.random.default_rng(1)
    laws = ("single precision", "gradient", "interval", "Lipschitz bound", "box", "file", "pickle")
    assert broken_laws(tree, rng, *laws, known=None) == []
    assert failures_of(tree, rng) == []


def test_the_same_definition_is_the_same_class() -> None:
    assert "Sway(width=0.4, rate=2.0)" in str(TREES["sway"])
    assert define_warp(sway, stretch=sway_stretch, box=0.5, limits=LIMITS) is Sway


def test_parameters_are_checked() -> None:
    with pytest.raises(InvalidNode, match=r"width: expected a number from -0\.5 to 0\.5"):
        Sway(ROD, 0.6, 1.0)
    with pytest.raises(InvalidNode, match="expected BlobTree nodes"):
        Sway(3, 0.1, 1.0)


def refused(**changed: Any) -> Any:
    """Define a class like `Swirl` with one change."""
    kind: Any = type(Swirl)
    return kind("Refused", (Swirl,), {"__module__": __name__, **changed})


REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "flat": (lambda: define_warp(flat, stretch=1.0, box=9.0), "its Jacobian is singular"),
    "folded": (lambda: define_warp(folded, stretch=9.0, box=99.0), "its Jacobian is singular"),
    "torn": (lambda: define_warp(torn, stretch=1.0, box=1.0), "lipschitz: .* it may jump between them"),
    "broken": (lambda: define_warp(broken, stretch=1.0, box=1.0), "broken: for "),
    "steep": (
        lambda: define_warp(sway, stretch=1.01, box=0.5, limits=LIMITS, name="s"),
        "lipschitz: the norm",
    ),
    "small box": (
        lambda: define_warp(sway, stretch=sway_stretch, box=0.1, limits=LIMITS, name="s"),
        "motion: .* does not hold it",
    ),
    "wrong pullback": (
        lambda: define_warp(
            sway, stretch=sway_stretch, box=0.5, pullback=wrong_pullback, limits=LIMITS, name="s"
        ),
        "pullback: for q",
    ),
    "no stretch": (lambda: define_warp(sway, stretch=0.0, box=0.5), "lipschitz: expected a number above 0"),
    "no box": (lambda: define_warp(sway, stretch=9.0, box="big"), "motion: expected a distance from 0"),
    "other parameters": (
        lambda: define_warp(sway, stretch=wrong_stretch, box=0.5),
        "lipschitz: expected a function of",
    ),
    "own small box": (
        lambda: refused(outer_box=classmethod(lambda _cls, lower, upper, **_: (lower, upper))),
        "outer_box: .* does not hold it",
    ),
    "small image": (lambda: refused(image_box=formula(same_size)), "image_box: the images of"),
    "too few numbers": (
        lambda: refused(numbers=classmethod(lambda _cls, axis, turns: axis)),
        "numbers: expected 4 in all, got 3",
    ),
    "no point": (lambda: define_warp(sway_stretch, stretch=1.0, box=0.5), "expected it to return wp.vec3"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_wrong_definitions_are_refused(name: str) -> None:
    define, message = REFUSED[name]
    with pytest.raises(InvalidDefinition, match=message):
        define()
