"""What this machine has of what the project needs, and what to do about the rest."""

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

from rich.console import Console
from rich.table import Table
from rich.text import Text

from decals.render.libraries import GL_LIBRARIES, install_advice, missing_gl_libraries

PACKAGES = ("numpy", "scipy", "warp-lang", "moderngl", "pyvista", "vtk")
OLDEST_PYTHON = (3, 11)
OLDEST_GL = 330
PROBE = (sys.executable, "-m", "implicit_decals.apps.machine.gl_probe")
PROBE_SECONDS = 60.0
SAMPLES = ("dragon.ply", "horse.vtp")
DRIVER_ADVICE = (
    "Update the graphics driver. Without a graphics card, Mesa draws in software: on Debian or Ubuntu, run "
    "as root: apt-get install --no-install-recommends libegl-mesa0 libgl1-mesa-dri"
)


class Status(Enum):
    """How much a finding matters."""

    GOOD = "good"
    NOTE = "note"  # something to know; everything draws without it
    MISSING = "missing"  # nothing draws without it


@dataclass(frozen=True)
class Finding:
    """One line of the examination.

    Parameters
    ----------
    name
        What was looked at.
    value
        What is there, in a few words.
    status
        How much it matters.
    advice
        What to do about it; empty where there is nothing to do.
    """

    name: str
    value: str
    status: Status = Status.GOOD
    advice: str = ""


def python_finding(version: tuple[int, ...] = tuple(sys.version_info[:3])) -> Finding:
    """Look at the version of Python."""
    shown = ".".join(map(str, version))
    if version >= OLDEST_PYTHON:
        return Finding("Python", shown)
    oldest = ".".join(map(str, OLDEST_PYTHON))
    return Finding("Python", shown, Status.MISSING, f"Make the environment with Python {oldest} or newer.")


def platform_finding() -> Finding:
    """Name the system and the processor."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return Finding("Platform", f"{platform.platform()}, {cores} cores")


def package_findings(version: Callable[[str], str] = metadata.version) -> list[Finding]:
    """Look for the packages that computing and drawing stand on.

    Parameters
    ----------
    version
        Gives the version of an installed package, or raises `importlib.metadata.PackageNotFoundError`.
    """
    return [_package_finding(name, version) for name in PACKAGES]


def _package_finding(name: str, version: Callable[[str], str]) -> Finding:
    try:
        return Finding(name, version(name))
    except metadata.PackageNotFoundError:
        return Finding(name, "not installed", Status.MISSING, f"Run: {sys.executable} -m pip install {name}")


def warp_devices() -> list[str]:
    """Name the devices that Warp computes on."""
    import warp as wp

    import blobtree  # noqa: F401 -- it keeps Warp from printing while it starts

    return [f"{device.alias} ({device.name})" for device in wp.get_devices()]


def warp_finding(devices: Callable[[], list[str]] = warp_devices) -> Finding:
    """Ask Warp for its devices.

    Parameters
    ----------
    devices
        Names them; raises anything where Warp does not work.
    """
    try:
        return Finding("Warp devices", ", ".join(devices()))
    except Exception as error:  # a broken installation fails in any way it likes
        advice = f"Run: {sys.executable} -m pip install --force-reinstall warp-lang"
        return Finding("Warp devices", f"none: {_last_line(str(error))}", Status.MISSING, advice)


def library_finding(missing: list[str]) -> Finding:
    """Report the system libraries of OpenGL.

    Parameters
    ----------
    missing
        Those that cannot be loaded.
    """
    if missing:
        value = f"{', '.join(missing)} cannot be loaded"
        return Finding("OpenGL libraries", value, Status.MISSING, install_advice(missing))
    value = ", ".join(GL_LIBRARIES) if sys.platform.startswith("linux") else "part of the system"
    return Finding("OpenGL libraries", value)


def context_findings(probe: Iterable[str] = PROBE) -> list[Finding]:
    """Make an OpenGL context in another process, which a bad driver may crash, and report it.

    Parameters
    ----------
    probe
        The command that prints what `implicit_decals.apps.machine.gl_probe.describe` returns.
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
        value = f"none: unreadable answer {_last_line(ran.stdout)!r}"
        return [Finding("OpenGL context", value, Status.MISSING, DRIVER_ADVICE)]


def _failure(ran: subprocess.CompletedProcess[str]) -> str:
    if ran.returncode < 0:
        return f"the driver crashed (signal {-ran.returncode})"
    return _last_line(ran.stderr)


def describe_context(context: Mapping[str, str | int]) -> list[Finding]:
    """Turn what the probe found into findings.

    Parameters
    ----------
    context
        As `implicit_decals.apps.machine.gl_probe.describe` returns it.
    """
    code, glsl = int(context["code"]), int(context["glsl"])
    shown = f"OpenGL {code // 100}.{code % 100 // 10}"
    shown += f", GLSL {glsl // 100}.{glsl % 100:02}" if glsl else ", GLSL older than 3.30"
    driver = Finding("OpenGL driver", f"{context['renderer']}, {context['vendor']}, {context['version']}")
    if min(code, glsl) >= OLDEST_GL:
        return [driver, Finding("OpenGL 3.3, GLSL 3.30", shown)]
    return [driver, Finding("OpenGL 3.3, GLSL 3.30", shown, Status.MISSING, DRIVER_ADVICE)]


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1] if lines else "it says nothing"


def sample_finding(environment: Mapping[str, str] = os.environ) -> Finding:
    """Look for the sample meshes, in the folder that ``PYVISTA_DATA`` names and among those downloaded.

    Parameters
    ----------
    environment
        The variables of the process.
    """
    folders = [*_data_folder(environment), *_download_folder()]
    absent = [name for name in SAMPLES if not any((folder / name).is_file() for folder in folders)]
    if not absent:
        return Finding("Sample meshes", ", ".join(SAMPLES))
    if "PYVISTA_DATA" in environment:
        value = f"PYVISTA_DATA is {environment['PYVISTA_DATA']}, which lacks {', '.join(absent)}"
        advice = "Name a folder that has them in its folder Data, or unset PYVISTA_DATA to download them."
        return Finding("Sample meshes", value, Status.NOTE, advice)
    advice = (
        "pyvista downloads them when they are first asked for. Without a network, set PYVISTA_DATA to a "
        "folder that has them in its folder Data."
    )
    return Finding("Sample meshes", f"not here yet: {', '.join(absent)}", Status.NOTE, advice)


def _data_folder(environment: Mapping[str, str]) -> list[Path]:
    if "PYVISTA_DATA" not in environment:
        return []
    folder = Path(environment["PYVISTA_DATA"])
    return [folder if folder.name == "Data" else folder / "Data"]


def _download_folder() -> list[Path]:
    try:
        from pyvista.examples import downloads
    except Exception:  # reported as a package already
        return []
    return [Path(downloads.USER_DATA_PATH)]


def examine() -> list[Finding]:
    """Look at everything."""
    missing = missing_gl_libraries()
    return [
        python_finding(),
        platform_finding(),
        *package_findings(),
        warp_finding(),
        library_finding(missing),
        *([] if missing else context_findings()),
        sample_finding(),
    ]


def report(findings: list[Finding], console: Console) -> int:
    """Print the findings, then what to do.

    Parameters
    ----------
    findings
        What `examine` returned.
    console
        Where to print.

    Returns
    -------
    int
        The exit code: 0 if everything that drawing needs is here, else 1.
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
    lacking = [finding.name for finding in findings if finding.status is Status.MISSING]
    verdict = f"Missing: {', '.join(lacking)}." if lacking else "Everything that drawing needs is here."
    console.print(f"\n{verdict}", markup=False, highlight=False)
    return 1 if lacking else 0


def doctor() -> int:
    """Say what is here of what the project needs, and what to do about the rest.

    Returns
    -------
    int
        The exit code: 0 if everything that drawing needs is here, else 1.
    """
    return report(examine(), Console())
