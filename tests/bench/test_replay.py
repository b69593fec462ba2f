"""Recordings are replayed through fragment and compute shaders, with equal results."""

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest
import warp as wp

from decals import Contact, DecalImage, MeshObject, Scene
from decals.apps.models.figure_14 import even_decals
from decals.errors import NoGraphics
from decals.rendering import Context, RenderOptions
from tests.bench import record, replay, tracing
from tests.bench.scenes import in_layers
from tests.decals.rendering.pictures import view_of
from tests.decals.shapes import torus


@pytest.fixture
def gl() -> Iterator[moderngl.Context]:
    try:
        context = Context.standalone()
    except NoGraphics as error:
        pytest.skip(str(error))
    with context, context.current():
        yield context.gl


def ring_scene(*, layered: bool) -> Scene:
    """Return a torus with 100 decals."""
    ring = torus(rows=96, columns=48)
    item = MeshObject("ring", ring.vertices, ring.faces)
    decals = even_decals(item.surface, count=100)
    if layered:
        decals = in_layers(decals)
    white = DecalImage("white", np.full((4, 4, 4), 255, np.uint8))
    return Scene(objects=(item,), camera=view_of(decals, ring).camera, decals=decals, images=(white,))


@pytest.mark.slow
@pytest.mark.parametrize("filtered", [False, True])
def test_a_recorded_picture_is_drawn_again(tmp_path: Path, gl: moderngl.Context, filtered: bool) -> None:
    path = tmp_path / "ring.npz"
    options = RenderOptions(size=(64, 48), samples=1, contact=Contact.PRODUCT, filtered=filtered)
    record.record(ring_scene(layered=False), path, options)
    figures = replay.measure(gl, path, 1)
    assert 0.1 < figures["covered"] < 0.9
    assert figures["decals_fragment"] >= 0.0
    if gl.version_code >= 430:
        assert figures["entries_differ"] == 0.0
        assert ("listed" in figures) == filtered
        assert 0.02 < figures.get("listed", 0.1) < figures["covered"]


@pytest.mark.slow
def test_replaced_decals_cover_the_same_part_of_the_picture(tmp_path: Path, gl: moderngl.Context) -> None:
    path = tmp_path / "ring.npz"
    record.record(
        ring_scene(layered=True), path, RenderOptions(size=(64, 48), samples=1, contact=Contact.RADIAL)
    )
    figures = replay.measure(gl, path, 1, counts=[50, 5000])
    assert 0 < figures["mb_50"] < figures["mb_5000"] / 20
    assert figures["painted_50"] == pytest.approx(1 - np.exp(-replay.COVERAGE), abs=0.1)
    assert figures["painted_5000"] == pytest.approx(1 - np.exp(-replay.COVERAGE), abs=0.03)
    assert figures["decals_fragment_5000_over_50"] > 0
    assert 0 < figures["upload_ms_5000"] < 1000


def test_random_decals_cover_equally() -> None:
    ring = torus(rows=96, columns=48)
    rng = np.random.default_rng(0)
    points = replay.random_decals(ring.vertices, ring.faces, 4000, layered=False).positions
    for count in (400, 3000):
        decals = replay.random_decals(ring.vertices, ring.faces, count, layered=True)
        assert decals.layered
        sample = points[rng.choice(len(points), 500, replace=False)]
        near = np.linalg.norm(sample[:, None] - decals.positions, axis=2) < decals.radii
        assert near.sum(axis=1).mean() == pytest.approx(replay.COVERAGE, rel=0.1)


def test_even_decals_cover_equally() -> None:
    ring = torus(rows=48, columns=24)
    surface = MeshObject("ring", ring.vertices, ring.faces).surface
    for count in (50, 800):
        decals = even_decals(surface, count=count)
        assert len(decals) == count
        assert np.pi * (decals.radii.astype(float) ** 2).sum() == pytest.approx(1.6 * surface.area, rel=0.01)


def test_recorded_rays_are_traced_to_the_depths_of_warp(tmp_path: Path, gl: moderngl.Context) -> None:
    path = tmp_path / "rays.npz"
    tracing.record(path, (40, 300), (64, 48))
    figures = replay.measure(gl, path, 1)
    for count in (40, 300):
        assert 0.1 < figures[f"hits_{count}"] < 0.9
        assert figures[f"fragment_{count}_apart"] == 0.0
        if gl.version_code >= 430:
            assert figures[f"compute_{count}_apart"] == 0.0
            assert figures[f"entries_{count}_apart"] == 0.0


def test_rays_are_timed_in_warp() -> None:
    with wp.ScopedDevice("cpu"):
        figures = tracing.warp_times("cpu", (40,), (32, 24), 1)
    assert 0.1 < figures["hits_40"] < 0.9
    assert figures["trace_40_ms"] > 0.0
