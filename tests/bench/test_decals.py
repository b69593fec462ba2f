"""The benchmark of decals, with small samples."""

import numpy as np
import pytest

from decals import Contact
from tests.bench import contact_modes, decal_index, decals
from tests.bench import decal_figures as bench


@pytest.mark.slow
def test_errors_and_folds() -> None:
    figures = bench.contact(2100) | bench.folds(2000) | bench.mapping(200)
    assert 0 < figures["contact_error_rh"] < 2e-5
    assert figures["folds_radial"] == 0
    assert figures["map_sphere"] < 1e-4 < figures["map_torus"] < figures["map_torus_chord"]


@pytest.mark.slow
def test_contact_modes_differ_in_folds_and_stretch() -> None:
    modes = Contact.PRODUCT, Contact.ELASTIC
    folds = [contact_modes.folds(contact, 4000) for contact in modes]
    assert folds[0] > 40
    assert folds[1] == 0
    paper, elastic = (np.quantile(contact_modes.stretch(contact, 8000), 0.95) for contact in modes)
    assert elastic < 0.5 * paper
    assert contact_modes.jump(Contact.ELASTIC, 20_000) < 1e-3


def test_missing_figures_are_reported() -> None:
    text = decals.report({"index_100k_s": 0.25, "slope_most": 4.7}, "a machine")
    assert "index_100k_s                         0.25  ≤ 0.5" in text
    assert "frame_100k_over_100          not measured" in text
    assert "slope_most" in text


@pytest.mark.slow
def test_the_decals_of_the_index_leave_no_gap() -> None:
    """Each point of the sphere lies within the rims of one to three decals."""
    decals = decal_index.spiral_decals(2000)
    rng = np.random.default_rng(0)
    points = rng.normal(size=(4000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    near = np.linalg.norm(points[:, None] - decals.positions, axis=2) < decals.radii
    assert near.any(axis=1).all()
    assert near.sum(axis=1).mean() < 3
    mixed = decal_index.spiral_decals(2000, spread=0.5).radii
    assert 5 < mixed.max() / mixed.min() <= 10.1


def test_an_edit_touches_few_rows() -> None:
    figures = decal_index.edits(2000)
    assert 0 < figures["edit_1m_ms"] <= figures["edit_1m_worst_ms"]
    assert 4 < figures["edit_1m_rows"] < 1000
