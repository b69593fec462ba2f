"""Owner, contact and image place against float64, a hundred million adversarial points in every mode:

    python -m tests.bench.parity --device cuda:0 --samples 100000000 --json P

The points are made on the device, and the oracle runs there too: `tests/oracles/parallel.py`, a float64
kernel that shares no function with the implementation and that the tests hold against the NumPy oracle.
Needs NumPy, Warp and msgspec; no graphics, and no Warp on the processor.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from decals.field.contact import REACH, Contact
from decals.field.mapping import Mapping
from decals.grid.index import DeviceIndex
from tests.bench import parity_kernels as kernels
from tests.bench.parity_report import worst_points
from tests.bench.parity_worlds import MEMBERS, World, make_world
from tests.oracles.parallel import Members, answer_points

CHUNK = 1 << 22
MODES = [(contact, layered) for layered in (False, True) for contact in Contact]
Figures = dict[str, float]

LIMITS = {
    "owners_differ": 0,
    "not_finite": 0,
    "contact_error_rh": 2e-5,
    "unlike_error_rh": 1e-4,
    "cut_error_rh": 7e-5 * (MEMBERS - 1),
    "uv_error": 2e-5,
}
"""The most that may be. Errors of r/r_h: of float32 alone among sizes to 20:1, and to 1,000:1 (unlike: radial
contact takes the difference of the squares of sizes); with what neighbours beyond REACH would add, less than
7e-5 each. Errors of uv: over the quotient of chord and tangent offset, which says how ill the direction is
conditioned. Owners count where no relative change of 1e-4 decides about them, contact where no neighbour lies
within 1e-6 of REACH and the owner's centre is no nearer than 1e-18 influence radii."""


def members_of(world: World, device: Any) -> Any:
    """Decals of a world as the oracle takes them."""
    decals, these = world.decals, Members()
    these.size = world.members
    for name in ("positions", "normals", "tangents"):
        setattr(these, name, wp.array(getattr(decals, name), dtype=wp.vec3, device=device))
    these.radii = wp.array(decals.radii, dtype=wp.float32, device=device)
    these.spill = wp.array(decals.spill.astype(np.int32), dtype=wp.int32, device=device)
    ranks = 4 * (decals.layers - decals.layers.min()) + decals.interactions
    these.ranks = wp.array(ranks.astype(np.int32), dtype=wp.int32, device=device)
    return these


class Chunk:
    """Points in one world, and arrays for what is said of them."""

    def __init__(self, world: World, count: int, seed: int, device: Any) -> None:
        self.world, self.count, self.device = world, count, device
        self.members = members_of(world, device)
        self.points, self.normals = self._new(wp.vec3), self._new(wp.vec3)
        self.sets = self._new(wp.int32)
        flat: Any = wp.array(world.flat.astype(np.int32), dtype=wp.int32, device=device)
        self._launch(
            kernels.choose_points, [seed, flat, self.members], [self.points, self.normals, self.sets]
        )

    def _new(self, dtype: Any) -> Any:
        return wp.zeros(self.count, dtype=dtype, device=self.device)

    def _launch(self, kernel: Any, inputs: list[Any], outputs: list[Any]) -> None:
        wp.launch(kernel, self.count, inputs, outputs, device=self.device)

    def found(self, contact: Contact, mapping: Mapping, *, once: bool) -> list[Any]:
        """(owners, rims, uv) as the implementation finds them."""
        decals = self.world.decals
        outputs = [self._new(dtype) for dtype in (wp.int32, wp.float32, wp.vec2)]
        records: Any = wp.array(decals.packed(), dtype=wp.vec4, device=self.device)
        index = DeviceIndex.of(decals, self.device).arguments()
        modes = int(mapping), int(contact), decals.layered, once
        self._launch(kernels.look_at_points, [self.points, self.normals, *modes, records, *index], outputs)
        return outputs

    def wanted(self, contact: Contact, mapping: Mapping, *, reach: float) -> list[Any]:
        """(owners, complements, (u, v, stretch), doubts, edges) as the oracle finds them."""
        types = (wp.int32, wp.float64, wp.vec3d, wp.float64, wp.float64)
        outputs = [self._new(dtype) for dtype in types]
        corrected = mapping == Mapping.CORRECTED
        inputs = [
            self.points,
            self.normals,
            self.sets,
            int(contact),
            corrected,
            wp.float64(reach),
            self.members,
        ]
        self._launch(answer_points, inputs, outputs)
        return outputs

    def compare(self, contact: Contact, mapping: Mapping, *, once: bool) -> tuple[Any, Any]:
        """Counts and worst errors; points of errors that may not be are printed."""
        counts = wp.zeros(kernels.COUNTS, dtype=wp.int32, device=self.device)
        worst = wp.zeros(kernels.WORST, dtype=wp.float64, device=self.device)
        found = self.found(contact, mapping, once=once)
        cut = self.wanted(contact, mapping, reach=REACH)
        uncut = self.wanted(contact, mapping, reach=1.0)[1]
        self._launch(kernels.compare_points, [self.members, *found, *cut, uncut], [counts, worst])
        figures = named(counts.numpy(), worst.numpy())
        if any(figures[name] > most for name, most in LIMITS.items()):
            arrays = [[array.numpy() for array in arrays] for arrays in (found, cut)]
            print(
                figures, *worst_points(self.world, self.points.numpy(), self.sets.numpy(), *arrays), sep="\n"
            )
        return counts.numpy(), worst.numpy()


def parity(contact: Contact, *, layered: bool, samples: int, device: Any, chunk: int = CHUNK) -> Figures:
    """Compare many points in one mode, each chunk of them in a world of its own."""
    total, worst = np.zeros(kernels.COUNTS, np.int64), np.zeros(kernels.WORST)
    for number, first in enumerate(range(0, samples, chunk)):
        points = Chunk(make_world(number, layered=layered), min(chunk, samples - first), number, device)
        once = not layered and contact != Contact.RADIAL and number % 2 == 0
        mapping = Mapping.CORRECTED if number // 2 % 2 == 0 else Mapping.CHORD
        counts, errors = points.compare(contact, mapping, once=once)
        total, worst = total + counts, np.maximum(worst, errors)
    return named(total, worst)


def named(counts: Any, worst: Any) -> Figures:
    """Figures by name."""
    names = ("points", "owned", "unclear", "owners_differ", "not_finite")
    errors = ("contact_error_rh", "cut_error_rh", "uv_error", "unlike_error_rh")
    return dict(zip(names, counts.tolist(), strict=True)) | dict(zip(errors, worst.tolist(), strict=True))


def measure(samples: int, device: Any) -> Figures:
    """All modes; the names of their figures begin with the mode."""
    figures: Figures = {}
    for contact, layered in MODES:
        mode = contact.name.lower() + ("_layered" if layered else "")
        begin = time.perf_counter()
        found = parity(contact, layered=layered, samples=samples, device=device)
        figures |= {f"{mode}_{name}": value for name, value in found.items()}
        figures[f"{mode}_s"] = time.perf_counter() - begin
        print(f"{mode:16}", " ".join(f"{name} {value:.4g}" for name, value in found.items()), flush=True)
    return figures


def main() -> int:
    """Read the command line, compare, and say whether all limits hold."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.parity", description=__doc__)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--samples", type=int, default=1_000_000, help="points in every mode")
    parser.add_argument("--json", type=Path, help="also write one flat object {figure: number}")
    options = parser.parse_args()
    wp.init()
    device = wp.get_device(options.device)
    print(f"python -m tests.bench.parity {' '.join(sys.argv[1:])}")
    print(f"{device.name}; numpy {np.__version__}, warp-lang {wp.__version__}", flush=True)
    figures = measure(options.samples, options.device)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    broken = {
        name: value
        for name, value in figures.items()
        for limit, most in LIMITS.items()
        if name.endswith(limit) and value > most
    }
    print("beyond the limits:" if broken else "all within the limits", *broken.items())
    return bool(broken)


if __name__ == "__main__":
    sys.exit(main())
