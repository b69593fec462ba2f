"""The renderer's fixtures, for pictures of what was edited; and few decals that count as many."""

import pytest

from tests.decals.conftest import context, renderer

__all__ = ["context", "few_are_many", "renderer"]


@pytest.fixture
def few_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let changes of more than five decals go on in the background."""
    monkeypatch.setattr("decals.editing.commands.MAX_IMMEDIATE_DECALS", 5)
    monkeypatch.setattr("decals.editing.session.MAX_REPLAYED_DECALS", 5)
