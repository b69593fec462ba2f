"""Files by key: save as, export and images, with names that are typed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

import decals
from blobtree import Point
from blobtree.pyvista_views import MESH_SUFFIXES
from decals import load_scene, save_scene
from decals.editing import Actions, EditSession, PointerTools, ScaleDecals
from decals.editing.background import MAX_WAITING
from decals.editing.recovery import in_use
from decals.errors import InvalidEdit
from tests.decals.editing.background import LONG, finish, hold_export, press, threaded
from tests.decals.editing.scenes import scene


class Typist:
    """Keys for actions without a window."""

    def __init__(self, actions: Any) -> None:
        self.actions, self.state = actions, actions.state
        self._tools = PointerTools(actions, lambda _x, _y: None)

    def key(self, name: str, **modifiers: Any) -> None:
        self._tools.key(name, 1, 1, **modifiers)

    def enter(self, text: str) -> None:
        self.key("Delete")
        for letter in text:
            self.key("unnamed", text=letter)
        self.key("Return")


@pytest.fixture
def typist(tmp_path: Path) -> Typist:
    return Typist(Actions(EditSession(scene()), path=tmp_path / "scene.json"))


def test_save_as_changes_the_file(typist: Typist, tmp_path: Path) -> None:
    typist.state.session.do(ScaleDecals([1], 2.0))
    typist.key("s", ctrl=True, shift=True)
    typist.enter(f"{tmp_path}/other.json")
    assert typist.actions.files.path == tmp_path / "other.json"
    assert typist.actions.files.path == tmp_path / "other.json"
    assert load_scene(tmp_path / "other.json").decals.radii[1] == 2 * scene().decals.radii[1]
    assert not (tmp_path / "scene.json").exists()


def test_an_existing_file_is_replaced_after_a_second_return_only(typist: Typist, tmp_path: Path) -> None:
    other = tmp_path / "other.json"
    other.write_text("precious")
    typist.key("s", ctrl=True, shift=True)
    typist.enter(str(other))
    assert "exists" in typist.state.message
    assert other.read_text() == "precious"
    typist.key("Return")
    assert load_scene(other)
    assert not typist.state.prompt.open


@pytest.mark.parametrize(
    ("name", "message"),
    [("scene.ply", r"ends in .json"), ("nowhere/a.json", "existing folder"), ("", "expected a name")],
    ids=["suffix", "folder", "empty"],
)
def test_a_wrong_name_is_named_and_can_be_corrected(
    typist: Typist, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    typist.key("s", ctrl=True, shift=True)
    typist.enter(name)
    assert message in typist.state.message
    assert typist.state.prompt.open
    typist.enter("right.json")
    assert (tmp_path / "right.json").exists()


def test_escape_closes_the_prompt_and_keys_are_keys_again(typist: Typist) -> None:
    typist.key("e", ctrl=True)
    typist.key("h", text="h")
    assert not typist.actions.help_visible
    typist.key("Escape")
    typist.key("h", text="h")
    assert typist.actions.help_visible


@pytest.mark.slow_cases(".obj")
@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_export_writes_all_objects(typist: Typist, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"mesh{suffix}"
    typist.key("e", ctrl=True)
    typist.enter(str(path))
    assert f"exported to {path}" in typist.state.message
    mesh = pv.read(path)
    low, high = scene().bounds
    assert pytest.approx(np.array([low, high]), abs=0.1) == np.reshape(mesh.bounds, (3, 2)).T
    points = np.asarray(mesh.points)
    assert (points[:, 0] < -1.4).sum() >= 8  # the box
    assert (points[:, 0] > -1.1).sum() > 100  # the tree
    assert typist.state.session.labels == ()


def test_an_export_replaces_a_file_after_a_second_return_only(typist: Typist, tmp_path: Path) -> None:
    path = tmp_path / "mesh.ply"
    path.write_text("precious")
    typist.key("e", ctrl=True)
    typist.enter(str(path))
    assert "exists; press Return again" in typist.state.message
    assert path.read_text() == "precious"
    typist.key("Return")
    assert pv.read(path).n_points > 100


def test_exports_have_the_colours_of_objects_and_decals(typist: Typist, tmp_path: Path) -> None:
    typist.key("e", ctrl=True)
    typist.enter(f"{tmp_path}/mesh.ply")
    decals.export(typist.state.session.document.scene, tmp_path / "other.ply")
    mesh, other = pv.read(tmp_path / "mesh.ply"), pv.read(tmp_path / "other.ply")
    assert np.array_equal(np.asarray(mesh.points), np.asarray(other.points))
    colors, others = np.asarray(mesh["RGB"]), np.asarray(other["RGB"])
    assert len(np.unique(colors, axis=0)) > 2
    assert np.array_equal(colors, others)


def test_the_scene_can_be_exported_as_a_page(typist: Typist, tmp_path: Path) -> None:
    typist.key("e", ctrl=True)
    typist.enter(f"{tmp_path}/scene.html")
    assert "exported to" in typist.state.message
    assert (tmp_path / "scene.html").read_text(encoding="utf-8").startswith("<!doctype html>")


def test_the_first_name_of_an_export_is_that_of_the_scene(typist: Typist, tmp_path: Path) -> None:
    typist.key("e", ctrl=True)
    assert str(tmp_path / "scene.ply") in typist.state.prompt.text


def test_an_empty_scene_cannot_be_exported() -> None:
    typist = Typist(Actions(EditSession(scene().replace(objects=(), decals=scene().decals[:0]))))
    typist.key("e", ctrl=True)
    assert "no object" in typist.state.message
    assert not typist.state.prompt.open


def test_an_image_is_added_and_can_be_undone(typist: Typist, tmp_path: Path) -> None:
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "red.png")
    typist.key("i", ctrl=True)
    typist.enter(f"{tmp_path}/red.png")
    images = typist.state.session.document.images
    assert [image.source for image in images] == ["scale", "eye", f"{tmp_path}/red.png"]
    assert images[2].pixels[0, 0].tolist() == [255, 0, 0, 255]
    assert typist.state.session.labels == ("add an image",)
    typist.key("z", ctrl=True)
    assert len(typist.state.session.document.images) == 2


def test_an_image_that_does_not_exist_is_named(typist: Typist) -> None:
    typist.key("i", ctrl=True)
    typist.enter("nothing.png")
    assert "nothing.png" in typist.state.message
    assert typist.state.prompt.open


def test_an_export_follows_another_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    actions = threaded(path=tmp_path / "scene.json")
    begun, go = hold_export(monkeypatch)
    typist = Typist(actions)
    typist.key("e", ctrl=True)
    typist.enter(f"{tmp_path}/mesh.stl")
    assert begun.wait(LONG)
    actions.files.write(f"{tmp_path}/scene.py", False)
    assert (
        f"another file is being written; the export to {tmp_path}/scene.py follows" in actions.state.message
    )
    assert actions.state.background.waiting == 1
    for number in range(MAX_WAITING - 1):
        actions.files.write(f"{tmp_path}/scene-{number}.py", False)
    with pytest.raises(InvalidEdit, match="other files are being written"):
        actions.files.write(f"{tmp_path}/one-more.py", False)
    go.set()
    finish(actions)
    assert {"mesh.stl", "scene.py", "scene-6.py"} <= {path.name for path in tmp_path.iterdir()}


def test_saves_do_not_wait_for_an_export_which_escape_cancels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("decals.editing.recovery.AUTOSAVE_SECONDS", 0.0)
    actions = threaded(path=tmp_path / "scene.json")
    begun, _ = hold_export(monkeypatch)
    actions.files.write(f"{tmp_path}/mesh.stl", False)
    actions.files.write(f"{tmp_path}/mesh.ply", False)
    assert begun.wait(LONG)
    actions.state.session.do(ScaleDecals([1], 2.0))
    background = actions.state.background
    actions.files.update()
    while background.writing:
        background.poll(timeout=0.02)
    assert [*tmp_path.glob("*.recovery.json")]
    actions.state.selection = (1,)
    press(actions, "save")
    while background.writing:
        background.poll(timeout=0.02)
    assert [*tmp_path.glob("scene*.json")] == [tmp_path / "scene.json"]
    press(actions, "deselect")
    assert background.waiting == 1
    press(actions, "deselect")
    assert (background.waiting, actions.state.message) == (0, "cancelled")
    finish(actions)
    assert [path.name for path in tmp_path.iterdir()] == ["scene.json"]


def test_a_new_scene_never_replaces_a_file_of_another_window(tmp_path: Path) -> None:
    first, second = (Actions(EditSession(scene()), path=tmp_path / "scene.json") for _ in range(2))
    first.state.session.do(ScaleDecals([1], 2.0))
    for actions in (first, second, first, second):
        press(actions, "save")
    assert first.files.path == tmp_path / "scene.json"
    assert second.files.path == tmp_path / "scene-2.json"
    radii = [load_scene(tmp_path / name).decals.radii[1] for name in ("scene.json", "scene-2.json")]
    assert radii[0] == pytest.approx(2 * radii[1])


def test_a_scene_that_is_set_aside_keeps_its_file_and_its_unsaved_changes(tmp_path: Path) -> None:
    path, unsaved = tmp_path / "scene.json", tmp_path / "scene.recovery.json"
    actions = Actions(EditSession(scene()), path=path)
    files, session = actions.files, actions.state.session
    session.do(ScaleDecals([1], 2.0))
    radius = session.document.decals[1].radii[0]
    files.set_aside()
    files.set_aside()
    assert (files.path, session.modified) == (None, True)
    session.do(ScaleDecals([1], 3.0))
    files.update()
    files.recovery.keep()
    assert load_scene(unsaved).decals.radii[1] == radius
    assert in_use(unsaved)
    session.undo()
    files.take_back()
    assert (files.path, load_scene(unsaved).decals.radii[1]) == (path, radius)
    press(actions, "save")
    assert path.exists()
    assert not unsaved.exists()
    session.do(ScaleDecals([1], 4.0))
    files.set_aside()
    files.finish()
    assert not in_use(unsaved)
    assert load_scene(unsaved).decals.radii[1] == pytest.approx(4 * radius)


def test_opening_another_scene_begins_anew_and_keeps_unsaved_changes(tmp_path: Path) -> None:
    other = decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"])
    save_scene(other, tmp_path / "other.json")
    actions = Actions(EditSession(scene()), path=tmp_path / "scene.json")
    files, session = actions.files, actions.state.session
    shown: list[decals.Camera] = []
    files.show_view = shown.append
    session.do(ScaleDecals([1], 2.0))
    scaled = session.document.decals[1].radii[0]
    files.open(lambda *_: load_scene(tmp_path / "other.json"), tmp_path / "other.json")
    assert len(session.document.decals) == 3
    assert (session.labels, session.modified, files.path) == ((), False, tmp_path / "other.json")
    assert [camera.position for camera in shown] == [other.camera.position]
    assert load_scene(tmp_path / "scene.recovery.json").decals.radii[1] == scaled
    files.open(lambda *_: scene(), tmp_path / "scene.json")
    assert session.labels == ("recover unsaved changes",)
    assert session.document.scene.decals.radii[1] == scaled


def test_files_outside_the_folder_are_refused(tmp_path: Path) -> None:
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "link").symlink_to(tmp_path)
    actions = Actions(EditSession(scene()), path=inside / "scene.json")
    actions.files.folder = inside
    for name in ("../a.json", str(tmp_path / "a.json"), "link/a.json", "a\0.json", "~/a.json", "none/a.json"):
        with pytest.raises(InvalidEdit, match="expected a file in"):
            actions.files.write(name, False)
        with pytest.raises(InvalidEdit, match="expected a"):
            actions.files.open(lambda *_: scene(), tmp_path / "a.json")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["inside"]
    with pytest.raises(InvalidEdit, match="ends in"):
        actions.files.write("a.txt", False)


@pytest.mark.parametrize(
    "name",
    [
        "con.json",
        "Aux.stl.py",
        "LPT9.glb",
        "nul .json",
        "inner/PRN.json",
        "a?.json",
        "a:b.json",
        "..\\a.json",
        "a\x07.json",
        "a\u202e.json",
        f"{'a' * 300}.json",
        f"{'字' * 90}.json",
        "a/" * 20 + "a.json",
        "inner /a.json",
        "inner./a.json",
    ],
)
def test_names_that_some_system_cannot_have_are_refused(name: str, tmp_path: Path) -> None:
    actions = Actions(EditSession(scene()), path=tmp_path / "scene.json")
    actions.files.folder = tmp_path
    (tmp_path / "inner").mkdir()
    with pytest.raises(InvalidEdit, match="expected"):
        actions.files.write(name, True)
    assert [path.name for path in tmp_path.iterdir()] == ["inner"]
    (tmp_path / "round").symlink_to(tmp_path / "round")
    with pytest.raises(InvalidEdit, match="expected a file inside"):
        actions.files.write("round/a.json", True)
    actions.files.write("inner/plain näme (2).json", False)
    assert (tmp_path / "inner" / "plain näme (2).json").exists()


@pytest.mark.parametrize("name", ["script.py", "mesh.stl", pytest.param("baked.glb", marks=pytest.mark.slow)])
def test_the_suffix_is_the_format(name: str, tmp_path: Path) -> None:
    actions = Actions(EditSession(scene()), path=tmp_path / "scene.json")
    actions.files.folder = tmp_path
    actions.files.write(name, False)
    assert (tmp_path / name).stat().st_size > 100
    with pytest.raises(InvalidEdit, match="exists; choose to replace it, or give another name"):
        actions.files.write(name, False)
    actions.files.write(name, True)
    actions.files.write("copy.json", False)
    assert actions.files.path == tmp_path / "copy.json"


def test_a_second_save_writes_the_file_of_the_first(tmp_path: Path) -> None:
    """The first one has written the file of a new scene, and its completion has not been called yet."""
    actions = threaded(path=tmp_path / "scene.json")
    actions.files.save(lambda: None)
    worker = actions.state.background._saves
    assert worker._run is not None
    assert worker._run.ended(LONG)
    assert (tmp_path / "scene.json").exists()
    actions.state.session.do(ScaleDecals([1], 2.0))
    actions.files.save(lambda: None)
    finish(actions)
    assert not list(tmp_path.glob("scene-*.json"))
    expected = actions.state.session.document.decals.decals.radii
    np.testing.assert_array_equal(load_scene(tmp_path / "scene.json").decals.radii, expected)
