"""One graphics context for all tests; small meshes to draw."""

from collections.abc import Iterator

import pytest

from decals.errors import NoGraphics
from decals.render.context import Context
from decals.render.renderer import Renderer


@pytest.fixture(scope="session")
def context() -> Iterator[Context]:
    try:
        made = Context.standalone()
    except NoGraphics as error:
        pytest.skip(str(error))
    with made, made.current():
        yield made


@pytest.fixture(scope="session")
def renderer(context: Context) -> Iterator[Renderer]:
    with Renderer(context) as made:
        yield made
