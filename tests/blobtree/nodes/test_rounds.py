"""Rounded operators: where their arcs end, what limits them, and the surfaces that they keep."""

from typing import Any

import numpy as np
import pytest

from blobtree import (
    Box,
    HalfSpace,
    Node,
    Point,
    RoundDifference,
    RoundIntersection,
    RoundUnion,
    Segment,
    Stroke,
    Union,
    from_json,
    polygonize,
    to_json,
)
from blobtree.errors import InvalidNode
from blobtree.nodes.rounds import field_at
from tests.rounded_widths import errors

EVERY_KIND = pytest.mark.parametrize("kind", [RoundUnion, RoundIntersection, RoundDifference])
FLOOR = HalfSpace((0, 0, 0), (0, 0, 1), 4.0, radius=0)
WALL = HalfSpace((0, 0, 0), (1, 0, 0), 4.0, radius=0)
SMALL, LARGE = Point((0, 0, 0), radius=0.2), Point((2, 0, 0), radius=1.0)


@pytest.mark.parametrize("seed", range(4))
def test_arcs_end_at_the_width_whatever_the_profiles(seed: int) -> None:
    assert max(error for _, error in errors(seed)) < 1e-3


def test_a_fillet_between_planes_is_an_arc() -> None:
    """Its surface is that of a circle but for the bend of the falloff."""
    blend = RoundUnion(FLOOR, WALL, 0.3)
    turns = np.radians(np.linspace(5.0, 85.0, 9))
    arc = 0.3 - 0.3 * np.column_stack([np.cos(turns), 0.0 * turns, np.sin(turns)])
    assert blend(arc) == pytest.approx(0.5, abs=0.01)


@EVERY_KIND
def test_a_width_scales_with_the_model(kind: Any) -> None:
    node, points = (
        kind(SMALL, LARGE.translate((-1, 0, 0)), 0.1),
        np.random.default_rng(0).uniform(-1, 2, (200, 3)),
    )
    larger = kind(SMALL.scale(3), LARGE.translate((-1, 0, 0)).scale(3), 0.3)
    assert larger(3 * points) == pytest.approx(node(points), abs=1e-5)
    assert node.scale(3)(3 * points) == pytest.approx(node(points), abs=1e-5)


@EVERY_KIND
def test_a_wider_arc_than_the_fields_ends_where_they_end(kind: Any) -> None:
    a, b = Point((0, 0, 0), radius=1.0), Point((0.8, 0, 0), radius=1.0)
    points = np.random.default_rng(0).uniform(-2, 2, (200, 3))
    assert kind(a, b, 5.0)(points) == pytest.approx(kind(a, b, 50.0)(points))


@pytest.mark.parametrize(
    ("node", "least"),
    [
        (Union(SMALL, LARGE), LARGE),
        (Union(SMALL, LARGE).offset(0.1), LARGE.offset(0.1)),
        (SMALL + LARGE.rotate((0, 0, 1), 40), LARGE),
        (Stroke(((0, 0, 0), (1, 0, 0)), (0.2, 1.0)), LARGE),
        (Union(SMALL, Point((9, 0, 0), radius=9.0, weight=0.3)), SMALL),
        (Box((0, 0, 0), (2, 2, 2), radius=0), LARGE),
    ],
)
def test_several_primitives_count_as_the_softest(node: Node, least: Node) -> None:
    for distance in (0.1, -0.1):
        assert field_at(node, distance) == pytest.approx(field_at(least, distance))


def test_the_surface_of_a_tool_counts_from_its_other_side() -> None:
    tool = Point((0, 0, 0), radius=2.0)
    assert field_at(Box((0, 0, 0), (2, 2, 2), radius=0) - tool, 0.1) == 1.0 - field_at(tool, -0.1)


def test_meshes_keep_the_edges_of_operands() -> None:
    plate, rod = Box((0, 0, 0), (2, 2, 0.4), radius=0), Segment((0, 0, 0), (0, 0, 1), radius=0.3)
    mesh = polygonize(RoundUnion(plate, rod, 0.15), resolution=48, creases=True)
    assert np.abs(mesh.vertices - [1.0, 1.0, 0.2]).max(axis=1).min() < 1e-3
    far = np.hypot(*mesh.vertices[:, :2].T) > 0.5
    assert mesh.vertices[far, 2].max() < 0.2 + 1e-4


@EVERY_KIND
def test_files_and_refusals(kind: Any) -> None:
    node = kind(SMALL, LARGE, 0.25)
    assert from_json(to_json(node)) == node
    with pytest.raises(InvalidNode, match="width: expected"):
        kind(SMALL, LARGE, 0.0)
