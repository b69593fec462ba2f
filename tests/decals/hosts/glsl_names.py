"""The names that a GLSL text declares outside functions, found by a grammar of its own."""

import re

COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
MACRO = re.compile(r"^[ \t]*#[ \t]*(?:define|ifndef|ifdef|undef)[ \t]+(\w+)", re.MULTILINE)
DIRECTIVE = re.compile(r"^[ \t]*#.*$", re.MULTILINE)
PRECISION = re.compile(r"\bprecision\s+\w+\s+\w+\s*;")
LAYOUT = re.compile(r"\blayout\s*\([^()]*\)")
STRUCT = re.compile(r"\bstruct\s+(\w+)\s*\{[^{}]*\}\s*;")
BLOCK = re.compile(r"\b(?:uniform|buffer)\s+(\w+)\s*\{([^{}]*)\}\s*(\w*)\s*;")
FUNCTION = re.compile(r"\b\w+\s+(\w+)\s*\(([^()]*)\)\s*(?:\{\}|;)")
VARIABLE = re.compile(r"(\w+)\s*(?:\[[^\]]*\]\s*)?(?:=[^;]*)?;")


def global_names(text: str) -> set[str]:
    """Names of macros, structures, blocks and their members, functions, constants, variables and uniforms.

    AssertionError if something of the text is left over.
    """
    code = COMMENT.sub(" ", text)
    names = set(MACRO.findall(code))
    code = LAYOUT.sub(" ", PRECISION.sub(" ", DIRECTIVE.sub(" ", code)))
    names |= set(STRUCT.findall(code))
    code = STRUCT.sub(" ", code)
    for block, members, instance in BLOCK.findall(code):
        names |= {block, *([instance] if instance else VARIABLE.findall(members))}
    code = _without_bodies(BLOCK.sub(" ", code))
    names |= {name for name, _ in FUNCTION.findall(code)}
    code = FUNCTION.sub(" ", code)
    for statement in filter(str.strip, code.split(";")):
        found = VARIABLE.search(statement + ";")
        assert found is not None, statement
        names.add(found[1])
    return names


def _without_bodies(code: str) -> str:
    """A text whose outermost braces are empty."""
    kept, depth = [], 0
    for sign in code:
        depth -= sign == "}"
        if depth == 0:
            kept.append(sign)
        depth += sign == "{"
    assert depth == 0
    return "".join(kept)
