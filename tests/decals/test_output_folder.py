"""A folder that is made for output is gone again if the work fails before there is a file in it."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from decals.errors import InvalidInput, InvalidScene
from decals.output_folder import output_folder


def fail(folder: Path, error: BaseException, files: Sequence[str] = ()) -> None:
    """Fail in a folder for output after some files were written."""
    with output_folder(folder, InvalidInput):
        for name in files:
            (folder / name).write_bytes(b"")
        assert folder.is_dir()
        raise error


@pytest.mark.parametrize("error", [InvalidScene("no"), KeyboardInterrupt()])
def test_work_that_fails_leaves_no_empty_folder(tmp_path: Path, error: BaseException) -> None:
    with pytest.raises(type(error)):
        fail(tmp_path / "new", error)
    assert not list(tmp_path.iterdir())


def test_folders_with_files_and_those_of_before_stay(tmp_path: Path) -> None:
    (tmp_path / "before").mkdir()
    for name, files in {"before": [], "begun": ["one.png"]}.items():
        with pytest.raises(KeyboardInterrupt):
            fail(tmp_path / name, KeyboardInterrupt(), files)
    with output_folder(tmp_path / "done", InvalidInput):
        pass
    assert sorted(path.name for path in tmp_path.iterdir()) == ["before", "begun", "done"]


def test_a_folder_that_cannot_be_made_is_an_error_of_the_given_type(tmp_path: Path) -> None:
    with pytest.raises(InvalidScene, match="could not make the output folder"):
        output_folder(tmp_path / "no" / "folder", InvalidScene).__enter__()
