"""Seeds give what they gave before: a change of their results must be made on purpose."""

import json
from pathlib import Path

import pytest

from tests.decals.scattering.golden_seeds import CASES, DISTURBANCE, FILE, TOLERANCE, distances

KEPT = json.loads(FILE.read_text(encoding="utf-8"))
ADVICE = (
    "a seed gives another result than in the last release; if that is meant, write it into the changelog, "
    "section 'Seeds', and run: python -m tests.decals.scattering.golden_seeds --write"
)


def test_all_cases_are_kept() -> None:
    assert list(KEPT) == list(CASES)


@pytest.mark.slow_cases("ball, seed 7", "blend by spacing", "random places on a mesh")
@pytest.mark.parametrize("name", CASES)
def test_seeds_give_what_they_gave(name: str) -> None:
    found = CASES[name](0.0)
    assert len(found) == len(KEPT[name]["radii"]), ADVICE
    assert distances(found, KEPT[name]).max() < TOLERANCE, ADVICE


def test_another_seed_is_seen() -> None:
    other = CASES["ball, seed 7"](0.0)
    assert distances(other, KEPT["ball"]).max() > TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_rounding_does_not_matter(name: str) -> None:
    assert distances(CASES[name](DISTURBANCE), KEPT[name]).max() < TOLERANCE


def test_the_changelog_has_a_section_of_seeds() -> None:
    changes = (Path(__file__).resolve().parents[3] / "CHANGELOG.md").read_text(encoding="utf-8")
    assert "\n### Seeds\n" in changes
