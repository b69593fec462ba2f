"""Invalid arguments of a renderer raise an error that names them in one line."""

from typing import Any

import numpy as np
import pytest

import blobtree
import decals
from decals import Camera, Contact, ImageMapping
from decals.errors import ImplicitDecalsError, InvalidPoints, InvalidScene, TooMuchData
from decals.rendering import TRANSPARENT, Background, Drawing, Light, Lighting, Renderer, RenderOptions
from decals.rendering.picture import TiledArray
from tests.decals.editing.scenes import one, scene

SIZE = (16, 12)
NUMBERS = (-1, 0, True, 10**400, 0.5, float("nan"), float("inf"), np.array(np.nan))
OTHERS: tuple[Any, ...] = (
    None,
    "x",
    b"x",
    {},
    ...,
    [None],
    ["x"],
    np.zeros((2, 2)),
    np.full((4, 4), np.nan),
    int,
    one(),
)
WRONG = (*NUMBERS, *OTHERS)


def refused(call: Any, error: type[ImplicitDecalsError] = InvalidScene) -> None:
    with pytest.raises(error) as caught:
        call()
    assert "\n" not in str(caught.value)
    assert "expected" in str(caught.value)


def drawn(renderer: Renderer, shown: Any, *, viewpoint: Any = None, **options: Any) -> Any:
    return renderer.render(shown, RenderOptions(**options), viewpoint=viewpoint)


@pytest.mark.parametrize("wrong", WRONG, ids=repr)
def test_every_argument_is_checked_by_every_picture(renderer: Renderer, wrong: Any) -> None:
    shown = scene()
    refused(lambda: renderer.render(wrong, RenderOptions(size=SIZE)))
    refused(lambda: renderer.buffers(wrong, RenderOptions(size=SIZE)))
    refused(lambda: renderer.begin_frame(wrong, RenderOptions(size=SIZE, samples=1)))
    for name in ("size", "samples", "background", "mapping", "contact", "viewpoint", "lights"):
        if wrong is None and name in ("viewpoint", "lights"):
            continue  # these may be left out
        if name in ("mapping", "contact") and type(wrong) in (int, bool) and 0 <= wrong < 4:
            continue  # the numbers of modes
        if name == "samples" and wrong is True:
            pass  # no number of samples
        refused(lambda name=name: drawn(renderer, shown, **{"size": SIZE, name: wrong}))
    for name in ("x", "y"):
        if not (type(wrong) is int and 0 <= wrong < 12):
            refused(
                lambda name=name: renderer.buffers_at(
                    shown, **{"x": 1, "y": 1, name: wrong}, options=RenderOptions(size=SIZE)
                ),
                InvalidPoints,
            )
    refused(lambda: Renderer(renderer.context, max_tile=wrong))
    if wrong is not None:
        refused(lambda: Renderer(wrong))


@pytest.mark.parametrize("wrong", WRONG, ids=repr)
def test_lights_and_backgrounds_are_made_of_numbers(wrong: Any) -> None:
    for name in ("color", "direction", "position", "attenuation"):
        if not (wrong is None and name == "position"):
            refused(lambda name=name: Light(**{"color": (1, 1, 1), "direction": (0, 0, -1), name: wrong}))
    refused(lambda: Lighting(wrong))
    refused(lambda: Lighting((wrong,)))
    refused(lambda: Background(wrong, (0, 0, 0, 0)))
    refused(lambda: Background((0, 0, 0, 0), wrong))


@pytest.mark.parametrize("cone", ["x", None, float("nan"), [1]])
def test_cones_of_lights_are_angles(cone: Any) -> None:
    refused(lambda: Light((1, 1, 1), (0, 0, -1), cone=cone))
    refused(lambda: Light((1, 1, 1), (0, 0, -1), exponent=cone))


def test_sizes_and_lights_may_be_any_sequences(renderer: Renderer) -> None:
    light = Light(np.ones(3), [0, 0, -1])  # type: ignore[arg-type]
    same = Light((1, 1, 1), (0, 0, -1))
    assert light == same
    pictures = [
        renderer.render(scene(), RenderOptions(size=size, lights=Lighting((light,))))  # type: ignore[arg-type]
        for size in ([16, 12], np.array([16, 12]), (np.int64(16), 12))
    ]
    for picture in pictures:
        np.testing.assert_array_equal(picture, pictures[0])


def test_a_picture_after_a_refused_one_is_as_before(renderer: Renderer) -> None:
    before = renderer.render(scene(), RenderOptions(size=SIZE))
    refused(lambda: renderer.render(scene(), RenderOptions(size=SIZE), viewpoint=np.eye(4)))  # type: ignore[arg-type]
    refused(lambda: renderer.render(scene(), RenderOptions(size=SIZE, background="no colour")))
    np.testing.assert_array_equal(renderer.render(scene(), RenderOptions(size=SIZE)), before)
    with pytest.raises(InvalidScene, match="viewpoint: expected a Camera"):
        renderer.render(scene(), RenderOptions(size=SIZE), viewpoint=Camera)  # type: ignore[arg-type]


def test_modes_and_colours_by_name() -> None:
    assert RenderOptions(contact="radial", mapping="Chord") == RenderOptions(
        contact=Contact.RADIAL, mapping=ImageMapping.CHORD
    )
    assert Background("white", "#00000000") == Background((1, 1, 1, 1), (0, 0, 0, 0))
    assert Light("red", (0, 0, -1)) == Light((1, 0, 0), (0, 0, -1))
    for wrong in ("round", 4, None):
        with pytest.raises(InvalidScene, match=r"contact: expected one of 'product', .*, 'elastic', got"):
            RenderOptions(contact=wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("color", ["white", "#ffffff", (1, 1, 1), [1.0, 1.0, 1.0, 1.0], np.ones(3)])
def test_a_background_is_a_colour_too(color: Any) -> None:
    white = Background("white", "white")
    assert RenderOptions(background=color).background == white
    assert Drawing(background=color) == Drawing(background=white)


def test_a_background_has_a_name(renderer: Renderer) -> None:
    assert Drawing(background="transparent").background == TRANSPARENT
    seen = renderer.render(scene(), RenderOptions(size=SIZE, background="red"))
    assert seen[0, 0].tolist() == [255, 0, 0, 255]
    with pytest.raises(InvalidScene, match="or a name, got 'no colour'"):
        Drawing(background="no colour")
    with pytest.raises(InvalidScene, match="background: expected"):
        Drawing(background=5)  # type: ignore[arg-type]


def test_a_picture_has_at_most_16384_pixels_a_side(monkeypatch: pytest.MonkeyPatch) -> None:
    assert RenderOptions(size=(16384, 1)).size == (16384, 1)
    for size in ((100_000, 100_000), (16385, 1)):
        with pytest.raises(
            InvalidScene, match=f"size: expected a whole number from 1 to 16384, got {size[0]}"
        ):
            decals.render(blobtree.Point((0, 0, 0), radius=1), size=size)

    def full(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(np, "zeros", full)
    with pytest.raises(TooMuchData, match="fits in memory, got 16384 x 9000 pixels; make it smaller"):
        TiledArray((16384, 9000), 4, np.uint8)
