"""What the viewer of a page reads: meshes, decals, shaders and rules, and the scene as its file has it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from blobtree.formulas.falloff import RIM
from blobtree.progress import Progress
from decals.errors import TooMuchData
from decals.hosts.shader import shader
from decals.images.load import embedded_image, opaque
from decals.index.decal_cells import FINEST, LEVEL_SHIFT, NO_FLOOR, NO_PARITY, REACH_WITH_SLACK
from decals.index.index import DecalIndex
from decals.index.lookup import HALF_RANGE, MIX_ALL, MIX_X, MIX_Y, MIX_Z, NESTING_SLACK
from decals.model import (
    FADE_ANGLES,
    FADE_DEPTHS,
    LAYER_LIMIT,
    MAX_COORDINATE,
    MIN_RADIUS,
    NO_IMAGE,
    Interaction,
)
from decals.pages.programs import PREFIX, VERSION, picture_programs
from decals.pages.surfaces import Surfaces, mesh_objects
from decals.pages.textures import (
    CLAMP,
    MAX_SIDE,
    TARGETS,
    Arrays,
    PageTexture,
    decal_texture,
    matrix_uniform,
    panorama_texture,
    targets,
    uniform,
)
from decals.record import MIN_KEPT_RADIUS
from decals.rendering.context import MESA_SOFTWARE
from decals.rendering.decal_library import Form
from decals.rendering.environment import Environment
from decals.rendering.frame_plan import AMBIENT_RADIUS
from decals.rendering.light_pass import NO_LIGHTS
from decals.rendering.options import Drawing
from decals.rendering.prefiltering import picture_texels, prefiltered
from decals.rendering.viewpoint import TILE_MARGIN
from decals.scenes.camera import MAX_RATIO, REFERENCE_ASPECT, Camera, Vector
from decals.scenes.files import to_json
from decals.scenes.material import DecalMaterial
from decals.scenes.objects import MeshObject
from decals.scenes.scene import Scene
from decals.validation import MAX_STIFFNESS

MAX_DECALS = 100_000
"""Most decals of a page: its index is built by the page's script."""

WHOLE, OR_ZERO = {"test": "isInteger"}, {"zero": True}
"""What the limits of some values add: whole numbers alone, or 0 too."""

SAMPLES = (0.0, 0.0), (0.125, 0.375), (0.375, -0.125), (-0.125, -0.375), (-0.375, 0.125)
"""Places in a pixel at which a page draws it, one after the other: its picture is their mean."""


def page_contents(
    scene: Scene, *, traced: int, resolution: int | None, report: Progress
) -> tuple[dict[str, Any], Arrays]:
    """Return the header and the arrays of a page, in which trees are meshes, or traced with some blocks.

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
    code = shader(scene, version=VERSION, prefix=PREFIX)
    surfaces = Surfaces.of(scene, code.receiver_table, traced=traced, resolution=resolution, report=report)
    environment = environment_textures(scene.drawing.environment)
    textures = {texture.name: decal_texture(texture) for texture in code.textures if len(texture.size) > 2}
    textures |= surfaces.textures | environment
    arrays = surfaces.arrays | mesh_objects(scene)
    for name, texture in textures.items():
        arrays |= texture.arrays(name)
    return {
        "camera": camera_record(scene.camera),
        "aspect": REFERENCE_ASPECT,
        "bounds": surfaces.bounds,
        "surfaces": surfaces.records,
        "textures": {name: texture.record(name) for name, texture in textures.items()},
        "isotropic": MESA_SOFTWARE,
        "targets": targets(),
        "samples": SAMPLES,
        "programs": surfaces.programs,
        "shaders": picture_programs(code, scene.drawing),
        "uniforms": picture_uniforms(scene.drawing, surfaces.bounds, [*textures, *TARGETS]),
        "images": len(scene.images),
        "mode": code.form.contact.name.lower(),
        "stiffness": scene.drawing.stiffness,
        "rules": record_rules(code.receiver_table, code.form, len(scene.images))
        | {"index": index_rules(DecalIndex.of(scene.decals))},
        "scene": _scene_record(scene),
    }, arrays


def camera_record(camera: Camera) -> dict[str, Any]:
    """Return a camera as the viewer reads it, which finds its pose in each picture as `Camera.at` does.

    It stays for those in the range ``kept``. Distances along the view count from the middle of the points.
    """
    record = {name: getattr(camera, name) for name in ("position", "target", "up", "fov")}
    aspect, kept, margin = 0.0, (0.0, MAX_RATIO), 1.0
    points: Sequence[Vector] = [camera.target]
    if camera.fit is not None and camera.fit.points:
        points, margin = camera.fit.points, camera.fit.margin
        kept = camera.aspects_of(points)
    elif camera.fit is not None:
        aspect = REFERENCE_ASPECT
    filling = camera.filling(points, margin)
    right, up, back = filling.axes
    return record | {
        "aspect": aspect,
        "fit": {
            "kept": kept,
            "points": np.stack([filling.across, filling.depths - filling.middle], axis=1).tolist(),
            "slope": filling.slope,
            "nearest": filling.nearest - filling.middle,
            "middle": (filling.along * up + filling.middle * back).tolist(),
            "right": right.tolist(),
            "back": back.tolist(),
        },
    }


def picture_uniforms(drawing: Drawing, bounds: Any, textures: Iterable[str]) -> dict[str, Any]:
    """Return the uniforms of the picture that stay; a texture is named as its uniform."""
    uniforms: dict[str, Any] = {
        "decal_mapping": uniform(int(drawing.mapping)),
        "ambient_radius": uniform(AMBIENT_RADIUS * float(np.linalg.norm(np.subtract(*bounds)))),
        "ambient_limit": uniform(TILE_MARGIN),
    }
    if drawing.lights is not None or drawing.environment is not None:
        lights = drawing.lights or NO_LIGHTS
        uniforms |= {
            "light_count": uniform(len(lights.lights)),
            "light_frame": matrix_uniform(lights.matrix),
            "lights": ["4fv", np.frombuffer(lights.packed(), np.float32).tolist()],
        }
    if drawing.environment is not None:
        uniforms |= {
            "environment_strength": uniform(float(drawing.environment.strength)),
            "environment_frame": matrix_uniform(drawing.environment.frame),
        }
    return uniforms | {name: name for name in textures}


def environment_textures(environment: Environment | None) -> dict[str, PageTexture]:
    """Return the textures of an environment, as `EnvironmentTextures` has them."""
    if environment is None:
        return {}
    panorama = environment.picture
    textures = {"environment_levels": panorama_texture(prefiltered(panorama), CLAMP)}
    if environment.visible:
        seen = picture_texels(panorama.light, MAX_SIDE)
        textures["environment_picture"] = panorama_texture(seen, "REPEAT")
    return textures


def record_rules(receivers: Sequence[str], form: Form, images: int) -> dict[str, Any]:
    """Return the constants and the limits of records, and for which decals the plain shaders are right."""
    interactions = {item.name.lower(): int(item) for item in Interaction}
    return {
        "rim": float(RIM),
        "layerLimit": LAYER_LIMIT,
        "receivers": receivers,
        "interactions": interactions,
        "values": {
            **{
                name: _limits(-MAX_COORDINATE, MAX_COORDINATE, 3)
                for name in ("position", "normal", "tangent")
            },
            "number": _limits(0, 2 * MAX_DECALS) | WHOLE,
            "radius": _limits(MIN_RADIUS, MAX_COORDINATE),
            "image": _limits(NO_IMAGE, images - 1) | WHOLE,
            "layer": _limits(-LAYER_LIMIT, LAYER_LIMIT - 1) | WHOLE,
            "tint": _limits(0, 1, 3),
            "opacity": _limits(0, 1),
            "fade_angle": _limits(*FADE_ANGLES) | OR_ZERO,
            "fade_depth": _limits(*FADE_DEPTHS) | OR_ZERO,
        },
        "choices": {
            "interaction": list(interactions),
            "spill": [False, True],
            "single_sheet": [False, True],
            "receivers": receivers,
        },
        "maxStiffness": MAX_STIFFNESS,
        "keptRadius": MIN_KEPT_RADIUS,
        "nestingSlack": NESTING_SLACK,
        "plain": {name: getattr(form, name) for name in ("layered", "limited", "nested")},
    }


def _limits(low: float, high: float, count: int = 0) -> dict[str, Any]:
    """Return the least and the greatest value of a number, or of each of some numbers."""
    return {"test": "isFinite", "low": low, "high": high, "count": count}


def index_rules(index: DecalIndex) -> dict[str, Any]:
    """Return the constants of an index, the sizes of its levels, and which sizes share levels in it."""
    return {
        "exponents": np.log2(index.levels[:, 1]).astype(int).tolist(),
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
