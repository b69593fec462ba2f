"""How texts differ from program to program: numbers, spaces, comments, line ends and encodings."""

import codecs
import random
from collections.abc import Callable

Number = Callable[[float], str]

NUMBERS: list[Number] = [
    lambda value: f"{value:.7g}",
    lambda value: f"{value:+.8e}",
    lambda value: f"{value:.12g}",
    repr,
    lambda value: f"{value:.9E}".replace("E", "e"),
    lambda value: f"{value:.10f}",
    lambda value: f"{value:+.9g}",
]
"""Spellings of a number with seven digits or more."""

WORDS = ["name", "Cube.001", "two words", "caf\xe9", "\u77f3", "a/b\\c", "#5", "", "solid facet", "-1"]
"""Names of objects and materials."""

MARKS = {"utf-16-le": codecs.BOM_UTF16_LE, "utf-16-be": codecs.BOM_UTF16_BE, "utf-32-le": codecs.BOM_UTF32_LE}


def encoded(text: str, chance: random.Random) -> bytes:
    """Return a text with line ends and an encoding of some program."""
    text = text.replace("\n", chance.choice(["\n", "\n", "\r\n", "\r"]))
    encoding = chance.choice(["utf-8"] * 5 + ["latin-1", "utf-8-sig", *MARKS])
    return MARKS.get(encoding, b"") + text.encode(encoding, "replace")


def spaced(words: list[str], chance: random.Random) -> str:
    """Return words with spaces or tabs between them, and sometimes around them."""
    gap = chance.choice([" "] * 8 + ["  ", "\t", " \t "])
    return chance.choice(["", "", "", " ", "\t"]) + gap.join(words) + chance.choice(["", "", "", " "])


def damaged(content: bytes, chance: random.Random) -> bytes:
    """Return a content that is cut off, or has a number, a line or some bytes changed."""
    kind = chance.randrange(6)
    if kind == 0:
        return content[: chance.randrange(len(content) + 1)]
    lines = content.split(b"\n")
    row = chance.randrange(len(lines))
    if kind == 1:
        del lines[row]
    elif kind == 2:
        lines.insert(row, lines[chance.randrange(len(lines))])
    elif kind == 3:
        words = lines[row].split(b" ")
        words[chance.randrange(len(words))] = chance.choice(ODD_WORDS)
        lines[row] = b" ".join(words)
    elif kind == 4:
        lines[row] = lines[row][: len(lines[row]) // 2]
    else:
        data = bytearray(content)
        for _ in range(chance.randint(1, 8)):
            if data:
                data[chance.randrange(len(data))] = chance.choice([0, 10, 32, 45, 47, 48, 57, 92, 255])
        return bytes(data)
    return b"\n".join(lines)


ODD_WORDS = [
    b"0", b"-1", b"1", b"1000000", b"-99999999", b"99999999999999999999", b"1/1/1/1", b"1//", b"/", b"nan",
    b"inf", b"1e400", b"1e39", b"-0", b"0x10", b"1_0", b"", b"\\", b"#", b"\0", b"\xff\xfe", b"4294967296",
    b"2147483648", b"0.5", b"x" * 5000,
]  # fmt: skip
"""Words of no use for most places."""
