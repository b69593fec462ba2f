"""Two backends from one source: the same pixels, chosen by measurement, by wish, or by what there is."""

import os
import subprocess
import sys

import numpy as np
import pytest

from decals import ImageMapping
from decals.errors import NoGraphics
from decals.rendering import Context, Renderer, RenderOptions, pixel_pass
from decals.rendering.pixel_pass import BACKEND_VARIABLE, COMPUTE_VERSION, PassBackend, measure
from tests.decals.rendering.pictures import SIZE, assert_same_surfaces, compare, scattered, view_of
from tests.decals.shapes import torus

NO_COMPUTE = {"MESA_GL_VERSION_OVERRIDE": "4.1", "MESA_GLSL_VERSION_OVERRIDE": "410"}
"""Mesa then offers what macOS does."""


@pytest.mark.parametrize("count", [0, 1, 400])
def test_both_backends_draw_the_same(fragment: Renderer, compute: Renderer, count: int) -> None:
    shapes = torus(), torus(0.8, 0.3, shift=(0.7, 0, 0.5))
    view = view_of(scattered(shapes[0], count, 5, radii=(0.05, 0.4)), *shapes)
    first, second = (drawing.buffers(view, RenderOptions(size=SIZE)) for drawing in (fragment, compute))
    assert_same_surfaces(first, second)
    assert (first.owner != second.owner).mean() < 0.005
    same = (first.owner == second.owner) & (np.abs(first.position - second.position).max(axis=-1) < 1e-4)
    np.testing.assert_allclose(second.field[same], first.field[same], atol=2e-3)


def test_compute_is_the_oracles_at_every_pixel(compute: Renderer) -> None:
    shape = torus()
    view = view_of(scattered(shape, 200, 7, radii=(0.02, 0.5)), shape)
    assert compare(view, compute.buffers(view, RenderOptions(size=SIZE)), ImageMapping.CORRECTED).any()


def test_odd_sizes_and_tiles(compute: Renderer, fragment: Renderer) -> None:
    shape = torus()
    view = view_of(scattered(shape, 100, 5, radii=(0.05, 0.3)), shape)
    whole = fragment.render(view, RenderOptions(size=(37, 53), samples=3))
    with Renderer(compute.context, max_tile=41) as tiled:
        parts = tiled.render(view, RenderOptions(size=(37, 53), samples=3))
    assert (np.abs(parts.astype(int) - whole).max(axis=-1) > 2).mean() < 0.01


@pytest.fixture
def card(context: Context, monkeypatch: pytest.MonkeyPatch) -> Context:
    """Give a context that has not measured anything yet, as on a graphics card."""
    if context.gl.version_code < COMPUTE_VERSION:
        pytest.skip(f"no compute shaders in {context.name}")
    monkeypatch.delenv(BACKEND_VARIABLE, raising=False)
    monkeypatch.setattr(pixel_pass, "_times", {})
    made = Context(context.gl)
    made.software = False
    return made


@pytest.mark.parametrize("faster", PassBackend)
def test_a_context_chooses_the_faster_one(
    card: Context, monkeypatch: pytest.MonkeyPatch, faster: PassBackend
) -> None:
    monkeypatch.setattr(pixel_pass, "measure", lambda _, backend: 1.0 + (backend is not faster))
    assert card.backend is faster


def test_equally_fast_means_fragment(card: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        pixel_pass, "measure", lambda _, backend: 1.0 if backend is PassBackend.COMPUTE else 1.4
    )
    assert card.backend is PassBackend.FRAGMENT


def test_it_measures_each_once_for_each_driver(card: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[PassBackend] = []

    def one_second(_: Context, backend: PassBackend) -> float:
        seen.append(backend)
        return 1.0

    monkeypatch.setattr(pixel_pass, "measure", one_second)
    card.probe(PassBackend.COMPUTE)
    assert seen == [PassBackend.COMPUTE]
    assert card.backend is PassBackend.FRAGMENT
    other = Context(card.gl)
    other.software = False
    assert other.backend is PassBackend.FRAGMENT
    assert sorted(seen) == sorted(PassBackend)


@pytest.mark.parametrize("known", ["software", "wished", "environment"])
def test_what_is_known_is_not_measured(card: Context, monkeypatch: pytest.MonkeyPatch, known: str) -> None:
    monkeypatch.setattr(pixel_pass, "measure", lambda *_: pytest.fail("measured"))
    card.software = known == "software"
    card.requested_backend = PassBackend.FRAGMENT if known == "wished" else None
    if known == "environment":
        monkeypatch.setenv(BACKEND_VARIABLE, "fragment")
    for backend in PassBackend:
        card.probe(backend)
    assert card.backend is PassBackend.FRAGMENT


def test_both_can_be_measured(context: Context) -> None:
    if context.gl.version_code < COMPUTE_VERSION:
        pytest.skip(f"no compute shaders in {context.name}")
    assert all(0.0 < measure(context.gl, backend) < 10.0 for backend in PassBackend)


def test_the_environment_and_an_argument_decide(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pixel_pass, "measure", lambda *_: pytest.fail("measured"))
    monkeypatch.setenv(BACKEND_VARIABLE, "Fragment")
    assert Context(context.gl).backend is PassBackend.FRAGMENT
    if context.gl.version_code >= COMPUTE_VERSION:
        assert Context(context.gl, backend="compute").backend is PassBackend.COMPUTE


@pytest.mark.parametrize("wish", ["vertex", " "])
def test_unknown_backends(context: Context, monkeypatch: pytest.MonkeyPatch, wish: str) -> None:
    with pytest.raises(NoGraphics, match="expected one of fragment, compute"):
        Context(context.gl, backend=wish)
    monkeypatch.setenv(BACKEND_VARIABLE, wish)
    with pytest.raises(NoGraphics, match="expected one of fragment, compute"):
        assert Context(context.gl).backend


def test_without_compute_shaders_fragments_do(context: Context) -> None:
    """In a process of its own: Mesa reads its version when it starts."""
    script = """
from decals.errors import NoGraphics
from decals.rendering.context import Context
with Context.standalone() as context:
    if context.gl.version_code >= 430:
        raise SystemExit("skip: not Mesa")
    with context.current():
        assert context.backend == "fragment", context.backend
    try:
        Context(context.gl, backend="compute")
    except NoGraphics as error:
        assert "4.3" in str(error), error
    else:
        raise AssertionError("compute was accepted")
from decals.rendering import Renderer, RenderOptions
from tests.decals.rendering.pictures import scattered, view_of
from tests.decals.shapes import torus
with Renderer() as renderer:
    view = view_of(scattered(torus(), 50, 5, radii=(0.05, 0.3)), torus())
    assert (renderer.buffers(view, RenderOptions(size=(32, 24))).owner >= 0).any()
"""
    environment = {**os.environ, **NO_COMPUTE}
    environment.pop(BACKEND_VARIABLE, None)
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False
    )
    if "skip:" in done.stderr:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stderr
