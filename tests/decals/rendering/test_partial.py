"""Regions that edits cannot reach are not drawn again; the picture has the same bits."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from decals import Camera, Contact, DecalImage, Decals, ImageMapping, Interaction, MeshObject, TreeObject
from decals.index import DecalEditor, change_log
from decals.rendering import Light, Lighting, Projection, Renderer, RenderOptions
from tests.decals.rendering.test_progressive import bits
from tests.decals.vtk.scenes import both

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
        editor.assign(
            numbers, before.replace(positions=before.positions + rng.normal(0, 0.1, (len(numbers), 3)))
        )
    elif kind == "scale":
        editor.assign(numbers, before.replace(radii=before.radii * rng.uniform(0.5, 1.6, len(numbers))))
    elif kind == "turn":
        editor.assign(numbers, before.replace(tangents=before.bitangents))
    elif kind == "look":
        opacities, images = rng.uniform(0, 1, len(numbers)), rng.integers(-1, 2, len(numbers))
        editor.assign(numbers, before.replace(opacities=opacities, images=images))
    elif kind == "delete":
        editor.delete(numbers)
    elif kind == "add":
        editor.add(editor[int(numbers[0])].replace(positions=before.positions[:1] + np.float32(0.1)))
    elif kind == "layer":
        kinds, layers = rng.choice(list(Interaction), len(numbers)), rng.integers(-2, 3, len(numbers))
        editor.assign(numbers, before.replace(interactions=kinds, layers=layers))
    else:
        many = editor.numbers[: 2 * len(editor) // 3]
        editor.assign(many, editor.take(many[::-1]))


PLAIN_KINDS = ("move", "scale", "turn", "look", "delete", "add", "move", "move")
KINDS = (*PLAIN_KINDS, "layer", "layer", "many")


def parallel(scene: Edited) -> Projection:
    """A sheared view along an axis."""
    matrix = np.array([[0.7, 0.1, 0, 0], [0, 0.8, 0.2, 0], [0, 0.05, -0.3, 0], [0, 0, 0, 1.0]])
    return Projection(matrix)


CASES = [(PLAIN_KINDS, Contact.PRODUCT), *((KINDS, contact) for contact in Contact)]
ORDINARY = {("fragment", (KINDS, Contact.ELASTIC))}
"""The default contact. What an edit can reach is found in the same way for both kinds of shaders."""


@pytest.mark.parametrize(
    ("drawer", "kinds", "contact"),
    [
        pytest.param(backend, *case, marks=() if (backend, case) in ORDINARY else pytest.mark.slow)
        for backend in ("fragment", "compute")
        for case in CASES
    ],
    indirect=["drawer"],
)
def test_after_any_edits_the_bits_are_those_of_a_whole_picture(
    drawer: Renderer, edited: Edited, contact: Contact, kinds: tuple[str, ...]
) -> None:
    rng, shares = np.random.default_rng(1), []
    views: list[dict[str, Any]] = [
        {"samples": 2},
        {"mapping": ImageMapping.CHORD},
    ]
    with drawer.context.current():
        for step in range(9):
            for _ in range(1 + (step % 4 == 3)):
                edit(edited.decals, rng, kinds[rng.integers(len(kinds))])
            for number, view in enumerate(views):
                options = RenderOptions(**{"size": SIZE, "samples": 1, "contact": contact, **view})
                viewpoint = parallel(edited) if number else None
                slot = f"kept {number}"
                frame = drawer.begin_frame(edited, options, viewpoint=viewpoint, slot=slot)
                shares.append(drawer.remaining_work(edited, options, viewpoint=viewpoint, slot=slot))
                frame.complete(max_samples=500 if step % 2 else None) if step % 4 else advance(frame)
                assert frame.work == shares[-1]
                whole = drawer.begin_frame(edited, options, viewpoint=viewpoint, slot="whole")
                whole.targets.state = None
                whole.complete()
                expected = bits(whole.targets)
                for name, found in bits(frame.targets).items():
                    assert found == expected[name], (step, name)
    assert min(shares[:2]) >= 2 / 3
    assert 0.0 < np.median(shares[2:]) < 0.5
    assert drawer.remaining_work(edited, options, viewpoint=viewpoint, slot=slot) == 0.0


def advance(drawing: Any) -> None:
    while not drawing.advance(0.0):
        pass


LIGHTS = Lighting((Light((1.0, 1.0, 1.0), (0.0, 0.0, -1.0)),))


@pytest.mark.parametrize(
    ("change", "share"),
    [
        ({}, 0.0),
        ({"lights": LIGHTS}, 1 / 3),
        ({"mapping": ImageMapping.CHORD}, 2 / 3),
        ({"contact": Contact.MIN}, 2 / 3),
    ],
)
def test_what_else_changes_is_drawn_over_the_same_surface(
    drawer: Renderer, edited: Edited, monkeypatch: pytest.MonkeyPatch, change: dict[str, Any], share: float
) -> None:
    with drawer.context.current():
        first = drawer.draw(edited, RenderOptions(size=SIZE, samples=1))
        monkeypatch.setattr(
            type(first.gbuffer), "clear", lambda *_: pytest.fail("the surface is drawn again")
        )
        options = RenderOptions(size=SIZE, samples=1, **change)
        drawing = drawer.begin_frame(edited, options)
        assert drawer.remaining_work(edited, options) == pytest.approx(share)
        drawing.complete()
        found = bits(drawing.targets)
        monkeypatch.undo()
        drawer.draw(both(), RenderOptions(size=(33, 22), samples=1))
        assert bits(drawer.draw(edited, options)) == found


@pytest.mark.slow_cases("compute")
def test_pictures_of_an_edited_scene_paint_only_where_it_changed(drawer: Renderer, edited: Edited) -> None:
    """The same for whole pictures that are read back."""
    first = drawer.render(edited, RenderOptions(size=(160, 120)))
    rng = np.random.default_rng(3)
    with Renderer(drawer.context) as fresh:
        for _ in range(8):
            edit(edited.decals, rng, "move")
            seen = drawer.render(edited, RenderOptions(size=(160, 120)))
            fresh.render(both(), RenderOptions(size=(31, 21)))
            np.testing.assert_array_equal(seen, fresh.render(edited, RenderOptions(size=(160, 120))))
    assert (seen != first).any()


def test_a_drawing_that_somebody_drew_over_begins_anew(drawer: Renderer, edited: Edited) -> None:
    with drawer.context.current():
        drawing = drawer.begin_frame(edited, RenderOptions(size=SIZE, samples=1), slot="shared")
        for _ in range(30):
            assert not drawing.advance(0.0)
        drawer.begin_frame(both(), RenderOptions(size=SIZE, samples=1), slot="shared").complete()
        advance(drawing)
        assert bits(drawing.targets) == bits(drawer.draw(edited, RenderOptions(size=SIZE, samples=1)))


def test_editors_say_where_they_changed_something(edited: Edited, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(change_log, "MAX_DIRTY_BALLS", 50)
    editor = edited.decals
    before, old = editor.version, editor[3]
    editor.change(3, positions=old.positions + np.float32(0.25))
    touched = editor.changed_balls(before)
    assert touched is not None
    np.testing.assert_array_equal(touched[:, :3], np.concatenate([old.positions, editor[3].positions]))
    np.testing.assert_array_equal(touched[:, 3], np.tile(old.influence, 2))
    middle = editor.version
    editor.delete(3)
    for version, expected in ((middle, 1), (editor.version, 0)):
        touched = editor.changed_balls(version)
        assert touched is not None
        assert len(touched) == expected
    for _ in range(60):
        editor.change(4, opacities=[0.5])
    assert editor.changed_balls(before) is None
    assert editor.changed_balls(editor.version) is not None
