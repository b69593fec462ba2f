"""GLB and glTF files (glTF 2.0), encoded by trimesh."""

import base64
import json
from functools import partial
from typing import Any

import numpy as np
from PIL import Image

from decals.baking.instances import SQUARE, SQUARE_FACES, add_instances
from decals.baking.materials import ROUGHNESS, Maps
from decals.baking.parts import Baked, udim
from decals.baking.pictures import PngTexture
from decals.validation import optional_package

PREFIX = "_"
"""Begin of names under which trimesh writes attributes of its own: linear float colours, and tangents."""

LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP_TO_EDGE = 9729, 9987, 33071


def glb_bytes(baked: Baked) -> bytes:
    """Return a GLB file, with a node for each part on each tile, whose parts share a material.

    Raises
    ------
    MissingPackage
        If trimesh is not installed.
    """
    trimesh = optional_package("trimesh", "bake")
    pieces = [piece for part in baked.parts for piece in part.on_tiles()]
    several = len(baked.tiles) > 1
    materials = [
        trimesh.visual.material.PBRMaterial(
            name=f"baked.{udim(tile)}" if several else "baked", doubleSided=True, **_textures(maps)
        )
        for tile, maps in enumerate(baked.tiles or [None])
    ]
    base = "scene"
    while base in {*(part.name for _, part in pieces), *(group.name for group in baked.instances)}:
        base = f"{base}-"
    scene = trimesh.Scene(base_frame=base)
    transform = baked.placement("y", metres=True)
    for tile, part in pieces:
        mesh = trimesh.Trimesh(
            vertices=part.vertices,
            faces=part.faces,
            vertex_normals=part.normals,
            visual=trimesh.visual.TextureVisuals(uv=part.uv, material=materials[tile]),
            process=False,
        )
        for name, values in (("COLOR_0", part.colors), ("TANGENT", part.tangents)):
            if values is not None:
                mesh.vertex_attributes[PREFIX + name] = values.astype(np.float32)
        for name, values in part.attributes.items():  # no attribute may have integers of 32 bits
            mesh.vertex_attributes[PREFIX + name.upper()] = values.astype(np.float32)
        scene.add_geometry(mesh, node_name=part.name, geom_name=part.name, transform=transform)
    for group in baked.instances:
        picture = Image.fromarray(group.picture)
        paint = {"metallicFactor": 0.0, "roughnessFactor": ROUGHNESS, "alphaMode": "BLEND"}
        decal = trimesh.visual.material.PBRMaterial(
            name=group.name, doubleSided=True, baseColorTexture=picture, **paint
        )
        square = trimesh.Trimesh(
            vertices=SQUARE,
            faces=SQUARE_FACES,
            vertex_normals=np.tile([0.0, 0.0, 1.0], (len(SQUARE), 1)),
            visual=trimesh.visual.TextureVisuals(uv=(SQUARE[:, :2] + 1.0) / 2.0, material=decal),
            process=False,
        )
        scene.add_geometry(square, node_name=group.name, geom_name=group.name, transform=transform)
    content: bytes = trimesh.exchange.gltf.export_glb(
        scene,
        include_normals=True,
        tree_postprocessor=partial(_finish_tree, baked=baked),
        buffer_postprocessor=partial(add_instances, instances=baked.instances),
    )
    return content


def gltf_bytes(baked: Baked) -> bytes:
    """Return a glTF file in JSON, which holds its buffer as a data URI."""
    glb = glb_bytes(baked)
    length = int.from_bytes(glb[12:16], "little")
    tree, buffer = json.loads(glb[20 : 20 + length]), glb[28 + length :]
    text = base64.b64encode(buffer).decode()
    tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{text}"
    return json.dumps(tree, ensure_ascii=False, separators=(",", ":")).encode()


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
    pictures = {id(texels): PngTexture(texels) for texels in given.values()}
    return factors | {name: pictures[id(texels)] for name, texels in given.items()}


def _finish_tree(tree: dict[str, Any], baked: Baked) -> None:
    """Name attributes as glTF does, let viewers filter textures without wrapping them, and add the recipe."""
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
    extras: dict[str, Any] = {} if baked.recipe is None else {"recipe": baked.recipe.record}
    extras |= {"export": baked.made} if baked.made else {}
    if extras:
        tree["asset"]["extras"] = extras
