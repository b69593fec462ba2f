"""Whatever a session, a command or a window is given: an error of ours, and nothing has changed."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from blobtree.errors import InvalidNode
from blobtree.nodes.paths import primitive_paths
from blobtree.nodes.surgery import dominant_primitive
from blobtree.validation import LARGEST_NUMBER, finite_number, finite_vector
from decals import Camera, DecalImage, MeshObject, Scene, TreeObject
from decals.editing import (
    AddDecals,
    AddImage,
    AddObject,
    AddPrimitive,
    Document,
    DuplicatePrimitive,
    EditSession,
    FillBarePlaces,
    JoinPrimitive,
    MoveDecals,
    MovePrimitive,
    PaintPrimitive,
    RelaxDecals,
    RemoveImage,
    RemoveObject,
    RemovePrimitive,
    ReplaceDecals,
    ReplaceImage,
    ReplaceNode,
    ResizePrimitive,
    ScaleDecals,
    ScatterDecals,
    SetCamera,
    SetParameter,
    SetValues,
    TurnDecals,
    first_hit,
    outline,
    pick,
)
from decals.errors import ImplicitDecalsError, InvalidEdit, InvalidImage, InvalidPoints, InvalidScene
from decals.validation import number_of, whole_number
from tests.decals.editing.scenes import TREE, digest, one, scene

RIVET = DecalImage.load("rivet")
NUMBERS = (0, 1, -3, 10**400, 1e300, float("nan"), float("inf"), True, 0.5, np.float32(2), np.array(np.nan))
OTHERS: tuple[Any, ...] = (
    None,
    "x",
    "",
    b"x",
    [],
    {},
    object(),
    [None],
    ["x"],
    np.zeros((2, 2)),
    TREE,
    one(),
    RIVET,
    ScaleDecals,
)
ROWS = ((1, 2), (0, 0, 0), (1e300, 0, 0), (float("nan"), 0, 0), np.ones(3), [1, 2, 3])
anything = st.sampled_from((*NUMBERS, *OTHERS, *ROWS))


def with_values(name: str, values: Any) -> SetValues:
    return SetValues.each([1, 2], **{name: values})


COMMANDS: dict[str, Callable[[Any], Any]] = {
    "add": AddDecals,
    "alter": lambda x: SetValues([1], x),
    **{
        f"alter {name}": partial(with_values, name)
        for name in ("positions", "normals", "tangents", "radii", "images", "spill", "layers", "tints")
    },
    "scale": lambda x: ScaleDecals([1], x),
    "scale whom": lambda x: ScaleDecals(x, 1.5),
    "turn": lambda x: TurnDecals([1], x),
    "carry": lambda x: MoveDecals([1], x, (0, 0, 1)),
    "carry normal": lambda x: MoveDecals([1], (0, 0, 1), x),
    "add an image": AddImage,
    "change which image": lambda x: ReplaceImage(x, RIVET),
    "change an image": lambda x: ReplaceImage(0, x),
    "remove an image": RemoveImage,
    "look": SetCamera,
    "add an object": AddObject,
    "remove an object": RemoveObject,
    "move": lambda x: MovePrimitive(0, (0,), x),
    "move in which": lambda x: MovePrimitive(x, (0,), (0, 0, 0.1)),
    "move which": lambda x: MovePrimitive(0, x, (0, 0, 0.1)),
    "move which child": lambda x: MovePrimitive(0, (x,), (0, 0, 0.1)),
    "resize": lambda x: ResizePrimitive(0, (0, 0), x),
    "paint": lambda x: PaintPrimitive(0, (0, 0), x),
    "add a primitive": lambda x: AddPrimitive(0, (0, 0), x),
    "add a primitive where": lambda x: AddPrimitive(0, x, TREE),
    "add a primitive in which": lambda x: AddPrimitive(x, (), TREE),
    "add a primitive how": lambda x: AddPrimitive(0, (), TREE, x),
    "remove a primitive": lambda x: RemovePrimitive(0, x),
    "set a parameter": lambda x: SetParameter(0, (0, 0), "radius", x),
    "set which parameter": lambda x: SetParameter(0, (0, 0), x, 0.5),
    "set a parameter of which": lambda x: SetParameter(0, x, "radius", 0.5),
    "replace a node": lambda x: ReplaceNode(0, (0, 0), x),
    "replace which node": lambda x: ReplaceNode(0, x, TREE),
    "duplicate a primitive": lambda x: DuplicatePrimitive(0, x, (0, 0, 0.1)),
    "duplicate a primitive where": lambda x: DuplicatePrimitive(0, (0, 0), x),
    "join": lambda x: JoinPrimitive(0, x, "union"),
    "join how": lambda x: JoinPrimitive(0, (1,), x),
    "fill": lambda x: FillBarePlaces((1,), x),
    "fill where": FillBarePlaces,
    "fill from which seed": lambda x: FillBarePlaces((1,), None, x),
    "relax": RelaxDecals,
    "scatter where": lambda x: ScatterDecals(x, 3),
    "scatter on which": lambda x: ScatterDecals((x,), 3),
    "scatter": lambda x: ScatterDecals((1,), x),
    "scatter from which seed": lambda x: ScatterDecals((1,), 3, x),
    "scatter in which zone": lambda x: ScatterDecals((1,), 3, 0, {}, x),
    "coat in which zone": lambda x: ReplaceDecals((1,), one(), mask=x),
    "coat where": lambda x: ReplaceDecals(x, one()),
    "coat": lambda x: ReplaceDecals((1,), x),
    "nothing": lambda x: x,
}  # fmt: skip


@pytest.fixture(scope="module")
def session() -> Any:
    return EditSession(scene())


EACH_COMMAND = pytest.mark.parametrize("name", COMMANDS)
ANY_NUMBER = settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])


@pytest.mark.filterwarnings("ignore:overflow")
@EACH_COMMAND
@settings(ANY_NUMBER, max_examples=6)
@given(x=anything)
def test_commands_do_something_or_say_why_not(session: Any, name: str, x: Any) -> None:
    do_and_undo(session, name, x)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:overflow")
@EACH_COMMAND
@settings(ANY_NUMBER, max_examples=80)
@given(x=anything)
def test_commands_do_something_or_say_why_not_many_times(session: Any, name: str, x: Any) -> None:
    do_and_undo(session, name, x)


def do_and_undo(session: EditSession, name: str, x: Any) -> None:
    before = digest(session.document)
    try:
        session.do(COMMANDS[name](x))
    except ImplicitDecalsError:
        assert digest(session.document) == before
    while session.undo():
        pass
    assert digest(session.document) == before


@pytest.mark.parametrize(
    ("ask", "error"),
    [
        (lambda x: EditSession(x), InvalidScene),
        (lambda x: Document.from_scene(x), InvalidScene),
        (lambda x: EditSession(scene()).do(x), InvalidEdit),
        (lambda x: Scene(objects=(x,), camera=Camera((0, 0, 1))), InvalidScene),
        (lambda x: Scene(objects=(), camera=x), InvalidScene),
        (lambda x: Scene(objects=(), camera=Camera((0, 0, 1)), images=(x,)), InvalidImage),
        (lambda x: Scene(objects=(), camera=Camera((0, 0, 1)), decals=x), InvalidScene),
        (lambda x: TreeObject("tree", x), InvalidScene),
        (lambda x: TreeObject(x, TREE), InvalidScene),
        (lambda x: MeshObject("mesh", x, np.array([[0, 1, 2]], np.int32)), ImplicitDecalsError),
        (lambda x: DecalImage(x, RIVET.pixels), InvalidScene),
        (lambda x: DecalImage("rivet", x), InvalidScene),
        (lambda x: DecalImage.load(x), InvalidImage),
        (lambda x: Camera(x), InvalidScene),
        (lambda x: Camera((0, 0, 1), fov=x), InvalidScene),
        (lambda x: pick(Document.from_scene(scene()), x, (0, 0, 1)), InvalidPoints),
        (lambda x: pick(Document.from_scene(scene()), (0, 0, 1), x), InvalidPoints),
        (lambda x: first_hit(scene().objects, x, (0, 0, 1)), InvalidPoints),
        (lambda x: outline(Document.from_scene(scene()), x), InvalidEdit),
        (lambda x: dominant_primitive(TREE, x), InvalidNode),
        (lambda x: primitive_paths(x), InvalidNode),
    ],
)
@pytest.mark.parametrize("wrong", [None, 10**400, float("nan"), {}, object(), [None], np.zeros((2, 2, 2))])
def test_what_is_of_the_wrong_kind_is_named(ask: Any, error: Any, wrong: Any) -> None:
    with pytest.raises(error, match="expected"):
        ask(wrong)


@pytest.mark.parametrize("path", [None, 5, "", [], b"x", object(), "a\0b"])
def test_a_session_is_saved_to_paths_alone(path: Any) -> None:
    with pytest.raises(InvalidEdit, match="expected a path to save to"):
        EditSession(scene()).save(path)


def test_a_camera_to_save_is_one(tmp_path: Path) -> None:
    session = EditSession(scene())
    with pytest.raises(InvalidScene, match="camera: expected a Camera"):
        session.save(tmp_path / "scene.json", camera=(0, 0, 1))  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


@example(value=-(2**63) - 1)
@given(st.one_of(st.integers(), st.floats(), st.booleans(), st.text(), st.none(), st.lists(st.floats())))
def test_checks_give_what_fits_or_say_what_came(value: Any) -> None:
    fits = type(value) in (int, float) and abs(value) <= LARGEST_NUMBER
    checked(finite_number, value, fits)
    if not isinstance(value, str):
        checked(number_of, value, fits)
    checked(
        lambda name, number, error: whole_number(name, number, -3, 3, error),
        value,
        type(value) is int and -3 <= value <= 3,
    )
    is_vector = isinstance(value, list) and len(value) == 3
    checked(finite_vector, value, is_vector and all(abs(number) <= LARGEST_NUMBER for number in value))


@pytest.mark.parametrize("text", ["", " ", "x", "nan", "-inf", "1e999", "1,5", "٣x"])
def test_a_form_sends_numbers_as_text(text: str) -> None:
    assert number_of("it", " -1.5e2 ", InvalidEdit) == -150.0
    with pytest.raises(InvalidEdit, match="it: expected a finite number, got"):
        number_of("it", text, InvalidEdit)


def checked(check: Any, value: Any, fits: Any) -> None:
    if fits:
        wanted = np.asarray(value, np.float64)  # large whole numbers lose digits, as in the check
        np.testing.assert_array_equal(check("it", value, InvalidEdit), wanted)
    else:
        with pytest.raises(InvalidEdit, match=r"it: expected .*, got "):
            check("it", value, InvalidEdit)
