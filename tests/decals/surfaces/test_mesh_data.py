"""Meshes of several parts: each corner of each face keeps its colour, its place and its texture."""

from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from decals.images.texels import decode_srgb
from decals.surfaces import BaseColor, BaseTexture
from decals.surfaces.base_color import CLAY
from decals.surfaces.mesh_data import MeshData, joined

KINDS = [kind for kind in product("-c", "-u", "-t", "-k") if "t" not in kind or "u" in kind]
"""What a part has: colours, texture coordinates, textures, and rows for corners in place of vertices."""


def part_of(kind: tuple[str, ...], random: np.random.Generator) -> MeshData:
    """Return a part of a kind; one without colours and coordinates has no base colour."""
    vertices, faces = random.random((5, 3)).astype(np.float32), random.integers(0, 5, (4, 3)).astype(np.int32)
    if "c" not in kind and "u" not in kind:
        return MeshData(vertices, faces)
    count = 7 if "k" in kind else 5
    images = [BaseTexture(random.integers(0, 256, (2, 2, 3), np.uint8)) for _ in range(2)]
    return MeshData(
        vertices,
        faces,
        BaseColor(
            random.random((count, 3)) if "c" in kind else None,
            random.random((count, 2)) if "u" in kind else None,
            images if "t" in kind else (),
            random.integers(-1, 2, 4) if "t" in kind else None,
            random.integers(0, 7, (4, 3)) if "k" in kind else None,
        ),
    )


def corners_of(part: MeshData) -> tuple[NDArray[np.float32], NDArray[np.float32], list[BaseTexture | None]]:
    """Return the colours and the places of the corners of a part, and the textures of its faces."""
    base, faces = part.color, part.faces
    if base is None:
        clay = np.float32(decode_srgb(np.array(CLAY)))
        return (
            np.broadcast_to(clay, (*faces.shape, 3)),
            np.zeros((*faces.shape, 2), np.float32),
            [None] * len(faces),
        )
    rows = faces if base.corners is None else base.corners
    colors = np.ones((*rows.shape, 3), np.float32) if base.colors is None else base.colors[rows]
    places = np.zeros((*rows.shape, 2), np.float32) if base.coordinates is None else base.coordinates[rows]
    numbers = [-1] * len(faces) if base.texture_of_face is None else base.texture_of_face
    return colors, places, [base.textures[number] if number >= 0 else None for number in numbers]


@pytest.mark.parametrize("first", KINDS, ids="".join)
def test_joined_parts_keep_what_each_has(first: tuple[str, ...]) -> None:
    random = np.random.default_rng(3)
    for second in KINDS:
        parts = [part_of(kind, random) for kind in (first, second, first)]
        whole = joined(parts)
        assert_array_equal(whole.vertices, np.concatenate([part.vertices for part in parts]))
        assert_array_equal(
            whole.vertices[whole.faces], np.concatenate([part.vertices[part.faces] for part in parts])
        )
        if whole.color is None:
            assert all(part.color is None for part in parts)
            continue
        known, found = [corners_of(part) for part in parts], corners_of(whole)
        for place in (0, 1):
            assert_array_equal(found[place], np.concatenate([corners[place] for corners in known]))
        assert [*map(id, found[2])] == [id(image) for corners in known for image in corners[2]]
        has_places = any(part.color is not None and part.color.coordinates is not None for part in parts)
        assert (whole.color.coordinates is not None) == has_places
