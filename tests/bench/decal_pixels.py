"""Pixels of covered models on which no image shows, at the scale of a large picture."""

import decals
from decals.rendering import Renderer, RenderOptions
from decals.surfaces import MeshSurface
from tests.bench.decal_faults import COUNT
from tests.decals.fault_models import FAULT_MODELS

SIZE = (3600, 2700)
"""Width and height of the pictures."""

VIEWS = ((0.55, 0.35, 1.0), (-1.0, 0.3, 0.4), (0.3, -0.9, -0.6), (0.1, 1.0, 0.2))
"""Directions from the model toward the camera."""

TARGETS = {"bare_pixels_worst": "0"}
"""Target of the worst model."""

RIM = 0.2501
"""Square of the distance from the middle of an image up to which it shows."""


def measure(seed: int = 1, *, quick: bool) -> dict[str, float]:
    """Cover each model evenly, draw it from several sides, and count surface pixels without an image."""
    size, views = ((900, 675), VIEWS[:2]) if quick else (SIZE, VIEWS)
    figures: dict[str, float] = {}
    with Renderer() as renderer:
        for name, model in FAULT_MODELS.items():
            vertices, faces = model()
            relaxation = decals.Relaxation(MeshSurface(vertices, faces), count=COUNT, seed=seed)
            relaxation.run()
            scene = decals.Scene(
                objects=[decals.MeshObject(name, vertices, faces)],
                camera=decals.Camera.fitting(vertices, direction=VIEWS[0]),
                decals=relaxation.to_decals(seed=seed),
                images=["tile"],
            )
            bare = shown = 0
            for direction in views:
                camera = decals.Camera.fitting(vertices, direction=direction)
                seen = renderer.buffers(scene, RenderOptions(size=size), viewpoint=camera)
                surface = seen.object_id >= 0
                inside = ((seen.uv[surface] - 0.5) ** 2).sum(axis=1) <= RIM
                shown += int(surface.sum())
                bare += int((~inside | (seen.owner[surface] < 0)).sum())
            figures |= {f"bare_pixels_{name}": float(bare), f"pixels_{name}": float(shown)}
            print(f"  {name}: {bare} of {shown} pixels", flush=True)
    figures["bare_pixels_worst"] = max(figures[f"bare_pixels_{name}"] for name in FAULT_MODELS)
    return figures
