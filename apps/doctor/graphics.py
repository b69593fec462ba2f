"""Checks of the OpenGL libraries and the OpenGL context."""

import json
import subprocess
import sys
from collections.abc import Iterable, Mapping

from decals.apps.doctor.finding import Finding, Status, last_line
from decals.rendering.gl_libraries import GL_LIBRARIES, install_advice

OLDEST_GL = 330
PROBE = (sys.executable, "-m", "decals.apps.doctor.gl_probe")
PROBE_SECONDS = 60.0
DRIVER_ADVICE = (
    "Update the graphics driver. Without a graphics card, Mesa draws in software: on Debian or Ubuntu, run "
    "as root: apt-get install --no-install-recommends libegl-mesa0 libgl1-mesa-dri"
)


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
        The command that prints what `decals.apps.doctor.gl_probe.describe` returns.
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
        The result of `decals.apps.doctor.gl_probe.describe`.
    """
    code, glsl = int(context["code"]), int(context["glsl"])
    versions = f"OpenGL {code // 100}.{code % 100 // 10}"
    versions += f", GLSL {glsl // 100}.{glsl % 100:02}" if glsl else ", GLSL older than 3.30"
    driver = Finding("OpenGL driver", f"{context['renderer']}, {context['vendor']}, {context['version']}")
    if min(code, glsl) >= OLDEST_GL:
        return [driver, Finding("OpenGL 3.3, GLSL 3.30", versions)]
    return [driver, Finding("OpenGL 3.3, GLSL 3.30", versions, Status.MISSING, DRIVER_ADVICE)]
