"""The pass of projected boxes in `python -m tests.bench.box_peers` agrees with NumPy."""

from dataclasses import replace

import numpy as np
import pytest

from decals import DecalImage, Interaction
from tests.bench import box_peers
from tests.bench.clipped_decals import box_coordinates
from tests.bench.projected_boxes import opacity
from tests.bench.scenes import bench_scene

SIZE = 192, 128


def test_boxes_are_those_of_numpy() -> None:
    scene = bench_scene("knot", 20, SIZE)
    rng = np.random.default_rng(0)
    radii = 1.5 * scene.decals.radii
    tints, opacities = rng.uniform(0.2, 1.0, (20, 3)), rng.uniform(0.2, 1.0, 20)
    decals = scene.decals.replace(radii=radii, tints=tints, opacities=opacities)
    halves = np.full((64, 64, 4), 255, np.uint8)
    halves[:, 32:, :3] = 0
    scene = replace(scene, decals=decals, images=(DecalImage("halves", halves),))
    with box_peers.staged(scene, SIZE) as stage:
        painting, _ = stage.painting("boxes", decals)
        stage.run(painting)
        drawn, base = stage.pixels(stage.target), stage.pixels(stage.gbuffer.color)
        places, normals = stage.pixels(stage.gbuffer.position), stage.pixels(stage.gbuffer.normal)
    seen = base[..., 3] > 0
    points, normals = places[seen][:, None, :3], normals[seen][:, :3]
    records = decals.packed().reshape(len(decals), -1, 4)
    color, left = np.zeros((len(points), 3)), np.ones(len(points))
    for box in reversed(range(len(decals))):
        local = box_coordinates(decals, np.full(len(points), box), points)[:, 0]
        inside = (np.abs(local) <= [1.0, 1.0, box_peers.DEPTH]).all(axis=1) & (left > 1e-4)
        shown = inside * records[box, 3, 3] * opacity(normals @ decals.normals[box].astype(np.float64))
        color += (left * shown * (local[:, 0] < 0))[:, None] * records[box, 3, :3]
        left *= 1.0 - shown
    expected = color + left[:, None] * base[seen][:, :3]
    apart = np.abs(drawn[seen][:, :3] - expected).max(axis=1)
    assert (left < 0.9).mean() > 0.5
    assert np.quantile(apart, 0.9) < 2e-3, "pixels that do not see the middle line of an image"


def test_decals_without_contact_keep_all_but_their_interaction() -> None:
    decals = bench_scene("knot", 20, SIZE).decals
    alone = box_peers.without_contact(decals)
    assert (alone.interactions == Interaction.OVERLAP).all()
    assert (alone.positions == decals.positions).all()


def test_the_table_has_a_row_for_each_number_of_decals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(box_peers, "WARM_SECONDS", 0.0)
    figures = box_peers.measure("knot", [100, 300], [(32, 24)], 1)
    lines = box_peers.table(figures, [100, 300], [(32, 24)]).splitlines()
    assert len(figures) == 1 + 2 * len(box_peers.KINDS)
    assert [line.split(" | ")[0] for line in lines[-2:]] == ["| 100", "| 300"]
