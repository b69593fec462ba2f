"""Custom decal fields and contact laws: checks, float64, and all backends."""

# mypy: disable-error-code="no-any-return"
# (the type of Warp's functions is Any)

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp

import decals
from blobtree.errors import InvalidDefinition
from decals import define_contact, evaluate
from decals.field.rules import LAWS
from decals.rendering import Drawing, Renderer, RenderOptions
from decals.rendering.pixel_pass import BACKEND_VARIABLE

RIM = np.sqrt(1 - 0.5 ** (1 / 3))


@wp.func
def cosine_bump(d: wp.float32) -> wp.float32:
    return 0.5 + 0.5 * wp.cos(3.14159265 * d)


@wp.func
def gentle_push(own: wp.float32, other: wp.float32) -> wp.float32:
    u = (own + other - 1.0) / (2.0 * own - 1.0)
    return 1.0 - wp.pow(u, 2.0 / wp.max(1.0 - own, 1.0e-6))


@wp.func
def with_ring(d: wp.float32) -> wp.float32:
    return (1.0 - d) * (1.0 + 2.0 * wp.sin(9.0 * d) * wp.sin(9.0 * d))


@wp.func
def from_half(d: wp.float32) -> wp.float32:
    return 0.5 * (1.0 - d)


@wp.func
def never_zero(d: wp.float32) -> wp.float32:
    return wp.exp(-4.0 * d * d)


@wp.func
def plateau(d: wp.float32) -> wp.float32:
    return wp.min(2.0 * (1.0 - d), 1.0)


@wp.func
def jumping(d: wp.float32) -> wp.float32:
    return wp.where(d <= 0.5, 1.0 - 0.5 * d, 0.0)


@wp.func
def root(d: wp.float32) -> wp.float32:
    return wp.sqrt(0.5 - d)


@wp.func
def short(d: wp.float32) -> wp.float32:
    return wp.max(wp.min(1.0 - d, 3.0 - 5.0 * d), 0.0)


@wp.func
def two_distances(d: wp.float32, e: wp.float32) -> wp.float32:
    return d + e


@wp.func
def too_weak(own: wp.float32, other: wp.float32) -> wp.float32:
    return 1.0 - 0.5 * (own + other - 1.0) / (2.0 * own - 1.0)


@wp.func
def too_wide(own: wp.float32, other: wp.float32) -> wp.float32:
    return 1.0 - (own + other - 1.0) / (2.0 * own - 1.0)


@wp.func
def outside(own: wp.float32, other: wp.float32) -> wp.float32:
    u = (own + other - 1.0) / (2.0 * own - 1.0)
    return 1.0 - 4.0 * u * (1.0 - u) - u


def disks() -> decals.Decals:
    rng = np.random.default_rng(4)
    positions = rng.uniform(-1.6, 1.6, (14, 3)) * [1, 1, 0]
    tangents = rng.normal(size=(14, 3)) * [1, 1, 0]
    return decals.Decals(positions, [[0, 0, 1]] * 14, tangents, rng.uniform(0.4, 0.7, 14))


def fields_in_float64(layout: decals.Decals, points: Any, *, strongest: bool) -> tuple[Any, Any, Any]:
    """Owner, F after contact and r/r_h with the two functions above, by brute force."""
    offsets = points[:, None] - layout.positions.astype(np.float64)
    visible = np.linalg.norm(offsets, axis=2) / layout.radii.astype(np.float64)
    fields = 0.5 + 0.5 * np.cos(np.pi * np.minimum(0.5 * visible, 1.0))  # ½ at half its reach
    fields[visible * RIM >= 0.575] = 0.0  # left out by the index
    owner, rows = fields.argmax(axis=1), np.arange(len(points))
    own = fields[rows, owner][:, None]
    with np.errstate(all="ignore"):
        u = np.clip((fields + own - 1) / (2 * own - 1), 0, 1)
        h = np.where(fields + own > 1, 1 - u ** (2 / np.maximum(1 - own, 1e-6)), 1.0)
    h[rows, owner] = 1.0
    together = h.min(axis=1) if strongest else h.prod(axis=1)
    deformed = 0.5 + (own[:, 0] - 0.5) * together
    return np.where(own[:, 0] >= 0.5, owner, -1), deformed, 2 / np.pi * np.arccos(2 * deformed - 1)


@pytest.mark.parametrize("combine", ["product", "min"])
def test_evaluate_follows_the_functions(combine: str) -> None:
    law = define_contact(cosine_bump, gentle_push, combine=combine, name=f"gentle_{combine}")
    layout, rng = disks(), np.random.default_rng(8)
    points = (rng.uniform(-1.8, 1.8, (3000, 3)) * [1, 1, 0]).astype(np.float32)
    found = evaluate(layout, points, np.tile([0, 0, 1.0], (3000, 1)), contact=law)
    owner, field, rim = fields_in_float64(layout, points.astype(np.float64), strongest=combine == "min")
    same = (found.owner == owner) & (owner >= 0)
    assert (found.owner == owner).mean() > 0.999
    assert same.sum() > 1500
    np.testing.assert_allclose(found.field[same], field[same], atol=1e-5)
    drawn = 2 * np.linalg.norm(found.uv[same].astype(np.float64) - 0.5, axis=1)
    away = rim[same] > 0.02  # nearer to the centre, 1 − f is rounded
    np.testing.assert_allclose(drawn[away], rim[same][away], atol=3e-5)


@pytest.mark.slow
def test_the_paper_s_functions_give_the_paper_s_mode() -> None:
    law = define_contact("wyvill", name="paper")
    points = np.random.default_rng(2).uniform(-1.8, 1.8, (1000, 3)) * [1, 1, 0]
    normals = np.tile([0, 0, 1.0], (1000, 1))
    own, paper = (
        evaluate(disks(), points, normals, contact=mode, neighbors=True) for mode in (law, "product")
    )
    assert own.neighbors is not None
    assert paper.neighbors is not None
    sums = [
        np.bincount(np.repeat(np.arange(1000), np.diff(near.offsets)), near.pushes, 1000)
        for near in (own.neighbors, paper.neighbors)
    ]
    np.testing.assert_allclose(sums[0], sums[1], atol=1e-4)
    assert np.array_equal(own.owner, paper.owner)
    np.testing.assert_allclose(own.uv, paper.uv, atol=1e-4)


def scene(law: decals.ContactLaw) -> decals.Scene:
    square = decals.MeshObject("s", [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], [[0, 1, 2], [0, 2, 3]])
    camera = decals.Camera((0, 0, 7))
    return decals.Scene(
        objects=[square], camera=camera, decals=disks(), images=["eye"], drawing=Drawing(contact=law)
    )


@pytest.mark.parametrize("backend", ["fragment", pytest.param("compute", marks=pytest.mark.slow)])
def test_shaders_show_what_evaluate_returns(backend: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(BACKEND_VARIABLE, backend)
    law = define_contact(cosine_bump, gentle_push, name="gentle_product")
    shown = scene(law)
    with Renderer() as renderer:
        drawn = renderer.buffers(shown, RenderOptions(size=(96, 72), contact=law))
    on = drawn.object_id.ravel() >= 0
    points, normals = drawn.position.reshape(-1, 3)[on], drawn.normal.reshape(-1, 3)[on]
    found = evaluate(shown.decals, points, normals, contact=law)
    same = drawn.owner.ravel()[on] == found.owner
    assert same.mean() > 0.999
    np.testing.assert_allclose(drawn.field.ravel()[on][same], found.field[same], atol=1e-5)
    far = np.linalg.norm(found.uv - 0.5, axis=1) > 0.01
    np.testing.assert_allclose(drawn.uv.reshape(-1, 2)[on][same & far], found.uv[same & far], atol=1e-5)


def test_files_name_a_law_that_must_be_defined(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    law = define_contact(cosine_bump, gentle_push, combine="min", name="gentle_min")
    scene(law).save(tmp_path / "scene.json")
    assert decals.load_scene(tmp_path / "scene.json").drawing.contact is law
    monkeypatch.delitem(LAWS, "gentle_min")
    with pytest.raises(decals.errors.InvalidScene, match=r"contact law that is defined .* got 'gentle_min'"):
        decals.load_scene(tmp_path / "scene.json")


def test_a_definition_is_made_once() -> None:
    law = define_contact(cosine_bump)
    assert law.name == "cosine_bump"
    assert law.rim == pytest.approx(0.5)
    assert define_contact(cosine_bump) is law
    assert define_contact(cosine_bump, combine="min") is not law


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((with_ring,), "g rises from .* the field of a decal never rises"),
        ((from_half,), r"g\(0\) = 0.5, expected 1"),
        ((never_zero,), r"g\(1\) = 0.0183156, expected 0"),
        ((plateau,), "g is flat at d = 0, inside its rim"),
        ((jumping,), "g jumps from 0.75 at d = 0.5 to 0, inside its rim"),
        ((root,), r"for d = 0.501 it returns nan; expected a finite number"),
        ((two_distances,), "expected the distance"),
        (("round",), "field: expected a typed function or one of wyvill, .*got 'round'"),
        (("wyvill", too_weak), "expected 0 where the fields are equal"),
        (("wyvill", too_wide), "expected 1 at the owner's centre"),
        (("wyvill", outside), "expected a factor from 0 to 1"),
        (("wyvill", cosine_bump), "expected the fields"),
        ((5,), "expected a typed function, got 5"),
    ],
)
def test_wrong_functions_are_refused(arguments: tuple[Any, ...], says: str) -> None:
    with pytest.raises(InvalidDefinition, match=says):
        define_contact(*arguments)


def test_a_field_may_end_inside_the_reach_of_its_neighbours() -> None:
    assert define_contact(short).rim == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize("wrong", ["radial", decals.Contact.ELASTIC, "sum", None])
def test_only_product_and_min_combine(wrong: Any) -> None:
    with pytest.raises(decals.errors.InvalidScene, match="combine: expected one of 'product', 'min', got"):
        define_contact(cosine_bump, combine=wrong)
