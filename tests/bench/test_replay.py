"""What is recorded is drawn again, through both entry points."""

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from decals.errors import NoGraphics
from decals.field.contact import Contact
from decals.render.context import Context
from decals.scenes.scene import DecalImage, MeshObject, Scene
from implicit_decals.apps.measuring.coats import even_coat
from tests.bench import record, replay, replay_counts
from tests.bench.scenes import in_layers
from tests.decals.render.pictures import view_of
from tests.decals.shapes import torus


@pytest.fixture
def gl() -> Iterator[moderngl.Context]:
    try:
        context = Context.standalone()
    except NoGraphics as error:
        pytest.skip(str(error))
    with context, context.current():
        yield context.gl


def test_a_recorded_picture_is_drawn_again(tmp_path: Path, gl: moderngl.Context) -> None:
    ring = torus()
    item = MeshObject("ring", ring.vertices, ring.faces)
    decals = even_coat(item.surface, count=100)
    white = DecalImage("white", np.full((4, 4, 4), 255, np.uint8))
    camera = view_of(decals, ring).camera
    path = tmp_path / "ring.npz"
    record.record(Scene(objects=(item,), camera=camera, decals=decals, images=(white,)), (64, 48), path)
    figures = replay.measure(gl, path, 1)
    assert 0.1 < figures["covered"] < 0.9
    assert figures["decals_fragment"] >= 0.0
    if gl.version_code >= 430:
        assert figures["entries_differ"] == 0.0


def test_a_recording_under_other_decals(tmp_path: Path, gl: moderngl.Context) -> None:
    """What is laid in place of the recorded decals covers the same part of the picture."""
    ring = torus(rows=96, columns=48)
    item = MeshObject("ring", ring.vertices, ring.faces)
    decals = in_layers(even_coat(item.surface, count=100))
    white = DecalImage("white", np.full((4, 4, 4), 255, np.uint8))
    path = tmp_path / "ring.npz"
    camera = view_of(decals, ring).camera
    scene = Scene(objects=(item,), camera=camera, decals=decals, images=(white,))
    record.record(scene, (64, 48), path, contact=Contact.RADIAL)
    figures = replay_counts.measure(gl, path, [50, 5000], 1, "cpu")
    assert 0 < figures["mb_50"] < figures["mb_5000"] / 20
    assert figures["painted_50"] == pytest.approx(1 - np.exp(-replay_counts.COVERAGE), abs=0.1)
    assert figures["painted_5000"] == pytest.approx(1 - np.exp(-replay_counts.COVERAGE), abs=0.03)
    assert figures["decals_fragment_5000_over_50"] > 0
    assert 0 < figures["upload_ms_5000"] < 1000


def test_random_coats_cover_equally() -> None:
    ring = torus(rows=96, columns=48)
    rng = np.random.default_rng(0)
    places = replay_counts.random_coat(ring.vertices, ring.faces, 4000, layered=False).positions
    for count in (400, 3000):
        coat = replay_counts.random_coat(ring.vertices, ring.faces, count, layered=True)
        assert coat.layered
        some = places[rng.choice(len(places), 500, replace=False)]
        near = np.linalg.norm(some[:, None] - coat.positions, axis=2) < coat.radii
        assert near.sum(axis=1).mean() == pytest.approx(replay_counts.COVERAGE, rel=0.1)


def test_even_coats_cover_equally() -> None:
    surface = MeshObject(
        "ring", *(getattr(torus(rows=48, columns=24), name) for name in ("vertices", "faces"))
    ).surface
    for count in (50, 800):
        coat = even_coat(surface, count=count)
        assert len(coat) == count
        assert np.pi * (coat.radii.astype(float) ** 2).sum() == pytest.approx(1.6 * surface.area, rel=0.01)
