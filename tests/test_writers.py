"""Writers that cannot write: an exception of ours, the old file as it was, nothing left behind."""

import os
import sys

import pytest

from tests.writers import WRITERS, cases, failure, failure_in_short_files, failure_on_full_disk

ORDINARY = {"plain.ply", "tree.json", "picture.png", "surface.ply", "scene.json", "script.py", "table.csv"}


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
@pytest.mark.parametrize(
    ("name", "fault"),
    [pytest.param(*case, marks=() if case[0] in ORDINARY else pytest.mark.slow) for case in cases()],
)
def test_a_writer_that_cannot_write_says_so(name: str, fault: str) -> None:
    assert not failure(name, fault)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="sets the largest size of a file")
@pytest.mark.parametrize(
    "name", sorted({*ORDINARY, "picture.jpg", "surface.obj", "surface.stl", "surface.vtp"})
)
def test_a_file_without_room_leaves_the_old_one(name: str) -> None:
    assert not failure_in_short_files(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_leaves_the_old_file(name: str) -> None:
    try:
        wrong = failure_on_full_disk(name)
    except OSError as error:
        pytest.skip(str(error))
    assert not wrong
