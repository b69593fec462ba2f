"""Pages and examples define kinds of nodes, some of them under the names of the tests' own."""

import pytest

from blobtree.custom import definition


@pytest.fixture(autouse=True)
def own_kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give each test a registry of its own, which starts with the kinds defined so far."""
    monkeypatch.setattr(definition, "_KINDS", dict(definition._KINDS))
