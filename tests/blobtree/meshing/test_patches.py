"""The tables of dual marching cubes, all 256 cells and both rows of each, against flood filling."""

import numpy as np
import pytest

from blobtree.meshing.patches import EDGES, FACES, FLIPPED, PATCH_COUNT, PATCH_OF_EDGE

CODES = pytest.mark.parametrize("code", range(256))


def crossed(code: int) -> list[int]:
    return [edge for edge, (a, b) in enumerate(EDGES) if (code >> a & 1) != (code >> b & 1)]


def alternating(code: int) -> bool:
    return any(sum(set(EDGES[edge]) <= set(face) for edge in crossed(code)) == 4 for face in FACES)


def components(corners: set[int]) -> int:
    """Parts into which corners fall that share an edge of the cell."""
    parts, left = 0, set(corners)
    while left:
        parts, pending = parts + 1, [left.pop()]
        while pending:
            corner = pending.pop()
            beside = {b if corner == a else a for a, b in EDGES if corner in (a, b)} & left
            left -= beside
            pending.extend(beside)
    return parts


def test_edges_join_neighbouring_corners_and_faces_have_four() -> None:
    assert len(set(EDGES)) == 12
    assert all(a < b and (a ^ b) in (1, 2, 4) for a, b in EDGES)
    assert all(len(face) == 4 for face in FACES)
    assert sorted(corner for face in FACES for corner in face) == sorted(list(range(8)) * 3)


@CODES
def test_exactly_the_crossed_edges_belong_to_a_patch(code: int) -> None:
    for row in (code, code + FLIPPED):
        patches = PATCH_OF_EDGE[row]
        assert np.flatnonzero(patches >= 0).tolist() == crossed(code)
        assert set(patches[patches >= 0].tolist()) == set(range(int(PATCH_COUNT[row])))


@CODES
def test_a_patch_is_one_loop_around_the_faces(code: int) -> None:
    """On every face a patch's edges pair up: a loop enters it as often as it leaves."""
    for row in (code, code + FLIPPED):
        for patch in range(int(PATCH_COUNT[row])):
            edges = np.flatnonzero(PATCH_OF_EDGE[row] == patch)
            assert len(edges) >= 3
            for face in FACES:
                assert sum(set(EDGES[edge]) <= set(face) for edge in edges) % 2 == 0


@CODES
def test_without_alternating_faces_patches_separate_inside_from_outside(code: int) -> None:
    """Each part of the inside and of the outside is walled off: one part more than there are patches."""
    inside = {corner for corner in range(8) if code >> corner & 1}
    parts = components(inside) + components(set(range(8)) - inside)
    if 0 < len(inside) < 8 and not alternating(code):
        assert PATCH_COUNT[code] == parts - 1


@CODES
def test_inside_corners_that_touch_at_an_alternating_face_are_kept_apart(code: int) -> None:
    inside = {corner for corner in range(8) if code >> corner & 1}
    if 0 < len(inside) < 8:
        assert PATCH_COUNT[code] >= components(inside) - (components(inside) > 1 and not alternating(code))


def test_known_cells() -> None:
    assert PATCH_COUNT[0] == PATCH_COUNT[255] == 0
    assert PATCH_COUNT[0b00000001] == PATCH_COUNT[0b11111110] == 1
    assert PATCH_COUNT[0b01101001] == 4  # every second corner
    assert PATCH_COUNT[0b10000001] == 2  # opposite corners
