"""Light on materials in float64 NumPy, from the glTF 2.0 specification (appendix B) and the cited papers."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals.rendering import Light
from decals.rendering.studio import GROUND, LAMPS, SKY

Array = NDArray[np.float64]

KEY, FILL = np.array([-0.55, 0.75, 0.70]), np.array([0.85, 0.10, 0.45])
KEY_LIGHT, FILL_LIGHT = 0.86 * np.array([1.00, 0.97, 0.92]), np.array([0.13, 0.14, 0.17])


@dataclass
class Surface:
    """Points with materials: rows of positions, normals, directions to the eye, and values of the maps."""

    position: Array
    normal: Array
    toward_eye: Array
    albedo: Array
    roughness: Array
    metallic: Array
    occlusion: Array
    emission: Array


def tilted(normal: Array, n_p: Array, u: Array, tilt: Array) -> Array:
    """Normals of a map, in the frame of the decal that turns with the normal on the way from its centre."""
    axis = np.cross(n_p, normal)
    sine, cosine = np.linalg.norm(axis, axis=1), normal @ n_p
    axis = axis / np.maximum(sine, 1e-30)[:, None]
    turned = (
        cosine[:, None] * u
        + sine[:, None] * np.cross(axis, u)
        + (1 - cosine)[:, None] * (axis @ u)[:, None] * axis
    )
    upright = np.sqrt(1 - tilt @ tilt)
    bent = tilt[0] * turned + tilt[1] * np.cross(normal, turned) + upright * normal
    return np.asarray(bent / np.linalg.norm(bent, axis=1, keepdims=True))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=-1))


def direct(s: Surface, toward_light: Array, light: Array) -> Array:
    """Lambert and GGX under light from one direction; `light`: what a white surface reflects head on."""
    lit, seen = _dot(s.normal, toward_light), np.maximum(_dot(s.normal, s.toward_eye), 1e-3)
    halfway = s.toward_eye + toward_light
    halfway /= np.linalg.norm(halfway, axis=1, keepdims=True)
    a2 = s.roughness**4
    distribution = a2 / (np.pi * (_dot(s.normal, halfway) ** 2 * (a2 - 1) + 1) ** 2)
    cosine = np.maximum(lit, 1e-9)
    smith = [2 * x / (x + np.sqrt(a2 + (1 - a2) * x**2)) for x in (cosine, seen)]
    height_correlated = 1 / (1 / smith[0] + 1 / smith[1] - 1)
    specular = distribution * height_correlated / (4 * cosine * seen)
    base = 0.04 + (s.albedo - 0.04) * s.metallic[:, None]
    fresnel = base + (1 - base) * ((1 - np.maximum(_dot(s.toward_eye, halfway), 0)) ** 5)[:, None]
    diffuse = (1 - fresnel) * (1 - s.metallic)[:, None] * s.albedo / np.pi
    radiance = np.pi * light * cosine[:, None] * (diffuse + fresnel * specular[:, None])
    return np.where((lit > 0)[:, None], radiance, 0.0)


def environment(s: Surface, ambient: Array, camera: Array) -> Array:
    """Diffuse light, and the environment mirrored by the lobe; columns of `camera`: right, up, back."""
    seen = np.maximum(_dot(s.normal, s.toward_eye), 1e-3)
    bounced = (2 * _dot(s.normal, s.toward_eye)[:, None] * s.normal - s.toward_eye) @ camera
    width = 2 * s.roughness**4 * seen  # of the lobe: one over its sharpness
    share = 0.5 + 0.5 * bounced[:, 1] / (1 + width)
    radiance = np.outer(1 - share, GROUND) + np.outer(share, SKY)
    for lamp in LAMPS:
        axis = np.array(lamp.direction) / np.linalg.norm(lamp.direction)
        sharpness = 1 / (1 / lamp.sharpness + width)
        strength = sharpness / lamp.sharpness * np.exp(sharpness * (bounced @ axis - 1))
        radiance += strength[:, None] * np.array(lamp.color)
    r = s.roughness
    first = 1 - r
    a004 = np.minimum(first**2, 2 ** (-9.28 * seen)) * first + (0.0425 - 0.0275 * r)
    scale, bias = -1.04 * a004 + 1.04 - 0.572 * r, 1.04 * a004 - 0.04 + 0.022 * r
    base = 0.04 + (s.albedo - 0.04) * s.metallic[:, None]
    mirrored = base * scale[:, None] + bias[:, None]
    diffuse = (1 - mirrored) * (1 - s.metallic)[:, None] * s.albedo * ambient
    return s.occlusion[:, None] * (diffuse + mirrored * radiance)


def tone_mapped(color: Array) -> Array:
    """Khronos PBR Neutral."""
    least = color.min(axis=1)
    color = color - np.where(least < 0.08, least - 6.25 * least**2, 0.04)[:, None]
    peak = color.max(axis=1)
    shown = 1 - 0.24**2 / (peak + 0.24 - 0.76)
    gray = 1 - 1 / (0.15 * (peak - shown) + 1)
    dimmed = color * (shown / np.maximum(peak, 1e-30))[:, None]
    bright = dimmed + gray[:, None] * (shown[:, None] - dimmed)
    return np.where((peak >= 0.76)[:, None], bright, color)


def studio(s: Surface, camera: Array) -> Array:
    """Display-linear colour under the studio light, without surroundings that keep light out."""
    up = camera[:, 1]
    ambient = np.outer(0.5 - 0.5 * s.normal @ up, GROUND) + np.outer(0.5 + 0.5 * s.normal @ up, SKY)
    light = environment(s, ambient, camera) + s.emission
    for direction, strength in ((KEY, KEY_LIGHT), (FILL, FILL_LIGHT)):
        toward = np.broadcast_to(camera @ (direction / np.linalg.norm(direction)), s.normal.shape)
        light = light + direct(s, toward, strength)
    return tone_mapped(light)


def lamps(s: Surface, lights: tuple[Light, ...], camera: Array, to_linear: Any) -> Array:
    """Display-linear colour under lights of a scene."""
    light = environment(s, np.zeros_like(s.albedo), camera) + s.emission
    for lamp in lights:
        toward, strength = np.broadcast_to(-np.array(lamp.direction), s.normal.shape), np.ones(len(s.normal))
        if lamp.position is not None:
            away = np.array(lamp.position) - s.position
            far = np.linalg.norm(away, axis=1)
            toward = away / far[:, None]
            strength = 1 / (np.array(lamp.attenuation) @ np.array([far**0, far, far**2]))
        light = light + direct(s, toward, to_linear(np.clip(np.outer(strength, lamp.color), 0, 1)))
    return tone_mapped(light)
