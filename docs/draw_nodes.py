"""Draw the pictures of the node reference from the samples of docs/nodes.toml.

``python docs/draw_nodes.py [CLASS ...]`` writes docs/images/nodes/, all by default. Of transforms,
deformations and pressed solids the picture shows on the left what they change.
"""

import ast
import sys

from node_pages import CLASSES, SAMPLES
from pictures import DOCS, draw_trees, run_code

from blobtree import Node, Union
from blobtree.nodes.contact import Press
from blobtree.nodes.tree import Placed

SIZE = (180, 150)


def sample_tree(code: str) -> Node:
    """Return the tree of a sample: its last line."""
    script = ast.parse(code)
    *body, last = script.body
    assert isinstance(last, ast.Expr)
    assignment = ast.parse("sample = 0").body[0]
    assert isinstance(assignment, ast.Assign)
    assignment.value = last.value
    script.body = [*body, assignment]
    text = "from blobtree import *\n" + ast.unparse(ast.fix_missing_locations(script))
    tree: Node = run_code(text)["sample"]
    return tree


def main() -> None:
    """Write the pictures."""
    for nodes in SAMPLES.values():
        for name, sample in nodes.items():
            if name not in sys.argv[1:] and len(sys.argv) > 1:
                continue
            tree = sample_tree(sample["code"])
            shown = [tree]
            if isinstance(tree, Placed):
                shown = [tree.child, tree]
            elif isinstance(tree, Press):
                shown = [Union(tree.solid, tree.obstacle), tree]
            path = DOCS / "images" / "nodes" / f"{CLASSES[name].file_tag}.jpg"
            draw_trees(path, shown, SIZE, lines=sample.get("lines", False), quality=60)


if __name__ == "__main__":
    main()
