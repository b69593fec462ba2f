"""Renderers whose passes run as fragment and as compute shaders."""

from collections.abc import Iterator

import pytest

from decals.rendering.context import Context
from decals.rendering.pixel_pass import COMPUTE_VERSION
from decals.rendering.renderer import Renderer


@pytest.fixture(scope="module", params=["fragment", "compute"])
def drawer(request: pytest.FixtureRequest, standalone_context: Context) -> Iterator[Renderer]:
    if request.param == "compute" and standalone_context.gl.version_code < COMPUTE_VERSION:
        pytest.skip(f"no compute shaders in {standalone_context.name}")
    with Context.standalone(backend=request.param) as made, Renderer(made) as renderer:
        yield renderer
