"""The renderer's fixtures, for pictures of what was edited; and few decals that count as many."""

import pytest

from tests.decals.conftest import context, renderer

__all__ = ["context", "few_are_many", "renderer"]


@pytest.fixture
def few_are_many(monkeypatch):
    """Let changes of more than five decals go on in the background."""
    monkeypatch.setattr("decals.edit.background.MANY", 5)
    monkeypatch.setattr("decals.edit.session.FEW", 5)
