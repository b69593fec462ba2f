"""Faults of covered models: stretched, folded, oversized and missing decals, on the models of the tests."""

import numpy as np

import decals
from tests.decals.distortion import distortion
from tests.decals.fault_models import FAULT_MODELS, visible
from tests.decals.placed_by_hand import FAMILIES, MODELS, pinholes, placed

TARGETS = {
    "stretch5_worst": "≤ 0.003",
    "folded_worst": "≤ 5e-4",
    "radius_worst": "≤ 1.5",
    "bare_worst": "0",
    "rho_worst": "≥ 0.86",
    "pinholes": "0",
}
"""Targets of the worst model, and of the worst set of decals that are placed by hand."""

COUNT = 300
"""Decals on each model."""


def measure(seed: int = 1, *, quick: bool) -> dict[str, float]:
    """Cover each model evenly, and measure it at points that the scattering did not use."""
    samples = 50_000 if quick else 1_000_000
    figures: dict[str, float] = {}
    for name, model in FAULT_MODELS.items():
        scene = decals.cover(model(), count=COUNT, seed=seed)
        layout = scene.decals
        found = distortion(layout, visible(name), samples)
        figures |= {
            f"stretch5_{name}": found.stretched,
            f"folded_{name}": found.folded,
            f"radius_{name}": float(layout.radii.max() / np.median(layout.radii)),
            f"bare_{name}": found.bare,
            f"rho_{name}": decals.measure(scene, samples=1000).rho,
        }
    for key in (key for key in TARGETS if key.endswith("_worst")):
        kind = key.removesuffix("_worst")
        values = [figures[f"{kind}_{name}"] for name in FAULT_MODELS]
        figures[key] = min(values) if kind == "rho" else max(values)
    figures["pinholes"] = max(
        pinholes(placed(mesh, seed, **family), mesh, samples // 10, contact.name.lower())
        for mesh in (model() for model in MODELS.values())
        for family in FAMILIES.values()
        for contact in decals.Contact
    )
    return figures
