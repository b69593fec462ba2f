"""GLSL for shaders of other programs: no directives, nothing that is not used, all names with one prefix."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

from decals.shaders.compose import ComposeError

_TOKEN = re.compile(
    r"//[^\n]*|/\*.*?\*/"  # comments
    r"|[A-Za-z_]\w*"  # words
    r"|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?[uUfF]*"  # numbers
    r"|\s+|.",
    re.DOTALL,
)
_WORD = re.compile(r"[A-Za-z_]\w*$")
_OWN = re.compile(r"^(?:decal_|Decal)")
_DIRECTIVE = re.compile(r"\s*#\s*(?P<name>\w+)\s*(?P<rest>.*?)\s*$")

COMMENTS = "//", "/*"
OPENING, CLOSING = ("(", "{"), (")", "}")


def tokens(text: str) -> list[str]:
    """Return the words, numbers, signs, spaces and comments of a text; they add up to it."""
    return _TOKEN.findall(text)


def is_word(token: str) -> bool:
    """Return True for a name or a word of the language."""
    return _WORD.match(token) is not None


def words(text: str) -> Iterator[str]:
    """Yield the words of a text but for its comments and what follows a dot."""
    last = ""
    for token in tokens(text):
        if is_word(token) and last != ".":
            yield token
        last = token if token.strip() else last


def replaced(text: str, names: Mapping[str, str]) -> str:
    """Return a text with other words in place of some, but for comments and what follows a dot."""
    result, last = [], ""
    for token in tokens(text):
        result.append(names.get(token, token) if last != "." else token)
        last = token if token.strip() else last
    return "".join(result)


def preprocessed(text: str) -> str:
    """Return a text without directives: ``#define`` of words, ``#ifdef``, ``#ifndef``, ``#else``, ``#endif``.

    Raises
    ------
    ComposeError
        The text has another directive, or blocks that do not close.
    """
    macros: dict[str, str] = {}
    kept: list[bool] = []
    lines: list[str] = []
    for line in text.splitlines():
        directive = _DIRECTIVE.match(line)
        if directive is None:
            if all(kept):
                lines.append(replaced(line, macros))
            continue
        name, rest = directive["name"], directive["rest"].partition("//")[0].strip()
        if name in ("ifdef", "ifndef"):
            kept.append((rest in macros) == (name == "ifdef"))
        elif name == "else" and kept:
            kept.append(not kept.pop())
        elif name == "endif" and kept:
            kept.pop()
        elif name == "define" and "(" not in rest.partition(" ")[0]:
            if all(kept):
                macros[rest.partition(" ")[0]] = rest.partition(" ")[2].strip()
        else:
            raise ComposeError(f"expected #define of a word, #ifdef, #ifndef, #else or #endif, got {line!r}")
    if kept:
        raise ComposeError("expected an #endif for each #ifdef")
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Declaration:
    """A declaration outside all functions, with its comments.

    Attributes
    ----------
    name
        What it declares. Functions of one name may have several declarations.
    text
        The declaration, with its comments.
    kind
        Its first word, such as ``uniform``, ``struct`` or the type of the result.
    """

    name: str
    text: str
    kind: str

    @property
    def code(self) -> str:
        """The declaration without comments."""
        return "".join(token for token in tokens(self.text) if not token.startswith(COMMENTS)).strip()

    @property
    def fields(self) -> frozenset[str]:
        """Names of the fields of a structure."""
        if self.kind != "struct":
            return frozenset()
        parts = [token for token in tokens(self.text) if token.strip()]
        return frozenset(word for word, after in pairwise(parts) if is_word(word) and after in ";,[")


def declarations(text: str) -> list[Declaration]:
    """Return the declarations of a text without directives, in their order.

    Each has the comments that touch it; comments above an empty line are left out.
    """
    found: list[Declaration] = []
    body: list[str] = []
    above, depth = "", 0
    for token in tokens(text):
        if not body and (not token.strip() or token.startswith(COMMENTS)):
            above = _comments_after(found, above, token)
            continue
        body.append(token)
        depth += (token in OPENING) - (token in CLOSING)
        if depth == 0 and (token == ";" or (token == "}" and body[0] != "struct")):
            found.append(Declaration(_declared_name(body), above.lstrip("\n") + "".join(body), body[0]))
            above, body = "", []
    return found


def _comments_after(found: list[Declaration], above: str, token: str) -> str:
    """Return the comments above the next declaration; one behind the last declaration belongs to that."""
    if found and token.startswith(COMMENTS) and not above.count("\n"):
        found[-1] = replace(found[-1], text=found[-1].text + above + token)
        return ""
    return "\n" if token.count("\n") > 1 else above + token


def _declared_name(body: list[str]) -> str:
    """Return the name that a declaration declares."""
    code = [token for token in body if token.strip() and not token.startswith(COMMENTS)]
    if code[0] == "struct":
        return code[1]
    return code[next(place for place, token in enumerate(code) if token in ("(", "=", ";", "[")) - 1]


def reachable(parts: Iterable[Declaration], roots: Iterable[str]) -> list[Declaration]:
    """Return the declarations that those with some names need, and these, in their order."""
    parts = list(parts)
    needs: dict[str, set[str]] = {}
    for part in parts:
        needs.setdefault(part.name, set()).update(words(part.text))
    reached, waiting = set[str](), list(roots)
    while waiting:
        name = waiting.pop()
        if name in needs and name not in reached:
            reached.add(name)
            waiting += needs[name]
    return [part for part in parts if part.name in reached]


def prefixed_name(name: str, prefix: str) -> str:
    """Return a name with a prefix, in place of ``decal_`` or ``Decal`` if it begins with that."""
    return prefix + _OWN.sub("", name)


def prefixed(parts: Iterable[Declaration], prefix: str, reserved: Iterable[str] = ()) -> list[Declaration]:
    """Return declarations whose names begin with a prefix, see `prefixed_name`.

    Raises
    ------
    ComposeError
        A name with this prefix would be one of the others, or a reserved word.
    """
    parts = list(parts)
    names = {name: prefixed_name(name, prefix) for name in dict.fromkeys(part.name for part in parts)}
    others = {word for part in parts for word in words(part.text)} - names.keys() | set(reserved)
    new = list(names.values())
    if clashes := sorted(name for name in new if name in others or new.count(name) > 1):
        raise ComposeError(f"the prefix {prefix!r} makes a second {clashes[0]!r}")
    return [_renamed(part, names) for part in parts]


def _renamed(part: Declaration, names: Mapping[str, str]) -> Declaration:
    """Return a declaration with other names; the fields of a structure keep theirs."""
    fields = part.fields
    chosen = {name: new for name, new in names.items() if name not in fields}
    return Declaration(names[part.name], replaced(part.text, chosen), names.get(part.kind, part.kind))
