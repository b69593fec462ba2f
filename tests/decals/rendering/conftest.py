"""Renderers whose passes run as fragment and as compute shaders; their contexts serve all files of tests."""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from decals.rendering import Context, Renderer
from decals.rendering.pixel_pass import COMPUTE_VERSION


@pytest.fixture(scope="session")
def contexts(standalone_context: Context) -> Iterator[dict[str, Context]]:
    """The contexts by their backends; shaders need not be compiled for each file of tests."""
    with ExitStack() as opened:
        names = ["fragment", "compute"][: 1 + (standalone_context.gl.version_code >= COMPUTE_VERSION)]
        yield {name: opened.enter_context(Context.standalone(backend=name)) for name in names}


@pytest.fixture(scope="module")
def fragment(contexts: dict[str, Context]) -> Iterator[Renderer]:
    with Renderer(contexts["fragment"]) as renderer:
        yield renderer


@pytest.fixture(scope="module")
def compute(contexts: dict[str, Context], standalone_context: Context) -> Iterator[Renderer]:
    if "compute" not in contexts:
        pytest.skip(f"no compute shaders in {standalone_context.name}")
    with Renderer(contexts["compute"]) as renderer:
        yield renderer


@pytest.fixture(scope="module", params=["fragment", "compute"])
def drawer(request: pytest.FixtureRequest) -> Renderer:
    renderer: Renderer = request.getfixturevalue(request.param)
    return renderer
