"""Edits on the card: after every edit it holds what the editor holds, and little was sent."""

import numpy as np
import pytest

from decals import Decals
from decals.index import DecalEditor
from decals.rendering import Context
from decals.rendering.data_texture import DataTexture
from decals.rendering.decal_data import DecalData


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
