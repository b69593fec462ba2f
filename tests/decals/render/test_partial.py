"""What edits cannot reach is not drawn again, and nobody sees a difference: not in a single bit."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.grid.editor import DecalEditor
from decals.model import Decals, Interaction
from decals.render.lamps import Lamp, Lamps
from decals.render.renderer import Renderer
from decals.scenes.camera import Camera
from decals.scenes.scene import DecalImage, MeshObject, TreeObject
from decals.scenes.viewpoint import Projection
from tests.decals.render.test_drawing import bits
from tests.vtk.scenes import both

SIZE = (117, 90)


@dataclass
class Edited:
    objects: tuple[MeshObject | TreeObject, ...]
    decals: DecalEditor
    images: tuple[DecalImage, ...]
    camera: Camera


@pytest.fixture
def edited() -> Edited:
    """A mesh and a tree under decals of two sizes, with small ones strewn over them."""
    scene, rng = both(), np.random.default_rng(2)
    chosen = rng.integers(0, len(scene.decals), 40)
    strewn = scene.decals[chosen].replace(radii=rng.uniform(0.01, 0.25, len(chosen)))
    images = (*scene.images, DecalImage.load("eye"))
    return Edited(
        scene.objects, DecalEditor(Decals.concatenate([scene.decals, strewn])), images, scene.camera
    )


def edit(editor: DecalEditor, rng: np.random.Generator, kind: str) -> None:
    numbers = rng.choice(editor.numbers, 1)
    before = editor.take(numbers)
    if kind == "move":
        editor.put(
            numbers, before.replace(positions=before.positions + rng.normal(0, 0.1, (len(numbers), 3)))
        )
    elif kind == "scale":
        editor.put(numbers, before.replace(radii=before.radii * rng.uniform(0.5, 1.6, len(numbers))))
    elif kind == "turn":
        editor.put(numbers, before.replace(tangents=before.bitangents))
    elif kind == "look":
        opacities, images = rng.uniform(0, 1, len(numbers)), rng.integers(-1, 2, len(numbers))
        editor.put(numbers, before.replace(opacities=opacities, images=images))
    elif kind == "delete":
        editor.delete(numbers)
    elif kind == "add":
        editor.add(editor[int(numbers[0])].replace(positions=before.positions[:1] + np.float32(0.1)))
    elif kind == "layer":
        kinds, layers = rng.choice(list(Interaction), len(numbers)), rng.integers(-2, 3, len(numbers))
        editor.put(numbers, before.replace(interactions=kinds, layers=layers))
    else:
        many = editor.numbers[: 2 * len(editor) // 3]
        editor.put(many, editor.take(many[::-1]))


PLAIN_KINDS = ("move", "scale", "turn", "look", "delete", "add", "move", "move")
KINDS = (*PLAIN_KINDS, "layer", "layer", "many")


def parallel(scene: Edited) -> Projection:
    """A sheared view along an axis."""
    matrix = np.array([[0.7, 0.1, 0, 0], [0, 0.8, 0.2, 0], [0, 0.05, -0.3, 0], [0, 0, 0, 1.0]])
    return Projection(matrix)


@pytest.mark.parametrize("contact", list(Contact))
@pytest.mark.parametrize("kinds", [PLAIN_KINDS, KINDS])
def test_after_any_edits_the_bits_are_those_of_a_whole_picture(
    drawer: Renderer, edited: Edited, contact: Contact, kinds: tuple[str, ...]
) -> None:
    rng, shares = np.random.default_rng(1), []
    views: list[dict[str, Any]] = [{"samples": 2}, {"viewpoint": parallel(edited), "mapping": Mapping.CHORD}]
    with drawer.context.current():
        for step in range(9):
            for _ in range(1 + (step % 4 == 3)):
                edit(edited.decals, rng, kinds[rng.integers(len(kinds))])
            for number, view in enumerate(views):
                asked = {"size": SIZE, "contact": contact, **view}
                drawing = drawer.drawing(edited, slot=f"kept {number}", **asked)
                shares.append(drawing.left())
                drawing.complete() if step % 4 else advance(drawing)
                assert drawing.share == shares[-1]
                whole = drawer.drawing(edited, slot="whole", **asked)
                whole.targets.shown = None
                whole.complete()
                expected = bits(whole.targets)
                for name, found in bits(drawing.targets).items():
                    assert found == expected[name], (step, name)
    assert min(shares[:2]) >= 2 / 3
    assert 0.0 < np.median(shares[2:]) < 0.5
    assert drawer.drawing(edited, slot=f"kept {number}", **asked).left() == 0.0


def advance(drawing: Any) -> None:
    while not drawing.advance(0.0):
        pass


LAMPS = Lamps((Lamp((1.0, 1.0, 1.0), (0.0, 0.0, -1.0)),))


@pytest.mark.parametrize(
    ("change", "share"),
    [
        ({}, 0.0),
        ({"lamps": LAMPS}, 1 / 3),
        ({"mapping": Mapping.CHORD}, 2 / 3),
        ({"contact": Contact.SMOOTH}, 2 / 3),
    ],
)
def test_what_else_changes_is_drawn_over_the_same_surface(
    drawer: Renderer, edited: Edited, monkeypatch: pytest.MonkeyPatch, change: dict[str, Any], share: float
) -> None:
    with drawer.context.current():
        first = drawer.draw(edited, size=SIZE)
        monkeypatch.setattr(
            type(first.gbuffer), "clear", lambda *_: pytest.fail("the surface is drawn again")
        )
        drawing = drawer.drawing(edited, size=SIZE, **change)
        assert drawing.left() == pytest.approx(share)
        drawing.complete()
        found = bits(drawing.targets)
        monkeypatch.undo()
        drawer.draw(both(), size=(33, 22))
        assert bits(drawer.draw(edited, size=SIZE, **change)) == found


def test_pictures_of_an_edited_scene_paint_only_where_it_changed(drawer: Renderer, edited: Edited) -> None:
    """The same for whole pictures that are read back."""
    first = drawer.render(edited, size=(160, 120))
    rng = np.random.default_rng(3)
    with Renderer(drawer.context) as fresh:
        for _ in range(8):
            edit(edited.decals, rng, "move")
            seen = drawer.render(edited, size=(160, 120))
            fresh.render(both(), size=(31, 21))
            np.testing.assert_array_equal(seen, fresh.render(edited, size=(160, 120)))
    assert (seen != first).any()


def test_a_drawing_that_somebody_drew_over_begins_anew(drawer: Renderer, edited: Edited) -> None:
    with drawer.context.current():
        drawing = drawer.drawing(edited, size=SIZE, slot="shared")
        for _ in range(30):
            assert not drawing.advance(0.0)
        drawer.drawing(both(), size=SIZE, slot="shared").complete()
        advance(drawing)
        assert bits(drawing.targets) == bits(drawer.draw(edited, size=SIZE))


def test_editors_say_where_they_changed_something(edited: Edited) -> None:
    editor = edited.decals
    before, old = editor.version, editor[3]
    editor.change(3, positions=old.positions + np.float32(0.25))
    touched = editor.touched(before)
    assert touched is not None
    np.testing.assert_array_equal(touched[:, :3], np.concatenate([old.positions, editor[3].positions]))
    np.testing.assert_array_equal(touched[:, 3], np.tile(old.influence, 2))
    middle = editor.version
    editor.delete(3)
    assert len(editor.touched(middle) if editor.touched(middle) is not None else []) == 1
    assert len(editor.touched(editor.version) if editor.touched(editor.version) is not None else [0]) == 0
    for _ in range(5000):
        editor.change(4, opacities=[0.5])
    assert editor.touched(before) is None
    assert editor.touched(editor.version) is not None
