"""One renderer for what is measured and drawn."""

from collections.abc import Iterator

import pytest

from decals.errors import NoGraphics
from decals.rendering import Renderer


@pytest.fixture(scope="module")
def renderer(vtk_display: None) -> Iterator[Renderer]:
    try:
        renderer = Renderer()
    except NoGraphics as error:
        pytest.skip(str(error))
    with renderer:
        yield renderer
