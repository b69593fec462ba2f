"""Checks of Python, the required packages and the Warp devices."""

import os
import platform
import sys
from collections.abc import Callable
from importlib import metadata

from decals.apps.doctor.finding import Finding, Status, last_line

PACKAGES = ("numpy", "scipy", "warp-lang", "moderngl", "pyvista", "vtk")
OLDEST_PYTHON = (3, 11)


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
    except Exception as error:  # a broken installation can raise any exception
        advice = f"Run: {sys.executable} -m pip install --force-reinstall warp-lang"
        return Finding("Warp devices", f"none: {last_line(str(error))}", Status.MISSING, advice)
