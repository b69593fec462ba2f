"""What is no tree, no device, no file and no function is named in one line, wherever it is given."""

from pathlib import Path
from typing import Any

import pytest

from blobtree import (
    ImplicitDecalsError,
    Point,
    Polygonizer,
    from_json,
    load,
    polygonize,
    save,
    split_creases,
    to_json,
)
from blobtree.errors import InvalidDevice, InvalidFile, InvalidNode, InvalidPoints

BALL = Point((0, 0, 0), radius=1.0)
NO_TREES: list[Any] = [None, 5, "x", [BALL], {}, Point]


@pytest.mark.parametrize("wrong", NO_TREES)
@pytest.mark.parametrize(
    "call",
    [
        polygonize,
        Polygonizer,
        lambda tree: polygonize(tree, chord_error=0.1),
        lambda tree: Polygonizer(BALL, resolution=4).update(tree),
        lambda tree: split_creases(tree, polygonize(BALL, resolution=4)),
        to_json,
    ],
)
def test_what_is_no_tree_is_refused(call: Any, wrong: Any) -> None:
    with pytest.raises(InvalidNode, match="tree: expected a BlobTree node such as Point"):
        call(wrong)


def test_a_polygonizer_keeps_its_mesh_when_it_is_given_no_tree() -> None:
    polygonizer = Polygonizer(BALL, resolution=4)
    before = polygonizer.mesh
    with pytest.raises(InvalidNode):
        polygonizer.update(None)  # type: ignore[arg-type]
    assert polygonizer.mesh is before
    assert polygonizer.tree is BALL


@pytest.mark.parametrize("wrong", ["bogus", "cuda:99", "", 5, [1]])
@pytest.mark.parametrize(
    "call",
    [
        lambda device: polygonize(BALL, resolution=4, device=device),
        lambda device: polygonize(BALL, chord_error=0.1, device=device),
        lambda device: Polygonizer(BALL, resolution=4, device=device),
        lambda device: BALL.to_pyvista(resolution=4, device=device),
        lambda device: BALL.raycast([[0, 0, 3]], [[0, 0, -1]], device=device),
        lambda device: BALL.tape.on(device),
    ],
)
def test_a_device_that_there_is_not_is_refused_with_those_there_are(call: Any, wrong: Any) -> None:
    with pytest.raises(InvalidDevice, match=r"device: expected a Warp device \('cpu'.*\), got"):
        call(wrong)


@pytest.mark.parametrize("name", ["progress", "cancel"])
@pytest.mark.parametrize("wrong", ["x", 5, [1]])
def test_what_cannot_be_called_is_refused_before_the_work(name: str, wrong: Any) -> None:
    with pytest.raises(ImplicitDecalsError, match=f"{name}: expected a function or None, got"):
        polygonize(BALL, resolution=4, **{name: wrong})


@pytest.mark.parametrize("wrong", [None, 5, [1], {}])
def test_what_is_neither_path_nor_text_is_refused(wrong: Any, tmp_path: Path) -> None:
    with pytest.raises(InvalidFile, match="path: expected the path of a file"):
        load(wrong)
    with pytest.raises(InvalidFile, match="expected JSON as text or bytes"):
        from_json(wrong)
    with pytest.raises(InvalidNode, match="tree: expected"):
        save(wrong, tmp_path / "tree.json")
    assert not list(tmp_path.iterdir())
    with pytest.raises(InvalidPoints, match="mesh: expected a Mesh"):
        split_creases(BALL, wrong)
