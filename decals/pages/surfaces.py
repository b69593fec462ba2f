"""The surfaces that a page draws: meshes, with their textures, and traced trees."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree.cells.surface_box import surface_box
from blobtree.progress import Progress
from blobtree.tracing.tree_cells import tracing_cells
from decals.baking.meshes import BakeMesh, bake_mesh
from decals.errors import InvalidScene
from decals.pages.programs import mesh_program, tree_program
from decals.pages.textures import Arrays, PageTexture, base_texture, data_texture, uniform
from decals.receivers import object_mask
from decals.rendering.base_textures import WHITE_TEXTURE
from decals.rendering.tracing_shader import Kinds
from decals.rendering.tree import BOX_VERTICES, tracing_uniforms
from decals.scenes.objects import MeshObject, TreeObject
from decals.scenes.scene import Scene
from decals.surfaces.base_color import BaseTexture, Wrap

NORMAL_LEVELS = 32767
"""Levels of the coordinates of normals."""

BOXES = "corners of boxes"
"""Array of the vertices of a box, in the order of their triangles."""

MASKS = "object_masks"
"""Texture of the masks of all objects."""


@dataclass
class Surfaces:
    """The surfaces of a page, as its header and its arrays have them.

    Attributes
    ----------
    records
        For each surface its program, attributes and parts.
    arrays, textures
        What the records name.
    programs
        Vertex and fragment shader of each program.
    corners
        Lower and upper corners of all surfaces.
    """

    records: list[dict[str, Any]] = field(default_factory=list)
    arrays: Arrays = field(default_factory=dict)
    textures: dict[str, PageTexture] = field(default_factory=dict)
    programs: dict[str, list[str]] = field(default_factory=dict)
    corners: list[NDArray[Any]] = field(default_factory=list)
    _images: dict[BaseTexture, str] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        scene: Scene,
        receivers: Sequence[str],
        *,
        traced: int,
        resolution: int | None,
        report: Progress,
    ) -> "Surfaces":
        """Return the surfaces of the objects that a scene shows: trees as meshes, or traced with some blocks.

        Raises
        ------
        InvalidScene
            The scene shows no object.
        """
        surfaces, masks = cls(), []
        for item in scene.objects:
            if (part := item.shown) is None:
                continue
            masks.append(object_mask(item, receivers))
            if traced and isinstance(part, TreeObject):
                surfaces._add_tree(part, traced)
            else:
                surfaces._add_mesh(part, bake_mesh(part, resolution=resolution, creases=True, report=report))
        if not masks:
            raise InvalidScene("scene: expected an object to show, got none; show one of its objects")
        surfaces.textures[MASKS] = data_texture(np.array(masks, np.int32))
        return surfaces

    @property
    def bounds(self) -> list[list[float]]:
        """Lower and upper corner of all surfaces together."""
        low, high = np.moveaxis(np.array(self.corners, np.float64), 1, 0)
        return [low.min(axis=0).tolist(), high.max(axis=0).tolist()]

    def _add_tree(self, item: TreeObject, blocks: int) -> None:
        number, tree = len(self.records), item.tree
        cells = tracing_cells(tree, blocks=blocks)
        lower, upper = np.asarray(surface_box(tree))
        self.corners.append(np.array([lower, upper]))
        box = {"box_lower": tuple(lower.tolist()), "box_upper": tuple(upper.tolist())}
        values: dict[str, Any] = {
            name: uniform(value) for name, value in {**tracing_uniforms(cells), **box}.items()
        }
        for name, array in (("tape", cells.tape), ("blocks", cells.blocks)):
            self.textures[f"{name} {number}"] = data_texture(array)
            values[name] = f"{name} {number}"
        shaders = tree_program(Kinds.of(tree.tape))
        known = [name for name, program in self.programs.items() if program == shaders]
        program = known[0] if known else f"tree {number}"
        self.programs[program] = shaders
        self.arrays[BOXES] = np.arange(BOX_VERTICES, dtype=np.int32)
        parts = [{"first": 0, "count": BOX_VERTICES, "values": values}]
        self._add(program, {}, parts, faces=BOXES, box=True)

    def _add_mesh(self, item: object, mesh: BakeMesh) -> None:
        number, base = len(self.records), mesh.base
        corners = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        self.corners.append(np.asarray(surface_box(item.tree) if isinstance(item, TreeObject) else corners))
        attributes: list[tuple[str, NDArray[Any], int]] = [
            ("vertex_position", mesh.vertices, 3),
            ("vertex_normal", np.rint(NORMAL_LEVELS * mesh.normals).astype(np.int16), 3),
            ("vertex_light", _vertex_light(mesh), 3),
        ]
        faces, program = mesh.faces, "mesh"
        parts = [{"first": 0, "count": faces.size, "values": {}}]
        if base is not None and base.coordinates is not None and base.textures:
            attributes.append(("vertex_coordinates", base.coordinates, 2))
            program = "textured"
            faces, of_textures = base.by_texture(faces)
            parts = [
                {"first": 3 * first, "count": 3 * (last - first), "values": self._image_values(texture)}
                for first, last, texture in of_textures
            ]
        self.arrays |= {f"{name} {number}": array for name, array, _ in attributes}
        self.arrays[f"faces {number}"] = faces
        self.programs[program] = mesh_program(textured=program == "textured")
        places = {
            name: (f"{name} {number}", size, "SHORT" if array.dtype == np.int16 else "FLOAT")
            for name, array, size in attributes
        }
        self._add(program, places, parts, faces=f"faces {number}")

    def _image_values(self, texture: BaseTexture | None) -> dict[str, Any]:
        """Return the uniforms of faces with a texture, which is kept once."""
        image = texture or WHITE_TEXTURE
        name = self._images.setdefault(image, f"base {len(self._images)}")
        self.textures[name] = base_texture(image)
        mirrored = tuple(mode is Wrap.MIRROR for mode in image.wrap)
        return {"base_texture": name, "mirrored": uniform(mirrored)}

    def _add(
        self, program: str, attributes: dict[str, Any], parts: list[dict[str, Any]], **more: Any
    ) -> None:
        for part in parts:
            part["values"]["object_id"] = uniform(len(self.records))
        self.records.append({"program": program, "attributes": attributes, "parts": parts, **more})


def mesh_objects(scene: Scene) -> Arrays:
    """Return vertices and faces of the meshes of a scene, which a page saves again."""
    return {
        f"{name} of {number}": getattr(item, name)
        for number, item in enumerate(scene.objects)
        if isinstance(item, MeshObject)
        for name in ("vertices", "faces")
    }


def _vertex_light(mesh: BakeMesh) -> NDArray[np.float32]:
    """Return the base colour of each vertex in linear light, which textures are multiplied by."""
    if mesh.base is None:
        return np.ascontiguousarray(mesh.vertex_light)
    return np.ones_like(mesh.vertices) if mesh.base.colors is None else mesh.base.colors
