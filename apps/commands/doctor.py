"""``implicit-decals doctor``: check the software and hardware of this machine, and give advice."""

import errno
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from importlib import metadata
from pathlib import Path
from tempfile import TemporaryFile

from rich.console import Console
from rich.table import Table
from rich.text import Text

from blobtree.errors import UnusableCache
from blobtree.graphics import GL_LIBRARIES, install_advice, missing_gl_libraries

PACKAGES = ("numpy", "scipy", "warp-lang", "moderngl", "pyvista", "vtk")
OLDEST_PYTHON = (3, 11)
SAMPLES = ("dragon.ply", "horse.vtp")
OLDEST_GL = 330
CACHE_BYTES = 8_000_000
"""Space that compiled kernels need at first."""
PROBE = (sys.executable, "-m", "decals.apps.gl_probe")
PROBE_SECONDS = 60.0
DRIVER_ADVICE = (
    "Update the graphics driver. Without a graphics card, Mesa draws in software: on Debian or Ubuntu, run "
    "as root: apt-get install --no-install-recommends libegl-mesa0 libgl1-mesa-dri"
)


class Status(Enum):
    """Severity of a finding."""

    GOOD = "good"
    NOTE = "note"  # drawing works without it
    MISSING = "missing"  # drawing does not work without it


@dataclass(frozen=True)
class Finding:
    """The result of one check.

    Parameters
    ----------
    name
        Subject of the check.
    value
        Result, in a few words.
    status
        Severity.
    advice
        What to do; empty if nothing needs to be done.
    """

    name: str
    value: str
    status: Status = Status.GOOD
    advice: str = ""


def last_line(text: str) -> str:
    """Return the last line of a program's output, which usually holds the error."""
    lines = text.strip().splitlines()
    return lines[-1] if lines else "no output"


def python_finding(version: tuple[int, ...] = tuple(sys.version_info[:3])) -> Finding:
    """Check the version of Python."""
    text = ".".join(map(str, version))
    if version >= OLDEST_PYTHON:
        return Finding("Python", text)
    oldest = ".".join(map(str, OLDEST_PYTHON))
    return Finding("Python", text, Status.MISSING, f"Create the environment with Python {oldest} or newer.")


def platform_finding() -> Finding:
    """Describe the system and the number of cores."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return Finding("Platform", f"{platform.platform()}, {cores} cores")


def package_findings(version: Callable[[str], str] = metadata.version) -> list[Finding]:
    """Check that the required packages are installed.

    Parameters
    ----------
    version
        Returns the version of an installed package, or raises `importlib.metadata.PackageNotFoundError`.
    """
    return [_package_finding(name, version) for name in PACKAGES]


def _package_finding(name: str, version: Callable[[str], str]) -> Finding:
    try:
        return Finding(name, version(name))
    except metadata.PackageNotFoundError:
        return Finding(name, "not installed", Status.MISSING, f"Run: {sys.executable} -m pip install {name}")


def warp_devices() -> list[str]:
    """Return the devices that Warp computes on."""
    import warp as wp

    from blobtree.device import start_warp

    start_warp()
    return [f"{device.alias} ({device.name})" for device in wp.get_devices()]


def warp_finding(devices: Callable[[], list[str]] = warp_devices) -> Finding:
    """Check that Warp starts, and list its devices.

    Parameters
    ----------
    devices
        Returns the devices; raises any exception if Warp does not work.
    """
    try:
        return Finding("Warp devices", ", ".join(devices()))
    except UnusableCache as error:
        return Finding("Warp devices", "none without a kernel cache", Status.MISSING, f"{error}.")
    except Exception as error:  # a broken installation can raise any exception
        advice = f"Run: {sys.executable} -m pip install --force-reinstall warp-lang"
        return Finding("Warp devices", f"none: {last_line(str(error))}", Status.MISSING, advice)


def cache_finding() -> Finding:
    """Check that compiled kernels can be kept, and name their folder."""
    try:
        from blobtree.device import start_warp
        from blobtree.kernels import kernel_cache

        start_warp()
    except Exception:  # `warp_finding` reports it
        return Finding("Kernel cache", "unknown, as Warp does not start", Status.NOTE)
    folder = kernel_cache()
    elsewhere = "the environment variable WARP_CACHE_PATH to a folder"
    try:
        with TemporaryFile(dir=folder) as file:
            file.write(bytes(CACHE_BYTES))
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            value, advice = "the disk is full", f"Free space there, or set {elsewhere} on another disk."
        else:
            value, advice = "it cannot be written", f"Set {elsewhere} that can be written."
        return Finding("Kernel cache", f"{folder}: {value}", Status.MISSING, advice)
    return Finding("Kernel cache", str(folder))


def library_finding(missing: list[str]) -> Finding:
    """Return a finding about the system libraries of OpenGL.

    Parameters
    ----------
    missing
        Names of the libraries that cannot be loaded.
    """
    if missing:
        value = f"{', '.join(missing)} cannot be loaded"
        return Finding("OpenGL libraries", value, Status.MISSING, install_advice(missing))
    value = ", ".join(GL_LIBRARIES) if sys.platform.startswith("linux") else "part of the system"
    return Finding("OpenGL libraries", value)


def context_findings(probe: Iterable[str] = PROBE) -> list[Finding]:
    """Create an OpenGL context in another process, which a faulty driver may crash, and return findings.

    Parameters
    ----------
    probe
        The command that prints what `decals.apps.gl_probe.describe` returns.
    """
    try:
        ran = subprocess.run(
            [*probe], capture_output=True, text=True, errors="replace", timeout=PROBE_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return [Finding("OpenGL context", f"none: {error}", Status.MISSING, DRIVER_ADVICE)]
    if ran.returncode:
        return [Finding("OpenGL context", f"none: {_failure(ran)}", Status.MISSING, DRIVER_ADVICE)]
    try:
        return describe_context(json.loads(ran.stdout.splitlines()[-1]))
    except (LookupError, TypeError, ValueError):
        value = f"none: unreadable answer {last_line(ran.stdout)!r}"
        return [Finding("OpenGL context", value, Status.MISSING, DRIVER_ADVICE)]


def _failure(ran: subprocess.CompletedProcess[str]) -> str:
    if ran.returncode < 0:
        return f"the driver crashed (signal {-ran.returncode})"
    return last_line(ran.stderr)


def describe_context(context: Mapping[str, str | int]) -> list[Finding]:
    """Convert the description that the probe printed to findings.

    Parameters
    ----------
    context
        The result of `decals.apps.gl_probe.describe`.
    """
    code, glsl = int(context["code"]), int(context["glsl"])
    versions = f"OpenGL {code // 100}.{code % 100 // 10}"
    versions += f", GLSL {glsl // 100}.{glsl % 100:02}" if glsl else ", GLSL older than 3.30"
    driver = Finding("OpenGL driver", f"{context['renderer']}, {context['vendor']}, {context['version']}")
    if min(code, glsl) >= OLDEST_GL:
        return [driver, Finding("OpenGL 3.3, GLSL 3.30", versions)]
    return [driver, Finding("OpenGL 3.3, GLSL 3.30", versions, Status.MISSING, DRIVER_ADVICE)]


def sample_finding(environment: Mapping[str, str] = os.environ) -> Finding:
    """Look for the sample meshes in the folder ``PYVISTA_DATA`` and in pyvista's cache.

    Parameters
    ----------
    environment
        The environment variables of the process.
    """
    folders = [*_data_folder(environment), *_download_folder()]
    absent = [name for name in SAMPLES if not any((folder / name).is_file() for folder in folders)]
    if not absent:
        return Finding("Sample meshes", ", ".join(SAMPLES))
    if "PYVISTA_DATA" in environment:
        value = f"PYVISTA_DATA is {environment['PYVISTA_DATA']}, which lacks {', '.join(absent)}"
        advice = "Set PYVISTA_DATA to a folder that has these files in Data/, or unset it to download them."
        return Finding("Sample meshes", value, Status.NOTE, advice)
    advice = (
        "pyvista downloads them on first use. Without a network, set PYVISTA_DATA to a folder that has these "
        "files in Data/."
    )
    return Finding("Sample meshes", f"not downloaded yet: {', '.join(absent)}", Status.NOTE, advice)


def _data_folder(environment: Mapping[str, str]) -> list[Path]:
    if "PYVISTA_DATA" not in environment:
        return []
    folder = Path(environment["PYVISTA_DATA"])
    return [folder if folder.name == "Data" else folder / "Data"]


def _download_folder() -> list[Path]:
    try:
        from pyvista.examples import downloads
    except Exception:  # `package_findings` reports a pyvista that fails to import
        return []
    return [Path(downloads.USER_DATA_PATH)]


def examine() -> list[Finding]:
    """Run all checks."""
    missing = missing_gl_libraries()
    return [
        python_finding(),
        platform_finding(),
        *package_findings(),
        warp_finding(),
        cache_finding(),
        library_finding(missing),
        *([] if missing else context_findings()),
        sample_finding(),
    ]


def report(findings: list[Finding], console: Console) -> int:
    """Print the findings, then the advice.

    Parameters
    ----------
    findings
        The result of `examine`.
    console
        The console to print on.

    Returns
    -------
    int
        The exit code: 0 if nothing that drawing needs is missing, else 1.
    """
    styles = {Status.GOOD: "green", Status.NOTE: "yellow", Status.MISSING: "bold red"}
    table = Table("", "", "", show_header=False, box=None, padding=(0, 2, 0, 0))
    for finding in findings:
        style = styles[finding.status]
        table.add_row(Text(finding.name), Text(finding.value), Text(finding.status.value, style))
    console.print(table)
    for finding in findings:
        if finding.advice:
            console.print(
                f"\n{finding.name}: {finding.advice}", markup=False, highlight=False, soft_wrap=True
            )
    missing = [finding.name for finding in findings if finding.status is Status.MISSING]
    verdict = f"Missing: {', '.join(missing)}." if missing else "Everything that drawing needs is installed."
    console.print(f"\n{verdict}", markup=False, highlight=False)
    return 1 if missing else 0


def doctor() -> int:
    """Check the software and hardware of this machine, and print advice.

    Returns
    -------
    int
        The exit code: 0 if nothing that drawing needs is missing, else 1.
    """
    return report(examine(), Console())
