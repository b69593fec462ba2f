"""What is special in contact: ratings are a group, bulges are smooth, and solids never overlap."""

import numpy as np
import pytest

from blobtree.nodes.contact import rated_field
from tests.blobtree.formulas.test_operators import CONTACTS, Setting, pressed, scale
from tests.blobtree.transpile.warp_functions import call
from tests.oracles.blobtree import rated

EVERY_CONTACT = pytest.mark.parametrize("setting", CONTACTS, ids=str)


@EVERY_CONTACT
def test_the_field_is_smooth_where_contact_and_bulge_begin_and_end(setting: Setting) -> None:
    """One-sided differences at m = ½, at the top and at the far edge, for solids near their surface."""
    ratio, width, height = setting.values()
    if height == 0.0:
        return
    a = np.full(3, 0.5)
    edges = rated(0.5 - np.array([0.0, 2.0 * height, width]), 1.0 / ratio)
    step = 1e-6 / scale(setting)
    below, here, above = (pressed(a, edges + move, **setting) for move in (-step, 0.0, step))
    np.testing.assert_allclose((above - here) / step, (here - below) / step, atol=2e-3 * scale(setting))
    peak = pressed(np.full(2001, 0.5), np.linspace(0.0, 0.5, 2001), **setting).max() - 0.5
    assert 0.8 * height < peak <= height + 1e-9


def test_ratings_are_a_group_and_keep_the_surface() -> None:
    b = np.linspace(0.0, 3.0, 301)
    for first, second in ((2.0, 3.0), (0.1, 7.0), (5.0, 0.2)):
        np.testing.assert_allclose(rated(rated(b, first), second), rated(b, first * second), atol=1e-12)
        seen = call(rated_field, b=b, ratio=first)
        np.testing.assert_allclose(seen[:, 0], rated(b, first), rtol=2e-6, atol=1e-6)
        assert seen[b == 0.5].tolist() == [[0.5, np.float32(first)]]
        assert (np.diff(seen[:, 0]) > 0.0).all()


@EVERY_CONTACT
def test_two_pressed_fields_never_both_exceed_a_half(setting: Setting) -> None:
    a, b = np.random.default_rng(1).uniform(0.2, 1.2, (2, 200_000))
    one, other = pressed(a, b, **setting), pressed(b, a, **setting | {"ratio": 1.0 / setting["ratio"]})
    assert not ((one > 0.5 + 1e-9) & (other > 0.5 + 1e-9)).any()
    covered = (a > 0.5 + 1e-9) | (b > 0.5 + 1e-9)
    assert (np.maximum(one, other)[covered] >= 0.5 - 1e-9).all()
