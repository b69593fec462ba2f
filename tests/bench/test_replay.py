"""What is recorded is drawn again, through both entry points."""

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from decals.errors import NoGraphics
from decals.render.context import Context
from decals.scene import DecalImage, MeshObject, Scene
from implicit_decals.apps.coats import even_coat
from tests.bench import record, replay
from tests.decals.shapes import torus
from tests.decals.test_render_decals import view_of


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


def test_even_coats_cover_equally() -> None:
    surface = MeshObject(
        "ring", *(getattr(torus(rows=48, columns=24), name) for name in ("vertices", "faces"))
    ).surface
    for count in (50, 800):
        coat = even_coat(surface, count=count)
        assert len(coat) == count
        assert np.pi * (coat.radii.astype(float) ** 2).sum() == pytest.approx(1.6 * surface.area, rel=0.01)
