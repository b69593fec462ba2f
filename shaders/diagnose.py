"""Turn a driver's complaint into one that names our files."""

import re
from collections.abc import Mapping

from decals.shaders.compose import ShaderError, Source

_COMPLAINTS = (
    re.compile(r"\d+:(?P<line>\d+)\(\d+\):\s*(?P<text>.*)"),  # Mesa       0:12(4): error: ...
    re.compile(r"\d+\((?P<line>\d+)\)\s*:\s*(?P<text>.*)"),  # NVIDIA     0(12) : error C1503: ...
    re.compile(r"(?P<kind>ERROR|WARNING):\s*\d+:(?P<line>\d+):\s*(?P<text>.*)"),  # Apple, Intel, AMD
)


class CompileError(ShaderError, RuntimeError):
    """The driver refused a composed shader; the message names file and line of every complaint."""


def compile_error(log: str, stages: Mapping[str, Source]) -> CompileError:
    """Make the exception for a driver's log.

    Parameters
    ----------
    log
        What the driver (or moderngl, which puts the stage's name above each part) said.
    stages
        The sources by stage name, such as ``vertex_shader`` and ``fragment_shader``. Complaints before any
        stage's name belong to the first.
    """
    source = next(iter(stages.values()))
    report = []
    for line in log.splitlines():
        source = stages.get(line.strip(), source)
        report.append(_explain(line, source))
    return CompileError("\n".join(report).strip())


def _explain(line: str, source: Source) -> str:
    for pattern in _COMPLAINTS:
        complaint = pattern.match(line.strip())
        if complaint is None:
            continue
        number = int(complaint["line"])
        origin = source.origin(number)
        if origin is None:
            return line
        kind = complaint.groupdict().get("kind")
        text = f"{kind.lower()}: {complaint['text']}" if kind else complaint["text"]
        return f"{origin}: {text}\n    {source.lines[number - 1].strip()}"
    return line
