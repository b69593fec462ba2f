"""What a picture takes for the first time, piece by piece."""

from collections.abc import Iterator

import numpy as np
import pytest

from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.grid.editor import DecalEditor
from decals.model import Decals
from decals.render.context import Context
from decals.render.drawing import PICTURE
from decals.render.entry import COMPUTE_BASELINE
from decals.render.lamps import Lamps
from decals.render.modes import Modes
from decals.render.pieces import Piece, told
from decals.render.renderer import Renderer
from decals.scenes.scene import Scene
from tests.vtk.scenes import both

SIZE = (40, 30)
PLAIN = Modes(Mapping.CORRECTED, Contact.PAPER)


@pytest.fixture(params=["fragment", "compute"])
def renderer(request: pytest.FixtureRequest, context: Context) -> Iterator[Renderer]:
    if request.param == "compute" and context.gl.version_code < COMPUTE_BASELINE:
        pytest.skip(f"no compute shaders in {context.name}")
    with Context.standalone(entry=request.param) as made, Renderer(made) as renderer:
        yield renderer


def layered(scene: Scene) -> Scene:
    return scene.replace(decals=scene.decals.replace(layers=np.arange(len(scene.decals)) % 2))


def test_pieces_say_how_far_they_are() -> None:
    pieces = [Piece(name, lambda: None) for name in ("shaders", "images", "shaders")]
    assert [news for _, news in told(pieces)] == ["shaders 1 of 2", "images", "shaders 2 of 2"]


@pytest.mark.parametrize(
    ("scene", "contact"),
    [
        (both(), Contact.PAPER),
        (layered(both()), Contact.RADIAL),
        (both().replace(decals=Decals.empty()), Contact.PAPER),
        (both().replace(objects=both().objects[:1]), Contact.PAPER),
    ],
)
def test_once_the_pieces_are_made_a_picture_compiles_nothing(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch, scene: Scene, contact: Contact
) -> None:
    context = renderer.context
    compiled: list[str] = []
    for name in ("program", "compute_shader"):
        compiler = getattr(context.gl, name)
        monkeypatch.setattr(
            context.gl, name, lambda *a, c=compiler, n=name, **k: compiled.append(n) or c(*a, **k)
        )
    with context.current():
        pieces = renderer.ahead(scene, Modes(Mapping.CORRECTED, contact)).pieces
        each = []
        for piece in pieces:
            before = len(compiled)
            piece.make()
            each.append(len(compiled) - before)
        assert max(each) == 1
        made = len(compiled)
        assert sum(each) == made
        renderer.draw(scene, size=SIZE, contact=contact)
    clearing = context.entry == "compute"  # a program of three lines
    assert len(compiled) - made == clearing


def test_a_drawing_makes_one_piece_at_a_time_and_says_which(renderer: Renderer) -> None:
    scene = both()
    pieces = renderer.ahead(scene, PLAIN).pieces
    with renderer.context.current():
        drawing = renderer.drawing(scene, size=SIZE)
        heard = []
        for _ in pieces:
            assert not drawing.advance(0.0)
            heard.append(drawing.news)
        assert heard == [news for _, news in told(pieces)]
        while not drawing.advance(0.0):
            pass
        assert drawing.news == PICTURE
        again = renderer.drawing(scene, size=SIZE, slot="again")
        again.advance(0.0)
        assert again.news == ""  # nothing is made twice


def test_the_same_programs_are_known_by_their_key(renderer: Renderer) -> None:
    scene = both()

    def key(shown: Scene = scene, modes: Modes = PLAIN) -> object:
        return renderer.ahead(shown, modes).key

    moved = scene.replace(decals=scene.decals.replace(radii=scene.decals.radii * 1.5))
    assert key() == key(moved) == key(modes=Modes(Mapping.CHORD, Contact.PAPER))
    others = [
        key(layered(scene)),
        key(scene.replace(decals=Decals.empty())),
        key(scene.replace(objects=scene.objects[:1])),
        key(modes=Modes(Mapping.CORRECTED, Contact.RADIAL)),
        key(modes=Modes(Mapping.CORRECTED, Contact.PAPER, Lamps((), np.eye(4)))),
    ]
    assert len({key(), *others}) == len(others) + 1


def test_an_editor_has_its_index_laid_out_as_a_piece(renderer: Renderer) -> None:
    class View:
        objects, images, camera = both().objects, both().images, both().camera
        decals = DecalEditor(both().decals)

    with renderer.context.current():
        for piece in renderer.ahead(View(), PLAIN).pieces:
            piece.make()
    assert not View.decals._behind
