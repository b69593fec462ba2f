"""Random messages of browsers, valid and malformed: none raises, and undoing all restores the first state."""

import pytest

pytest.importorskip("trame_vtk")


def test_growth_is_measured_after_the_first_part() -> None:
    from tests.apps.sandbox.messages import growth

    memory = [(1000, 50.0), (2000, 90.0), (3000, 100.0), (4000, 103.0), (5000, 106.0)]
    assert growth(memory, 0.5) == pytest.approx(3.0)
    assert growth(memory, 0.3) == pytest.approx((-1.5 * 90 - 0.5 * 100 + 0.5 * 103 + 1.5 * 106) / 5)
    assert growth(memory[:1], 0.5) == 0.0


@pytest.mark.slow
def test_random_messages_raise_nothing(vtk_display: None) -> None:
    from tests.apps.sandbox.messages import measure

    figures = measure(300, seed=1)
    assert figures["restored"]
    assert (figures["errors"], figures["unanswered"]) == (0, 0), figures["first_errors"]
