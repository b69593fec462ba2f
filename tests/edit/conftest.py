"""The renderer's fixtures, for pictures of what was edited."""

from tests.decals.conftest import context, renderer

__all__ = ["context", "renderer"]
