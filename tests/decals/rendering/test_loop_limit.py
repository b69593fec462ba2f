"""Stacks too deep for a driver are refused as soon as an edit makes them, with little reading of lists."""

import inspect
from typing import Any

import numpy as np
import pytest

from decals import Decals, Interaction
from decals.errors import TooMuchData
from decals.index import DecalEditor, DecalIndex
from decals.rendering import Renderer
from decals.rendering.decal_data import LoopLimit
from tests.decals.rendering.pictures import WHITE
from tests.decals.rendering.test_millions import PAPER, check_one_point, one_point
from tests.decals.shapes import View


def some(rng: np.random.Generator, count: int) -> Decals:
    arrays: dict[str, Any] = {
        "positions": rng.uniform(-0.4, 0.4, (count, 3)),
        "normals": np.tile([0, 0, 1], (count, 1)),
        "tangents": np.tile([1, 0, 0], (count, 1)),
        "radii": 10.0 ** rng.uniform(-1, 0, count),
        "interactions": rng.choice([Interaction.PUSH, Interaction.OVERLAP], count, p=[0.9, 0.1]),
    }
    return Decals(**arrays)


def refusal(limit: LoopLimit, editor: DecalEditor) -> str:
    try:
        limit.check(editor.index, layered=editor.layered, version=editor.version)
    except TooMuchData as error:
        return str(error)
    return ""


@pytest.mark.ordinary_cases("0", "5")
@pytest.mark.parametrize("seed", range(6))
def test_what_edits_pile_up_is_refused_when_it_would_be_at_once(seed: int) -> None:
    rng, refused, steps = np.random.default_rng(seed), 0, 300
    editor, most = DecalEditor(some(rng, 5)), int(rng.integers(300, 3_000))
    kept = LoopLimit(most)
    for _ in range(steps):
        if rng.random() < 0.7 or not len(editor):
            numbers = editor.next_number + np.arange(rng.integers(1, 4))
            editor.assign(numbers, some(rng, len(numbers)))
        else:
            editor.delete(rng.choice(editor.numbers, min(2, len(editor)), replace=False))
        seen = refusal(kept, editor)
        assert seen == refusal(LoopLimit(most), editor)
        refused += bool(seen)
    assert 0 < refused < steps


def test_few_edits_read_all_lists(monkeypatch: pytest.MonkeyPatch) -> None:
    lists, reads, rng = inspect.getattr_static(DecalIndex, "longest_lists"), 0, np.random.default_rng(9)

    def counted(index: DecalIndex) -> Any:
        nonlocal reads
        reads += 1
        return lists.fget(index)

    monkeypatch.setattr(DecalIndex, "longest_lists", property(counted))
    editor, limit = DecalEditor(some(rng, 300)), LoopLimit(65_535)
    for _ in range(100):
        editor.change(int(rng.choice(editor.numbers)), positions=rng.uniform(-0.4, 0.4, (1, 3)))
        assert not refusal(limit, editor)
    assert 0 < reads <= 20


def test_nothing_is_read_where_there_is_no_limit() -> None:
    editor = DecalEditor(some(np.random.default_rng(0), 300))
    assert not refusal(LoopLimit(None), editor)
    assert refusal(LoopLimit(100), editor)


def test_a_picture_of_decals_that_were_piled_up_is_refused_until_they_are_gone(renderer: Renderer) -> None:
    if renderer.context.max_loop_iterations is None:
        pytest.skip("this driver has no limit of turns")
    start = one_point(3)
    assert isinstance(start.decals, Decals)
    editor = DecalEditor(start.decals)
    view = View(start.objects, start.camera, editor, (WHITE,))  # type: ignore[arg-type]  # an editor is drawn too
    check_one_point(renderer.buffers(view, PAPER))
    numbers = np.arange(3, 9_000)
    editor.assign(numbers, one_point(len(numbers)).decals)
    for _ in range(2):
        with pytest.raises(TooMuchData, match=r"9,000 decals reach the same place"):
            renderer.buffers(view, PAPER)
    editor.delete(numbers)
    check_one_point(renderer.buffers(view, PAPER))
