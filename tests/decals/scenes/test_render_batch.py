"""`render_batch` draws the pictures of `render`, bit for bit, in one context; errors are clear."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import blobtree
import decals
from decals import Camera, Contact, Scene, cover, render, render_batch
from decals.errors import InvalidScene
from decals.rendering import Context
from decals.rendering import context as context_module

TREE = blobtree.Point((0, 0, 0), radius=1.0)
SIZE = (60, 40)


@pytest.fixture(scope="module")
def scenes() -> list[Scene]:
    lumps = TREE + blobtree.Point((1.1, 0, 0), radius=0.7)
    mesh = blobtree.polygonize(lumps, resolution=16)
    return [cover(TREE, count=6), cover(mesh, count=9), cover(lumps, count=4, seed=2)]


def same(pictures: list[Any], others: list[Any]) -> bool:
    return len(pictures) == len(others) and all(
        np.array_equal(picture, other) for picture, other in zip(pictures, others, strict=True)
    )


def test_many_scenes(scenes: list[Scene]) -> None:
    options: dict[str, Any] = {"size": SIZE, "contact": Contact.RADIAL, "background": "white"}
    expected = [render(scene, **options) for scene in scenes]
    assert same(list(render_batch(scenes, **options)), expected)
    assert same(list(render_batch(iter(scenes), **options)), expected)
    assert same(list(render_batch(tuple(scenes), **options)), expected)


def test_many_viewpoints_of_one_scene(scenes: list[Scene]) -> None:
    cameras = [Camera((5, 0, 0)), Camera((0, 5, 1)), Camera((0, 0, 4), fov=40)]
    expected = [render(scenes[2], size=SIZE, viewpoint=camera) for camera in cameras]
    assert same(list(render_batch(scenes[2], viewpoints=cameras, size=SIZE)), expected)
    assert same(list(render_batch(scenes[2], viewpoints=iter(cameras), size=SIZE)), expected)
    assert same(list(render_batch(scenes[2], viewpoints=cameras[1], size=SIZE)), expected[1:2])


def test_each_scene_from_its_viewpoint(scenes: list[Scene]) -> None:
    cameras = [Camera((5, 0, 0)), Camera((0, 5, 1)), Camera((0, 0, 4), fov=40)]
    pairs = list(zip(scenes, cameras, strict=True))
    expected = [render(scene, size=SIZE, viewpoint=camera) for scene, camera in pairs]
    assert same(list(render_batch(scenes, viewpoints=cameras, size=SIZE)), expected)


def test_models_and_recipes(scenes: list[Scene]) -> None:
    mesh = blobtree.polygonize(TREE, resolution=8)
    pair = mesh.vertices, mesh.faces
    found = list(render_batch([TREE, [TREE, mesh]], size=SIZE))
    assert same(found, [render(TREE, size=SIZE), render([TREE, mesh], size=SIZE)])
    assert same(list(render_batch(pair, size=SIZE)), [render(pair, size=SIZE)])
    (picture,) = render_batch(scenes[0], size=SIZE)
    assert picture.recipe is not None
    assert picture.recipe["scene"] == (render(scenes[0], size=SIZE).recipe or {})["scene"]


def test_pictures_are_drawn_when_they_are_taken(scenes: list[Scene]) -> None:
    taken: list[int] = []

    def endless() -> Iterator[Scene]:
        while True:
            taken.append(len(taken))
            yield scenes[0]

    pictures = render_batch(endless(), size=SIZE)
    assert not taken
    assert next(pictures).shape == (40, 60, 4)
    assert next(pictures).shape == (40, 60, 4)
    assert len(taken) == 2


def test_all_pictures_share_a_context(scenes: list[Scene], monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    standalone = Context.standalone

    def counted() -> Context:
        made.append(1)
        return standalone()

    monkeypatch.setattr(context_module, "_idle", type(context_module._idle)())
    monkeypatch.setattr(Context, "standalone", counted)
    assert len(list(render_batch(scenes, size=SIZE))) == 3
    assert len(made) == 1


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        (
            lambda scenes: scenes,
            {"viewpoints": [Camera((5, 0, 0))] * 2},
            "viewpoints: .*of 3 scenes, got 2",
        ),
        (lambda scenes: scenes, {"viewpoints": 3}, "viewpoint: expected a Camera"),
        (lambda scenes: scenes[0], {"viewpoints": [3]}, "viewpoint: expected a Camera"),
        (lambda scenes: scenes, {"size": (0, 3)}, "size"),
        (lambda scenes: scenes, {"contact": "soft"}, "contact: expected"),
    ],
)
def test_errors(scenes: list[Scene], arguments: Any, options: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidScene, match=words):
        list(render_batch(arguments(scenes), **{"size": SIZE, **options}))


def test_no_scenes_and_no_viewpoints_give_no_pictures(scenes: list[Scene]) -> None:
    assert list(render_batch([], size=SIZE)) == []
    assert list(render_batch(scenes[0], viewpoints=[], size=SIZE)) == []


def test_an_unusable_model_ends_the_batch_there(scenes: list[Scene]) -> None:
    pictures = render_batch([scenes[0], 3], size=SIZE)  # type: ignore[list-item]
    next(pictures)
    with pytest.raises(decals.ImplicitDecalsError, match="expected"):
        next(pictures)
