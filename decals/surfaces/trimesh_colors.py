"""Base colours of trimesh's meshes: colours of vertices and faces, textures, and factors of materials."""

from typing import Any

import numpy as np

from blobtree._typing import Float32Array, Int32Array
from decals.surfaces.base_color import WHITE, BaseColor, BaseTexture, linear_colors

UNSET_DIFFUSE = (102, 102, 102, 255)
"""Colour that trimesh gives to a material without any."""


def trimesh_color(mesh: Any) -> BaseColor | None:
    """Return the base colour of a mesh of trimesh, or its texture coordinates alone; None without either.

    Colours of vertices and faces and the diffuse colour are sRGB, the factor of a glTF material is linear.
    """
    visual = mesh.visual
    if visual is None or not visual.defined:
        return None
    if visual.kind == "vertex":
        return BaseColor(linear_colors(visual.vertex_colors, name="vertex_colors"))
    if visual.kind == "face":
        return BaseColor.of_faces(linear_colors(visual.face_colors, name="face_colors"))
    return _textured(visual, np.asarray(mesh.faces, np.int32))


def _textured(visual: Any, faces: Int32Array) -> BaseColor | None:
    """Return the base colour of the materials of faces, with their textures if there are coordinates."""
    coordinates = None if visual.uv is None else np.asarray(visual.uv)
    materials = list(getattr(visual.material, "materials", ())) or [visual.material]
    of_face = np.zeros(len(faces), np.int32)
    if visual.face_materials is not None and len(materials) > 1:
        of_face = np.asarray(visual.face_materials, np.int32)
    factors, images = zip(*map(_material, materials), strict=True)
    if all(factor is None for factor in factors) and (coordinates is None or not any(images)):
        return None if coordinates is None else BaseColor(coordinates=coordinates)
    return BaseColor.of_materials(
        [WHITE if factor is None else factor for factor in factors],
        [None if image is None else BaseTexture(image) for image in images],
        of_face,
        faces,
        coordinates=coordinates,
        colors=_colors_of_vertices(visual),
    )


def _material(material: Any) -> tuple[Any, Any]:
    """Return the linear factor and the image of a material; None for what it has not."""
    if hasattr(material, "baseColorTexture"):
        factor = material.baseColorFactor
        return None if factor is None else factor[:3] / 255.0, material.baseColorTexture
    image, diffuse = getattr(material, "image", None), getattr(material, "diffuse", None)
    if diffuse is None or tuple(diffuse) == UNSET_DIFFUSE:
        return None, image
    return linear_colors(diffuse[None], name="diffuse")[0], image


def _colors_of_vertices(visual: Any) -> Float32Array | None:
    """Return the colours that vertices have beside a texture."""
    colors = visual.vertex_attributes.get("color")
    return None if colors is None else linear_colors(colors, name="colours of vertices")
