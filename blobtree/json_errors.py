"""What is wrong with a JSON text, in plain words: msgspec's messages name its types and paths."""

import re

TYPES = {
    "object": "an object in braces",
    "array": "a list",
    "str": "a text",
    "int": "a whole number",
    "float": "a number",
    "bool": "true or false",
    "null": "null",
}
"""Names of the types in msgspec's messages."""

_RULES = (
    (r"Expected `array` of length (\d+), got (\d+)", r"expected a list of \1 values, got \2"),
    (r"Expected `array` of length (\d+)", r"expected a list of \1 values"),
    (r"Object missing required field `(.*?)`", r"the field '\1' is missing"),
    (r"Object contains unknown field `(.*?)`", r"there is no field '\1'; remove it"),
    (r"Invalid (?:enum )?value (.*)", r"unknown value \1"),
    (r"Number out of range", "the number is too large"),
    (r"Input data was truncated", "the file ends too early"),
    (r"JSON is malformed: (.*) \(byte \d+\)", r"it is not valid JSON: \1"),
)


def json_reason(error: Exception, text: bytes | str) -> str:
    """Return what is wrong with a text that msgspec could not read, and where.

    Parameters
    ----------
    error : Exception
        The exception of ``msgspec.json.decode``.
    text : bytes or str
        The text; a buffer of bytes, too.

    Returns
    -------
    str
        A sentence without its end, such as "camera.fov: expected a number, got a text".

    Examples
    --------
    >>> import msgspec
    >>> try:
    ...     msgspec.json.decode('{"a": 1,}')
    ... except msgspec.DecodeError as error:
    ...     json_reason(error, '{"a": 1,}')
    'it is not valid JSON: trailing comma in object at line 1, column 9'
    """
    try:
        decoded = text if isinstance(text, str) else bytes(text).decode()
        content = decoded.encode()
    except UnicodeError:
        return "it is not a text in UTF-8"
    if not decoded.strip():
        return "the file is empty"
    message, _, place = str(error).partition(" - at `")
    words = message
    for pattern, replacement in _RULES:
        words, found = re.subn(f"^{pattern}$", replacement, words)
        if found:
            break
    words = re.sub(r"Expected `(.*?)`", lambda found: f"expected {_types(found[1])}", words)
    words = re.sub(r"got `(.*?)`", lambda found: f"got {_types(found[1])}", words)
    if byte := re.search(r" \(byte (\d+)\)$", message):
        before = content[: int(byte[1])].decode(errors="replace")
        line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
        words += f" at line {line}, column {column}"
    place = place.rstrip("`").removeprefix("$").removeprefix(".")
    return f"{place}: {words}" if place else words


def _types(names: str) -> str:
    return " or ".join(TYPES.get(name, name) for name in names.split(" | "))
