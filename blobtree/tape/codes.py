"""Codes of instructions on a tape, and the sizes that interpreters have; `tape` states the layout."""

SKELETONS = ("point", "segment", "cone", "torus", "disc", "box")
OPERATORS = ("sum", "ricci", "union", "intersection", "difference")
WARPS = ("twist",)
"""Tags of the kinds of the core, by sort; the index of one here is its code on the tape."""

PUSH = -1
POP = -2
POP_SWAPPED = -3
WARP = -4
UNWARP = -5
STRETCHED = 1024
FIELD = 2048
PREFIX = 4
REGISTERS = 24
"""Registers that the interpreters hold: enough for any tree of 2²⁴ leaves."""

WARP_REGISTERS = 8
"""How deep warps may nest."""
