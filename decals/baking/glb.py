"""GLB files (binary glTF 2.0), encoded by trimesh."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from blobtree._typing import Float32Array, Int32Array, UInt8Array
from decals.validation import optional_package

ROUGHNESS = 0.7
"""Roughness of the material, about that of the studio light's highlight."""

COLOR_ATTRIBUTE = "_COLOR_0"
"""Name under which trimesh writes linear float colours; its own colours are bytes."""

LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP_TO_EDGE = 9729, 9987, 33071


@dataclass(frozen=True, eq=False)
class Node:
    """A named mesh of a file.

    Attributes
    ----------
    name : str
        Name of the node, unique in its file.
    vertices, normals : float32[n, 3]
    faces : int32[m, 3]
    uv : float32[n, 2], optional
        Texture coordinates, v upward.
    colors : float32[n, 3], optional
        Linear colours.
    """

    name: str
    vertices: Float32Array
    faces: Int32Array
    normals: Float32Array
    uv: Float32Array | None = None
    colors: Float32Array | None = None


def glb_bytes(
    nodes: Sequence[Node], texture: UInt8Array | None = None, origin: ArrayLike = (0.0, 0.0, 0.0)
) -> bytes:
    """Return a GLB file of nodes that share one material.

    Parameters
    ----------
    nodes : sequence of Node
        All with ``uv`` and a texture, or all with ``colors`` and without one.
    texture : uint8[h, w, 3], optional
        sRGB base colour, first row at the top.
    origin : (x, y, z), optional
        Point that all vertices are relative to, in float64; it becomes the translation of the nodes.

    Raises
    ------
    MissingPackage
        If trimesh is not installed.
    """
    trimesh = optional_package("trimesh", "bake")
    material = trimesh.visual.material.PBRMaterial(
        name="baked",
        baseColorTexture=None if texture is None else Image.fromarray(texture),
        metallicFactor=0.0,
        roughnessFactor=ROUGHNESS,
        doubleSided=True,
    )
    base = "scene"
    while any(node.name == base for node in nodes):
        base = f"{base}-"
    scene = trimesh.Scene(base_frame=base)
    transform = np.eye(4)
    transform[:3, 3] = origin
    for node in nodes:
        mesh = trimesh.Trimesh(
            vertices=node.vertices,
            faces=node.faces,
            vertex_normals=node.normals,
            visual=trimesh.visual.TextureVisuals(uv=node.uv, material=material),
            process=False,
        )
        if node.colors is not None:
            mesh.vertex_attributes[COLOR_ATTRIBUTE] = node.colors
        scene.add_geometry(mesh, node_name=node.name, geom_name=node.name, transform=transform)
    content: bytes = trimesh.exchange.gltf.export_glb(
        scene, include_normals=True, tree_postprocessor=_finish_tree
    )
    return content


def _finish_tree(tree: dict[str, Any]) -> None:
    """Name the colours as glTF does, and let viewers filter the texture without wrapping it."""
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            attributes = primitive["attributes"]
            if COLOR_ATTRIBUTE in attributes:
                attributes["COLOR_0"] = attributes.pop(COLOR_ATTRIBUTE)
    if textures := tree.get("textures"):
        wrap = {"wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE}
        tree["samplers"] = [{"magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR, **wrap}]
        for texture in textures:
            texture["sampler"] = 0
