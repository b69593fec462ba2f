"""Sample meshes in the places where pyvista looks."""

from pathlib import Path

import pytest

from decals.apps.doctor import sample_meshes
from decals.apps.doctor.finding import Finding, Status


def test_samples_in_the_folder_that_pyvista_reads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sample_meshes, "_download_folder", lambda: [tmp_path / "downloads"])
    data = tmp_path / "Data"
    data.mkdir()
    (data / "dragon.ply").touch()
    incomplete = sample_meshes.sample_finding({"PYVISTA_DATA": str(tmp_path)})
    assert incomplete.status is Status.NOTE
    assert incomplete.value.endswith("lacks horse.vtp")
    assert incomplete.advice
    (data / "horse.vtp").touch()
    for folder in (tmp_path, data):
        assert sample_meshes.sample_finding({"PYVISTA_DATA": str(folder)}).status is Status.GOOD
    unset = sample_meshes.sample_finding({})
    assert unset.status is Status.NOTE
    assert unset.value.startswith("not downloaded yet")


def test_downloaded_samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sample_meshes, "_download_folder", lambda: [tmp_path])
    for name in sample_meshes.SAMPLES:
        (tmp_path / name).touch()
    assert sample_meshes.sample_finding({}) == Finding("Sample meshes", "dragon.ply, horse.vtp")
