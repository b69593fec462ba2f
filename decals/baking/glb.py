"""GLB files (binary glTF 2.0), encoded by trimesh."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from blobtree._typing import Float32Array, Int32Array
from decals.baking.materials import ROUGHNESS, Maps
from decals.validation import optional_package

PREFIX = "_"
"""Begin of names under which trimesh writes attributes of its own: linear float colours, and tangents."""

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
    tangents : float32[n, 4], optional
        Tangents along u, and the signs of the bitangents.
    """

    name: str
    vertices: Float32Array
    faces: Int32Array
    normals: Float32Array
    uv: Float32Array | None = None
    colors: Float32Array | None = None
    tangents: Float32Array | None = None


def glb_bytes(nodes: Sequence[Node], maps: Maps | None = None, origin: ArrayLike = (0.0, 0.0, 0.0)) -> bytes:
    """Return a GLB file of nodes that share one material.

    Parameters
    ----------
    nodes : sequence of Node
        All with ``uv`` and textures, or all with ``colors`` and without any.
    maps : Maps, optional
        Textures, first row at the top.
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
        doubleSided=True,
        **_textures(maps),
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
        for name, values in (("COLOR_0", node.colors), ("TANGENT", node.tangents)):
            if values is not None:
                mesh.vertex_attributes[PREFIX + name] = values
        scene.add_geometry(mesh, node_name=node.name, geom_name=node.name, transform=transform)
    content: bytes = trimesh.exchange.gltf.export_glb(
        scene, include_normals=True, tree_postprocessor=_finish_tree
    )
    return content


def _textures(maps: Maps | None) -> dict[str, Any]:
    """Return the textures and factors of a material of trimesh."""
    given = {} if maps is None else {"baseColorTexture": maps.color}
    if maps is None or maps.surface is None:
        factors: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": ROUGHNESS}
    else:
        factors = {"metallicFactor": 1.0, "roughnessFactor": 1.0}
        given |= {"metallicRoughnessTexture": maps.surface, "occlusionTexture": maps.surface}
        given |= {} if maps.normal is None else {"normalTexture": maps.normal}
        if maps.emission is not None:
            given["emissiveTexture"], factors["emissiveFactor"] = maps.emission, [1.0, 1.0, 1.0]
    return factors | {name: Image.fromarray(texels) for name, texels in given.items()}


def _finish_tree(tree: dict[str, Any]) -> None:
    """Name attributes as glTF does, and let viewers filter textures without wrapping them."""
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            attributes = primitive["attributes"]
            for name in ("COLOR_0", "TANGENT"):
                if PREFIX + name in attributes:
                    attributes[name] = attributes.pop(PREFIX + name)
    if textures := tree.get("textures"):
        wrap = {"wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE}
        tree["samplers"] = [{"magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR, **wrap}]
        for texture in textures:
            texture["sampler"] = 0
