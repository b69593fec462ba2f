"""``implicit-decals scatter``."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from blobtree import Point, Repeat, Segment, save
from decals import Camera, Scene, TreeObject, load_scene, reproduce, save_scene
from decals.apps.cli import run
from decals.scenes.cover import fitting_camera
from decals.scenes.scene import as_images
from tests.apps.commands.pictures import picture

Capture = pytest.CaptureFixture[str]


@pytest.mark.slow
def test_a_scene_and_a_table_hold_the_same_decals(folder: Path) -> None:
    arguments = ["scatter", "spheres", "--count", "25", "--images", "3", "--seed", "4"]
    assert run([*arguments, "-o", "scene.json"]) == 0
    assert run([*arguments, "-o", "decals.csv"]) == 0
    scene = load_scene(folder / "scene.json")
    assert len(scene.images) == 3
    assert [item.name for item in scene.objects] == ["spheres"]
    header, *rows = (folder / "decals.csv").read_text().splitlines()
    assert header == "x,y,z,nx,ny,nz,tx,ty,tz,radius,image"
    table = np.array([row.split(",") for row in rows], float)
    decals = scene.decals
    expected = [
        decals.positions,
        decals.normals,
        decals.tangents,
        decals.radii[:, None],
        decals.images[:, None],
    ]
    assert len(table) == 25
    assert np.allclose(table, np.hstack(expected), rtol=1e-6, atol=1e-7)


@pytest.mark.slow_cases("parquet")
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_commands_take_the_written_table(suffix: str, folder: Path, capsys: Capture) -> None:
    """A model with a table is the scene that was written beside it: pictures and measures are equal."""
    table = f"decals.{suffix}"
    pv.Sphere(radius=0.5, center=(7e4, 0, 0)).save(folder / "ball.ply")
    for output in ("scene.json", table):
        assert run(["scatter", "ball.ply", "--count", "30", "--images", "2", "-o", output]) == 0
    size = ["--size", "64x48", "--samples", "1"]
    assert run(["render", "scene.json", *size, "-o", "scene.png", "--save", "again.json"]) == 0
    assert (
        run(["render", "ball.ply", "--table", table, *size, "-o", "table.png", "--save", "taken.json"]) == 0
    )
    assert np.array_equal(picture(folder / "scene.png"), picture(folder / "table.png"))
    written, read = (load_scene(folder / name) for name in ("again.json", "taken.json"))
    assert (read.decals, read.images, read.objects) == (written.decals, written.images, written.objects)
    capsys.readouterr()
    for source in (["scene.json"], ["ball.ply", "--table", table]):
        assert run(["measure", *source, "--samples", "300", "--json"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first == second
    assert run(["export", "ball.ply", "--table", table, "-o", "ball.html"]) == 0
    assert run(["render", "scene.json", "--table", table, *size, "-o", "replaced.png"]) == 0
    assert np.array_equal(picture(folder / "scene.png"), picture(folder / "replaced.png"))
    options = ["--image", "eye", "--image", "tile"]
    assert run(["render", "ball.ply", "--table", table, *options, *size, "-o", "other.png"]) == 0
    assert not np.array_equal(picture(folder / "scene.png"), picture(folder / "other.png"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--table", "none.csv"], "expected a table of decals, found no file 'none.csv'"),
        (["--table", "bad.csv"], "'bad.csv': line 2, column 'radius': expected a finite number, got 'nan'"),
        (["--table", "good.csv", "--decals", "5"], "a saved scene or table has its own decals"),
        (["--table", "good.csv", "--image", "eye"], "--table: decals refer to 3 images, got 1"),
    ],
)
def test_tables_that_cannot_be_used(options: list[str], message: str, folder: Path, capsys: Capture) -> None:
    header = "x,y,z,nx,ny,nz,tx,ty,tz,radius,image\n0,0,0,0,0,1,1,0,0"
    (folder / "bad.csv").write_text(f"{header},nan,0\n")
    (folder / "good.csv").write_text(f"{header},1,2\n")
    assert run(["render", "spheres", *options, "-o", "a.png"]) == 2
    assert message in " ".join(capsys.readouterr().err.split())


def test_render_draws_a_written_scene(folder: Path) -> None:
    pv.Sphere(radius=0.5).save(folder / "ball.ply")
    size = ["--size", "64x48", "--samples", "1"]
    assert run(["scatter", "ball.ply", "--count", "30", "-o", "scene.json"]) == 0
    assert run(["render", "scene.json", *size, "-o", "scattered.png"]) == 0
    assert run(["render", "ball.ply", "--decals", "30", *size, "-o", "rendered.png"]) == 0
    assert np.array_equal(picture(folder / "scattered.png"), picture(folder / "rendered.png"))


def test_spacing_and_sizing_rule(folder: Path) -> None:
    pv.Sphere(radius=0.5).save(folder / "ball.ply")
    rules = ["--spacing", "0.2", "--sizing", "touching", "--along", "cross", "--factor", "0.5"]
    assert run(["scatter", "ball.ply", *rules, "-o", "scene.json"]) == 0
    radii = load_scene(folder / "scene.json").decals.radii
    assert len(radii) == pytest.approx(np.pi / (0.2**2 * np.sqrt(0.75)), abs=3)
    assert np.median(radii) == pytest.approx(0.25 * 0.2, rel=0.15)


def test_a_painted_image_sets_the_density(folder: Path) -> None:
    pv.Sphere(radius=0.5).save(folder / "ball.ply")
    Image.fromarray(np.array([[0, 255]], np.uint8).repeat(8, axis=1)).save(folder / "half.png")
    image = ["--count", "200", "--painted", "half.png", "--painted-along", "y", "--black", "0.25"]
    rules = ["--choice", "curvature", "--regularity", "0.6"]
    assert run(["scatter", "ball.ply", *image, *rules, "-o", "scene.json"]) == 0
    positions = load_scene(folder / "scene.json").decals.positions
    assert (positions[:, 2] < 0).sum() == pytest.approx(40, abs=4)  # seen from +y, z runs to the right


def test_zones_by_solids_names_images_and_the_rest(folder: Path) -> None:
    tree = Point((0, 0, 0), radius=1.0) + Segment((0.8, 0, 0), (2.2, 0, 0), radius=0.35)
    body = TreeObject("body", tree, names={(1,): "limb"})
    save_scene(
        Scene(objects=[body], camera=fitting_camera([body]), images=as_images(["tile"] * 4)), "body.json"
    )
    save(Point((0, 1, 0), radius=0.7), "mask.json")
    Image.fromarray(np.array([[255, 0]], np.uint8).repeat(8, axis=1)).save(folder / "left.png")
    zones = ["mask.json:density=4,images=1", "limb:images=2+3,along=curvature", "left.png:images=0"]
    options = [text for zone in zones for text in ("--zone", zone)]
    assert run(["scatter", "body.json", "--count", "120", *options, "-o", "scene.json"]) == 0
    decals = load_scene(folder / "scene.json").decals
    assert len(decals) == 120
    in_mask = np.linalg.norm(decals.positions - [0, 1, 0], axis=1) < 0.7
    assert np.array_equal(decals.images == 1, in_mask)
    assert (decals.images[in_mask] == 1).sum() > 20
    assert decals.positions[decals.images >= 2, 0].min() > 0.9
    assert decals.positions[decals.images == 0, 0].max() < 0.8  # the middle of the picture


def test_spacings_of_zones_set_the_count(folder: Path) -> None:
    pv.Sphere(radius=0.5).save(folder / "ball.ply")
    zones = ["--zone", "ball:spacing=0.2", "--border-width", "0.1"]
    assert run(["scatter", "ball.ply", *zones, "-o", "scene.json"]) == 0
    scene = load_scene(folder / "scene.json")
    assert len(scene.decals) == pytest.approx(np.pi / (0.2**2 * np.sqrt(0.75)), abs=3)
    assert "zones" in reproduce(scene).missing[0]


def test_copies_of_a_grid_get_the_same_decals(folder: Path) -> None:
    ball = Point((0, 0, 0), radius=0.4)
    grid = Repeat(Repeat(ball, (3, 0, 0), 3), (0, 2, 0), 2).translate((0, 0, 1))
    save(grid, "grid.json")
    save(ball.translate((0, 0, 1)), "ball.json")
    for name, options in (("grid", ["--same-on-copies"]), ("ball", [])):
        assert run(["scatter", f"{name}.json", "--count", "20", *options, "-o", f"{name}-scene.json"]) == 0
    one, scene = (load_scene(folder / f"{name}-scene.json") for name in ("ball", "grid"))
    places = [(x, y, 0) for y in (0, 2) for x in (0, 3, 6)]
    expected = np.concatenate([one.decals.positions + place for place in places])
    np.testing.assert_allclose(scene.decals.positions, expected, atol=1e-5)
    assert len(scene.objects) == 1
    assert reproduce(scene).equal
    Image.fromarray(np.array([[0, 255]], np.uint8).repeat(8, axis=1)).save(folder / "half.png")
    painted = ["--painted", "half.png", "--painted-along", "y", "--count", "20"]
    assert run(["scatter", "grid.json", *painted, "--same-on-copies", "-o", "painted.json"]) == 0
    assert reproduce(load_scene(folder / "painted.json")).equal


def test_too_many_decals_on_copies_are_refused_before_work(folder: Path, capsys: Capture) -> None:
    save(Repeat(Repeat(Point((0, 0, 0), radius=0.4), (3, 0, 0), 300), (0, 2, 0), 300), "grid.json")
    for options, message in (
        (["--count", "20"], "at most 1,000,000 decals on all copies, got 20 on each of 90,000"),
        (["--spacing", "0.3"], "which makes 1,000,000 decals, got 0.3"),
    ):
        assert run(["scatter", "grid.json", "--same-on-copies", *options, "-o", "a.json"]) == 2
        assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--same-on-copies", "-o", "a.json"], "expected one model, a tree whose root is a Repeat"),
        (["--same-on-copies", "--zone", "*", "-o", "a.json"], "leave one of them out"),
        (["--zone", "tail", "-o", "a.json"], "expected a name of the models, which have 'spheres'"),
        (["--zone", "*:taste=1", "-o", "a.json"], "expected WHERE:KEY=VALUE"),
        (["--zone", "*:density=much", "-o", "a.json"], "expected WHERE:KEY=VALUE"),
        (["--zone", "*:factor=2,factor=3", "-o", "a.json"], "each once, got 'factor=3'"),
        (["--zone", "*:factor=2", "--zone", "*:factor=-2", "-o", "a.json"], "--zone *:factor=-2: factor of"),
        (["--zone", "*:images=1", "-o", "a.json"], "there are 1 images, from 0 on; raise --images"),
        (["--zone", "*:spacing=0.5", "--count", "5", "-o", "a.json"], "no count or spacing beside"),
        (["--border-width", "0.1", "-o", "a.json"], "give --zone"),
        (["--regularity", "2", "-o", "a.json"], "regularity: expected a number from 0 to 1"),
        (["--painted", "none.png", "-o", "a.json"], "found no file"),
        (["--count", "5", "--spacing", "0.1", "-o", "a.json"], "--count or --spacing"),
        (["--count", "-1", "-o", "a.json"], "--count: expected"),
        (["--images", "257", "-o", "a.json"], "--images: expected"),
        (["--spacing", "0", "-o", "a.json"], "spacing: expected a length above 0"),
        (["--spacing", "1e-5", "-o", "a.json"], "which makes 1,000,000 decals, got 1e-05"),
        (["--black", "0.5", "-o", "a.json"], "give --painted"),
        (["--painted-along", "x", "-o", "a.json"], "give --painted"),
        (["-o", "a.png"], "expected an output file"),
    ],
)
def test_invalid_arguments(folder: Path, capsys: Capture, arguments: list[str], message: str) -> None:
    assert run(["scatter", "spheres", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_a_scene_gets_other_decals_and_keeps_its_images_and_camera(folder: Path) -> None:
    pv.Sphere(radius=0.5).save(folder / "ball.ply")
    assert run(["scatter", "ball.ply", "--count", "5", "--images", "2", "-o", "scene.json"]) == 0
    before = load_scene(folder / "scene.json")
    assert run(["scatter", "scene.json", "--count", "20", "-o", "more.json"]) == 0
    after = load_scene(folder / "more.json")
    assert len(after.decals) == 20
    assert set(after.decals.images) == {0, 1}
    assert [image.source for image in after.images] == [image.source for image in before.images]
    assert after.camera == before.camera
    assert run(["scatter", "scene.json", "--count", "9", "--images", "3", "-o", "more.json"]) == 0
    assert len(load_scene(folder / "more.json").images) == 3


def test_a_scene_without_objects_is_refused(folder: Path, capsys: Capture) -> None:
    save_scene(Scene(objects=(), camera=Camera((0, 0, 1))), folder / "empty.json")
    assert run(["scatter", "empty.json", "-o", "more.json"]) == 2
    assert "empty.json" in capsys.readouterr().err
