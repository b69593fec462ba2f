"""Objects of a scene as meshes that are drawn in their place."""

import numpy as np

from blobtree import Point
from decals import MeshObject, TreeObject
from decals.scenes.meshes import MeshedTree, as_polydata, meshed
from decals.scenes.objects import SceneObject


def test_trees_become_meshes_with_their_colours_names_and_surface() -> None:
    tree = Point((0, 0, 0), radius=1.0, color=(1.0, 0.0, 0.2)) + Point(
        (1.5, 0, 0), radius=1.0, color=(0.0, 0.6, 1.0)
    )
    ball = TreeObject("ball", tree, labels="round", named_only=True)
    corner = MeshObject("corner", [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    items: list[SceneObject] = [ball, corner]
    meshes = [as_polydata([item], resolution=24) for item in items]
    drawn, same = meshed(items, meshes)
    assert same is corner
    assert isinstance(drawn, MeshedTree)
    assert (drawn.name, drawn.labels, drawn.named_only) == ("ball", ("round",), True)
    assert drawn.surface is ball.surface
    np.testing.assert_allclose(tree(drawn.vertices), 0.5, atol=1e-3)
    np.testing.assert_allclose(drawn.color, tree.colors(drawn.vertices), atol=0.5 / 255 + 1e-6)
    corners = drawn.vertices[drawn.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("na,na->n", normals, tree.gradient(corners.mean(axis=1))) <= 1e-9).all()
