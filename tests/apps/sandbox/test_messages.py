"""Random messages of browsers, valid and malformed: none raises, and undoing all restores the first state."""

import pytest

pytest.importorskip("trame_vtk")


@pytest.mark.slow
def test_random_messages_raise_nothing(vtk_display: None) -> None:
    from tests.apps.sandbox.messages import measure

    figures = measure(300, seed=1)
    assert figures["restored"]
    assert (figures["errors"], figures["unanswered"]) == (0, 0), figures["first_errors"]
