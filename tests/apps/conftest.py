"""One renderer for what is measured and drawn."""

import pytest

from decals.errors import NoGraphics
from decals.render import Renderer


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    try:
        return Renderer()
    except NoGraphics as error:
        pytest.skip(str(error))
