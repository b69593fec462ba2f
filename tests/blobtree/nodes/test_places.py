"""Places of nodes below transforms and warps: the field of a point is 1 where its centre shows."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blobtree import Mirror, Node, Point, Sum
from blobtree.errors import InvalidNode
from blobtree.nodes.paths import node_at
from blobtree.nodes.places import Place, mirror_maps
from tests.blobtree.custom_kinds import Sway

BALL = Point((1, 0.2, 0.5), radius=0.3)
PLACED: list[tuple[Node, tuple[int, ...]]] = [
    (BALL.twist(700), (0,)),
    (BALL.rotate((1, 2, 3), 30).twist(-120).translate((1, 2, 3)).scale(2), (0, 0, 0, 0)),
    (BALL.taper(0.4, (0, 2)).shear(0.5, -0.2, (0, 2)), (0, 0)),
    (BALL.stretch(3, (0, 1)).bend(20, (0, 2)).offset(0.1), (0, 0, 0)),
    (BALL.noise_warp(0.1, 1.0).twist(40), (0, 0)),
    (Sway(BALL, 0.3, 2.0), (0,)),
]


@pytest.mark.parametrize(("tree", "path"), PLACED, ids=lambda value: type(value).__name__)
def test_the_world_shows_the_middle_of_a_node_where_its_place_says(tree: Node, path: Any) -> None:
    place = Place(tree, path)
    assert place.warped
    np.testing.assert_allclose(tree(place.middle[None]), 1.0, atol=2e-5)
    np.testing.assert_allclose(place.local(place.middle), BALL.center, atol=1e-6)
    offset = np.array((0.03, -0.05, 0.04))
    np.testing.assert_allclose(
        place.world(place.own_middle + place.moved(offset)), place.middle + offset, atol=1e-6
    )
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    shifted = place.mapped(matrix)
    np.testing.assert_allclose(shifted[:3, :3], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(shifted[:3, 3], place.moved(offset), atol=1e-9)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), st.floats(-400, 400))
@settings(max_examples=30)
def test_a_twist_is_undone_anywhere(x: float, y: float, z: float, degrees: float) -> None:
    place, angle = Place(BALL.twist(degrees), (0,)), np.radians(degrees) * z
    world = np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y, z
    np.testing.assert_allclose(place.world((x, y, z)), world, atol=1e-7)
    np.testing.assert_allclose(place.local(world), (x, y, z), atol=1e-9)


def test_images_are_those_of_all_mirrors_above() -> None:
    tree = Sum(BALL, Mirror(Mirror(BALL, "x").translate((0, 1, 0)), "z").rotate((0, 0, 1), 90))
    path, points = (1, 0, 0, 0, 0), [(1, 0.2, 0.5), (-1, 0.2, 0.5), (1, 0.2, -0.5), (-1, 0.2, -0.5)]
    assert node_at(tree, path) is BALL
    assert len(mirror_maps(tree, (0,))) == 1
    middle = Place(tree, path).middle
    np.testing.assert_allclose(middle, (-1.2, 1.0, 0.5), atol=1e-6)
    found = sorted((image @ (*middle, 1.0))[:3].round(6).tolist() for image in mirror_maps(tree, path))
    np.testing.assert_allclose(found, sorted([-y - 1, x, z] for x, y, z in points), atol=1e-6)
    assert len(mirror_maps(tree.twist(10), (0, *path))) == 1


def test_what_no_warp_shows_is_refused() -> None:
    tree = Point((0, 0, 0), radius=0.4).translate((2.0, 0, 0)).bend(30, (0, 2))
    with pytest.raises(InvalidNode, match=r"axis|middle"):
        Place(tree, (0, 0))
