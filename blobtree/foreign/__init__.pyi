from .lipschitz import read_lipschitz
from .programs import read_program
from .reading import read_tree
from .three_js import read_three_js

__all__ = [
    "read_lipschitz",
    "read_program",
    "read_three_js",
    "read_tree",
]
