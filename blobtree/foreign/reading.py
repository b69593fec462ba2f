"""Trees in files of this package and of others, told apart by suffix and content."""

import os
import re

from blobtree.foreign.content import naming, read_bytes
from blobtree.foreign.json_values import parsed_json
from blobtree.foreign.lipschitz import lipschitz_tree
from blobtree.foreign.programs import read_program
from blobtree.foreign.three_js import three_js_tree
from blobtree.io import from_json
from blobtree.nodes.node import Node

PROGRAM_SUFFIXES = (".vm", ".frep")
"""Suffixes of programs."""

OWN_START = re.compile(rb'\s*\{\s*"format"\s*:\s*"blobtree"')
"""How every file begins that `blobtree.save` writes."""


def read_tree(path: str | os.PathLike[str]) -> Node:
    """Return the tree in a file of this package or of another program, whichever wrote it.

    These are files of `blobtree.save`, programs (`.vm`, `.frep`), scenes of Lipschitz Pruning and trees of
    three-js-blobtree (`.json`).

    Parameters
    ----------
    path : str or path-like
        Path of the file.

    Raises
    ------
    InvalidFile
        The file holds no tree, or one with a part that has no counterpart.
    UnusableFile
        The file cannot be read.

    See Also
    --------
    blobtree.load, read_program

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from blobtree.foreign import read_tree
    >>> path = pathlib.Path(tempfile.mkdtemp(), "disc.vm")
    >>> text = ["x var-x", "y var-y", "r hypot x y", "one const 0.5", "disc sub r one"]
    >>> _ = path.write_text(chr(10).join(text))
    >>> read_tree(path)([[0.5, 0, 0]]).tolist()
    [0.5]
    """
    if str(path).lower().endswith(PROGRAM_SUFFIXES):
        return read_program(path)
    content = read_bytes(path)
    with naming(path):
        return _json_tree(content)


def _json_tree(content: bytes) -> Node:
    """Return the tree of a JSON text of any of the formats."""
    if OWN_START.match(content):
        return from_json(content)
    values = parsed_json(content)
    if isinstance(values, dict) and "nodeType" in values:
        return lipschitz_tree(values)
    if isinstance(values, dict) and "type" in values:
        return three_js_tree(values)
    return from_json(content)
