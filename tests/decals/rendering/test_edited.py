"""Scenes whose decals are being edited: the pictures are those of fresh scenes, and little is sent."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from blobtree import Point
from decals import Camera, DecalImage, Decals, Interaction, MeshObject, Scene, TreeObject, scatter
from decals.index import DecalEditor
from decals.rendering import Context, Renderer, RenderOptions
from decals.rendering.data_texture import DataTexture
from decals.rendering.decal_data import DecalData
from decals.scenes.camera import DEFAULT_DIRECTION


@dataclass
class EditedScene:
    objects: tuple[MeshObject | TreeObject, ...]
    decals: DecalEditor
    images: tuple[DecalImage, ...]
    camera: Camera

    def fresh(self) -> Scene:
        return Scene(objects=self.objects, decals=self.decals.decals, images=self.images, camera=self.camera)


@pytest.fixture
def edited() -> EditedScene:
    ball = TreeObject("ball", Point((0, 0, 0), radius=1.0))
    decals = scatter([ball.surface], count=200)
    images = (DecalImage.load("scale"), DecalImage.load("eye"))
    return EditedScene((ball,), DecalEditor(decals), images, Camera.framing(ball.bounds))


def edit(editor: DecalEditor, step: int) -> None:
    nearest = np.argsort(editor.decals.positions @ -np.array(DEFAULT_DIRECTION))
    number = int(editor.numbers[nearest[3 * step]])
    if step % 5 == 0:
        editor.change(number, positions=editor[number].positions + np.float32(0.02))
    elif step % 5 == 1:
        editor.delete(number)
    elif step % 5 == 2:
        editor.add(editor[number].replace(radii=editor[number].radii * 2, images=[1]))
    elif step % 5 == 3:
        editor.change(number, interactions=[Interaction.OVERLAP], tints=[[0.5, 1.0, 0.2]])
    else:
        numbers = editor.numbers[:150]
        turned = editor.take(numbers[::-1])
        editor.assign(numbers, turned.replace(radii=turned.radii * np.float32(0.9)))


@pytest.mark.slow
def test_edited_scenes_look_like_fresh_ones(renderer: Renderer, edited: EditedScene) -> None:
    pictures = [renderer.render(edited, RenderOptions(size=(160, 120)))]
    for step in range(10):
        edit(edited.decals, step)
        seen = renderer.buffers(edited, RenderOptions(size=(160, 120)))
        expected = renderer.buffers(edited.fresh(), RenderOptions(size=(160, 120)))
        owner = np.where(expected.owner < 0, -1, edited.decals.numbers[expected.owner])
        np.testing.assert_array_equal(seen.owner, owner)
        np.testing.assert_array_equal(seen.uv, expected.uv)
        pictures.append(renderer.render(edited, RenderOptions(size=(160, 120))))
        np.testing.assert_array_equal(
            pictures[-1], renderer.render(edited.fresh(), RenderOptions(size=(160, 120)))
        )
    assert [(one != other).any() for one, other in pairwise(pictures)] == [True] * 10


def test_what_is_undone_gives_the_first_picture_bit_for_bit(renderer: Renderer, edited: EditedScene) -> None:
    editor = edited.decals
    first, before = renderer.render(edited, RenderOptions(size=(160, 120))), editor.decals
    for step in range(10):
        edit(editor, step)
    assert editor.layered
    assert (renderer.render(edited, RenderOptions(size=(160, 120))) != first).any()
    editor.delete(editor.numbers[editor.numbers >= 200])
    editor.assign(np.arange(200), before)
    np.testing.assert_array_equal(renderer.render(edited, RenderOptions(size=(160, 120))), first)


def test_a_picture_after_an_edit_sends_about_a_kilobyte(
    renderer: Renderer, edited: EditedScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[int] = []
    made: list[DecalData] = []
    update, make = DecalData.update, DecalData.__init__

    def counted_make(self: DecalData, *args: Any, **options: Any) -> None:
        made.append(self)
        make(self, *args, **options)

    monkeypatch.setattr(DecalData, "update", lambda self, editor: sent.append(update(self, editor)))
    monkeypatch.setattr(DecalData, "__init__", counted_make)
    for step in range(21):
        number = int(edited.decals.numbers[step])
        edited.decals.change(number, positions=edited.decals[number].positions * np.float32(1.001))
        renderer.render(edited, RenderOptions(size=(40, 30), samples=1))
    assert len(made) == 1
    assert sent[0] == 0  # uploaded as a whole just before
    assert 0 < np.median(sent) < 2048
    assert max(sent) < 5000


def test_two_renderers_follow_one_editor(renderer: Renderer, edited: EditedScene) -> None:
    with Renderer(renderer.context) as other:
        other.render(edited, RenderOptions(size=(40, 30)))
        renderer.render(edited, RenderOptions(size=(40, 30)))
        edit(edited.decals, 3)
        one, two = (
            renderer.render(edited, RenderOptions(size=(160, 120))),
            other.render(edited, RenderOptions(size=(160, 120))),
        )
        np.testing.assert_array_equal(one, two)
        np.testing.assert_array_equal(one, other.render(edited.fresh(), RenderOptions(size=(160, 120))))


def test_no_decals_left(renderer: Renderer, edited: EditedScene) -> None:
    edited.decals.delete(edited.decals.numbers)
    assert len(edited.decals) == 0
    assert not edited.decals.layered
    np.testing.assert_array_equal(
        renderer.render(edited, RenderOptions(size=(80, 60))),
        renderer.render(edited.fresh(), RenderOptions(size=(80, 60))),
    )


# -- edits on the card ---------------------------------------------------------------------------------


def some(rng: np.random.Generator, count: int) -> Decals:
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    radii = np.full(count, 2.0 / np.sqrt(max(count, 100)))
    return Decals(normals, normals, rng.normal(size=(count, 3)), radii)


@pytest.mark.parametrize(
    ("first", "count"), [(0, 1), (5, 4096), (4000, 150), (4095, 1), (4096, 9000), (0, 15000)]
)
@pytest.mark.parametrize("row", [(), (4,)])
def test_writing_changes_these_elements_alone(
    context: Context, first: int, count: int, row: tuple[int, ...]
) -> None:
    array = np.arange(15000 * 4, dtype=np.int32).reshape(15000, 4)[:, 0] if row == () else None
    array = np.arange(15000 * 4, dtype=np.int32).reshape(15000, 4) if array is None else array.copy()
    texture = DataTexture(context, array)
    array[first : first + count] *= -3
    texture.write(first, array[first : first + count])
    np.testing.assert_array_equal(texture.read(), array)
    texture.release()


def test_after_each_edit_the_card_holds_what_the_editor_holds(context: Context) -> None:
    rng = np.random.default_rng(0)
    editor = DecalEditor(some(rng, 200))
    data = DecalData(context, editor)
    for step in range(200):
        number = int(rng.choice(editor.numbers))
        if step % 3 == 0:
            editor.add(some(rng, 1))
        elif step % 3 == 1:
            editor.change(number, positions=rng.normal(size=(1, 3)), layers=[step // 100])
        else:
            editor.delete(number)
        data.update(editor)
        assert data.layered == (step >= 100)
        for name, texture in data._textures.items():
            np.testing.assert_array_equal(texture.read(), editor.arrays[name])
        assert data._uniforms == {"index_level_count": editor.level_count, "index_mask": editor.index.mask}
    data.release()


def test_an_edit_among_many_sends_little(context: Context) -> None:
    rng = np.random.default_rng(1)
    editor = DecalEditor(some(rng, 30_000))
    data = DecalData(context, editor)
    sent = []
    for number in range(40):
        editor.change(number, positions=editor[number].positions * np.float32(1.0001))
        sent.append(data.update(editor))
    assert max(sent) < 10_000
    data.release()
