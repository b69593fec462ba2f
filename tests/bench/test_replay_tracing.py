"""Recorded rays are traced again: through both entry points, to the depths that Warp finds."""

from pathlib import Path

import pytest
import warp as wp

from decals.errors import NoGraphics
from decals.render.context import Context
from tests.bench import replay_tracing, tracing


def test_recorded_rays_are_traced_again(tmp_path: Path) -> None:
    path = tmp_path / "rays.npz"
    tracing.record(path, (40, 300), (64, 48))
    try:
        context = Context.standalone()
    except NoGraphics as error:
        pytest.skip(str(error))
    with context, context.current():
        figures = replay_tracing.measure(context.gl, path, 1)
        compute = context.gl.version_code >= 430
    for count in (40, 300):
        assert 0.1 < figures[f"hits_{count}"] < 0.9
        assert figures[f"fragment_{count}_apart"] == 0.0
        if compute:
            assert figures[f"compute_{count}_apart"] == 0.0
            assert figures[f"entries_{count}_apart"] == 0.0


def test_times_in_warp() -> None:
    with wp.ScopedDevice("cpu"):
        figures = tracing.warp_times("cpu", (40,), (32, 24), 1)
    assert 0.1 < figures["hits_40"] < 0.9
    assert figures["trace_40_ms"] > 0.0
