"""Warp kernels: how they are compiled, where they are kept, and how they are loaded.

Warp compiles all kernels of a file at the first launch of one of them, and keeps the result in its kernel
cache on disk, under a hash of the source. `loaded` does more than that:

* Kernels that were compiled ahead of time lie in the installed package (`SHIPPED`). They are copied to the
  cache. Their names hold Warp's version and the hash, so kernels of other sources are never taken.
* Where there are none, the files of all kernels that an operation names (`load_together`) compile at the same
  time, one per core, and report their progress.
* Processes that start together share the work: each file of kernels is compiled by one of them.
* A damaged file of the cache is removed, and its kernels are compiled again: `_seal` keeps its checksum.
* Warp's own headers are parsed once per machine, not once per thread of every process (`_kept_headers`).
"""

import hashlib
import logging
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import warp as wp

from blobtree.errors import UnusableCache
from blobtree.file_lock import FileLock
from blobtree.files import replacing, write_atomically
from blobtree.progress import Progress, reporting

KERNEL_OPTIONS: dict[str, Any] = {
    "enable_backward": False,
    "max_unroll": 4,
    "cpu_compiler_flags": "-mllvm=-inline-threshold=1000",
}
"""Options for `wp.set_module_options`: no adjoint code, no unrolling of long loops, code for any processor.

Kernels that call whole formulas in unrolled loops compile several times as long, and run no faster. The same
holds for functions that are inlined beyond this threshold; below it, kernels run slower. Code for the
instruction set of one processor runs no faster either, and could not be shipped to others.
"""

wp.set_module_options({**KERNEL_OPTIONS, "block_dim": 1})  # as of all modules loaded for processors

SHIPPED = Path(__file__).with_name("compiled")
"""Folder of kernels compiled ahead of time: ``<Warp version>/<module and hash>/``, as in Warp's cache."""

HEADERS = "headers"
"""Folder of the kernel cache for Warp's parsed headers, 5 MB."""

COMPILED = (".o", ".ptx", ".cubin", ".meta", ".pch")
"""Suffixes of files whose checksums are kept."""

CHECKSUM = ".checksum"
"""Suffix of these checksums, after the name of the file."""

CUDA_BLOCK = 256
"""Threads of a block, where a module of kernels sets no other number; Warp's default."""

LOCK_INTERVAL = 0.05
"""Seconds between looks at kernels that another process compiles."""

COMPILING = "compiling kernels for this machine (once)"
"""Stage of progress reports; the number of compiled files of kernels follows, as in ``": 3 of 11"``."""

_logger = logging.getLogger(__name__)


class NotCompiled(Exception):
    """Kernels are needed that are not compiled yet, within `without_compiling`."""


class _Refusal(threading.local):
    """What this thread may do: it must not compile while ``active``."""

    active = False


_refusal = _Refusal()


@contextmanager
def without_compiling() -> Iterator[None]:
    """Within a ``with`` block, raise `NotCompiled` in place of compiling kernels in this thread."""
    before, _refusal.active = _refusal.active, True
    try:
        yield
    finally:
        _refusal.active = before


class _State:
    """What this process has loaded and compiled."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.loaded: dict[tuple[str, str], bytes] = {}
        self.compiled = 0


_state = _State()


def _renew_lock() -> None:
    """In a forked child: the parent's lock may be held by a thread that the child does not have."""
    _state.lock = threading.RLock()


if hasattr(os, "register_at_fork"):  # not on Windows, which has no fork
    os.register_at_fork(after_in_child=_renew_lock)


def kernel_cache() -> Path:
    """Return the folder in which Warp keeps compiled kernels; Warp must have been started."""
    return Path(str(wp.config.kernel_cache_dir))


def loaded(kernel: wp.Kernel, device: Any = None) -> wp.Kernel:
    """Return `kernel`, once it is compiled and loaded on `device`.

    Raises
    ------
    UnusableCache
        The kernel cache cannot be written.
    """
    load_together([kernel], device)
    return kernel


def load_together(kernels: Iterable[wp.Kernel], device: Any = None) -> None:
    """Load kernels on `device`; those to compile are compiled at the same time, one file of them per core.

    Long work names the kernels that it is sure to launch, those that compile longest first. All other files
    of kernels compile at their first launch.

    Raises
    ------
    UnusableCache
        The kernel cache cannot be written.
    NotCompiled
        Some are to compile, and this thread may not.
    """
    warp_device = wp.get_device(device)
    modules = {kernel.module.name: kernel.module for kernel in kernels}
    unloaded = [module for module in modules.values() if not _is_loaded(module, warp_device)]
    if not unloaded:
        return
    if not _state.lock.acquire(blocking=not _refusal.active):
        raise NotCompiled
    try:
        missing = [module for module in unloaded if not _is_cached(module, warp_device)]
        if missing and _refusal.active:
            raise NotCompiled
        if missing:
            _compile(missing, warp_device)
        for module in unloaded:
            _load(module, warp_device)
            _state.loaded[module.name, str(warp_device)] = _module_hash(module, warp_device)
    finally:
        _state.lock.release()


def _is_loaded(module: wp.Module, device: wp.Device) -> bool:
    return _state.loaded.get((module.name, str(device))) == _module_hash(module, device)


def _block_size(module: wp.Module, device: wp.Device) -> int:
    """Return the block size of a launch, which is part of the hash of a module."""
    return 1 if device.is_cpu else module.options["block_dim"] or CUDA_BLOCK


def _module_hash(module: wp.Module, device: wp.Device) -> bytes:
    return bytes(module.get_module_hash(_block_size(module, device)))


def _folder_name(module: wp.Module, device: wp.Device) -> str:
    return str(module.get_module_identifier(_block_size(module, device)))


def _is_cached(module: wp.Module, device: wp.Device) -> bool:
    """Return True if the cache has the kernels of `module`, after those of the package were copied there."""
    folder = kernel_cache() / _folder_name(module, device)
    suffixes = (".o",) if device.is_cpu else (".ptx", ".cubin")
    if not _has_file(folder, suffixes):
        _copy_shipped(folder)
    return _has_file(folder, suffixes)


def _has_file(folder: Path, suffixes: tuple[str, ...]) -> bool:
    return folder.is_dir() and any(file.suffix in suffixes for file in folder.iterdir())


def _copy_shipped(folder: Path) -> None:
    """Copy the shipped kernels that belong into this folder of the cache; other processes may too."""
    shipped = SHIPPED / wp.config.version / folder.name
    if not shipped.is_dir():
        return
    with _cache_errors():
        folder.mkdir(parents=True, exist_ok=True)
        for file in shipped.iterdir():
            write_atomically(folder / file.name, file.read_bytes())
        _seal(folder)


def _seal(folder: Path) -> None:
    """Keep the checksums of the compiled files of a folder, if it can be written."""
    for file in _compiled_files(folder):
        sealed = file.with_name(f"{file.name}{CHECKSUM}")
        if not sealed.exists() or sealed.stat().st_mtime_ns < file.stat().st_mtime_ns:
            with suppress(OSError):
                write_atomically(sealed, _checksum(file))


def _damaged(folder: Path) -> list[Path]:
    """Return the compiled files of a folder that differ from their checksums.

    Warp and LLVM load some damaged files, such as those full of zeros after a power cut.
    """
    sealed = ((file, file.with_name(f"{file.name}{CHECKSUM}")) for file in _compiled_files(folder))
    return [file for file, sums in sealed if sums.exists() and sums.read_bytes() != _checksum(file)]


def _compiled_files(folder: Path) -> list[Path]:
    return [file for file in folder.iterdir() if file.suffix in COMPILED] if folder.is_dir() else []


def _checksum(file: Path) -> bytes:
    return hashlib.blake2b(file.read_bytes(), digest_size=16).hexdigest().encode()


def _load(module: wp.Module, device: wp.Device) -> None:
    """Load a module; remove it from the cache and compile it again if its files are damaged."""
    folder = kernel_cache() / _folder_name(module, device)
    with _cache_errors():
        if damaged := _damaged(folder):
            _remove(folder, damaged)
        was_cached = folder.is_dir()
        with nullcontext() if was_cached else _compiling(folder):
            try:
                wp.load_module(module, device=device)
            except Exception as error:  # Warp raises nothing more precise for a damaged file
                if not was_cached or isinstance(error, OSError):
                    raise
                _remove(folder, error)
                wp.load_module(module, device=device)
            _seal(folder)


def _remove(folder: Path, reason: object) -> None:
    """Remove damaged kernels from the cache; those of the package take their place."""
    _logger.info("removing damaged kernels from %s: %s", folder, reason)
    shutil.rmtree(folder)
    _copy_shipped(folder)


@contextmanager
def _compiling(folder: Path) -> Iterator[None]:
    """Within a ``with`` block, no other process fills this folder of the cache; wait for one that does."""
    lock_file = folder.with_name(f"{folder.name}.lock")
    lock_file.parent.mkdir(parents=True, exist_ok=True)
    while (lock := FileLock.acquire(lock_file)) is None:
        time.sleep(LOCK_INTERVAL)
    try:
        with nullcontext() if folder.is_dir() else _kept_headers():
            yield
    finally:
        lock.release()


@contextmanager
def _kept_headers() -> Iterator[None]:
    """Within a ``with`` block, kernels compile with Warp's parsed headers from the kernel cache.

    Warp parses its headers once per thread into a temporary folder, which takes two seconds. Warp itself
    removes a file there that is damaged or does not fit its headers; then the kept one is removed too. Each
    installation of Warp has its own files, because these name the folder of its headers. This function is a
    no-op for versions of Warp without such a folder.
    """
    folder_of_thread = getattr(wp._src.context.runtime, "get_clang_pch_dir", lambda: None)()
    if folder_of_thread is None:
        yield
        return
    kept, used = _headers_folder(), Path(folder_of_thread)
    for file in _damaged(kept):
        _unlink_header(file)
    _copy_newer(kept, used)
    yield
    for file in kept.glob("*.pch"):
        if not (used / file.name).exists():
            _unlink_header(file)
    _copy_newer(used, kept)
    _seal(kept)


def _unlink_header(file: Path) -> None:
    file.unlink(missing_ok=True)
    file.with_name(f"{file.name}{CHECKSUM}").unlink(missing_ok=True)


def _headers_folder() -> Path:
    """Return the folder of the headers that were parsed for this installation of Warp."""
    installation = hashlib.sha256(str(Path(wp.__file__).resolve().parent).encode()).hexdigest()[:12]
    return kernel_cache() / HEADERS / installation


@wp.kernel
def _no_operation() -> None:
    """Do nothing: to compile this kernel is to parse Warp's headers, with the options of all others."""


def _parse_headers() -> None:
    """Parse Warp's headers, if no parsed ones are kept, before several threads would each parse them."""
    if any(_headers_folder().glob("*.pch")):
        return
    with _cache_errors(), tempfile.TemporaryDirectory() as folder, _kept_headers():
        wp.compile_aot_module(_no_operation.module, device="cpu", module_dir=folder)


def _copy_newer(source: Path, target: Path) -> None:
    """Copy files that the other folder lacks or has in another version; other processes may do so too."""
    for file in source.glob("*.pch"):
        copy = target / file.name
        if copy.exists() and copy.stat().st_mtime_ns == file.stat().st_mtime_ns:
            continue
        target.mkdir(parents=True, exist_ok=True)
        with replacing(copy) as temporary:
            shutil.copy2(file, temporary)


def _compile(modules: list[wp.Module], device: wp.Device) -> None:
    """Compile and load modules at the same time, and report the progress."""
    total = _state.compiled + len(modules)
    with reporting() as report, ThreadPoolExecutor(os.cpu_count() or 1, "blobtree compiler") as threads:
        _report(report, total)
        if device.is_cpu and len(modules) > 1:
            _parse_headers()
        pending = {threads.submit(_load, module, device) for module in modules}
        while pending:
            done, pending = wait(pending, return_when=FIRST_COMPLETED)
            for future in done:
                future.result()
            _state.compiled += len(done)
            _report(report, total)


def _report(report: Progress, total: int) -> None:
    """Report how many files of kernels this process has compiled of those that it has to compile so far."""
    report(f"{COMPILING}: {_state.compiled} of {total}", _state.compiled / total)


@contextmanager
def _cache_errors() -> Iterator[None]:
    """Raise errors of the file system as `UnusableCache`."""
    try:
        yield
    except OSError as error:
        raise unusable_cache(error) from error


def unusable_cache(error: OSError) -> UnusableCache:
    """Return the exception for an error of the file system in the kernel cache."""
    folder = wp.config.kernel_cache_dir or os.environ.get("WARP_CACHE_PATH") or error.filename
    return UnusableCache(
        f"compiled kernels cannot be kept in {str(folder)!r} ({error.strerror}); "
        "set the environment variable WARP_CACHE_PATH to a folder that can be written, or free space there"
    )
