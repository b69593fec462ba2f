"""Boxes around trees from their blocks hold the surface, and not much more."""

import numpy as np
import pytest

from blobtree import Point, Segment
from blobtree.tracing.tree_cells import BLOCKS_ALONG
from decals import MeshObject, TreeObject
from decals.scenes.objects import bounds_of
from decals.vtk.proxy_actor import box_around
from tests.decals.shapes import torus

TREES = {
    "ball": Point((3, 0, 0), radius=1.0),
    "blend": Segment((-0.8, 0, 0), (0.5, 0, 0), radius=0.4) + Point((0.7, 0.3, 0.2), radius=0.45),
    "cut": Point((0, 0, 0), radius=1.0) - Point((0.8, 0, 0), radius=0.7),
    "flat": Point((0, 0, 0), radius=1.0).scale((3, 1, 0.2)),
}


@pytest.mark.parametrize("name", TREES)
def test_a_trees_box(name: str) -> None:
    tree = TREES[name]
    thing = TreeObject(name, tree)
    low, high = box_around([thing])
    assert "surface" not in vars(thing), "the surface was not made for it"
    block = float(np.max(tree.support[1] - tree.support[0])) / BLOCKS_ALONG
    true_low, true_high = thing.bounds
    assert (low <= true_low + 1e-3 * block).all()
    assert (high >= true_high - 1e-3 * block).all()
    assert (low >= tree.support[0] - block).all()
    assert (high <= tree.support[1] + block).all()
    if name != "flat":  # intervals of stretched parts are loose
        assert (true_low - low).max() < 2.5 * block
        assert (high - true_high).max() < 2.5 * block
    np.testing.assert_array_equal(box_around([thing]), thing.bounds)


def test_a_box_around_several() -> None:
    ring = torus(shift=(0, 5, 0))
    objects = TreeObject("ball", TREES["ball"]), MeshObject("ring", ring.vertices, ring.faces)
    low, high = box_around(objects)
    np.testing.assert_allclose((low, high), bounds_of(objects), atol=0.2)


def test_a_tree_without_a_surface_has_its_support() -> None:
    nothing = Point((0, 0, 0), radius=1.0) & Point((9, 0, 0), radius=1.0)
    low, high = box_around([TreeObject("nothing", nothing)])
    assert np.isfinite([low, high]).all()
    assert (low <= high).all()
