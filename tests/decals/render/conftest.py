"""Renderers whose passes run as fragment and as compute shaders."""

from collections.abc import Iterator

import pytest

from decals.render.context import Context
from decals.render.entry import COMPUTE_BASELINE
from decals.render.renderer import Renderer


@pytest.fixture(scope="module", params=["fragment", "compute"])
def drawer(request: pytest.FixtureRequest, context: Context) -> Iterator[Renderer]:
    if request.param == "compute" and context.gl.version_code < COMPUTE_BASELINE:
        pytest.skip(f"no compute shaders in {context.name}")
    with Context.standalone(entry=request.param) as made, Renderer(made) as renderer:
        yield renderer
