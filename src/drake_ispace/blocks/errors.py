"""The exception for bad input from the user, and the wording of its messages."""

from collections.abc import Iterable
from difflib import get_close_matches


class InputError(ValueError):
    """Bad input from the user: one sentence that names the file, the field or row, and what was expected.

    The command line prints the sentence and exits with status 2, without a traceback. Line breaks in the message,
    which a file name may contain, become spaces, so that the message stays on one line; other control characters, which
    a terminal would obey, are escaped.
    """

    def __init__(self, message: str):
        super().__init__(printable(" ".join(message.splitlines())))


def printable(text: str) -> str:
    """Return `text` with control characters escaped, line breaks and tabs apart: names of files may hold any."""
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


def shown(value: object, longest: int = 40) -> str:
    """Return `value` as text for a message: quoted, with control characters escaped.

    A string is cut to `longest` characters, any other representation to twice as many.
    """
    if isinstance(value, str) and len(value) > longest:
        value = value[:longest] + "..."
    text = repr(value)
    return text if len(text) <= 2 * longest else text[: 2 * longest] + "..."


def expected_one_of(word: str, known: Iterable[str]) -> str:
    """Return the end of a message that refuses `word`: the nearest known word as a question, or all known words."""
    known = list(known)
    near = get_close_matches(word, known, n=1)
    return f"did you mean {near[0]!r}?" if near else "expected one of " + ", ".join(known)
