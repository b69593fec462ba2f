"""Filtered pictures whose border pixels are listed and drawn afterwards, against one program for all."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

import decals
from decals import Camera, MeshObject, Scene
from decals.rendering import Context, Renderer, RenderOptions, SceneLike, computed_mesh
from decals.rendering.pixel_pass import LIST_HEAD, IndirectPass
from decals.rendering.viewpoint import Rectangle
from tests.decals.rendering.flat_views import flat_view
from tests.decals.rendering.pictures import scattered
from tests.decals.rendering.test_materials import GOLD, PLASTIC, ROUGH
from tests.decals.shapes import torus

SIZE = (60, 44)
OPTIONS = RenderOptions(SIZE, samples=1, filtered=True)


@pytest.fixture(scope="module")
def exact() -> Iterator[Renderer]:
    """A renderer that draws all pixels with one program."""
    with Context.standalone(backend="fragment") as context, Renderer(context) as renderer:
        context.software = False
        yield renderer


@pytest.fixture
def counts(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of pixels that passes of compute shaders list."""
    numbers: list[int] = []
    run = IndirectPass.run

    def counted(self: IndirectPass, rectangle: Rectangle) -> None:
        run(self, rectangle)
        numbers.append(int(np.frombuffer(self._list.read(LIST_HEAD.nbytes), np.uint32)[3]))

    monkeypatch.setattr(IndirectPass, "run", counted)
    return numbers


@pytest.fixture(autouse=True)
def same_surfaces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Meshes of both renderers are rasterised: the lists are compared here, not the surfaces."""
    monkeypatch.setattr(computed_mesh, "is_computed", lambda context: False)


def differences(one: Renderer, other: Renderer, scene: SceneLike, options: RenderOptions) -> np.ndarray:
    """Differences of two pictures, in levels of 255."""
    pictures = [renderer.render(scene, options).astype(int) for renderer in (one, other)]
    assert np.ptp(pictures[0][..., :3]) > 20
    difference: np.ndarray = np.abs(pictures[0] - pictures[1]).max(axis=-1)
    return difference


def near() -> SceneLike:
    """The inside of one decal of flat_view."""
    view = flat_view(0, "waves")
    return replace(view, camera=replace(view.camera, target=(-0.6, 1.0, 0.0), fov=0.9))


def ring() -> MeshObject:
    return MeshObject("ring", torus().vertices, torus().faces)


def posed(count: int = 60) -> SceneLike:
    """Layers of small decals with materials, fades and receivers on a deformed torus."""
    item = ring()
    rng = np.random.default_rng(4)
    decals_on = scattered(item, count, 2, radii=(0.08, 0.4)).replace(
        images=rng.integers(0, 3, count),
        layers=rng.integers(0, 2, count),
        opacities=rng.uniform(0.4, 1.0, count),
        fade_angles=np.where(rng.random(count) < 0.5, 120.0, 0.0),
        receivers=["ring"] * count,
    )
    camera = Camera.fitting(item.vertices, direction=(0.5, -0.9, 0.8), up=(0, 0, 1))
    scene = Scene(objects=[item], camera=camera, decals=decals_on, images=[GOLD, PLASTIC, ROUGH])
    bent = item.vertices * (1.0, 1.0, 1.4) + 0.1 * np.sin(3 * item.vertices[:, [1, 2, 0]])
    return decals.pose(scene, {"ring": bent})


def specks() -> SceneLike:
    """Decals of less than a pixel, beside large ones."""
    item = ring()
    decals_on = scattered(item, 400, 3, radii=(0.004, 0.3))
    camera = Camera.fitting(item.vertices, direction=(0.5, -0.9, 0.8), up=(0, 0, 1))
    return Scene(objects=[item], camera=camera, decals=decals_on, images=flat_view(0, "waves").images)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "least", "most"),
    [
        (lambda: flat_view(80, "waves"), 300, 1500),
        (near, 0, 0),
        (lambda: flat_view(45, "layers"), SIZE[0] * SIZE[1], SIZE[0] * SIZE[1]),
        (specks, 300, 1500),
        (posed, 1900, 2100),
    ],
    ids=["borders", "none", "layers", "specks", "posed"],
)
def test_listed_pixels_are_drawn_as_all_are(
    compute: Renderer,
    exact: Renderer,
    counts: list[int],
    scene: Callable[[], SceneLike],
    least: int,
    most: int,
) -> None:
    assert differences(compute, exact, scene(), OPTIONS).max() <= 1
    (count,) = counts
    assert least <= count <= most
