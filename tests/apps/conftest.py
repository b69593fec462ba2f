"""One renderer for what is measured and drawn."""

import pytest

from decals.errors import NoGraphics
from decals.rendering import Renderer


@pytest.fixture(scope="module")
def renderer(vtk_display: None) -> Renderer:
    try:
        return Renderer()
    except NoGraphics as error:
        pytest.skip(str(error))
