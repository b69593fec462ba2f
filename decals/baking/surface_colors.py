"""Colours of a scene's surface with the decals on it, without light, at any of its points."""

from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Float64Array
from blobtree.device import launch
from decals.baking.materials import surface_values
from decals.baking.meshes import BakeMesh
from decals.baking.texel_kernels import over_base
from decals.field.evaluate import ColorEvaluator, Samples, evaluate
from decals.field.jacobian import normal_derivatives_of_triangles, stretch_of
from decals.field.rules import PictureRules
from decals.field.walks import evaluation_options
from decals.images.load import HasPixels
from decals.index.editor import DecalEditor
from decals.index.index import DecalIndex
from decals.model import Decals
from decals.rendering.options import Drawing
from decals.scenes.scene import DecalImage

BLOCK = 1 << 18
"""Vertices that are evaluated at once."""


class SurfaceColors:
    """Colours of the objects of a scene with the decals on them, without light.

    Parameters
    ----------
    meshes : sequence of BakeMesh
        The objects.
    objects : sequence of objects of a scene
        The same as the scene has them, which decides which decals lie on them.
    decals : Decals or DecalEditor
        The decals on them.
    images : sequence of images
        Images of the decals.
    drawing : Drawing
        Has the modes of the decals.
    """

    def __init__(
        self,
        meshes: Sequence[BakeMesh],
        objects: Sequence[object],
        decals: Decals | DecalEditor,
        images: Sequence[HasPixels],
        drawing: Drawing,
    ) -> None:
        self._meshes, self._objects, self._decals = meshes, objects, decals
        self.has_materials = any(hasattr(image, "surface_texels") for image in images)
        self._materials = list(images)
        self._images = [DecalImage(f"image {i}", image.pixels) for i, image in enumerate(images)]
        self._options = options_on(objects, decals, drawing)
        index, walks = self._options["index"], self._options["walks"]
        self._evaluator = ColorEvaluator(decals, self._images, drawing, index=index, walks=walks)

    def at_vertices(self, number: int, rows: slice = slice(None)) -> Float32Array:
        """Return linear colours of vertices of mesh ``number``, ``float32[n, 3]``."""
        mesh = self._meshes[number]
        return self.at(number, mesh.places[rows], mesh.facings[rows], base=mesh.vertex_light[rows])

    def at(
        self,
        number: int,
        points: Float32Array,
        normals: Float32Array,
        tangents: Float32Array | None = None,
        base: Float32Array | None = None,
    ) -> Float32Array:
        """Return linear colours ``float32[n, 3]`` of mesh ``number`` at points with unit normals.

        With tangents, they are the values of all maps, see `decals.baking.materials.surface_values`. The base
        colours at the points are linear too; by default those of `BakeMesh.base_colors`.
        """
        if base is None:
            base = self._meshes[number].base_light(points)
        item = self._objects[number]
        if tangents is None:
            return _over(self._evaluator.at(points, normals, on=item), base)
        samples = evaluate(
            self._decals, points, normals, images=self._materials, materials=True, on=item, **self._options
        )
        assert samples.color is not None  # there are images
        assert samples.materials is not None  # there are tangents for materials alone
        return surface_values(_over(samples.color, base), samples.materials, normals, tangents)

    def on_device(self, number: int, points: Any, normals: Any, base: Any) -> Any:
        """Return what `at` returns without tangents, one channel after another, for arrays on the device.

        The base colours are one, or one for each point.
        """
        colors = self._evaluator.on_device(points, normals, on=self._objects[number])
        values: Any = wp.empty(3 * len(points), dtype=wp.float32, device=points.device)
        launch(over_base, len(points), [colors, base], [values], str(points.device))
        return values

    def attributes_at_vertices(self, number: int, names: Collection[str]) -> dict[str, NDArray[Any]]:
        """Return some of `ATTRIBUTES` at the vertices of mesh ``number``."""
        mesh = self._meshes[number]
        columns: dict[str, list[NDArray[Any]]] = {name: [] for name in names}
        turns = _normal_derivatives(mesh) if "stretch" in names else None
        for first in range(0, len(mesh.places) if names else 0, BLOCK):
            rows = slice(first, first + BLOCK)
            samples = evaluate(
                self._decals,
                mesh.places[rows],
                mesh.facings[rows],
                on=self._objects[number],
                jacobian=turns is not None,
                normal_derivatives=None if turns is None else turns[rows],
                **self._options,
            )
            for name, column in columns.items():
                column.append(ATTRIBUTES[name](samples))
        return {name: np.concatenate(column) for name, column in columns.items()}


def _over(decals: Float32Array, base: Float32Array) -> Float32Array:
    """Return base colours under premultiplied colours of decals."""
    colors: Float32Array = base * (1.0 - decals[:, 3:]) + decals[:, :3]
    return colors


def _stretch(samples: Samples) -> Float32Array:
    """Return the stretch of the image at each point, 0 without an owner."""
    assert samples.jacobian is not None
    known = (samples.owner >= 0) & np.isfinite(samples.jacobian).all(axis=(1, 2))
    values = np.zeros(len(known), np.float32)
    values[known] = stretch_of(samples.jacobian[known])
    return values


ATTRIBUTES: dict[str, Callable[[Samples], NDArray[Any]]] = {
    "owner": lambda samples: samples.owner,
    "uv": lambda samples: samples.uv,
    "field": lambda samples: samples.field,
    "stretch": _stretch,
}
"""Values of decals at points, by the names under which files hold them."""


def _normal_derivatives(mesh: BakeMesh) -> Float64Array:
    """Return the derivative of the normal at each vertex, ``float64[n, 3, 3]``: the mean of its faces."""
    turns = normal_derivatives_of_triangles(mesh.places[mesh.faces], mesh.facings[mesh.faces])
    corners = mesh.faces.reshape(-1)
    count = np.maximum(np.bincount(corners, minlength=len(mesh.places)), 1)
    rows = np.repeat(turns.reshape(-1, 9), 3, axis=0)
    sums = np.stack([np.bincount(corners, column, len(mesh.places)) for column in rows.T], axis=1)
    means: Float64Array = (sums / count[:, None]).reshape(-1, 3, 3)
    return means


def options_on(
    objects: Sequence[object], decals: Decals | DecalEditor, rules: PictureRules
) -> dict[str, Any]:
    """Return the arguments of `evaluate` that are the same everywhere on some objects."""
    index = DecalIndex.of(decals) if isinstance(decals, Decals) else None
    return evaluation_options(rules, decals, objects) | {"index": index}
