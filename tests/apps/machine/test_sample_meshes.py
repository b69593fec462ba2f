"""Sample meshes in the places where pyvista looks."""

from pathlib import Path

import pytest

from implicit_decals.apps.machine import sample_meshes
from implicit_decals.apps.machine.finding import Finding, Status


def test_samples_in_the_folder_that_pyvista_reads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sample_meshes, "_download_folder", lambda: [tmp_path / "downloads"])
    data = tmp_path / "Data"
    data.mkdir()
    (data / "dragon.ply").touch()
    lacking = sample_meshes.sample_finding({"PYVISTA_DATA": str(tmp_path)})
    assert lacking.status is Status.NOTE
    assert lacking.value.endswith("lacks horse.vtp")
    assert lacking.advice
    (data / "horse.vtp").touch()
    for folder in (tmp_path, data):
        assert sample_meshes.sample_finding({"PYVISTA_DATA": str(folder)}).status is Status.GOOD
    unset = sample_meshes.sample_finding({})
    assert unset.status is Status.NOTE
    assert unset.value.startswith("not here yet")


def test_samples_that_were_downloaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sample_meshes, "_download_folder", lambda: [tmp_path])
    for name in sample_meshes.SAMPLES:
        (tmp_path / name).touch()
    assert sample_meshes.sample_finding({}) == Finding("Sample meshes", "dragon.ply, horse.vtp")
