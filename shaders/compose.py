"""Shaders are files with named slots; a composed text knows where each of its lines came from.

Two directives, each on a line of its own:

    //@ include camera.glsl      the file's text, once per composition
    //@ slot library             text that the caller gives; a slot without a filling is an error
    //@ slot extras optional     the same, but may stay empty

A file carries no ``#version``: the caller chooses it, because one text serves several entry points.
"""

import re
from ast import literal_eval
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

DIRECTORY = Path(__file__).parent
"""Where the project's own shader files lie."""

Define = str | int | float | bool

_CONSTANT = re.compile(r"^const (?:float|int) (?P<name>\w+) = (?P<value>[-+.\de]+);", re.MULTILINE)
_DIRECTIVE = re.compile(r"\s*//@\s*(?P<text>.*?)\s*$")
_INCLUDE = re.compile(r"include\s+(?P<name>\S+)$")
_SLOT = re.compile(r"slot\s+(?P<name>[A-Za-z_]\w*)(?P<optional>\s+optional)?$")
_NAME = re.compile(r"[A-Za-z_]\w*$")


@cache
def constants(name: str) -> dict[str, int | float]:
    """Return the constants that a file of shaders declares as numbers, by their names."""
    text = (DIRECTORY / name).read_text(encoding="utf-8")
    return {each["name"]: literal_eval(each["value"]) for each in _CONSTANT.finditer(text)}


class ShaderError(Exception):
    """Any failure of composing or compiling a shader."""


class ComposeError(ShaderError, ValueError):
    """A shader could not be put together from its files and slots."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a line was written: a file's name (or ``<slot NAME>``) and the line in it, from 1."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


@dataclass(frozen=True, slots=True)
class Source:
    """Shader text together with the origin of every line."""

    lines: tuple[str, ...]
    origins: tuple[Origin, ...]

    @property
    def text(self) -> str:
        """What the driver gets."""
        return "\n".join(self.lines) + "\n"

    def origin(self, line: int) -> Origin | None:
        """Give the origin of a line of the text, counted from 1; None beyond the text."""
        return self.origins[line - 1] if 1 <= line <= len(self.origins) else None

    @classmethod
    def named(cls, name: str, text: str) -> "Source":
        """Wrap a text whose lines are reported as lines of ``name``."""
        lines = tuple(text.splitlines())
        return cls(lines, tuple(Origin(name, i + 1) for i in range(len(lines))))


def compose(
    name: str,
    *,
    slots: Mapping[str, str | Source] | None = None,
    defines: Mapping[str, Define] | None = None,
    version: str | None = "330 core",
    directory: Path = DIRECTORY,
) -> Source:
    """Put a shader together from its file, the files it includes, and the fillings of its slots.

    Parameters
    ----------
    name
        File in ``directory``.
    slots
        Text for each slot; a :class:`Source` keeps its own origins. Fillings may hold directives too.
    defines
        Written as ``#define`` below the version; True defines a bare name, False leaves it out.
    version
        Text of the ``#version`` line, or None to make a piece that goes into another shader.
    directory
        Folder of the files.

    Raises
    ------
    ComposeError
        A file is missing, a slot has no filling, a filling has no slot, or a directive is not understood.
    """
    head = [f"#version {version}"] if version is not None else []
    head += [_define(key, value) for key, value in (defines or {}).items() if value is not False]
    composer = _Composer(directory, dict(slots or {}))
    composer.add(Source(tuple(head), (Origin("<head>", 0),) * len(head)))
    composer.include(name, None)
    unknown = sorted(set(composer.slots) - composer.filled)
    if unknown:
        raise ComposeError(
            f"{name} has no slot {', '.join(map(repr, unknown))}; its slots are "
            f"{', '.join(map(repr, sorted(composer.met))) or 'none'}"
        )
    return Source(tuple(composer.lines), tuple(composer.origins))


def _define(name: str, value: Define) -> str:
    if not _NAME.match(name):
        raise ComposeError(f"expected an identifier as the name of a define, got {name!r}")
    return f"#define {name}" if value is True else f"#define {name} {value}"


@dataclass
class _Composer:
    directory: Path
    slots: dict[str, str | Source]
    lines: list[str] = field(default_factory=list)
    origins: list[Origin] = field(default_factory=list)
    included: set[str] = field(default_factory=set)
    filled: set[str] = field(default_factory=set)
    met: set[str] = field(default_factory=set)
    open_slots: list[str] = field(default_factory=list)

    def include(self, name: str, place: Origin | None) -> None:
        if name in self.included:
            return
        self.included.add(name)
        try:
            text = (self.directory / name).read_text(encoding="utf-8")
        except OSError as error:
            where = f"{place}: " if place else ""
            raise ComposeError(f"{where}no shader file {name!r} in {self.directory}") from error
        self.add(Source.named(name, text))

    def add(self, source: Source) -> None:
        for line, origin in zip(source.lines, source.origins, strict=True):
            directive = _DIRECTIVE.match(line)
            if directive:
                self._obey(directive["text"], origin)
            elif line.lstrip().startswith("#version") and origin.file != "<head>":
                raise ComposeError(f"{origin}: a shader file carries no #version; the caller chooses it")
            else:
                self.lines.append(line)
                self.origins.append(origin)

    def _obey(self, directive: str, origin: Origin) -> None:
        if include := _INCLUDE.match(directive):
            self.include(include["name"], origin)
        elif slot := _SLOT.match(directive):
            self._fill(slot["name"], optional=slot["optional"] is not None, origin=origin)
        else:
            raise ComposeError(
                f"{origin}: expected '//@ include FILE' or '//@ slot NAME [optional]', got '//@ {directive}'"
            )

    def _fill(self, name: str, *, optional: bool, origin: Origin) -> None:
        self.met.add(name)
        if name in self.open_slots:
            raise ComposeError(f"{origin}: the filling of slot {name!r} holds that slot itself")
        if name not in self.slots:
            if optional:
                return
            raise ComposeError(f"{origin}: nothing was given for slot {name!r}")
        self.filled.add(name)
        filling = self.slots[name]
        self.open_slots.append(name)
        self.add(filling if isinstance(filling, Source) else Source.named(f"<slot {name}>", filling))
        self.open_slots.pop()
