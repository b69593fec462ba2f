"""Words of the theory: a sentence, a small picture and a page of each, which stand beside their options."""

import base64
from pathlib import Path

FOLDER = Path(__file__).parent / "words"

TEXTS = {
    part.split("\n", 1)[0]: part.split("\n\n", 1)[1].strip()
    for part in (FOLDER / "words.md").read_text(encoding="utf-8").split("## ")[1:]
}
"""The text of each word in Markdown, by the name of its option; the first paragraph is the sentence."""


def words() -> dict[str, dict[str, str]]:
    """Return sentence, page in HTML, and picture of each word, by the names of the options."""
    from markdown_it import MarkdownIt

    page = MarkdownIt("commonmark", {"html": False})
    return {
        name: {
            "sentence": text.split("\n\n", 1)[0],
            "page": page.render(text),
            "picture": "data:image/svg+xml;base64,"
            + base64.b64encode((FOLDER / f"{name}.svg").read_bytes()).decode(),
        }
        for name, text in TEXTS.items()
    }
