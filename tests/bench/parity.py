"""Compare owner, contact and image mapping with float64 at adversarial points, in every mode.

    python -m tests.bench.parity --device cuda:0 --samples 100000000 --json FILE

The points are sampled on the device. The oracle runs there too: `tests/oracles/parallel.py`, a float64 kernel
that shares no function with the implementation and that the tests compare with the NumPy oracle. The check
needs NumPy, Warp and msgspec, but no graphics and no Warp on the processor.
"""

import sys
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.device import start_warp
from decals import Contact, Decals, ImageMapping
from decals.index.index import index_on
from decals.record import NEIGHBOR_REACH
from tests.bench import parity_kernels as kernels
from tests.bench.command_line import bench_parser, write
from tests.oracles.contact import RIM, rim_distance
from tests.oracles.parallel import Members, answer_points

SETS = 512
"""Sets of decals in a world; no set reaches another."""
MEMBERS = 9
"""Decals in a set."""
SPACING = 8.0
KINDS = 6
"""Kinds of sets: in space, in a plane, sizes to 1,000:1, concentric, nearly a hexagonal tiling, nested."""


TIE, EDGE = 1e-4, 1e-6
MAX_REPORTED_POINTS = 4


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
"""Largest allowed value of each figure.

``contact_error_rh``: error of r/r_h by float32 alone, for sizes to 20:1. ``unlike_error_rh``: the same for
sizes to 1,000:1, where contact in cells subtracts squares of sizes. ``cut_error_rh``: with the effect of
neighbours beyond NEIGHBOR_REACH, less than 7e-5 each. ``uv_error``: divided by chord over tangent offset, the
condition number of the direction. Owners are compared where no relative change of 1e-4 decides between two,
contact where no neighbour lies within 1e-6 of NEIGHBOR_REACH and the owner's centre is farther than 1e-18
influence radii."""

ELASTIC_UV_ERROR = 5e-5
"""The limit of ``uv_error`` in ELASTIC contact, which stretches images near contact lines."""


def limits_of(contact: Contact) -> dict[str, float]:
    """Return the largest allowed value of each figure in a contact mode."""
    return LIMITS | {"uv_error": ELASTIC_UV_ERROR} if contact is Contact.ELASTIC else LIMITS


@dataclass(frozen=True)
class World:
    """Decals in sets of `members`, and flags of the sets that lie in a plane."""

    decals: Decals
    members: int
    flat: NDArray[np.bool_]


def make_world(seed: int, *, layered: bool = False) -> World:
    """Return a world; with `layered`, decals have random interactions in three layers."""
    rng = np.random.default_rng(seed)
    kind = np.arange(SETS) % KINDS
    radii = _radii(rng, kind)
    flat = np.isin(kind, (1, 4))
    offsets = _offsets(rng, kind, radii, flat)
    unused = np.arange(MEMBERS) > rng.integers(1, MEMBERS, (SETS, 1))
    away = np.zeros((SETS, MEMBERS, 3)) + [0, 0, 3] + 0.1 * np.arange(MEMBERS)[:, None] * [1, 0, 0]
    radii[unused], offsets[unused] = 1e-3, away[unused]
    corners = np.stack(np.unravel_index(np.arange(SETS), (8, 8, 8)), -1) * SPACING
    count = SETS * MEMBERS
    normals = [0, 0, 1] + 0.3 * rng.normal(size=(count, 3)) * ~np.repeat(flat, MEMBERS)[:, None]
    more: dict[str, Any] = {"spill": rng.random(count) < 0.1}
    if layered:
        more |= {"interactions": rng.integers(0, 3, count), "layers": rng.integers(-1, 2, count)}
    positions = (offsets + corners[:, None]).reshape(-1, 3)
    decals = Decals(positions, normals, rng.normal(size=(count, 3)), radii.reshape(-1), **more)
    return World(decals, MEMBERS, flat)


def _radii(rng: np.random.Generator, kind: NDArray[np.intp]) -> NDArray[np.float64]:
    ratio = np.where(kind == 2, 1000.0, 20.0)[:, None]
    radii = ratio ** rng.uniform(-1, 0, (len(kind), MEMBERS))
    hexagonal = 0.4 * (1 + 10.0 ** rng.uniform(-7, -1, radii.shape))
    radii = np.where((kind == 4)[:, None], hexagonal, radii)
    same = (kind == 3)[:, None] & (rng.random(radii.shape) < 0.5)
    return np.where(same, radii[:, :1], radii)


def _offsets(
    rng: np.random.Generator, kind: NDArray[np.intp], radii: NDArray[np.float64], flat: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the offsets of all members from the first of their set."""
    away = rng.normal(size=(*radii.shape, 3)) * np.where(flat, 0, 1)[:, None, None] ** [0, 0, 1]
    away /= np.linalg.norm(away, axis=2, keepdims=True)
    distance = (radii + radii[:, :1]) * rng.uniform(0, 1, radii.shape)
    deep = np.abs(radii - radii[:, :1]) * rng.uniform(0.8, 1.2, radii.shape)
    distance = np.where((kind == 5)[:, None], deep, distance)
    concentric = (kind == 3)[:, None] & (rng.random(radii.shape) < 0.7)
    distance = np.where(concentric, 0.0, distance)
    offsets = away * distance[..., None]
    angle = np.arange(MEMBERS) * np.pi / 3
    ring = 0.7 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(MEMBERS)])
    tiling = ring * (1 + 10.0 ** rng.uniform(-7, -1, (len(kind), MEMBERS, 1)))
    offsets = np.where((kind == 4)[:, None, None], tiling, offsets)
    offsets[:, 0] = 0
    return offsets


def members_of(world: World, device: Any) -> Any:
    """Return the decals of a world as arguments of the oracle."""
    decals = world.decals
    members: Any = Members()
    members.size = world.members
    for name in ("positions", "normals", "tangents"):
        setattr(members, name, wp.array(getattr(decals, name), dtype=wp.vec3, device=device))
    members.radii = wp.array(decals.radii, dtype=wp.float32, device=device)
    members.spill = wp.array(decals.spill.astype(np.int32), dtype=wp.int32, device=device)
    ranks = 4 * (decals.layers - decals.layers.min()) + decals.interactions
    members.ranks = wp.array(ranks.astype(np.int32), dtype=wp.int32, device=device)
    return members


class Chunk:
    """Sample points in one world, and their results."""

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

    def computed(self, contact: Contact, mapping: ImageMapping, *, once: bool) -> list[Any]:
        """Return (owners, rims, uv) of the implementation."""
        decals = self.world.decals
        outputs = [self._new(dtype) for dtype in (wp.int32, wp.float32, wp.vec2)]
        index = index_on(decals, self.device)
        index.mapping = int(mapping)
        inputs = [self.points, self.normals, int(contact), once, index]
        self._launch(kernels.look_at_points, inputs, outputs)
        return outputs

    def expected(self, contact: Contact, mapping: ImageMapping, *, reach: float) -> list[Any]:
        """Return (owners, complements, (u, v, stretch), doubts, edges) of the oracle."""
        types = (wp.int32, wp.float64, wp.vec3d, wp.float64, wp.float64)
        outputs = [self._new(dtype) for dtype in types]
        corrected = mapping == ImageMapping.CORRECTED
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

    def compare(self, contact: Contact, mapping: ImageMapping, *, once: bool) -> tuple[Any, Any]:
        """Return counts and largest errors; print the points whose errors exceed the limits."""
        counts = wp.zeros(kernels.COUNTS, dtype=wp.int32, device=self.device)
        worst = wp.zeros(kernels.WORST, dtype=wp.float64, device=self.device)
        computed = self.computed(contact, mapping, once=once)
        cut = self.expected(contact, mapping, reach=NEIGHBOR_REACH)
        uncut = self.expected(contact, mapping, reach=1.0)[1]
        self._launch(kernels.compare_points, [self.members, *computed, *cut, uncut], [counts, worst])
        figures = named(counts.numpy(), worst.numpy())
        if any(figures[name] > limit for name, limit in limits_of(contact).items()):
            arrays = [[array.numpy() for array in arrays] for arrays in (computed, cut)]
            print(
                figures, *worst_points(self.world, self.points.numpy(), self.sets.numpy(), *arrays), sep="\n"
            )
        return counts.numpy(), worst.numpy()


def parity(contact: Contact, *, layered: bool, samples: int, device: Any, chunk: int = CHUNK) -> Figures:
    """Compare many points in one mode; each chunk has its own world."""
    total, worst = np.zeros(kernels.COUNTS, np.int64), np.zeros(kernels.WORST)
    for number, first in enumerate(range(0, samples, chunk)):
        points = Chunk(make_world(number, layered=layered), min(chunk, samples - first), number, device)
        once = not layered and contact != Contact.RADIAL and number % 2 == 0
        mapping = ImageMapping.CORRECTED if number // 2 % 2 == 0 else ImageMapping.CHORD
        counts, errors = points.compare(contact, mapping, once=once)
        total, worst = total + counts, np.maximum(worst, errors)
    return named(total, worst)


def named(counts: Any, worst: Any) -> Figures:
    """Return the figures by name."""
    names = ("points", "owned", "unclear", "owners_differ", "not_finite")
    errors = ("contact_error_rh", "cut_error_rh", "uv_error", "unlike_error_rh")
    return dict(zip(names, counts.tolist(), strict=True)) | dict(zip(errors, worst.tolist(), strict=True))


def worst_points(
    world: World,
    points: NDArray[np.float32],
    sets: NDArray[np.int32],
    computed: list[NDArray[Any]],
    expected: list[NDArray[Any]],
) -> list[str]:
    """Describe the worst points: different owners first, then by the error of r.

    `computed` and `expected` are the arrays of `Chunk.computed` and `Chunk.expected`, on the host.
    """
    owner, rim = computed[:2]
    expected_owner, complement, _, doubt, edge = expected
    expected_rim = np.minimum(rim_distance(complement), 1)
    differ = (owner != expected_owner) & (doubt > TIE)
    comparable = (owner == expected_owner) & (owner >= 0) & (edge > EDGE)
    error = np.where(differ, 2.0, np.where(comparable, np.abs(rim - expected_rim), 0.0))
    lines = []
    for i in np.argsort(-error, kind="stable")[:MAX_REPORTED_POINTS].tolist():
        rows = slice(sets[i] * world.members, (sets[i] + 1) * world.members)
        w = points[i].astype(np.float64) - world.decals.positions[rows]
        radii = world.decals.radii[rows].astype(np.float64)
        away = np.linalg.norm(w, axis=1) / radii * RIM
        lines += [
            f"  error {error[i]:.3e} in set {sets[i]} (kind {sets[i] % KINDS}): owner {owner[i] - rows.start}"
            f" and {expected_owner[i] - rows.start}, r {rim[i]!r} and {expected_rim[i]!r},"
            f" E {complement[i]:.9e}, doubt {doubt[i]:.2e}, edge {edge[i]:.2e}",
            f"    |q - p|/s {away.tolist()}",
            f"    radii {radii.tolist()}",
            f"    ranks {(4 * world.decals.layers[rows] + world.decals.interactions[rows]).tolist()}",
        ]
    return lines


def measure(samples: int, device: Any) -> Figures:
    """Compare in all modes; the names of the figures begin with the mode."""
    figures: Figures = {}
    for contact, layered in MODES:
        mode = contact.name.lower() + ("_layered" if layered else "")
        begin = time.perf_counter()
        mode_figures = parity(contact, layered=layered, samples=samples, device=device)
        figures |= {f"{mode}_{name}": value for name, value in mode_figures.items()}
        figures[f"{mode}_s"] = time.perf_counter() - begin
        print(
            f"{mode:16}", " ".join(f"{name} {value:.4g}" for name, value in mode_figures.items()), flush=True
        )
    return figures


def main() -> int:
    """Parse the command line and compare; return True if a limit is exceeded."""
    parser = bench_parser("parity", __doc__)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--samples", type=int, default=1_000_000, help="points in every mode")
    options = parser.parse_args()
    start_warp()
    device = wp.get_device(options.device)
    print(f"python -m tests.bench.parity {' '.join(sys.argv[1:])}")
    print(f"{device.name}; numpy {np.__version__}, warp-lang {wp.__version__}", flush=True)
    figures = measure(options.samples, options.device)
    write(options.json, figures)
    broken = {
        name: value
        for name, value in figures.items()
        for contact in Contact
        for figure, limit in limits_of(contact).items()
        if name.startswith(contact.name.lower()) and name.endswith(figure) and value > limit
    }
    print("beyond the limits:" if broken else "all within the limits", *broken.items())
    return bool(broken)


if __name__ == "__main__":
    sys.exit(main())
