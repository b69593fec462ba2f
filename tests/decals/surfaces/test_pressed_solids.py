"""Particles and decals on solids in contact."""

import numpy as np

from blobtree import ISO, Point, SolidContact
from decals import scatter
from decals.surfaces import ImplicitSurface

BALLS = (Point((-0.8, 0, 0), radius=1.0), Point((0.8, 0, 0), radius=1.0))


def test_decals_cover_the_outside_of_a_contact_and_all_of_a_solid() -> None:
    model = SolidContact(BALLS, height=0.06)
    for tree, touching in ((model, False), (model.solids()[0], True)):
        surface = ImplicitSurface(tree)
        decals = scatter(surface, count=120, seed=1)
        assert len(decals) == 120
        np.testing.assert_allclose(tree(decals.positions), ISO, atol=1e-4)
        in_contact = np.hypot(*decals.positions[np.abs(decals.positions[:, 0]) < 0.01, 1:].T) < 0.5
        assert in_contact.any() == touching


def test_rays_hit_the_contact_surface_of_a_single_solid() -> None:
    left = SolidContact(BALLS).solids()[0]
    distances = ImplicitSurface(left).raycast([[3.0, 0.1, 0.0]], [[-1.0, 0.0, 0.0]])
    np.testing.assert_allclose(distances, 3.0, atol=1e-4)
