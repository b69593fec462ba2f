"""The benchmark of decals measures what it says, in small."""

from tests.bench import decals as bench


def test_errors_and_folds() -> None:
    figures = bench.contact(2100) | bench.folds(2000) | bench.mapping(200)
    assert 0 < figures["contact_error_rh"] < 2e-5
    assert figures["folds_radial"] == 0
    assert figures["map_sphere"] < 1e-4 < figures["map_torus"] < figures["map_torus_chord"]


def test_what_is_missing_is_said() -> None:
    text = bench.report({"index_100k_s": 0.25, "slope_most": 4.7})
    assert "index_100k_s                     0.25  ≤ 0.5" in text
    assert "frame_100k_over_100      not measured" in text
    assert "slope_most" in text
