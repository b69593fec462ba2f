"""Prompts of a window: a line of text to enter, and a question with an answer by key.

While a prompt is open it receives all keys.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from decals.errors import ImplicitDecalsError, InvalidEdit

ACCEPT, CANCEL, ERASE, CLEAR = ("Return", "KP_Enter", "Enter"), ("Escape",), ("BackSpace",), ("Delete",)
"""Names of the keys of a text prompt."""

HINT = "Return: accept, Escape: cancel, Delete: clear"


class Prompt(Protocol):
    """A prompt that receives keys until it is closed."""

    @property
    def line(self) -> str:
        """What the window shows."""
        ...

    def key(self, name: str, text: str) -> bool:
        """Handle a key press, and return True if the prompt is to be closed.

        Parameters
        ----------
        name
            Name of the key.
        text
            The character that the key types, or "".
        """
        ...


@dataclass
class TextPrompt:
    """A line of text.

    Attributes
    ----------
    label
        What the text is for.
    text
        The text so far.
    accept
        Called with the text, and True if it was accepted twice in a row. If it raises, the prompt stays open.
    """

    label: str
    text: str
    accept: Callable[[str, bool], None]
    _refused: str | None = None

    @property
    def line(self) -> str:
        """Label, text and keys."""
        return f"{self.label}: {self.text}_   ({HINT})"

    def key(self, name: str, text: str) -> bool:
        """Change the text, accept it, or close the prompt."""
        if name in ACCEPT:
            if not self.text.strip():
                raise InvalidEdit(f"{self.label}: expected a name, got nothing")
            repeated, self._refused = self._refused == self.text, self.text
            self.accept(self.text.strip(), repeated)
            return True
        if name in CANCEL:
            return True
        if name in ERASE:
            self.text = self.text[:-1]
        elif name in CLEAR:
            self.text = ""
        elif len(text) == 1 and text.isprintable():
            self.text += text
        return False


@dataclass(frozen=True)
class Question:
    """A question that some keys answer; other keys do nothing, and Escape closes it.

    Attributes
    ----------
    line
        The question, and the keys.
    answers
        What each key does, by its name in lower case.
    """

    line: str
    answers: Mapping[str, Callable[[], None]]

    def key(self, name: str, _text: str) -> bool:
        """Answer the question, or close it."""
        if name in CANCEL:
            return True
        answer = self.answers.get(name.lower())
        if answer is not None:
            answer()
        return answer is not None


class PromptLine:
    """The open prompt of a window, if any.

    Parameters
    ----------
    show
        Shows a message to the user.

    Attributes
    ----------
    text
        What the window shows; empty without a prompt.
    """

    def __init__(self, show: Callable[[str], None]) -> None:
        self._show = show
        self._prompt: Prompt | None = None
        self.text = ""

    @property
    def open(self) -> bool:
        """True while a prompt is open."""
        return self._prompt is not None

    @property
    def asking(self) -> bool:
        """True while a question is open."""
        return isinstance(self._prompt, Question)

    def begin(self, prompt: Prompt) -> None:
        """Open a prompt in place of the present one."""
        self._prompt, self.text = prompt, prompt.line
        self._show("")

    def close(self) -> None:
        """Close the prompt."""
        self._prompt, self.text = None, ""

    def key(self, name: str, text: str) -> None:
        """Send a key to the open prompt; an error becomes the message, and the prompt stays."""
        prompt = self._prompt
        if prompt is None:
            return
        self._show("")
        try:
            done = prompt.key(name, text)
        except ImplicitDecalsError as error:
            self._show(str(error))
            return
        if self._prompt is not prompt:  # the answer opened another one
            return
        self.text = prompt.line
        if done:
            self.close()
