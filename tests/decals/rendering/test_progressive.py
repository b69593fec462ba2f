"""Pictures drawn part by part have the same bits as pictures drawn at once."""

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decals.rendering import Renderer, RenderOptions
from decals.rendering.progressive import MAX_UNITS, UNITS, ProgressiveFrame
from decals.rendering.targets import TEXTURE_KINDS, Targets
from decals.rendering.viewpoint import Part
from tests.decals.vtk.scenes import both

SIZE = (117, 90)


def bits(targets: Targets) -> dict[str, bytes]:
    gbuffer, shown = targets.gbuffer, targets.shown
    assert shown is not None
    named = {
        "position": gbuffer.position,
        "normal": gbuffer.normal,
        "color": gbuffer.color,
        "depth": gbuffer.depth,
        "paint": targets.decal_pass.paint,
        "light": targets.light_pass.light,
        "shown color": shown.color,
        "shown depth": shown.depth,
    }
    return {name: texture.read() for name, texture in named.items()}


@pytest.mark.slow_cases("compute-0.0-1", "compute-0.0-2", "fragment-0.0-1")
@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize("seconds", [0.0, 0.01])
def test_a_picture_in_parts_has_the_bits_of_one_at_once(
    drawer: Renderer, samples: int, seconds: float
) -> None:
    """Mesh, tree, decals, and light that looks at its neighbours."""
    with drawer.context.current():
        whole = bits(drawer.draw(both(), RenderOptions(size=SIZE, samples=samples)))
        drawing = drawer.begin_frame(both(), RenderOptions(size=SIZE, samples=samples), slot="parts")
        turns = 1
        while not drawing.advance(seconds):
            turns += 1
            if turns % 50 == 0:  # another renderer draws in between; its uploads stay separate
                drawer.draw(
                    both().replace(objects=both().objects[:1]), RenderOptions(size=(31, 22), samples=1)
                )
        parts = bits(drawing.targets)
    for name, expected in whole.items():
        assert parts[name] == expected, name
    assert any(parts["light"])
    if not seconds:
        assert turns > UNITS // MAX_UNITS


def test_targets_are_made_one_texture_at_a_time(drawer: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    new = drawer.context._new_texture

    def counted(size: tuple[int, int], kind: str) -> Any:
        made.append(kind)
        return new(size, kind)

    monkeypatch.setattr(drawer.context, "_new_texture", counted)
    with drawer.context.current():
        drawer.draw(both(), RenderOptions(size=(8, 8), samples=1))  # so that all else is there
        made.clear()
        drawing = drawer.begin_frame(both(), RenderOptions(size=(61, 37), samples=1), slot="new")
        for number in range(len(TEXTURE_KINDS) + 1):
            assert made == list(TEXTURE_KINDS[:number])
            drawing.advance(0.0)
        assert made == list(TEXTURE_KINDS)
        assert not any(drawer.context._spare_textures.values())
        drawer.begin_frame(both(), RenderOptions(size=(61, 38), samples=1), slot="new").advance(0.0)
        assert any(drawer.context._spare_textures.values())
        drawer.context.clear_spare_textures()
        assert not drawer.context._spare_textures


def test_slots_keep_their_pictures(drawer: Renderer) -> None:
    with drawer.context.current():
        first = drawer.begin_frame(both(), RenderOptions(size=SIZE, samples=1), slot="parts")
        first.complete()
        before = bits(first.targets)
        drawer.draw(both().replace(decals=both().decals[:9]), RenderOptions(size=SIZE, samples=1))
        assert bits(first.targets) == before


def test_pictures_of_other_objects_are_forgotten(drawer: Renderer) -> None:
    options, scene = RenderOptions(size=SIZE, samples=1), both()
    with drawer.context.current():

        def drawn(shown: Any, slot: str) -> Any:
            frame = drawer.begin_frame(shown, options, slot=slot)
            frame.complete()
            assert (frame.targets.frame, frame._previous) == (None, None)
            return frame.targets

        first = drawn(scene, "parts")
        before = bits(first)
        drawer.forget_others(drawn(scene.replace(decals=scene.decals[:9]), "others"))
        assert first.state is not None
        drawer.forget_others(drawn(scene.replace(objects=scene.objects[:1]), "others"))
        assert first.state is None
        assert bits(drawn(scene, "parts")) == before
        drawer.release_targets("parts")
        assert drawer.targets_of("parts") is None
        assert bits(drawn(scene, "parts")) == before


@given(st.lists(st.integers(0, UNITS), max_size=20), st.integers(0, 5000))
def test_parts_miss_nothing_and_take_nothing_twice(cuts: list[int], count: int) -> None:
    edges = [0, *sorted(cuts), UNITS]
    parts = [Part(a / UNITS, b / UNITS).of(count) for a, b in pairwise(edges)]
    numbers = [number for first, last in parts for number in range(first, last)]
    assert numbers == list(range(count))


class Machine:
    """A clock that work moves: each unit of a step costs what is written, in seconds."""

    def __init__(self, costs: list[Any]) -> None:
        self.now, self.costs = 0.0, costs
        self.most = 0.0

    def step(self, number: int, part: Part) -> None:
        units = range(round(part.begin * UNITS), round(part.end * UNITS))
        self.now += 1e-5 + sum(float(self.costs[number][unit]) for unit in units)

    def drawing(self) -> ProgressiveFrame:
        steps = [lambda part, number=number: self.step(number, part) for number in range(len(self.costs))]
        plan: Any = SimpleNamespace(steps=steps, state=None, work=1.0)
        targets: Any = SimpleNamespace(frame=None, state=None)
        return ProgressiveFrame(iter([targets]), lambda *_: plan, lambda: None, clock=lambda: self.now)


@pytest.mark.parametrize("total", [0.02, 0.5, 4.0])
def test_no_turn_takes_much_longer_than_it_is_given(total: float) -> None:
    """Rows that show much come after rows that show nothing, and steps differ a hundredfold."""
    rng = np.random.default_rng(1)
    dense = np.zeros(UNITS)
    dense[UNITS // 2 :] = 2.0 * total / UNITS
    costs = [dense, 0.01 * dense, rng.random(UNITS) * 2.0 * total / UNITS]
    machine = Machine(costs)
    drawing, turns = machine.drawing(), []
    while not drawing.done:
        before = machine.now
        drawing.advance(0.04)
        turns.append(machine.now - before)
    assert max(turns) < 0.04 + 2.0 * total * MAX_UNITS / UNITS
    assert drawing.seconds == pytest.approx(sum(turns))
    assert len(turns) < 2 * machine.now / 0.03 + 2


def test_what_cannot_be_drawn_in_time_goes_on_by_the_smallest_parts() -> None:
    machine = Machine([np.full(UNITS, 1.0)])
    drawing = machine.drawing()
    sizes = []
    for _ in range(5):
        before = machine.now
        assert not drawing.advance(0.04)
        sizes.append(round(machine.now - before))
    assert sizes == [8, 4, 4, 4, 4]
