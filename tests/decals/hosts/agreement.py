"""Agreement of exported shaders with the library: values at points, and pictures."""

from typing import Any

import numpy as np

from decals import Scene, evaluate, render
from decals.rendering import Lighting
from decals.rendering.decal_library import Form
from tests.oracles.decals import decals_at

DOUBT = 1e-4
"""Owners may differ where a relative change of this size decides."""

VALUE, COLOR = 2e-3, 8e-3
"""Greatest errors of fields and image coordinates, and of colours, whose images are bytes."""

PIXEL = 2
"""Levels of 255 by which a pixel may differ."""


def wrong_values(form: Form, scene: Scene, points: Any, normals: Any, values: dict[str, Any]) -> list[str]:
    """What differs between a shader's values at points and the library's, in words; none if they agree.

    Owners and fields are compared with the oracle, colours and maps with `evaluate`.
    """
    on = frozenset({scene.objects[0].name})
    reference = decals_at(scene.decals, points, normals, contact=form.contact.name.lower(), on=on)
    options: dict[str, Any] = {"on": scene.objects[0], "images": list(scene.images), "materials": True}
    known = evaluate(scene.decals, points, normals, **scene.drawing.modes, **options)
    sure = (reference.doubt > DOUBT) & (reference.stretch < 20)
    owner, field = values["found"][:, 0].astype(int), values["found"][:, 1]
    assert sure.mean() > 0.9
    assert (reference.owner[sure] >= 0).mean() > 0.5
    wrong = []
    if (owner != reference.owner)[sure].any():
        wrong.append(f"{(owner != reference.owner)[sure].sum()} owners")
    sure &= owner == known.owner
    assert sure.mean() > 0.9
    steady = sure & _steady(scene, points, normals, known, options)
    assert steady.mean() > 0.7
    pairs = {
        "field": (field, reference.field, sure, VALUE),
        "uv": (values["place"][:, :2], known.uv, steady, VALUE),
        "color": (values["color"], known.color, steady, COLOR),
    }
    wrong += [name for name, pair in pairs.items() if differs(*pair)]
    if np.abs(values["values"][:, 3]).max() > 0:
        wrong.append("color of the material")
    return wrong + (wrong_maps(form, values, known, steady) if form.materials else [])


def wrong_maps(form: Form, values: dict[str, Any], known: Any, steady: np.ndarray) -> list[str]:
    """The maps of materials that differ; `evaluate` turns the normals of all layers as the topmost one."""
    maps, part = known.materials, values["surface"][:, 3]
    shown = steady & (maps.part > 0.05)
    assert shown.mean() > 0.1
    lengths = np.linalg.norm(maps.normal, axis=1, keepdims=True)
    normal = maps.normal / np.maximum(lengths, 1e-9)
    pairs = {
        "part": (part, maps.part, steady, COLOR),
        "normal": (values["surface"][:, :3], normal, shown & (not form.layered), 2 * COLOR),
        "roughness": (values["values"][:, 0] * part, maps.roughness, shown, COLOR),
        "metallic": (values["values"][:, 1] * part, maps.metallic, shown, COLOR),
        "occlusion": (values["values"][:, 2] * part, maps.occlusion, shown, COLOR),
        "emission": (values["glow"][:, :3], maps.emission, shown, COLOR),
    }
    return [name for name, pair in pairs.items() if differs(*pair)]


def differs(values: np.ndarray, expected: np.ndarray, rows: np.ndarray, tolerance: float) -> bool:
    """True if some rows differ by more than a tolerance."""
    return bool((np.abs(values - expected)[rows] > tolerance).any())


def _steady(scene: Scene, points: Any, normals: Any, known: Any, options: dict[str, Any]) -> np.ndarray:
    """Points at which small steps change little: neither an edge nor a place where images are torn."""
    result = np.ones(len(points), bool)
    for axis in range(3):
        for step in (-2e-5, 2e-5):
            moved = evaluate(
                scene.decals,
                points + step * np.eye(3, dtype=np.float32)[axis],
                normals,
                **scene.drawing.modes,
                **options,
            )
            result &= (moved.owner == known.owner) & (np.abs(moved.uv - known.uv).max(axis=1) < 5e-4)
            result &= np.abs(moved.color - known.color).max(axis=1) < 2e-3
    return result


def equal_pixels(shown: np.ndarray, scene: Scene) -> float:
    """Share of the surface's pixels that equal those of `render` without light, uint8[h, w, 4] each.

    0 if a silhouette lies more than one pixel off.
    """
    size = shown.shape[1], shown.shape[0]
    picture = render(
        scene, size=size, samples=1, lights=Lighting(()), background="transparent", filtered=False
    )
    expected = np.asarray(picture.pixels)
    ours, theirs = expected[..., 3] > 0, shown[..., 3] > 0
    if (ours & ~grown(theirs)).any() or (theirs & ~grown(ours)).any():
        return 0.0
    both = ours & theirs
    errors = np.abs(expected[..., :3].astype(int) - shown[..., :3].astype(int)).max(axis=-1)
    return float((errors[both] <= PIXEL).mean())


def grown(mask: np.ndarray) -> np.ndarray:
    """A mask and the pixels that touch it."""
    height, width = mask.shape
    padded = np.pad(mask, 1)
    shifts = [padded[i : i + height, j : j + width] for i in range(3) for j in range(3)]
    result: np.ndarray = np.any(shifts, axis=0)
    return result
