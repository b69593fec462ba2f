"""Command lines exactly as they must be typed in the shell from which this program was called."""

import os
import shlex
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

COMMAND = "implicit-decals"

# Path of the activation script below an environment, and the line that runs it.
_ACTIVATION = {
    "sh": ("bin/activate", ". {}"),
    "fish": ("bin/activate.fish", "source {}"),
    "csh": ("bin/activate.csh", "source {}"),
    "pwsh": ("bin/Activate.ps1", "& {}"),
    "sh on Windows": ("Scripts/activate", ". {}"),
    "powershell": ("Scripts/Activate.ps1", "& {}"),
    "cmd": ("Scripts/activate.bat", "{}"),
}
_SHELLS = {
    "bash": "sh",
    "zsh": "sh",
    "ksh": "sh",
    "fish": "fish",
    "csh": "csh",
    "tcsh": "csh",
    "pwsh": "pwsh",
}
"""The kind of each shell. Plain sh is left out: it often stands between a shell and a program."""


def command_lines(commands: Sequence[str]) -> list[str]:
    """Return the lines to type in order to run commands of ``implicit-decals``.

    If the shell does not find the program of this environment, a line that activates the environment comes
    first. Without an activation script, or in an unknown shell, each command begins with its full path.

    Parameters
    ----------
    commands : sequence of str
        Commands with their arguments, such as ``"render knot -o knot.png"``.

    Returns
    -------
    list of str
    """
    if _is_on_path():
        return [f"{COMMAND} {command}" for command in commands]
    shell = find_shell(os.environ, windows=sys.platform == "win32")
    if shell is not None:
        script, line = _ACTIVATION[shell]
        path = Path(sys.prefix, script)
        if path.is_file():
            return [line.format(_quote(path, shell)), *(f"{COMMAND} {command}" for command in commands)]
    python = _quote(Path(sys.executable), shell)
    return [f"{python} -m decals {command}" for command in commands]


def find_shell(environment: Mapping[str, str], *, windows: bool) -> str | None:
    """Return the kind of the shell that called this program; None if it is uncertain.

    Parameters
    ----------
    environment : mapping of str to str
        The environment variables of the process.
    windows : bool
        True on Windows.
    """
    if not windows:
        names = [*_ancestors(), Path(environment.get("SHELL", "")).name]
        return next((_SHELLS[name] for name in names if name in _SHELLS), "sh")
    if "MSYSTEM" in environment:
        return "sh on Windows"
    # cmd sets PROMPT for its children. PowerShell adds a folder of the user to PSModulePath.
    home = environment.get("USERPROFILE", "").lower()
    folders = environment.get("PSModulePath", "").lower().split(";")
    powershell = bool(home) and any(folder.startswith(home) for folder in folders)
    cmd = "PROMPT" in environment
    if powershell == cmd:  # one of the two was started from the other
        return None
    return "powershell" if powershell else "cmd"


def _ancestors() -> list[str]:
    """Return the names of the processes above this one, nearest first; empty where there is no ``/proc``."""
    names: list[str] = []
    number = os.getppid()
    while number > 0:
        try:
            record = Path(f"/proc/{number}/stat").read_text(encoding="utf-8", errors="replace")
        except OSError:
            break
        name, _, fields = record.partition("(")[2].rpartition(")")
        names.append(name)
        number = int(fields.split()[1])
    return names


def _is_on_path() -> bool:
    """Return True if the shell finds the program of this environment."""
    found = shutil.which(COMMAND)
    called = Path(sys.argv[0])
    scripts = {Path(sys.executable).parent.resolve()}
    if called.stem == COMMAND:  # pip install --user writes the program into another folder than Python's
        scripts.add(called.resolve().parent)
    return found is not None and Path(found).resolve().parent in scripts


def _quote(path: Path, shell: str | None) -> str:
    """Return a path as a word of the shell: relative to the current folder if it lies inside."""
    text = str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
    if shell in ("cmd", "powershell", None):
        return f'"{text}"' if " " in text else text
    return shlex.quote(text)
