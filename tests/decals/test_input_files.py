"""Scenes, models, images, tables and lessons are read from regular files, not from devices or pipes."""

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista

import blobtree
import decals
from blobtree.files import no_file, read_file, read_text
from blobtree.foreign import read_tree
from decals.apps.commands.zone_options import parse_zones
from decals.apps.lab.lesson import load_lesson
from decals.apps.models.loading import import_module_or_file, load_model
from decals.baking.reproduction import reproduce_export
from decals.errors import ImplicitDecalsError
from decals.experiments.store import described
from decals.images import read_image
from decals.rendering.picture import picture_recipe
from decals.surfaces import read_mesh

READERS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "scene": (".json", decals.load_scene),
    "model": (".json", decals.load_model),
    "tree": (".json", blobtree.load),
    "program": (".frep", read_tree),
    "covered": (".ply", lambda path: decals.cover(path, count=5)),
    "mesh": (".obj", read_mesh),
    "VTK mesh": (".vtp", read_mesh),
    "image": (".png", read_image),
    "images": (".png", lambda path: decals.cover(pyvista.Plane(), count=1, images=path)),
    "map": (".png", lambda path: decals.DecalMaterial("map", np.zeros((1, 1, 4), np.uint8), roughness=path)),
    "table": (".csv", decals.load_table),
    "picture": (".png", picture_recipe),
    "exported": (".glb", reproduce_export),
    "lesson": (".md", load_lesson),
    "argument": (".ply", lambda path: load_model(str(path))),
    "module": (".py", lambda path: import_module_or_file("--define", str(path))),
    "material": (".txt", decals.DecalMaterial.load),
}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no pipes in folders")
@pytest.mark.parametrize("kind", READERS)
def test_pipes_devices_and_folders_are_refused_at_once(kind: str, tmp_path: Path) -> None:
    suffix, read = READERS[kind]
    pipe, device, folder = (tmp_path / f"{name}{suffix}" for name in ("pipe", "device", "folder"))
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    folder.mkdir()
    for path, reason in (
        (pipe, "a device or a pipe|found none"),
        (device, "a device or a pipe|found none"),
        (folder, r"(i|I)s a(n empty)? (folder|directory)|expected a file of the base colour"),
        (tmp_path / f"none{suffix}", "found no|No such file"),
    ):
        with pytest.raises(ImplicitDecalsError, match=reason) as caught:
            read(path)
        assert str(path) in str(caught.value)


def test_a_pipe_in_a_folder_of_results_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "experiment.json")
    with pytest.raises(ImplicitDecalsError, match="a device or a pipe"):
        described(tmp_path)


def test_what_is_at_a_path_is_said(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_bytes(b"one\r\ntwo\rthree\n")
    assert no_file(file) == ""
    assert no_file("a\0b") == "found no file 'a\\x00b'"
    assert no_file(tmp_path) == f"{str(tmp_path)!r} is a folder"
    assert no_file(os.devnull) == f"{os.devnull!r} is a device or a pipe"
    assert read_file(file) == b"one\r\ntwo\rthree\n"
    assert read_text(file) == "one\ntwo\nthree\n"
    with pytest.raises(ValueError, match="null"):
        read_file(Path("a\0b"))


def test_a_zone_of_a_missing_file_is_no_misspelt_name() -> None:
    objects = decals.cover(pyvista.Plane(), count=1).objects
    zones = parse_zones(["nope.json"], 0.0, objects, axis="z", images=1, trust=False)
    scatter = partial(decals.scatter, objects, count=5)
    with pytest.raises(ImplicitDecalsError, match=r"got 'nope\.json', which is no file either$"):
        scatter(zones=zones)
    with pytest.raises(ImplicitDecalsError, match=r"got 'nope'$"):
        scatter(zones=decals.scattering.Zones(decals.scattering.Zone("nope")))
