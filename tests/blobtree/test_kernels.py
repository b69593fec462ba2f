"""Kernels are compiled once, taken from the package if they fit, and compiled again if a file is damaged."""

import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import warp as wp

import blobtree.kernels as kernels
from blobtree.device import start_warp
from blobtree.errors import UnusableCache
from blobtree.file_lock import FileLock
from blobtree.kernels import (
    CHECKSUM,
    COMPILING,
    HEADERS,
    KERNEL_OPTIONS,
    NotCompiled,
    loaded,
    without_compiling,
)
from blobtree.progress import reporting

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def _double(values: wp.array(dtype=wp.float32)):  # type: ignore[no-untyped-def, valid-type]
    i = wp.tid()
    values[i] = 2.0 * values[i]


@contextmanager
def _cache_in(folder: Path) -> Iterator[Path]:
    """Within a ``with`` block, an empty kernel cache, no parsed headers, and no shipped kernels."""
    start_warp()
    headers: dict[int, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wp._src.context.runtime, "_pch_dirs", headers)
        patch.setattr(wp.config, "kernel_cache_dir", str(folder / "cache"))
        patch.setattr(kernels, "SHIPPED", folder / "shipped")
        _forget()
        yield folder / "cache"
        _forget()
    for used in headers.values():
        used.cleanup()


@pytest.fixture
def empty_cache(tmp_path: Path) -> Iterator[Path]:
    with _cache_in(tmp_path) as folder:
        yield folder


@pytest.fixture(scope="module")
def parsed_headers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with _cache_in(tmp_path_factory.mktemp("headers")) as folder:
        kernels._parse_headers()
        return folder / HEADERS


@pytest.fixture
def cache(empty_cache: Path, parsed_headers: Path) -> Path:
    """A kernel cache that holds parsed headers alone."""
    shutil.copytree(parsed_headers, empty_cache / HEADERS)
    return empty_cache


def _forget() -> None:
    _double.module.unload()
    kernels._state.loaded.clear()


def _doubled() -> list[float]:
    values: wp.array[wp.float32] = wp.array(np.array([1.0, 2.5], np.float32), device="cpu")
    wp.launch(loaded(_double, "cpu"), dim=2, inputs=[values], device="cpu")
    return [float(value) for value in values.numpy()]


def _object_file(cache: Path) -> Path:
    (file,) = cache.glob(f"wp_{_double.module.name}_*/*.o")
    return file


def test_a_second_process_would_compile_nothing(cache: Path) -> None:
    stages: list[str] = []
    with reporting(lambda stage, _fraction: stages.append(stage)):
        assert _doubled() == [2.0, 5.0]
        before = kernels._state.compiled
        assert stages == [f"{COMPILING}: {done} of {before}" for done in (before - 1, before)]
        written = _object_file(cache).stat().st_mtime_ns
        _forget()
        assert _doubled() == [2.0, 5.0]
    assert len(stages) == 2
    assert _object_file(cache).stat().st_mtime_ns == written
    assert kernels._state.compiled == before


def test_kernels_that_another_process_compiles_are_awaited(cache: Path) -> None:
    _doubled()
    _forget()
    folder, elsewhere = _object_file(cache).parent, cache / "elsewhere"
    written = _object_file(cache).stat().st_mtime_ns
    folder.rename(elsewhere)
    lock = FileLock.acquire(folder.with_name(f"{folder.name}.lock"))
    assert lock is not None
    with ThreadPoolExecutor(1) as thread:
        waiting = thread.submit(_doubled)
        assert not wait([waiting], timeout=0.3).done
        elsewhere.rename(folder)
        lock.release()
        assert waiting.result() == [2.0, 5.0]
    assert _object_file(cache).stat().st_mtime_ns == written
    assert not list(cache.glob("*.lock"))


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda whole: b"",
    "nearly whole": lambda whole: whole[: int(0.9 * len(whole))],
    "zeros": lambda whole: bytes(len(whole)),
    "no symbols": lambda whole: whole[:-600] + bytes(600),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_object_file_is_compiled_again_without_a_word(
    cache: Path, capfd: pytest.CaptureFixture[str], damage: Callable[[bytes], bytes]
) -> None:
    _doubled()
    file = _object_file(cache)
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    _forget()
    capfd.readouterr()
    assert _doubled() == [2.0, 5.0]
    assert _object_file(cache).read_bytes() == whole
    assert capfd.readouterr().err == ""


def test_a_damaged_description_is_compiled_again(cache: Path) -> None:
    _doubled()
    (meta,) = cache.glob("*/*.meta")
    meta.write_text("{")
    _forget()
    assert _doubled() == [2.0, 5.0]


def test_shipped_kernels_are_copied_and_not_compiled(cache: Path) -> None:
    _doubled()
    shipped = kernels.SHIPPED / str(wp.config.version)
    shipped.parent.mkdir()
    cache.rename(shipped)
    _forget()
    before = kernels._state.compiled
    assert _doubled() == [2.0, 5.0]
    assert kernels._state.compiled == before
    assert _object_file(cache).read_bytes() == _object_file(shipped).read_bytes()


def test_shipped_kernels_of_another_version_of_warp_are_left(cache: Path) -> None:
    _doubled()
    shipped = kernels.SHIPPED / "1.0.0"
    shipped.parent.mkdir()
    cache.rename(shipped)
    shutil.copytree(shipped / HEADERS, cache / HEADERS)
    _forget()
    before = kernels._state.compiled
    assert _doubled() == [2.0, 5.0]
    assert kernels._state.compiled == before + 1


def test_a_cache_that_cannot_be_written_is_named(empty_cache: Path) -> None:
    empty_cache.write_text("a file, where a folder should be")
    with pytest.raises(UnusableCache, match="set the environment variable WARP_CACHE_PATH") as raised:
        _doubled()
    assert repr(str(empty_cache)) in str(raised.value)


def test_headers_are_parsed_once_per_machine(empty_cache: Path) -> None:
    _doubled()
    (kept,) = (empty_cache / HEADERS).glob("*/*.pch")
    parsed = kept.stat().st_mtime_ns

    def compile_in_thread() -> None:
        with kernels._kept_headers():
            (used,) = Path(cast(Any, wp._src.context.runtime).get_clang_pch_dir()).glob("*.pch")
            assert used.read_bytes() == kept.read_bytes()

    with ThreadPoolExecutor(1) as thread:
        thread.submit(compile_in_thread).result()
    assert kept.stat().st_mtime_ns == parsed


def test_files_of_kernels_that_compile_together_share_parsed_headers(cache: Path) -> None:
    """Headers parsed with other options, such as another size of blocks, would be parsed again."""
    (kept,) = (cache / HEADERS).glob("*/*.pch")
    parsed = kept.stat().st_mtime_ns
    with ThreadPoolExecutor(1) as thread:
        assert thread.submit(_doubled).result() == [2.0, 5.0]
    assert [file.stat().st_mtime_ns for file in (cache / HEADERS).glob("*/*.pch")] == [parsed]
    with ThreadPoolExecutor(1) as thread:
        thread.submit(kernels._parse_headers).result()
    assert kept.stat().st_mtime_ns == parsed


@pytest.mark.slow
def test_damaged_headers_are_replaced(cache: Path, capfd: pytest.CaptureFixture[str]) -> None:
    _doubled()
    (kept,) = (cache / HEADERS).glob("*/*.pch")
    whole = kept.read_bytes()
    kept.write_bytes(whole[:1000])
    shutil.rmtree(_object_file(cache).parent)
    _forget()
    capfd.readouterr()
    with ThreadPoolExecutor(1) as thread:
        assert thread.submit(_doubled).result() == [2.0, 5.0]
        shutil.rmtree(_object_file(cache).parent)
        _forget()
        assert thread.submit(_doubled).result() == [2.0, 5.0]
    assert capfd.readouterr().err == ""
    assert kept.stat().st_size > len(whole) / 2


def test_each_installation_of_warp_has_its_own_headers(
    cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Headers parsed for another folder do not compile, with thousands of lines of errors."""
    (kept,) = (cache / HEADERS).iterdir()
    with kernels._kept_headers():
        pass
    monkeypatch.setattr(wp, "__file__", str(tmp_path / "warp" / "__init__.py"))
    with kernels._kept_headers():
        pass
    (other,) = {*(cache / HEADERS).iterdir()} - {kept}
    assert {file.suffix for folder in (kept, other) for file in folder.iterdir()} == {".pch", CHECKSUM}


def test_a_thread_that_may_not_compile_raises_and_loads_what_others_compiled(cache: Path) -> None:
    with pytest.raises(NotCompiled), without_compiling():
        _doubled()
    _doubled()
    _forget()
    with without_compiling():
        assert _doubled() == [2.0, 5.0]
    _forget()
    with ThreadPoolExecutor(1) as other, kernels._state.lock, pytest.raises(NotCompiled):
        other.submit(_refused).result()


def _refused() -> None:
    with without_compiling():  # does not wait for a thread that compiles
        _doubled()
