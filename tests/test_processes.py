"""Models, decals and pictures in child processes of every start method, after first use in the parent."""

import multiprocessing
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from blobtree.graphics import install_advice, missing_gl_libraries

TIME_LIMIT = 120.0
"""Seconds after which a child counts as hung."""

KNOWN_METHODS = multiprocessing.get_all_start_methods()
START_METHODS = [
    "fork",
    pytest.param("spawn", marks=pytest.mark.slow),
    pytest.param("forkserver", marks=pytest.mark.slow),
]

SCRIPT = """
    import multiprocessing
    import sys

    import numpy as np

    import blobtree
    import decals
    from decals.surfaces import as_surface

    TREE = blobtree.Point((0, 0, 0), radius=1) + blobtree.Point((1, 0, 0), radius=1)

    def polygonize(number):
        return len(blobtree.polygonize(TREE, resolution=40 + number).faces)

    def raycast(number):
        heights = np.linspace(-1, 1, 2000)
        origins = np.stack([np.full(2000, 5.0), heights, np.full(2000, 0.1 * number)], axis=1)
        return float(np.nansum(as_surface(TREE).raycast(origins, np.tile([-1.0, 0.0, 0.0], (2000, 1)))))

    def scatter(number):
        return decals.scatter(TREE, count=40, seed=number).positions.sum(dtype=float)

    if __name__ == "__main__":
        jobs = (polygonize, raycast, scatter)
        expected = [[work(number) for number in range(2)] for work in jobs]
        with multiprocessing.get_context(sys.argv[1]).Pool(2) as pool:
            print([pool.map(work, range(2)) for work in jobs] == expected)
"""


def run_script(text: str, folder: Path, *arguments: str) -> str:
    """Run a script in a process of its own, within the time limit; return what it printed."""
    path = folder / "script.py"
    path.write_text(textwrap.dedent(text), encoding="utf-8")
    command = [sys.executable, str(path), *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True) as process:
        try:
            printed, _ = process.communicate(timeout=TIME_LIMIT)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            raise
    assert process.returncode == 0
    return printed


@pytest.mark.parametrize("method", START_METHODS)
def test_work_in_children_gives_the_results_of_the_parent(method: str, tmp_path: Path) -> None:
    if method not in KNOWN_METHODS:
        pytest.skip(f"the system has no {method}")
    assert run_script(SCRIPT, tmp_path, method) == "True\n"


@pytest.mark.skipif("fork" not in KNOWN_METHODS, reason="the system has no fork")
def test_a_fork_during_work_in_a_thread_does_not_hang(tmp_path: Path) -> None:
    """Also while another thread holds the lock under which kernels are registered."""
    text = """
        import multiprocessing
        import threading
        import time

        import blobtree
        from blobtree.tape import instruction_set

        def hold():
            with instruction_set.LOCK:
                held.set()
                time.sleep(1.0)

        def polygonize(number):
            with instruction_set.LOCK:
                return len(blobtree.polygonize(blobtree.Point((0, 0, 0), radius=1), resolution=20).faces)

        held = threading.Event()
        expected = polygonize(0)
        threading.Thread(target=hold).start()
        held.wait()
        with multiprocessing.get_context("fork").Pool(2) as pool:
            print(pool.map(polygonize, range(2)) == [expected] * 2)
    """
    assert run_script(text, tmp_path) == "True\n"


@pytest.mark.slow
@pytest.mark.skipif("fork" not in KNOWN_METHODS, reason="the system has no fork")
def test_drawing_after_a_fork_names_spawn(tmp_path: Path) -> None:
    """OpenGL does not survive a fork; a renderer of the parent and a new one both say so."""
    if missing := missing_gl_libraries():
        pytest.skip(f"no OpenGL here: {install_advice(missing)}")
    text = """
        import multiprocessing

        import blobtree
        import decals
        from decals.errors import NoGraphics
        from decals.rendering import Renderer, RenderOptions

        BALL = blobtree.Point((0, 0, 0), radius=1)
        SCENE = decals.cover(BALL, count=3)
        OPTIONS = RenderOptions(size=(16, 12), samples=1)

        def again(_):
            try:
                renderer.render(SCENE, OPTIONS)
            except NoGraphics as error:
                renderer.release()
                return str(error)

        def anew(_):
            try:
                decals.render(BALL, size=(16, 12), samples=1)
            except NoGraphics as error:
                return str(error)

        renderer = Renderer()
        renderer.render(SCENE, OPTIONS)
        with multiprocessing.get_context("fork").Pool(1) as pool:
            for work in (again, anew):
                (message,) = pool.map(work, [0])
                print('use spawn, as in multiprocessing.get_context("spawn")' in message)
        renderer.render(SCENE, OPTIONS)
        renderer.release()
    """
    assert run_script(text, tmp_path) == "True\nTrue\n"


@pytest.mark.skipif("fork" not in KNOWN_METHODS, reason="the system has no fork")
def test_a_cuda_device_after_a_fork_names_spawn(tmp_path: Path) -> None:
    """The device is a stand-in for one of CUDA, which this machine need not have."""
    text = """
        import multiprocessing
        from types import SimpleNamespace

        import warp as wp

        import blobtree
        from blobtree import device

        def resolve(name):
            get_device, wp.get_device = wp.get_device, lambda _: SimpleNamespace(is_cuda=True)
            try:
                return device.known_device(name)
            except blobtree.errors.InvalidDevice as error:
                return str(error)
            finally:
                wp.get_device = get_device

        with multiprocessing.get_context("fork").Pool(1) as pool:
            (before,) = pool.map(resolve, ["cuda:0"])
        device.start_warp()
        with multiprocessing.get_context("fork").Pool(1) as pool:
            (after,) = pool.map(resolve, ["cuda:0"])
            (cpu,) = pool.map(device.known_device, ["cpu"])
        print("use spawn" in before, "use spawn" in after, cpu)
    """
    assert run_script(text, tmp_path) == "False True cpu\n"
