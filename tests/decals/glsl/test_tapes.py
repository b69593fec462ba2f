"""Whole tapes in Warp and GLSL, and pictures of them."""

from itertools import cycle

import numpy as np
import pytest

from blobtree import (
    Box,
    EndlessRepeat,
    GradientBlend,
    Node,
    Point,
    Polyline,
    Segment,
    SolidContact,
    Superquadric,
    from_sdf,
)
from blobtree.nodes import blends as blend_kinds
from blobtree.nodes import rounds
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.tape.instruction_set import library
from blobtree.tape.model import colors_at, gradients_at
from blobtree.tracing.trace import trace
from decals import Camera
from decals.rendering import Context, Renderer, RenderOptions
from decals.rendering.tracing_shader import Kinds, tracing_shader
from tests.blobtree.custom_kinds import CUSTOM_TREES, EVERYTHING, Brick, Carve, Path, Ring, Soft
from tests.blobtree.nodes.test_deformations import STRONG
from tests.blobtree.nodes.test_gradient_blends import CORE as GRADIENT_BLENDS
from tests.blobtree.nodes.test_gradient_blends import LIBRARY as LIBRARY_GRADIENT_BLENDS
from tests.blobtree.tape.evaluations import bounds_along, bounds_at
from tests.blobtree.trees import (
    BLENDED,
    CONTACTS,
    FIELDS,
    PROFILED,
    SHAPES,
    SIGNED,
    SOLIDS,
    MoreKinds,
    points_around,
    random_trees,
)
from tests.conformance import sample
from tests.decals.glsl.arguments import Array, units
from tests.decals.glsl.functions import ALL_KINDS, run_program
from tests.decals.glsl.tapes import (
    BOUND_AND_VALUE,
    COLOR,
    GRADIENT,
    MAIN,
    TAPE_AGREEMENT,
    Model,
    assert_close,
    padded,
)
from tests.decals.shapes import View
from tests.oracles import blends
from tests.oracles import blobtree as oracle
from tests.oracles.pixels import middle_rays

TREES = random_trees(seed=31, count=24) + random_trees(seed=33, count=12, more=SOLIDS)
VOLUME = from_sdf(lambda p: np.linalg.norm(p, axis=1) - 0.8, (-1, -1, -1), (1, 1, 1), spacing=0.2, width=0.4)
FIELD_TREES = [
    *random_trees(seed=35, count=5, more=FIELDS),
    VOLUME.rotate((1, 2, 3), 30) + Point((0.8, 0, 0), radius=0.4),
]
CONTACT_TREES = random_trees(seed=36, count=6, depth=2, more=CONTACTS)
NEGATIVE = Point((0, 0, 0), radius=1.0) + Polyline(
    ((-1, 0, 0), (0, 1, 0), (1, 0, 0)), radius=0.4, weight=-0.5
)
BALLS = cycle([Point((0.8 * x, 0.1 * x, 0.0), radius=0.7) for x in range(3)])
BLEND_NODES = [
    sample(kind, np.random.default_rng(38), lambda _: next(BALLS))
    for kind in NODE_KINDS.values()
    if kind.__module__ in (blend_kinds.__name__, rounds.__name__) and kind is not GradientBlend
]
BLEND_TREES = [*BLEND_NODES, NEGATIVE, *random_trees(seed=37, count=4, depth=2, more=BLENDED)]
LIBRARY_TREES = random_trees(seed=34, count=10, more=SHAPES)


def read_tape(
    context: Context,
    tree: Node,
    reading: int,
    points: Array,
    heading: tuple[float, ...] = (0.0, 0.0, 0.0),
    kinds: Kinds = ALL_KINDS,
) -> Array:
    """What the tracing shader's own functions give for `tree`, in place of a picture."""
    shader, _, _ = tracing_shader(kinds).text.partition("void main()")
    textures = {"tape": tree.tape.data, "points": padded(points)}
    uniforms = {"reading": reading, "part": (tree.tape.start, len(tree.tape.data)), "heading": heading}
    return run_program(context, shader + MAIN, len(points), textures, uniforms)


def test_the_trees_use_everything_that_a_tape_can_hold() -> None:
    assert {code for tree in TREES for code in tree.tape.skeletons} == set(ALL_KINDS.skeletons)
    drawn = {code for tree in (*TREES, *LIBRARY_TREES) for code in tree.tape.skeletons}
    assert drawn == set(range(len(library().skeletons)))
    assert {code for tree in TREES for code in tree.tape.operators} == set(ALL_KINDS.operators)
    assert 2 <= max(tree.tape.registers for tree in TREES) <= ALL_KINDS.registers
    assert sum(tree.tape.stretched for tree in TREES) > 5


@pytest.mark.ordinary_cases("0")
@pytest.mark.parametrize("start", range(0, len(TREES), 6))
def test_whole_tapes_are_the_same_in_both_languages(context: Context, start: int) -> None:
    assert_same_in_both_languages(context, TREES[start : start + 6], ALL_KINDS, start)


@pytest.mark.slow
def test_direct_fields_are_the_same_in_both_languages(context: Context) -> None:
    kinds = kinds_of(FIELD_TREES)
    others = [field.name for code, field in enumerate(library().fields) if code not in kinds.fields]
    assert all(name.startswith("sharp_") for name in others)  # those are in test_conformance
    # Bounds of arcs depend on where the kernel ends, a square root of a difference that is near 0.
    assert_same_in_both_languages(context, FIELD_TREES, kinds, bounds_agreement=1e-4)


@pytest.mark.slow
def test_library_skeletons_are_the_same_in_both_languages(context: Context) -> None:
    assert_same_in_both_languages(context, LIBRARY_TREES, kinds_of(LIBRARY_TREES))


def test_contacts_are_the_same_in_both_languages(context: Context) -> None:
    names = {library().operators[code].name for tree in CONTACT_TREES for code in tree.tape.operators}
    assert {"press", "rated_union"} <= names
    assert_same_in_both_languages(context, CONTACT_TREES, kinds_of(CONTACT_TREES))


@pytest.mark.slow
def test_blends_are_the_same_in_both_languages(context: Context) -> None:
    used = {library().operators[code].name for tree in BLEND_TREES for code in tree.tape.operators}
    assert set(blends.VALUES) - {"gradient_blend"} <= used
    assert_same_in_both_languages(context, BLEND_TREES, kinds_of(BLEND_TREES))


def test_deformations_are_the_same_in_both_languages(context: Context) -> None:
    trees = [*STRONG.values(), EndlessRepeat(Segment((0, 0, 0), (0.2, 0.3, 0), radius=0.3), (0.9, 0, 0.2))]
    kinds = kinds_of(trees)
    assert kinds.warps == tuple(range(1, len(kinds.instruction_set.warps)))
    assert_same_in_both_languages(context, trees, kinds)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["nested", "scaled and turned", "warped", "a profile and a field"])
def test_gradient_blends_are_the_same_in_both_languages(context: Context, name: str) -> None:
    tree = (GRADIENT_BLENDS | LIBRARY_GRADIENT_BLENDS)[name]
    # Second derivatives, and bounds that divide by short gradients, magnify rounding.
    kinds = Kinds.of(tree.tape)
    assert_same_in_both_languages(context, [tree], kinds, 0, bounds_agreement=1e-3, field_agreement=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("more", [PROFILED, SIGNED], ids=["profiled", "signed"])
def test_other_falloffs_are_the_same_in_both_languages(context: Context, more: MoreKinds) -> None:
    trees = random_trees(seed=35, count=6, more=more)
    kinds = kinds_of(trees)
    assert kinds.falloffs == tuple(range(len(library().falloffs)))
    assert_same_in_both_languages(context, trees, kinds)


@pytest.mark.slow
def test_own_kinds_are_the_same_in_both_languages(context: Context) -> None:
    instruction_set = EVERYTHING.tape.instruction_set
    all_kinds = Kinds(
        tuple(range(len(instruction_set.skeletons))),
        tuple(range(len(instruction_set.operators))),
        6,
        stretched=True,
        warps=(0,),
        warp_registers=4,
        instruction_set=instruction_set,
    )
    trees = [tree for tree in CUSTOM_TREES if tree.tape.instruction_set is instruction_set]
    assert_same_in_both_languages(context, trees[:20], all_kinds, 6)


def kinds_of(trees: list[Node]) -> Kinds:
    """What the trees use, in one program: a driver compiles one for the whole library in half a minute."""
    used = [Kinds.of(tree.tape) for tree in trees]

    def codes(name: str) -> tuple[int, ...]:
        return tuple(sorted({code for kinds in used for code in getattr(kinds, name)}))

    return Kinds(
        codes("skeletons"),
        codes("operators"),
        max(kinds.registers for kinds in used),
        any(kinds.stretched for kinds in used),
        codes("warps"),
        max(kinds.warp_registers for kinds in used),
        codes("fields"),
        max((kinds.instruction_set for kinds in used), key=lambda rows: len(rows.rows)),
        codes("falloffs"),
    )


def assert_same_in_both_languages(
    context: Context,
    trees: list[Node],
    kinds: Kinds,
    seed: int = 0,
    bounds_agreement: float = TAPE_AGREEMENT,
    field_agreement: float = TAPE_AGREEMENT,
) -> None:
    rng = np.random.default_rng(seed)
    compared = 0
    for tree in trees:
        points = points_around(rng, tree, 500)
        reach = (10.0 ** rng.uniform(-3.0, 0.5, 500)).astype(np.float32)
        seen = read_tape(context, tree, BOUND_AND_VALUE, np.column_stack([points, reach]), kinds=kinds)
        assert_close(seen[:, :2], bounds_at(tree.tape, points, reach), bounds_agreement)
        heading = units(rng, 4)[3]
        seen = read_tape(
            context, tree, BOUND_AND_VALUE, np.column_stack([points, reach]), tuple(heading.tolist()), kinds
        )
        field = oracle.evaluate(tree, points)
        smooth = field.margin > 1e-5  # on a tie of two operands, rounding may choose either bound
        expected = bounds_along(tree.tape, points, np.tile(heading, (500, 1)), reach)
        assert_close(seen[smooth, :3], expected[smooth], bounds_agreement)
        assert_close(
            read_tape(context, tree, GRADIENT, points, kinds=kinds)[smooth],
            gradients_at(tree.tape, points)[smooth],
            field_agreement,
        )
        strong = smooth & (field.value > 1e-3)
        seen = read_tape(context, tree, COLOR, points, kinds=kinds)[:, 1:]
        assert_close(seen[strong], colors_at(tree.tape, points)[strong], field_agreement)
        compared += int(strong.sum())
    assert compared > 0.25 * min(len(trees), 6) * 500


BAR = Box((0, 0, 0), (0.5, 0.3, 3), radius=0.2)
RING = Ring((0, 0, 0), (0.2, 0, 1), 0.8, radius=0.25, color=(0.9, 0.3, 0.1))
MODELS = {
    "one ring": RING,
    "a brick, stretched": Brick((0, 0, 0), (1, 1, 0.4), radius=0.2).scale((1, 0.6, 1.5)),
    "a ring in a soft blend, carved by a path": Carve(
        (
            Soft((RING, Point((0.8, 0, 0), radius=0.5)), 2.0),
            Path((-2, -0.8, 0), (0, -0.8, 0), (0, -0.8, 2), radius=0.2),
        )
    ),
    "a volume": VOLUME + Point((0.8, 0, 0), radius=0.4),
    "a superquadric": Superquadric((0, 0, 0), (1, 0.6, 0.8), 0.4, 0.6).rotate((1, 2, 3), 30)
    + Point((1, 0, 0), radius=0.5),
    "one point": Point((0, 0, 0), radius=1.0),
    "balls in a box": (Point((-0.6, 0, 0), radius=1.0) | Point((0.6, 0, 0), radius=1.0))
    & Box((0, 0, 0), (2, 1, 1), radius=0.1),
    "one segment": Segment((0, 0, 0), (1, 1, 0), radius=0.4),
    "a tiny model": (Point((0, 0, 0), radius=1.0) - Point((0.5, 0, 1), radius=0.7)).scale(1e-4),
    "a twist in a twist": Segment((0.3, 0, -0.5), (0.3, 0, 0.5), radius=0.3)
    .twist(400)
    .rotate((1, 0, 0), 90)
    .twist(400),
    "a bent horn": BAR.taper(0.4, (-1, 1)).bend(20, (-1, 1)),
    "a twisted and sheared bar": BAR.twist(60, limits=(-1, 1)).stretch(1.2, (0, 1)).shear(0.3, 0.3, (-1, 1)),
    "a bar under noise": BAR.noise_warp(0.1, 1.0),
    "a bar along a curve": BAR.curve_warp([(0, 0, 0)], [(0.1, 0.2, 0)], reach=1.0),
    "random trees side by side": random_trees(seed=5, count=1)[0]
    | random_trees(seed=6, count=1)[0].translate((2, 0, 0)),
}


@pytest.mark.slow_cases("a twist in a twist", "a volume", "random trees side by side")
@pytest.mark.parametrize("name", MODELS)
def test_a_traced_picture_is_what_warp_traces(renderer: Renderer, name: str) -> None:
    assert_traced_alike(renderer, MODELS[name])


def assert_traced_alike(renderer: Renderer, tree: Node) -> None:
    width, height = 160, 120
    camera = Camera.framing(tree.support, direction=(0.3, 0.5, 1.0), aspect=width / height)
    buffers = renderer.buffers(View((Model(tree),), camera), RenderOptions(size=(width, height)))
    origin, directions = middle_rays(camera, (width, height))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    distance = trace(tree, np.tile(origin, (len(directions), 1)), directions)
    expected = np.isfinite(distance)
    seen = buffers.object_id.ravel() == 0
    assert expected.sum() > 500
    assert (seen != expected).sum() <= 1e-3 * expected.size
    both = seen & expected
    depth = np.linalg.norm(buffers.position.reshape(-1, 3)[both] - origin, axis=1)
    size = float(np.linalg.norm(tree.support[1] - tree.support[0]))
    assert (np.abs(depth - distance[both]) > 1e-4 * size).mean() <= 2e-3
    points = buffers.position.reshape(-1, 3)[both]
    smooth = oracle.evaluate(tree, points).margin > 2e-3  # a hit may lie a tolerance beside its block
    gradient = tree.gradient(points[smooth])
    normal = -gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
    np.testing.assert_allclose(buffers.normal.reshape(-1, 3)[both][smooth], normal, atol=1e-4)


@pytest.mark.slow
def test_rays_that_graze_bulges_show_the_surface_that_they_hit(renderer: Renderer) -> None:
    """They take some 2,000 evaluations of the tape. Mesa ends all loops of a pixel after 65,535 turns."""
    balls = [Point(centre, radius=size) for centre, size in (((-0.7, 0, 0), 1.0), ((0.9, 0, 0), 1.0))]
    tree = SolidContact(
        (*balls, Point((0.1, 1.5, 0), radius=0.8)), stiffness=(1, 0.1, 1), width=0.4, height=0.06
    )
    camera = Camera((0.1, 0.9, 11.0), target=(-0.567, 1.051, 0.0), up=(0, 1, 0), fov=0.032)
    seen = renderer.buffers(View((Model(tree),), camera), RenderOptions((24, 16)))
    rays = camera.rays(24, 16)
    column, row = np.meshgrid(np.arange(24) + 0.5, np.arange(16)[::-1] + 0.5)
    hits = tree.raycast(rays.origins(column, row).reshape(-1, 3), rays.directions(column, row).reshape(-1, 3))
    both = (seen.object_id.ravel() >= 0) & hits.hit
    assert 100 < both.sum() < len(both)
    cosines = (seen.normal.reshape(-1, 3) * hits.normals).sum(axis=1)
    assert cosines[both].min() > 0.99
