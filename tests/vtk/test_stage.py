"""What a stage shows is what the batch renderer draws, and what it says lies there."""

import numpy as np
import pytest

from decals.errors import NoGraphics
from decals.render import TRANSPARENT
from tests.oracles.raster import edges
from tests.vtk.conftest import Factory
from tests.vtk.scenes import both, shot


@pytest.mark.parametrize("samples", [1, 2])
def test_the_window_shows_the_batch_renderers_pixels(plotter: Factory, samples: int) -> None:
    pl = plotter()
    pl.set_background("black")
    pl.decals.add_scene(both())
    stage = pl.decals.stage
    stage.samples = samples
    seen = shot(pl)
    with stage.current():
        batch = stage.renderer.render(both(), size=(160, 120), samples=samples, background=TRANSPARENT)
        object_id = stage.renderer.buffers(both(), size=(160, 120)).object_id
    sure = ~edges(object_id)
    inside = sure & (object_id >= 0)
    assert inside.mean() > 0.2
    assert np.abs(seen - batch[..., :3])[inside].max() <= 1
    assert (seen[sure & (object_id < 0)] == 0).all()


def test_one_place_in_the_window(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add_scene(both())
    stage = pl.decals.stage
    shot(pl)
    with stage.current():
        buffers = stage.renderer.buffers(both(), size=(160, 120), viewpoint=stage.viewpoint())
    sure = ~edges(buffers.object_id)
    rng = np.random.default_rng(1)
    for x, y in rng.integers(0, (160, 120), (30, 2)).tolist():
        if not sure[y, x]:
            continue
        hit = stage.at(x, 119 - y)
        if hit is None:
            assert buffers.object_id[y, x] == -1
            continue
        assert hit.object_id == buffers.object_id[y, x]
        np.testing.assert_allclose(hit.position, buffers.position[y, x], atol=1e-4)
        if hit.field > 0.52:
            assert hit.owner == buffers.owner[y, x]
            np.testing.assert_allclose(hit.uv, buffers.uv[y, x], atol=1e-2)
    assert stage.at(-1, 5) is None
    assert stage.at(5, 120) is None


def test_before_the_first_frame_there_is_no_graphics(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add_scene(both())
    with pytest.raises(NoGraphics, match="render it first"):
        pl.decals.stage.at(80, 60)
