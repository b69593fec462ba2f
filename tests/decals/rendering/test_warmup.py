"""What a picture takes for the first time, piece by piece."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from decals import Contact, Decals, ImageMapping, Scene
from decals.index import DecalEditor
from decals.rendering import Context, Lighting, Renderer, RenderOptions
from decals.rendering.pixel_pass import COMPUTE_VERSION
from decals.rendering.progressive import DRAWING
from decals.rendering.warmup import WarmupTask, with_status
from tests.decals.vtk.scenes import both

SIZE = (40, 30)
PLAIN = RenderOptions(size=SIZE, samples=1)


@pytest.fixture(params=["fragment", "compute"])
def renderer(request: pytest.FixtureRequest, context: Context) -> Iterator[Renderer]:
    if request.param == "compute" and context.gl.version_code < COMPUTE_VERSION:
        pytest.skip(f"no compute shaders in {context.name}")
    with Context.standalone(backend=request.param) as made, Renderer(made) as renderer:
        yield renderer


def layered(scene: Scene) -> Scene:
    return scene.replace(decals=scene.decals.replace(layers=np.arange(len(scene.decals)) % 2))


def test_tasks_are_counted_by_group() -> None:
    tasks = [WarmupTask(name, lambda: None) for name in ("shaders", "images", "shaders")]
    assert [status for _, status in with_status(tasks)] == ["shaders 1 of 2", "images", "shaders 2 of 2"]


@pytest.mark.parametrize(
    ("change", "contact"),
    [
        (lambda scene: scene, Contact.PRODUCT),
        (layered, Contact.RADIAL),
        (lambda scene: scene.replace(decals=Decals.empty()), Contact.PRODUCT),
        (lambda scene: scene.replace(objects=scene.objects[:1]), Contact.PRODUCT),
    ],
    ids=["both", "layered", "without decals", "one object"],
)
def test_after_the_warm_up_a_picture_compiles_nothing(
    renderer: Renderer,
    monkeypatch: pytest.MonkeyPatch,
    change: Callable[[Scene], Scene],
    contact: Contact,
) -> None:
    context, scene = renderer.context, change(both())
    compiled: list[str] = []
    for name in ("program", "compute_shader"):
        compiler = getattr(context.gl, name)

        def counted(*args: Any, name: str = name, compiler: Any = compiler, **options: Any) -> Any:
            compiled.append(name)
            return compiler(*args, **options)

        monkeypatch.setattr(context.gl, name, counted)
    with context.current():
        tasks = renderer.warmup(scene, RenderOptions(contact=contact)).tasks
        each = []
        for task in tasks:
            before = len(compiled)
            task.run()
            each.append(len(compiled) - before)
        assert max(each) == 1
        made = len(compiled)
        assert sum(each) == made
        renderer.draw(scene, RenderOptions(size=SIZE, contact=contact, samples=1))
    clearing = context.backend == "compute"  # a program of three lines
    assert len(compiled) - made == clearing


@pytest.mark.slow_cases("compute")
def test_a_frame_runs_one_task_at_a_time(renderer: Renderer) -> None:
    scene = both()
    tasks = renderer.warmup(scene, PLAIN).tasks
    with renderer.context.current():
        drawing = renderer.begin_frame(scene, RenderOptions(size=SIZE, samples=1))
        statuses = []
        for _ in tasks:
            assert not drawing.advance(0.0)
            statuses.append(drawing.status)
        assert statuses == [status for _, status in with_status(tasks)]
        while not drawing.advance(0.0):
            pass
        assert drawing.status == DRAWING
        again = renderer.begin_frame(scene, RenderOptions(size=SIZE, samples=1), slot="again")
        again.advance(0.0)
        assert again.status == ""  # nothing is made twice


def test_the_same_programs_are_known_by_their_key(renderer: Renderer) -> None:
    scene = both()

    def key(shown: Scene = scene, options: RenderOptions = PLAIN) -> object:
        return renderer.warmup(shown, options).key

    moved = scene.replace(decals=scene.decals.replace(radii=scene.decals.radii * 1.5))
    assert key() == key(moved) == key(options=RenderOptions(mapping=ImageMapping.CHORD))
    others = [
        key(layered(scene)),
        key(scene.replace(decals=Decals.empty())),
        key(scene.replace(objects=scene.objects[:1])),
        key(options=RenderOptions(contact=Contact.RADIAL)),
        key(options=RenderOptions(lights=Lighting(()))),
    ]
    assert len({key(), *others}) == len(others) + 1


def test_the_index_of_an_editor_is_a_task(renderer: Renderer) -> None:
    class View:
        objects, images, camera = both().objects, both().images, both().camera
        decals = DecalEditor(both().decals)

    with renderer.context.current():
        for task in renderer.warmup(View(), PLAIN).tasks:
            task.run()
    assert not View.decals._index.stale
