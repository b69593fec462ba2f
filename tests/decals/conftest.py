"""One graphics context for all tests; small meshes to draw."""

from collections.abc import Iterator

import pytest

from decals.errors import NoGraphics
from decals.rendering import Context, Renderer


@pytest.fixture(scope="session")
def standalone_context(vtk_display: None) -> Iterator[Context]:
    try:
        standalone = Context.standalone()
    except NoGraphics as error:
        pytest.skip(str(error))
    with standalone:
        yield standalone


@pytest.fixture
def context(standalone_context: Context) -> Iterator[Context]:
    """Make the context current: a window of another test may have taken its place."""
    with standalone_context.current():
        yield standalone_context


@pytest.fixture(scope="session")
def renderer(standalone_context: Context) -> Iterator[Renderer]:
    with standalone_context.current(), Renderer(standalone_context) as renderer:
        yield renderer
