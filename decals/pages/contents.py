"""What the viewer of a page reads: meshes, decals, shaders and rules, and the scene as its file has it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from blobtree.formulas.falloff import RIM
from blobtree.progress import Progress
from decals.baking.meshes import BakeMesh, bake_mesh
from decals.errors import InvalidScene, TooMuchData
from decals.hosts.code import Form, code_of
from decals.hosts.shader import Shader, shader
from decals.images.load import embedded_image, opaque
from decals.index.decal_cells import FINEST, LEVEL_SHIFT, NO_FLOOR, NO_PARITY, REACH_WITH_SLACK
from decals.index.index import DecalIndex
from decals.index.lookup import HALF_RANGE, MIX_ALL, MIX_X, MIX_Y, MIX_Z, NESTING_SLACK
from decals.model import LAYER_LIMIT, MAX_COORDINATE, MIN_RADIUS
from decals.receivers import object_mask
from decals.record import MIN_KEPT_RADIUS, Contact
from decals.rendering.context import MAX_ANISOTROPY, MESA_SOFTWARE
from decals.rendering.options import Background
from decals.rendering.studio import studio_ambient, studio_constants
from decals.scenes.camera import REFERENCE_ASPECT
from decals.scenes.files import to_json
from decals.scenes.material import DecalMaterial
from decals.scenes.objects import MeshObject
from decals.scenes.scene import Scene
from decals.shaders import compose

MAX_DECALS = 100_000
"""Most decals of a page: its index is built by the page's script."""

PREFIX = "decal_"
"""Beginning of the names of decals in the page's shaders."""

NORMAL_LEVELS = 32767
"""Levels of the coordinates of normals."""

Arrays = dict[str, NDArray[Any]]


def page_contents(
    scene: Scene, *, background: Background, resolution: int | None, report: Progress
) -> tuple[dict[str, Any], Arrays]:
    """Return the header and the arrays of a page.

    Raises
    ------
    InvalidScene
        The scene has no surface, or a feature that pages do not have.
    TooMuchData
        The scene has more than MAX_DECALS decals.
    """
    if len(scene.decals) > MAX_DECALS:
        raise TooMuchData(
            f"a page shows at most {MAX_DECALS:,} decals, got {len(scene.decals):,}, about "
            f"{len(scene.decals) * 100 // 2**20} MB; show a part of them, or write a picture"
        )
    code = shader(scene, version="300 es", prefix=PREFIX)
    shown = [(item, part) for item in scene.objects if (part := item.shown) is not None]
    meshes = [
        (item, bake_mesh(part, resolution=resolution, creases=True, report=report)) for item, part in shown
    ]
    if not meshes:
        raise InvalidScene("scene: expected an object to show, got none; show one of its objects")
    colors = [mesh.vertex_light for _, mesh in meshes]
    arrays: Arrays = {}
    for number, (_, mesh) in enumerate(meshes):
        parts = _mesh_arrays(mesh, colors[number])
        arrays |= {f"{name} {number}": array for name, array in parts.items()}
    for number, item in enumerate(scene.objects):
        if isinstance(item, MeshObject):
            arrays |= {f"vertices of {number}": item.vertices, f"faces of {number}": item.faces}
    textures = {texture.name: texture for texture in code.textures if texture.kind == "2d-array"}
    levels = {name: texture.levels() for name, texture in textures.items()}
    for name, of_texture in levels.items():
        arrays |= {f"{name} {number}": level.reshape(-1, 4) for number, level in enumerate(of_texture)}
    camera = scene.camera.at(REFERENCE_ASPECT)
    return {
        "camera": {name: getattr(camera, name) for name in ("position", "target", "up", "fov")},
        "aspect": REFERENCE_ASPECT,
        "bounds": [side.tolist() for side in scene.bounds],
        "background": {"top": background.top, "bottom": background.bottom},
        "meshes": [
            {"mask": object_mask(item, code.receiver_table), "color": shades[0].tolist()}
            for (item, _), shades in zip(meshes, colors, strict=True)
        ],
        "images": {
            "textures": {
                name: {"size": t.size, "format": t.format, "levels": len(levels[name])}
                for name, t in textures.items()
            },
            "count": len(scene.images),
            "anisotropy": MAX_ANISOTROPY,
            "isotropic": MESA_SOFTWARE,
        },
        "shaders": _shaders(code),
        "mode": code.form.contact.name.lower(),
        "stiffness": scene.drawing.stiffness,
        "mapping": int(scene.drawing.mapping),
        "rules": record_rules(code.receiver_table, code.form)
        | {"index": index_rules(DecalIndex.of(scene.decals))},
        "scene": _scene_record(scene),
    }, arrays


def _mesh_arrays(mesh: BakeMesh, colors: NDArray[np.float32]) -> Arrays:
    """Return vertices, faces and normals of a mesh, and the colours of its vertices if they differ."""
    normals = np.rint(NORMAL_LEVELS * mesh.normals).astype(np.int16)
    arrays: Arrays = {"vertices": mesh.vertices, "faces": mesh.faces, "normals": normals}
    if (colors != colors[0]).any():
        arrays["color"] = colors
    return arrays


def _shaders(code: Shader) -> dict[str, Any]:
    """Return the vertex shader, and the parts of the fragment shaders: of each contact mode, and the ends.

    The plain form of a mode is fast, and the full one is right for all decals that an edit can make.
    """
    precision = "precision highp float;\nprecision highp int;\n"
    vertex = compose("base_mesh.vert", version=None).text
    light: dict[str, str | bool] = {**studio_ambient(), "MATERIAL_LIGHT": code.form.materials}
    material = {}
    if code.form.materials:
        environment = f"{studio_constants()}//@ include studio_environment.glsl"
        material = {"material": "//@ include material.glsl", "environment": environment}
    ends = {
        "color": compose("page.frag", slots=material, defines=light, version=None).text,
        "pick": compose("page.frag", slots=material, defines={**light, "PICK": True}, version=None).text,
    }
    full = replace(code.form, layered=True, limited=True, nested=True)
    modes = {
        mode.name.lower(): {
            name: code.header + code_of(form, code.version, code.stage, code.prefix).text
            for name, form in (
                ("plain", replace(code.form, contact=mode)),
                ("full", replace(full, contact=mode)),
            )
        }
        for mode in Contact
    }
    return {"vertex": code.header + precision + vertex, "modes": modes, "ends": ends}


def record_rules(receivers: Sequence[str], form: Form) -> dict[str, Any]:
    """Return the constants of records, and for which decals the plain form of the shaders is right."""
    return {
        "rim": float(RIM),
        "layerLimit": LAYER_LIMIT,
        "receivers": receivers,
        "minRadius": MIN_RADIUS,
        "maxCoordinate": MAX_COORDINATE,
        "keptRadius": MIN_KEPT_RADIUS,
        "nestingSlack": NESTING_SLACK,
        "plain": {name: getattr(form, name) for name in ("layered", "limited", "nested")},
    }


def index_rules(index: DecalIndex) -> dict[str, Any]:
    """Return the constants of an index, and which sizes share levels in it."""
    return {
        "reach": REACH_WITH_SLACK,
        "finest": FINEST,
        "halfRange": int(HALF_RANGE),
        "levelShift": LEVEL_SHIFT,
        "mix": [int(mix) for mix in (MIX_X, MIX_Y, MIX_Z, MIX_ALL)],
        "parity": None if index.parity == NO_PARITY else index.parity,
        "floor": None if index.floor == NO_FLOOR else index.floor,
    }


def _scene_record(scene: Scene) -> Mapping[str, Any]:
    """Return the scene as its file has it, with all images in it; meshes are among the arrays."""
    objects = tuple(
        replace(item, source=None) if isinstance(item, MeshObject) else item for item in scene.objects
    )
    record: dict[str, Any] = msgspec.json.decode(to_json(replace(scene, objects=objects), folder=Path()))
    for item in record["objects"]:
        item.pop("data", None)
    for number, image in enumerate(scene.images):
        if not isinstance(image, DecalMaterial) and not image.is_generated:
            name, pixels = Path(image.source).stem, embedded_image(image.pixels)
            record["images"][number] = {"name": name, "pixels": pixels}
    environment = scene.drawing.environment
    if environment is not None:  # a path would name a folder of this machine
        record["drawing"]["environment"]["picture"] = embedded_image(opaque(environment.picture.light))
    return record
