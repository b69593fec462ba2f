"""XML as elements in turn, without document types: these may expand to any size, or name other files."""

from collections.abc import Callable, Iterable, Mapping
from typing import NoReturn
from xml.parsers import expat

from decals.surfaces.files.faults import Unreadable

Attributes = dict[str, str]
"""Attributes of an element; names have no namespace."""

SEPARATOR = "\n"
"""Between a namespace and a name; neither holds it."""


def parse_xml(
    chunks: Iterable[bytes],
    prefixes: Mapping[str, str],
    starts: Mapping[str, Callable[[Attributes], None]],
    ends: Mapping[str, Callable[[], None]],
) -> None:
    """Call functions at the starts and ends of elements.

    Parameters
    ----------
    chunks : iterable of bytes
        The text, in pieces.
    prefixes : mapping
        Namespaces whose elements are read, and how their names begin in the two tables. Elements without a
        namespace have no prefix.
    starts, ends : mapping
        Functions by the names of elements.

    Raises
    ------
    Unreadable
        If the text is no XML, or declares a document type.
    """
    known: dict[str, str] = {}

    def key(name: str) -> str:
        if name not in known:
            space, _, local = name.rpartition(SEPARATOR)
            known[name] = prefixes.get(space, "") + local if space in prefixes or not space else ""
        return known[name]

    def start(name: str, attributes: Attributes) -> None:
        if function := starts.get(key(name)):
            if SEPARATOR in "".join(attributes):
                attributes = {name.rpartition(SEPARATOR)[2]: value for name, value in attributes.items()}
            function(attributes)

    def end(name: str) -> None:
        if function := ends.get(key(name)):
            function()

    def refuse(*_: object) -> NoReturn:
        raise Unreadable("its XML declares a document type, which is not read")

    parser = expat.ParserCreate(namespace_separator=SEPARATOR)
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = refuse
    try:
        for chunk in chunks:
            parser.Parse(chunk, False)
        parser.Parse(b"", True)
    except expat.ExpatError as error:
        raise Unreadable(f"its XML is wrong: {error}") from error
    except LookupError as error:
        raise Unreadable(f"its XML is in an unknown encoding: {error}") from error
