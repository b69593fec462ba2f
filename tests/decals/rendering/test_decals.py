"""The decal pass at every pixel: against float64 brute force, against Warp, and the colours that it makes."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from decals import Camera, Contact, Decals, ImageMapping, MeshObject, evaluate
from decals.errors import TooMuchData
from decals.field import Walks
from decals.index import DecalEditor
from decals.index.index import has_nested, index_on
from decals.rendering import Context, Renderer, RenderOptions
from decals.rendering import viewpoint as tile
from decals.rendering.decal_library import Form, decal_library
from decals.rendering.decal_pass import decal_programs
from decals.shaders import compose
from decals.surfaces import MeshSurface
from tests.decals.rendering.pictures import (
    SIZE,
    WHITE,
    compare,
    in_layers,
    plain_colors,
    quarters,
    scattered,
    view_of,
    wall,
)
from tests.decals.shapes import Picture, Shape, View, torus
from tests.oracles.decals import colors_at

CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)], np.float32)
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
CUBE = CORNERS, np.array([face for a, b, c, d in SIDES for face in ((a, b, c), (a, c, d))])


@pytest.mark.slow_cases("True")
@pytest.mark.parametrize("filtered", [False, True])
def test_without_nested_decals_their_code_is_left_out(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch, filtered: bool
) -> None:
    """That changes no bit of pictures and of samples. It changes pictures of nested decals.

    Filtered pictures change by a few levels, because that code divides more of the pixels at corners.
    """
    shape, options = torus(), RenderOptions(size=SIZE, samples=1, filtered=filtered)
    dense = scattered(shape, 500, 8, radii=(0.2, 0.22))
    kept: list[int] = []
    for row, place in enumerate(dense.positions):
        if (np.linalg.norm(dense.positions[kept] - place, axis=1) > 0.15).all():
            kept.append(row)
    assert len(kept) > 100
    nested = Decals.concatenate([dense[kept], dense[kept[:40]].replace(radii=np.full(40, 0.05))])
    shifted = dense.positions[kept[:40]] + [0.0, 0.0, 0.02]
    stacked = Decals.concatenate([dense[kept], dense[kept[:40]].replace(positions=shifted)])
    for decals, same in ((dense[kept], True), (nested, False), (stacked, False)):
        view = replace(view_of(decals, shape), images=(Picture(quarters()),))
        first, buffers = renderer.render(view, options), renderer.buffers(view, options)
        seen = buffers.owner >= 0
        points = decals, buffers.position[seen], buffers.normal[seen]
        uv = evaluate(*points).uv
        with monkeypatch.context() as patch:
            patch.setattr("decals.index.editor.has_nested", lambda *_, value=same: value)
            patch.setattr("decals.field.evaluate.index_on", index_without_nested)
            other = renderer.render(replace(view, decals=decals[:]), options)
            change = np.abs(other.astype(int) - first).max()
            assert (change <= (8 if filtered else 0)) == same
            assert (evaluate(*points).uv == uv).all() == same
        assert has_nested(index_on(decals, "cpu"), len(decals)) != same


def index_without_nested(*arguments: Any) -> Any:
    index = index_on(*arguments)
    index.nested = False
    return index


@pytest.mark.slow_cases("800-radii2-0", "800-radii2-1")
@pytest.mark.parametrize("mapping", [ImageMapping.CHORD, ImageMapping.CORRECTED])
@pytest.mark.parametrize(("count", "radii"), [(1, (0.5, 0.6)), (40, (0.2, 0.6)), (800, (0.004, 0.4))])
def test_every_pixel_is_the_oracles(
    renderer: Renderer, mapping: ImageMapping, count: int, radii: tuple[float, float]
) -> None:
    shapes = torus(), torus(0.8, 0.3, shift=(0.7, 0, 0.5))
    decals = Decals.concatenate([scattered(shape, count, 7, radii=radii) for shape in shapes])
    view = view_of(decals, *shapes)
    owned = compare(view, renderer.buffers(view, RenderOptions(size=SIZE, mapping=mapping)), mapping)
    assert owned.any()
    assert count > 1 or not owned.all()


@pytest.mark.parametrize("layered", [False, True])
def test_every_pixel_of_walked_images(renderer: Renderer, layered: bool) -> None:
    """On a cube, where many walks cross edges; before and after an edit, as `evaluate` has it."""
    cube = MeshSurface(*CUBE)
    centres, normals = cube.sample(12, 3)
    decals = Decals(centres, normals, np.roll(normals, 1, axis=1), np.linspace(0.4, 0.9, 12))
    editor = DecalEditor(in_layers(decals, 8) if layered else decals)
    objects: Any = {"objects": (MeshObject("cube", *CUBE),), "decals": editor}
    view = replace(view_of(decals, torus()), **objects)
    for moved in (False, True):
        if moved:
            editor.assign([3, 5], editor.take([5, 3]))
        buffers = renderer.buffers(view, RenderOptions(size=SIZE, mapping=ImageMapping.WALKED))
        seen = buffers.owner >= 0
        assert seen.mean() > 0.1
        walks = Walks.over(editor, [cube])
        points = buffers.position[seen], buffers.normal[seen]
        samples = evaluate(editor, *points, mapping="walked", walks=walks, device="cpu")
        same = samples.owner == buffers.owner[seen]
        assert same.mean() > 0.99
        errors = np.abs(samples.uv - buffers.uv[seen])[same].max(axis=1)
        assert np.quantile(errors, 0.995) < 1e-3  # the rest lies on cuts, where two walks are equally long
        assert (errors > 0.02).mean() < 0.003
        plain = evaluate(editor, *points, device="cpu")
        assert (np.abs(plain.uv - buffers.uv[seen])[same].max(axis=1) > 0.02).mean() > 0.1


@pytest.mark.slow
def test_no_scene_needs_more_textures_than_every_driver_has(context: Context) -> None:
    form = Form(Contact.ELASTIC, *(True,) * 6)
    names = {name for program in decal_programs(context, form, posed=True) for name in program}
    slots = {"decals": "//@ include decals.glsl", "functions": decal_library(form)}
    slots |= {"relief": "//@ include relief.glsl"}
    text = compose("decal_pass.glsl", slots=slots, version=None).text
    samplers = names & set(re.findall(r"uniform i?sampler\w+ (\w+);", text))
    assert {"decal_walks", "decal_materials", "object_masks"} < samplers
    assert len(samplers) <= 16


@pytest.mark.parametrize("contact", list(Contact))
@pytest.mark.parametrize("layered", [False, True])
def test_every_pixel_of_every_contact_mode(renderer: Renderer, contact: Contact, layered: bool) -> None:
    shape = torus()
    decals = scattered(shape, 90, 8, radii=(0.05, 0.4))
    view = view_of(in_layers(decals, 8) if layered else decals, shape)
    buffers = renderer.buffers(view, RenderOptions(size=SIZE, contact=contact))
    assert compare(view, buffers, ImageMapping.CORRECTED, contact).any()


def test_pictures_have_the_stiffness_of_their_options(renderer: Renderer) -> None:
    shape = torus()
    view = view_of(scattered(shape, 90, 8, radii=(0.05, 0.4)), shape)
    for stiffness in (1.0, 6.0):
        modes: dict[str, Any] = {"contact": Contact.ELASTIC, "stiffness": stiffness}
        buffers = renderer.buffers(view, RenderOptions(size=SIZE, **modes))
        seen = buffers.owner >= 0
        samples = evaluate(view.decals, buffers.position[seen], buffers.normal[seen], **modes)
        same = samples.owner == buffers.owner[seen]
        assert same.mean() > 0.99
        assert np.abs(samples.field - buffers.field[seen])[same].max() < 1e-4


@pytest.mark.parametrize("scenes", [18, pytest.param(200, marks=pytest.mark.slow)])
def test_every_pixel_of_random_scenes(renderer: Renderer, scenes: int) -> None:
    """Sizes over three decades, any interaction, layer, contact and mapping, on one torus."""
    shape = torus()
    for seed in range(scenes):
        rng = np.random.default_rng(seed)
        contact, mapping = list(Contact)[seed % 4], list(ImageMapping)[seed // 4 % 2]
        radii = (0.001, 1.0) if seed % 4 == 0 else (0.05, 0.5)
        decals = scattered(shape, int(rng.integers(1, 70)), seed, radii=radii)
        view = view_of(in_layers(decals, seed) if seed % 2 else decals, shape)
        buffers = renderer.buffers(view, RenderOptions(size=(48, 36), mapping=mapping, contact=contact))
        compare(view, buffers, mapping, contact)


@pytest.mark.slow
def test_no_pixel_flickers_on_an_orbit(renderer: Renderer) -> None:
    """The topmost decal at every point seen from 360 sides is the oracle's, which knows of no camera."""
    shape = torus()
    view = view_of(in_layers(scattered(shape, 60, 10, radii=(0.1, 0.5)), 10), shape)
    for degrees in range(360):
        angle = np.radians(degrees)
        direction = (float(np.cos(angle)), float(np.sin(angle)), 0.8)
        camera = Camera.fitting(shape.vertices, direction=direction, up=(0, 0, 1))
        turned = View((shape,), camera, view.decals, view.images)
        compare(view, renderer.buffers(turned, RenderOptions(size=(48, 36))), ImageMapping.CORRECTED)


@pytest.mark.ordinary_cases("45", "225")
@pytest.mark.parametrize("turn", range(0, 360, 45))
def test_what_lies_over_what_is_the_same_from_every_side(renderer: Renderer, turn: int) -> None:
    """The topmost decal at points seen by two cameras."""
    shape = torus()
    decals = in_layers(scattered(shape, 300, 9, radii=(0.1, 0.4)), 9)
    view = view_of(decals, shape)
    angle = np.radians(turn)
    direction = (float(np.cos(angle)), float(np.sin(angle)), 0.8)
    camera = Camera.fitting(shape.vertices, direction=direction, up=(0, 0, 1))
    buffers = renderer.buffers(View((shape,), camera, decals, view.images), RenderOptions(size=SIZE))
    compare(view, buffers, ImageMapping.CORRECTED)


@pytest.mark.slow_cases("3-70")
@pytest.mark.parametrize(("contact", "count"), [(Contact.PRODUCT, 300), (Contact.ELASTIC, 70)])
def test_many_decals_on_one_point(renderer: Renderer, contact: Contact, count: int) -> None:
    """In elastic contact the oracle compares each decal with each: its time grows with the square."""
    shape = torus()
    decals = scattered(shape, count, 3, radii=(0.1, 0.5)).replace(positions=np.full((count, 3), [0, -1.4, 0]))
    view = view_of(decals, shape)
    buffers = renderer.buffers(view, RenderOptions(size=SIZE, contact=contact))
    assert compare(view, buffers, ImageMapping.CORRECTED, contact).any()


def test_graphics_and_warp_agree_bit_for_nearly_bit(renderer: Renderer) -> None:
    shape = torus()
    view = view_of(scattered(shape, 300, 5, radii=(0.05, 0.3)), shape)
    buffers = renderer.buffers(view, RenderOptions(size=SIZE))
    seen = buffers.object_id == 0
    samples = evaluate(view.decals, buffers.position[seen], buffers.normal[seen], device="cpu")
    same = buffers.owner[seen] == samples.owner
    assert same.mean() > 0.999
    np.testing.assert_allclose(buffers.field[seen][same], samples.field[same], atol=1e-4)
    assert np.quantile(np.abs(buffers.uv[seen] - samples.uv)[same], 0.999) < 1e-4


def test_tiles_change_nothing(context: Context, renderer: Renderer) -> None:
    shape = torus()
    view = view_of(scattered(shape, 100, 5, radii=(0.05, 0.3)), shape)
    whole = renderer.render(view, RenderOptions(size=SIZE, samples=3))
    with Renderer(context, max_tile=50) as tiled:
        parts = tiled.render(view, RenderOptions(size=SIZE, samples=3))
    assert (np.abs(parts.astype(int) - whole).max(axis=-1) > 2).mean() < 0.01


@pytest.mark.parametrize("margin", [0, 7])
def test_tiles_fit_together(
    context: Context, renderer: Renderer, monkeypatch: pytest.MonkeyPatch, margin: int
) -> None:
    shape = torus()
    view = view_of(scattered(shape, 100, 5, radii=(0.05, 0.3)), shape)
    whole = renderer.buffers(view, RenderOptions(size=SIZE))
    monkeypatch.setattr(tile, "TILE_MARGIN", margin)
    with Renderer(context, max_tile=17) as tiled:
        parts = tiled.buffers(view, RenderOptions(size=SIZE))
    seen = (whole.object_id == 0) & (parts.object_id == 0)
    assert seen.sum() > 0.98 * (whole.object_id == 0).sum()
    assert (parts.owner == whole.owner).mean() > 0.99
    assert np.quantile(np.abs(parts.position - whole.position)[seen], 0.99) < 1e-3


# -- colours --------------------------------------------------------------------------------------------


def test_an_image_stands_upright(renderer: Renderer) -> None:
    picture = renderer.render(wall(quarters(), color=(1, 1, 1)), RenderOptions(size=(64, 64), samples=1))
    upper_left, upper_right, lower_left, lower_right = (
        picture[y, x, :3].astype(int) for y, x in [(24, 24), (24, 40), (40, 24), (40, 40)]
    )
    assert upper_left[0] > 2 * max(upper_left[1:])
    assert upper_right[1] > 2 * max(upper_right[[0, 2]])
    assert lower_left[2] > 2 * max(lower_left[:2])
    assert lower_right.min() > 150  # the white wall shows through
    corner = picture[1, 1, :3].astype(int)
    assert corner.min() > 150  # outside the rim too


def test_uv_of_a_flat_decal_by_hand(renderer: Renderer) -> None:
    buffers = renderer.buffers(wall(quarters()), RenderOptions(size=(64, 64)))
    x, y = np.meshgrid((np.arange(64) + 0.5) / 64, 1 - (np.arange(64) + 0.5) / 64)
    inside = np.hypot(x - 0.5, y - 0.5) < 0.499
    np.testing.assert_array_equal(buffers.owner == 0, np.hypot(x - 0.5, y - 0.5) < 0.5)
    np.testing.assert_allclose(buffers.uv[inside], np.stack([x, y], -1)[inside], atol=1e-5)


@pytest.mark.parametrize("pixels", [21, 37])
def test_a_fine_pattern_averages_to_grey(renderer: Renderer, pixels: int) -> None:
    """Black and white squares far smaller than a pixel: linear light makes them 188, not 128."""
    board = np.zeros((512, 512, 4), np.uint8)
    board[..., 3] = 255
    board[(np.indices((512, 512)).sum(axis=0) % 2).astype(bool), :3] = 255
    grey = np.full((4, 4, 4), 255, np.uint8)
    grey[..., :3] = 188
    inside = np.s_[pixels // 4 : -pixels // 4, pixels // 4 : -pixels // 4, :3]
    fine = renderer.render(wall(board), RenderOptions(size=(pixels, pixels), samples=1))[inside]
    flat = renderer.render(wall(grey), RenderOptions(size=(pixels, pixels), samples=1))[inside]
    np.testing.assert_allclose(fine.astype(int), flat, atol=3)


@pytest.mark.parametrize(("block", "spread"), [(2, (0, 8)), (8, (60, 128))])
def test_images_are_read_at_the_size_of_a_pixel(
    renderer: Renderer, block: int, spread: tuple[float, float]
) -> None:
    """Squares of half a pixel a side leave nothing; those of two pixels a side stay black and white."""
    board = np.zeros((256, 256, 4), np.uint8)
    board[..., 3] = 255
    board[((np.indices((256, 256)) // block).sum(axis=0) % 2).astype(bool), :3] = 255
    seen = renderer.render(wall(board), RenderOptions(size=(61, 61), samples=1))[16:45, 16:45, 0].astype(
        float
    )
    print(block, seen.std())
    assert spread[0] <= seen.std() <= spread[1]


def test_an_opaque_decal_looks_like_an_object_of_its_colour(renderer: Renderer) -> None:
    image = np.full((4, 4, 4), 255, np.uint8)
    image[..., :3] = 200, 90, 40
    covered = renderer.render(wall(image), RenderOptions(size=(32, 32)))
    painted = wall(image, color=(200 / 255, 90 / 255, 40 / 255))
    plain = renderer.render(View(painted.objects, painted.camera), RenderOptions(size=(32, 32)))
    np.testing.assert_allclose(covered[12:20, 12:20].astype(int), plain[12:20, 12:20], atol=1)


def test_light_is_kept_out_of_corners(renderer: Renderer) -> None:
    """A wall is darker next to another that stands on it than far from it."""
    corners = [
        [-2, -2, 0],
        [2, -2, 0],
        [2, 2, 0],
        [-2, 2, 0],
        [0.5, -2, 0],
        [0.5, 2, 0],
        [0.5, 2, 2],
        [0.5, -2, 2],
    ]
    faces = [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]]
    floor = Shape(np.array(corners[:4], np.float32), np.array(faces[:2], np.int32))
    step = Shape(np.array(corners, np.float32), np.array(faces[2:], np.int32))
    camera = Camera((-3, 0, 9), (0, 0, 0), fov=20)
    alone, beside = (
        renderer.render(View(shapes, camera), RenderOptions(size=(60, 40)))[20, :, :3]
        .astype(float)
        .mean(axis=1)
        for shapes in ((floor,), (floor, step))
    )
    foot = np.argmax(
        renderer.buffers(View((floor, step), camera), RenderOptions(size=(60, 40))).object_id[20] == 1
    )
    np.testing.assert_array_equal(beside[: foot - 6], alone[: foot - 6])
    assert beside[foot - 1] < 0.96 * alone[foot - 1]
    assert (np.diff(beside[foot - 5 : foot]) <= 0).all()


def test_transparent_images_leave_the_object(renderer: Renderer) -> None:
    view = wall(np.zeros((8, 8, 4), np.uint8))
    bare = View(view.objects, view.camera)
    np.testing.assert_array_equal(
        renderer.render(view, RenderOptions(size=(32, 32))),
        renderer.render(bare, RenderOptions(size=(32, 32))),
    )


# -- stacks --------------------------------------------------------------------------------------------


CENTRE = (0, -1.4, 0)


@pytest.mark.parametrize("contact", list(Contact))
@pytest.mark.parametrize("order", ["falling", "rising", "shuffled"])
@pytest.mark.parametrize("count", [64, pytest.param(200, marks=pytest.mark.slow)])
def test_stacks(renderer: Renderer, count: int, order: str, contact: Contact) -> None:
    """Radial contact shows the smallest over the others; the other modes one of highest field."""
    rng = np.random.default_rng(count)
    radii = np.geomspace(0.6, 0.06, count)
    radii = {"falling": radii, "rising": radii[::-1], "shuffled": rng.permutation(radii)}[order]
    arrays: dict[str, Any] = {
        "positions": np.tile(CENTRE, (count, 1)),
        "normals": np.tile([0, -1, 0], (count, 1)),
        "tangents": rng.normal(size=(count, 3)),
        "radii": radii,
    }
    shape = torus()
    camera = Camera.fitting(shape.vertices, direction=(0, -1, 0.2), up=(0, 0, 1))
    view = View((shape,), camera, Decals(**arrays), (WHITE,))
    owned = compare(
        view,
        renderer.buffers(view, RenderOptions(size=(32, 24), contact=contact)),
        ImageMapping.CORRECTED,
        contact,
    )
    assert owned.sum() > 60


@pytest.mark.slow_cases("1000")
@pytest.mark.parametrize("count", [64, 500, 1000, 3000, 6000])
def test_deep_stacks_in_layers_are_whole_or_refused(renderer: Renderer, count: int) -> None:
    """Translucent plain decals over each other: all of them in the colour, or a clear error."""
    rng = np.random.default_rng(count)
    view = wall(quarters(), color=(0, 0, 0))
    arrays: dict[str, Any] = {
        "positions": np.zeros((count, 3)),
        "normals": [[0, 0, 1]] * count,
        "tangents": [[1, 0, 0]] * count,
        "radii": rng.choice([2.0, 4.5], count),
        "interactions": rng.integers(0, 2, count) * 2,
        "layers": rng.integers(-9, 9, count),
        "images": np.full(count, -1),
        "tints": rng.random((count, 3)),
        "opacities": np.full(count, 3 / count),
    }
    decals = Decals(**arrays)
    try:
        seen = renderer.render(
            View(view.objects, view.camera, decals), RenderOptions(size=(16, 12), samples=1)
        )
    except TooMuchData:
        assert count > 1500
        return
    points, normals = np.zeros((1, 3)), np.array([[0, 0, 1.0]])
    color = colors_at(decals, points, normals, lambda i, uv: plain_colors(decals, i))[0]
    srgb = 1.055 * color[:3] ** (1 / 2.4) - 0.055
    painted = wall(quarters(), color=tuple(srgb.tolist()))
    plain = renderer.render(View(painted.objects, painted.camera), RenderOptions(size=(16, 12), samples=1))
    np.testing.assert_allclose(seen.astype(int), plain, atol=1)
