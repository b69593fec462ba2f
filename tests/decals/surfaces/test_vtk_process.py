"""Files at which VTK's readers crash or hang: one error of ours, and the next file is read as usual."""

import json
import multiprocessing
import os
import signal
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from blobtree.progress import reporting
from decals.errors import Cancelled, InvalidMesh
from decals.surfaces import read_mesh, vtk_process
from decals.surfaces.vtk_process import _process
from tests.programs import output_of

DAMAGED = Path(__file__).with_name("damaged")
"""Files that crash or hang the process which reads them by pyvista 0.49 with VTK 9.6."""


@pytest.fixture
def sphere(tmp_path: Path) -> Path:
    path = tmp_path / "sphere.vtp"
    pv.Sphere(theta_resolution=8, phi_resolution=6).save(path)
    return path


def check_sphere(path: Path) -> None:
    expected = pv.read(path)
    vertices, faces = read_mesh(path)
    assert np.array_equal(vertices, expected.points)
    assert np.array_equal(faces, expected.regular_faces)


@pytest.mark.parametrize("name", ["crash.vtu", "crash.vtk", "hang.vtp"])
def test_a_file_that_breaks_the_reader_is_refused(
    name: str, sphere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    check_sphere(sphere)  # the process has started
    if name == "hang.vtp":
        monkeypatch.setattr(vtk_process, "SECONDS", 1.0)
    begun = time.perf_counter()
    with pytest.raises(InvalidMesh, match=rf"{name}.*(export it again|within the limits .* processor time)"):
        read_mesh(DAMAGED / name)
    assert time.perf_counter() - begun < vtk_process.SECONDS + 30.0
    monkeypatch.undo()
    check_sphere(sphere)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system has no fork")
def test_a_process_without_the_file_of_its_size_reads_with_one_import_of_pyvista(sphere: Path) -> None:
    program = f"""
import io, json, os, pathlib, sys
from decals.surfaces import vtk_child
assert "pyvista" in sys.modules, "every fork would import it again"
vtk_child.STATM = pathlib.Path({str(sphere.with_name("nothing"))!r})
answers = io.FileIO(os.open({str(sphere.with_name("answer"))!r}, os.O_WRONLY | os.O_CREAT), "w")
request = {{"path": os.fsencode({str(sphere)!r}).hex(), "seconds": 60.0, "bytes": 1 << 30}}
vtk_child._answer_in_fork(request, answers)
"""
    output_of(program)
    header = json.loads(sphere.with_name("answer").read_bytes().splitlines()[0])
    vertices, faces = read_mesh(sphere)
    assert header["arrays"]["vertices"][1:] == [len(vertices), 3]
    assert header["arrays"]["faces"][1:] == [len(faces), 3]


@pytest.mark.parametrize("folder", ["usable", "missing"])
def test_a_fork_loads_nothing_that_an_earlier_one_loaded(folder: str, sphere: Path) -> None:
    """Unless no file can be written, in which case the process reads all the same."""
    program = f"""
import pathlib, sys, tempfile
from decals.surfaces import vtk_child
tempfile.tempdir = {str(sphere.parent if folder == "usable" else sphere)!r}
vtk_child.warm_up()
loaded = set(sys.modules)
vtk_child._read(pathlib.Path({str(sphere.with_suffix(".vtu"))!r}), 60.0)
print(len(set(sys.modules) - loaded))
"""
    pv.read(sphere).cast_to_unstructured_grid().save(sphere.with_suffix(".vtu"))
    assert (int(output_of(program)) == 0) == (folder == "usable")


def test_an_answer_to_a_former_request_is_not_taken(sphere: Path, tmp_path: Path) -> None:
    """As if a reader had crashed once its answer was sent: the process then adds a second answer."""
    check_sphere(sphere)
    other = tmp_path / "other.vtp"
    pv.Plane(i_resolution=2, j_resolution=3).save(other)
    child = _process._child
    assert child is not None
    assert child.stdin is not None
    request = {"path": os.fsencode(other).hex(), "seconds": 60.0, "bytes": 1 << 30, "number": -1}
    child.stdin.write(json.dumps(request).encode() + b"\n")
    check_sphere(sphere)
    check_sphere(sphere)
    assert _process._child is not child


def test_the_process_is_kept_and_started_again(sphere: Path) -> None:
    check_sphere(sphere)
    child = _process._child
    assert child is not None
    check_sphere(sphere)
    assert _process._child is child
    os.kill(child.pid, 9)
    child.wait()
    check_sphere(sphere)
    assert _process._child is not child


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot stop a process for a while")
def test_a_cancelled_reader_ends_and_the_next_file_is_read(sphere: Path) -> None:
    check_sphere(sphere)
    child = _process._child
    assert child is not None
    os.kill(child.pid, signal.SIGSTOP)  # as a reader that takes long
    cancelled = threading.Event()
    timer = threading.Timer(0.1, cancelled.set)
    timer.start()
    with reporting(cancel=cancelled.is_set), pytest.raises(Cancelled):
        read_mesh(sphere)
    assert child.poll() is not None
    check_sphere(sphere)


def test_threads_read_in_turn(sphere: Path) -> None:
    threads = [threading.Thread(target=check_sphere, args=[sphere]) for _ in range(4)]
    failures: list[object] = []
    hook, threading.excepthook = threading.excepthook, failures.append
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        threading.excepthook = hook
    assert failures == []


def faces_of(path: Path) -> int:
    return len(read_mesh(path)[1])


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="the system has no fork")
def test_forked_children_read_by_processes_of_their_own(sphere: Path) -> None:
    expected = faces_of(sphere)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(faces_of, [sphere] * 4).get(timeout=120) == [expected] * 4
    assert faces_of(sphere) == expected


def test_a_mesh_without_faces_is_refused_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "points.vtp"
    pv.PolyData(np.zeros((3, 3), np.float32)).save(path)
    with pytest.raises(InvalidMesh, match=r"points.vtp.*no faces"):
        read_mesh(path)
