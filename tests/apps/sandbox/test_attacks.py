"""Attacks on the real servers of the sandbox, and the table of them in the docs."""

import sys
from pathlib import Path

import pytest

pytest.importorskip("trame_vtk")

from tests.apps.sandbox.attacks import ATTACKS, LEFT_OUT, WAYS, applies, attempt, table

PAGE = Path(__file__).parents[3] / "docs" / "sandbox-security.md"


def test_the_table_of_the_docs_names_all_attacks_and_ways() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert table() in page
    assert all(f"| {name.replace('_', ' ')} |" in page for name in ATTACKS)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the servers of this test end by signals")
@pytest.mark.parametrize("way", WAYS)
def test_all_attacks_are_refused(way: str, vtk_display: None) -> None:
    got = attempt(way)
    assert {name: what for name, what in got.items() if what} == {}
    left = {name: LEFT_OUT[name]() for name in ATTACKS if applies(name, way) and name not in got}
    if any(left.values()):
        pytest.skip(f"not tried: {left}")
