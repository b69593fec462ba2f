"""The layout of the tape, texel by texel, as shaders read it."""

import numpy as np
import pytest
import warp as wp

from blobtree import RIM, Node, Point, Segment, Tape, polygonize
from blobtree.errors import InvalidNode
from blobtree.tape.codes import OPERATORS, POP, POP_SWAPPED, PREFIX, PUSH, SKELETONS, STRETCHED, UNWARP, WARP
from blobtree.tape.instruction_set import core
from tests.blobtree.trees import random_trees

CODES = {tag: code for code, tag in enumerate(SKELETONS)}
OPERATOR = {tag: code for code, tag in enumerate(OPERATORS)}
BALL = Point((1, 2, 3), radius=0.5, color=(1, 0.5, 0.25))
BONE = Segment((0, 0, 0), (0, 0, 2), radius=0.25, color=(0, 0, 1))
INFLUENCE = 0.5 / RIM


def instructions(tape: Tape) -> list[tuple[int, int, int, float]]:
    """The headers, found by the strides that the layout promises."""
    at, found = 0, []
    while at < len(tape.data):
        code, operator, count, parameter = tape.data[at]
        found.append((int(code), int(operator), int(count), float(parameter)))
        at += 1
        if code >= 0:
            stretched = code >= STRETCHED
            skeleton = core().skeletons[int(code) - STRETCHED * stretched]
            at += int(count) * (PREFIX * stretched + skeleton.parameters + 1)
        elif code in (WARP, UNWARP):
            at += PREFIX
    assert at == len(tape.data)
    return found


def test_a_point() -> None:
    expected = [[CODES["point"], OPERATOR["sum"], 1, 0], [1, 2, 3, INFLUENCE], [1, 0.5, 0.25, 1]]
    np.testing.assert_allclose(BALL.tape.data, np.array(expected), rtol=1e-6)
    assert BALL.tape.data.dtype == np.float32


def test_a_segment_and_one_without_length() -> None:
    expected = [
        [CODES["segment"], OPERATOR["sum"], 1, 0],
        [0, 0, 0, INFLUENCE / 2],
        [0, 0, 2, 0.25],
        [0, 0, 1, 1],
    ]
    np.testing.assert_allclose(BONE.tape.data, np.array(expected), rtol=1e-6)
    dot = Segment((1, 2, 3), (1, 2, 3), radius=0.5)
    assert dot.tape.data[2].tolist() == [0, 0, 0, 0]
    probe = [[1.2, 2.0, 3.1]]
    np.testing.assert_allclose(dot(probe), BALL(probe))
    np.testing.assert_allclose(dot.gradient(probe), BALL.gradient(probe))


def test_a_similar_map_folds_into_the_parameters() -> None:
    placed = BALL.scale(-2.0).translate((0, 0, 1))
    assert not placed.tape.stretched
    np.testing.assert_allclose(placed.tape.data[1], [-2, -4, -5, 2 * INFLUENCE], rtol=1e-6)


def test_a_stretched_primitive_carries_its_inverse_map() -> None:
    tape = BALL.scale((2, 1, 0.5)).translate((1, 0, 0)).tape
    expected = [
        [CODES["point"] + STRETCHED, OPERATOR["sum"], 1, 0],
        [0.5, 0, 0, -0.5], [0, 1, 0, 0], [0, 0, 2, 0], [2, 0, 0, 0],
        [1, 2, 3, INFLUENCE], [1, 0.5, 0.25, 1],
    ]  # fmt: skip
    np.testing.assert_allclose(tape.data, np.array(expected), rtol=1e-6, atol=1e-7)
    assert tape.stretched


def test_push_and_pop() -> None:
    pair = BALL | BONE
    assert instructions((pair - (BALL & BONE)).tape) == [
        (CODES["point"], OPERATOR["union"], 1, 0.0),
        (CODES["segment"], OPERATOR["union"], 1, 0.0),
        (PUSH, 0, 0, 0.0),
        (CODES["point"], OPERATOR["sum"], 1, 0.0),
        (CODES["segment"], OPERATOR["intersection"], 1, 0.0),
        (POP, OPERATOR["difference"], 0, 0.0),
    ]
    assert instructions((BALL - pair).tape)[-1] == (POP_SWAPPED, OPERATOR["difference"], 0, 0.0)


@pytest.mark.parametrize("tree", random_trees(seed=8, count=40), ids=range(40))
def test_a_tape_lists_the_kinds_in_use(tree: Node) -> None:
    tape = tree.tape
    found = instructions(tape)
    runs = [header for header in found if header[0] >= 0]
    assert set(tape.skeletons) == {code % STRETCHED for code, *_ in runs}
    combines = [header for header in found if header[0] not in (PUSH, WARP, UNWARP)]
    operators = {operator for _, operator, *_ in combines}
    from_operand = (
        {OPERATOR["sum"]} if not all(core().operators[code].starts_from_zero for code in operators) else set()
    )
    assert set(tape.operators) == operators | from_operand
    assert set(tape.warps) == {kind for code, kind, *_ in found if code == WARP}
    assert tape.warp_registers == max((count + 1 for code, _, count, _ in found if code == WARP), default=0)
    assert tape.stretched == any(code >= STRETCHED for code, *_ in runs)
    assert tape.registers == max((count + 1 for code, _, count, _ in found if code == PUSH), default=0)
    assert all(parameter > 1.0 for _, operator, _, parameter in runs if OPERATORS[operator] == "ricci")
    assert np.isfinite(tape.data).all()


def test_a_tape_on_a_device_has_the_same_texels() -> None:
    uploaded = (BALL + BONE).tape.on("cpu")
    np.testing.assert_array_equal(uploaded.data.numpy(), (BALL + BONE).tape.data)
    assert uploaded.data.dtype == wp.vec4


def test_a_twist_encloses_its_child() -> None:
    tape = (BALL.twist(90.0).translate((0, 0, 5)) | BONE).tape
    assert [code for code, *_ in instructions(tape)] == [WARP, CODES["point"], UNWARP, CODES["segment"]]
    np.testing.assert_allclose(tape.data[1:4], [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -5]])
    np.testing.assert_allclose(tape.data[4], [1, np.pi / 2, 0, 0], rtol=1e-6)
    assert tape.warps == (0,)
    assert tape.warp_registers == 1


def test_warps_nested_too_deep_are_refused() -> None:
    tree: Node = BALL
    for _ in range(9):
        tree = tree.twist(1.0)
    with pytest.raises(InvalidNode, match="nest 9 deep, at most 8"):
        _ = tree.tape


def test_an_offset_folds_into_the_radii_and_shrinks_tools() -> None:
    solid, tool = (BALL - Point((1, 2, 3.5), radius=0.3)).scale(2.0).offset(0.1).tape.data[[1, 4], 3]
    assert solid * RIM == pytest.approx(2.0 * 0.5 + 0.1, rel=1e-6)
    assert tool * RIM == pytest.approx(2.0 * 0.3 - 0.1, rel=1e-6)
    with pytest.raises(InvalidNode, match="leaves nothing of Point"):
        _ = BALL.offset(-0.6).tape


@pytest.mark.parametrize("distance", [-1.5, -10.0])
def test_an_offset_that_removes_a_primitive_is_refused(distance: float) -> None:
    eaten = BALL.offset(distance)
    for ask in (lambda: eaten.support, lambda: polygonize(eaten), lambda: polygonize(eaten, cell_size=0.1)):
        with pytest.raises(InvalidNode, match="leaves nothing of Point"):
            ask()
