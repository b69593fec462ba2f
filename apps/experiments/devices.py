"""What a processor and a graphics card compute alike: bit for bit, to rounding, or in kind alone.

`STATEMENTS` says for each public function what decides its results. The experiment measures it: each case is
computed on a backend, and compared with Warp on the processor.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import blobtree
import decals
from blobtree._typing import Float32Array
from blobtree.device import start_warp
from decals.experiments import Grid, Seeds
from decals.rendering import Context, Renderer, RenderOptions

Kind = Literal["processor", "rounding", "seeded", "drawn", "either"]
"""What decides the results of a function; `EXPLAINED` says it in words."""

EXPLAINED: dict[Kind, str] = {
    "processor": "computed by the processor, with or without a card",
    "rounding": "the same bits on the processor, in every run and with any number of threads; on a card "
    "equal to rounding",
    "seeded": "the same bits for a seed on one device; on another device other decals of the same quality",
    "drawn": "drawn by OpenGL: the same bits with one driver and backend; on others equal to rounding, "
    "but for pixels on lines",
    "either": "the parts that it works with decide: as the functions that it calls",
}

BY_KIND: dict[Kind, str] = {
    "processor": """
        blobtree.check_kind blobtree.content_hash blobtree.custom.define_falloff blobtree.custom.define_field
        blobtree.custom.define_operator blobtree.custom.define_skeleton blobtree.custom.define_warp
        blobtree.foreign.read_lipschitz blobtree.foreign.read_program blobtree.foreign.read_three_js
        blobtree.foreign.read_tree blobtree.formula blobtree.from_json blobtree.from_sdf
        blobtree.load blobtree.numeric_parameters blobtree.numeric_values blobtree.save blobtree.to_json
        blobtree.with_numeric_values blobtree.split_creases decals.define_contact decals.load_image
        decals.load_model decals.load_scene decals.pose decals.save_scene decals.shader decals.skin
        decals.from_table decals.load_table decals.save_table decals.to_arrow decals.to_pandas
        decals.scattering.on_copies decals.scattering.region_mask decals.scattering.vertex_density
        decals.surfaces.check_mesh decals.surfaces.linear_colors decals.surfaces.read_mesh
        decals.rendering.register decals.pages.viewer_script decals.editing.recovery_path
        decals.window.browser_keys decals.window.press_key decals.images.generate_image
        decals.images.image_pixels decals.images.is_builtin decals.images.read_image decals.experiments.report
    """,
    "rounding": """
        blobtree.Node.__call__ blobtree.Node.gradient blobtree.Node.colors blobtree.Node.raycast
        blobtree.field_grid blobtree.fit blobtree.from_mesh blobtree.polygonize blobtree.polygonize_batch
        blobtree.raycast_batch blobtree.sample blobtree.to_sdf
        decals.area_gradient decals.outlines decals.save_figure
        decals.evaluate decals.evaluate_batch decals.measure decals.displace decals.bake decals.export
        decals.scattering.gradient_of decals.scattering.seen_from_outside
        decals.surfaces.as_surface decals.editing.first_hit
        decals.editing.nearest_points decals.editing.outline decals.editing.pick
    """,
    "seeded": "decals.cover decals.scatter decals.scattering.remeshed_points",
    "drawn": """
        decals.animate decals.render decals.render_batch decals.turntable decals.edit decals.show
        decals.save_html decals.pages.page
    """,
    "either": "decals.reproduce decals.experiments.run",
}

STATEMENTS: dict[str, Kind] = {name: kind for kind, names in BY_KIND.items() for name in names.split()}
"""What decides the results of each public function."""

Backend = Literal["cpu", "cuda", "fragment", "compute"]

POINTS = 20_000
SIZE = 160, 120


@dataclass(frozen=True)
class Answers:
    """Results at many places.

    Attributes
    ----------
    choices : int[n]
        Whole numbers that decide what the values are: the owner of a point, hit or miss.
    values : float[n, k]
        Numbers of each place.
    scale : float
        Size to which differences of values are compared.
    """

    choices: NDArray[Any]
    values: NDArray[Any]
    scale: float = 1.0


Case = Callable[[str, int], Answers]
"""The results of a case on a Warp device, with a seed."""

DrawnCase = Callable[[str, int], tuple[Answers, Answers]]
"""The results of two ways to draw, of which one is a backend of OpenGL."""


def devices(case: str, backend: str, seed: int = 0) -> dict[str, float]:
    """Compute a case on a backend, and compare it with Warp on the processor.

    Parameters
    ----------
    case
        One of `CASES` for Warp, or of `DRAWN` for OpenGL.
    backend
        A `Backend`; ``"cpu"`` computes the case on the processor a second time.
    seed
        Seed of points, rays and decals.

    Returns
    -------
    dict
        ``bits``, the share of places with the same bits; ``unlike``, the share where another decal is seen
        or another part is hit; ``p99`` and ``largest``, of the differences at all other places.
    """
    if case in DRAWN:
        return compared(*DRAWN[case](backend, seed))
    return compared(CASES[case]("cpu", seed), CASES[case]("cuda:0" if backend == "cuda" else "cpu", seed))


def compared(first: Answers, second: Answers) -> dict[str, float]:
    """Return how far two results differ."""
    if len(first.choices) != len(second.choices):
        return _compared_sets(first, second)
    alike = first.choices == second.choices
    one, other = (_rows(answers) for answers in (first, second))
    same = alike & (one.view(np.uint8) == other.view(np.uint8)).all(axis=1)
    with np.errstate(invalid="ignore"):
        apart = np.abs(one.astype(np.float64) - other.astype(np.float64)).max(axis=1, initial=0.0)
    apart = np.where(same, 0.0, apart)[alike] / first.scale
    return {
        "bits": float(same.mean()),
        "unlike": float(1.0 - alike.mean()),
        "p99": float(np.quantile(apart, 0.99, method="higher")) if len(apart) else 0.0,
        "largest": float(apart.max(initial=0.0)),
    }


def _rows(answers: Answers) -> NDArray[Any]:
    """Return the values with one row for each place."""
    values = answers.values
    return values.reshape(len(values), int(np.prod(values.shape[1:])))


def _compared_sets(first: Answers, second: Answers) -> dict[str, float]:
    """Return how far two sets of different sizes differ: each value from the nearest one of the other set."""
    one, other = (_rows(answers) for answers in (first, second))
    apart = np.full(1, np.inf)
    if len(one) and len(other):
        nearest = [cKDTree(a).query(b)[0] for a, b in ((one, other), (other, one))]
        apart = np.concatenate(nearest) / first.scale
    larger = max(len(one), len(other))
    return {
        "bits": 0.0,
        "unlike": 1.0 - min(len(one), len(other)) / larger,
        "p99": float(np.quantile(apart, 0.99, method="higher")),
        "largest": float(apart.max()),
    }


# -- Warp -----------------------------------------------------------------------------------------------


def _tree() -> Any:
    """Return a tree of several kinds of primitives and operators."""
    ball, bar = blobtree.Point((0, 0, 0), radius=1.0), blobtree.Segment((0, 0, 0), (2, 0, 0), radius=0.4)
    bent = blobtree.Twist(bar + blobtree.Point((2, 0.3, 0), radius=0.6), 30)
    return blobtree.Union((ball + bent, blobtree.Torus((0, 1.2, 0), (0, 1, 0), ring_radius=0.8, radius=0.2)))


def _places(seed: int) -> tuple[Float32Array, Float32Array]:
    """Return points near the tree, and directions."""
    rng = np.random.default_rng(seed)
    ways = rng.normal(size=(POINTS, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return rng.uniform(-2, 3, (POINTS, 3)).astype(np.float32), ways.astype(np.float32)


def _plain(values: Any, scale: float = 1.0) -> Answers:
    rows = np.ascontiguousarray(values)
    return Answers(np.zeros(len(rows), np.int32), rows, scale)


def _called(function: Callable[[Any, Float32Array], Any]) -> Case:
    """Return a case of a function of the tree and points, on Warp's default device."""

    def case(device: str, seed: int) -> Answers:
        start_warp()
        with wp.ScopedDevice(device):
            return _plain(function(_tree(), _places(seed)[0]))

    return case


def _rays(device: str, seed: int) -> Answers:
    _, ways = _places(seed)
    targets = np.random.default_rng(seed + 1).uniform(-0.5, 1.5, (POINTS, 3))
    hits = _tree().raycast((targets - 6.0 * ways).astype(np.float32), ways, device=device)
    distances = np.where(hits.hit, hits.distances, 0.0).astype(np.float32)
    return Answers(hits.hit.astype(np.int32), np.column_stack([distances, hits.normals, hits.colors]), 4.0)


def _mesh(device: str, seed: int) -> Answers:
    turned = _tree().rotate((1, 2, 3), 17 * seed)
    mesh = blobtree.polygonize(turned, resolution=64, device=device)
    return _plain(mesh.vertices, 4.0)


def _decals(seed: int) -> decals.Decals:
    """Return overlapping decals of many sizes on the unit sphere, in two layers."""
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(300, 3))
    centres /= np.linalg.norm(centres, axis=1, keepdims=True)
    tangents = np.cross(centres, rng.normal(size=(300, 3)))
    radii = rng.uniform(0.03, 0.3, 300)
    return decals.Decals(centres, centres, tangents, radii, layers=rng.integers(0, 2, 300))


def _evaluated(contact: str) -> Case:
    def case(device: str, seed: int) -> Answers:
        _, ways = _places(seed)
        image = decals.images.generate_image("scale", size=64)
        samples = decals.evaluate(_decals(seed), ways, ways, contact=contact, images=[image], device=device)
        return _seen(samples)

    return case


def _batched(device: str, seed: int) -> Answers:
    _, ways = _places(seed)
    sets = [_decals(4 * seed + number) for number in range(4)]
    return _seen(decals.evaluate_batch(sets, ways[:5000], ways[:5000], device=device))


def _seen(samples: Any) -> Answers:
    columns = [samples.uv, samples.field[:, None]]
    if samples.color is not None:
        columns.append(samples.color)
    return Answers(samples.owner, np.hstack(columns).astype(np.float32))


def _scattered(device: str, seed: int) -> Answers:
    found = decals.scatter(_tree(), count=300, seed=seed, device=device)
    return _plain(np.column_stack([found.positions, found.radii]), 4.0)


CASES: dict[str, Case] = {
    "blobtree.Node.__call__": _called(lambda tree, points: tree(points)),
    "blobtree.Node.gradient": _called(lambda tree, points: tree.gradient(points)),
    "blobtree.Node.colors": _called(lambda tree, points: tree.colors(points)),
    "blobtree.Node.raycast": _rays,
    "blobtree.polygonize": _mesh,
    "blobtree.to_sdf": _called(lambda tree, points: blobtree.to_sdf(tree, points[:2000]).values),
    "decals.evaluate, elastic": _evaluated("elastic"),
    "decals.evaluate, product": _evaluated("product"),
    "decals.evaluate, min": _evaluated("min"),
    "decals.evaluate, radial": _evaluated("radial"),
    "decals.evaluate_batch": _batched,
    "decals.scatter": _scattered,
}
"""Cases for Warp, by the names of the functions."""


# -- OpenGL ---------------------------------------------------------------------------------------------


def _scene(traced: bool, seed: int) -> decals.Scene:
    tree = blobtree.Point((0, 0, 0), radius=1.0)
    return decals.cover(tree if traced else blobtree.polygonize(tree, resolution=48), count=40, seed=seed)


def _drawn(traced: bool) -> DrawnCase:
    """Return a case: decals in a picture, and those that `evaluate` finds at the same points."""

    def case(backend: str, seed: int) -> tuple[Answers, Answers]:
        scene = _scene(traced, seed)
        with Context.standalone(backend=backend) as context, Renderer(context) as renderer:
            buffers = renderer.buffers(scene, RenderOptions(size=SIZE))
        seen = buffers.object_id >= 0
        points, normals = buffers.position[seen], buffers.normal[seen]
        found = decals.evaluate(scene.decals, points, normals, device="cpu")
        drawn = np.hstack([buffers.uv[seen], buffers.field[seen][:, None]])
        return _seen(found), Answers(buffers.owner[seen], drawn)

    return case


def _pixels(backend: str, seed: int) -> tuple[Answers, Answers]:
    """Return a picture by the fragment backend, and by another."""
    scene, pictures = _scene(True, seed), []
    for name in ("fragment", backend):
        with Context.standalone(backend=name) as context, Renderer(context) as renderer:
            pixels = renderer.render(scene, RenderOptions(size=SIZE))
        pictures.append(_plain(pixels.reshape(-1, 4), 255.0))
    return pictures[0], pictures[1]


DRAWN: dict[str, DrawnCase] = {
    "decals.render of a mesh, beside evaluate": _drawn(traced=False),
    "decals.render of a traced tree, beside evaluate": _drawn(traced=True),
    "decals.render, beside the fragment backend": _pixels,
}
"""Cases for OpenGL: pictures beside `evaluate`, and beside each other."""

experiment = devices


def backends(names: Sequence[Backend] = get_args(Backend)) -> list[Backend]:
    """Return the backends of this machine."""
    start_warp()
    return [name for name in names if name != "cuda" or wp.is_cuda_available()]


design = Grid(case=list(CASES), backend=backends(("cpu", "cuda"))) + Grid(
    case=list(DRAWN), backend=["fragment", "compute"]
)
full = design * Seeds(5)


def statements_table() -> str:
    """Return a table of all public functions in Markdown, by what decides their results."""
    rows = [
        f"| {EXPLAINED[kind]} | {', '.join(f'`{name}`' for name in sorted(names.split()))} |"
        for kind, names in BY_KIND.items()
    ]
    return "\n".join(["| Results | Functions |", "|---|---|", *rows])
