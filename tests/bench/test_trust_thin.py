"""The campaign over thin parts counts what it did not measure, and shares in whole decals."""

import numpy as np
import pytest

from tests.bench.trust_thin import campaign
from tests.thin_trees import has_share


@pytest.mark.slow
def test_parts_of_trees_that_are_ended_are_lost() -> None:
    lines: list[str] = []
    figures = campaign([0], 20, workers=1, limit=0.01, report=lines.append)
    assert (figures["thin_cases"], figures["thin_trees_failed"]) == (1, 1)
    assert figures["thin_parts_lost"] == figures["thin_parts"] == 2
    assert "limit" in lines[0]


def test_shares_are_rounded_to_whole_decals() -> None:
    found, expected = np.array([25, 24, 29, 30, 95, 94]), np.array([27.1, 27.1, 27.1, 27.1, 100.0, 100.0])
    assert has_share(found, expected).tolist() == [True, False, True, False, True, False]
