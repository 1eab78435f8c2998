"""InputError, the one exception for input that is wrong."""

from collections.abc import Iterable
from difflib import get_close_matches


class InputError(ValueError):
    """Bad input from the user: one clear sentence naming the file, the field or row, and what was expected.

    The command line prints the sentence and exits with status 2, without a traceback. Line breaks in the message (a
    file name may hold one) become spaces, so that it always stays on one line.
    """

    def __init__(self, message: str):
        super().__init__(" ".join(message.splitlines()))


def shown(value: object, longest: int = 40) -> str:
    """`value` as it may stand in a message: quoted, control characters escaped, cut to `longest` characters."""
    if isinstance(value, str) and len(value) > longest:
        value = value[:longest] + "..."
    text = repr(value)
    return text if len(text) <= 2 * longest else text[: 2 * longest] + "..."


def expected_one_of(word: str, known: Iterable[str]) -> str:
    """The end of a message that refuses `word`: a near miss as a question, else all known words."""
    known = list(known)
    near = get_close_matches(word, known, n=1)
    return f"did you mean {near[0]!r}?" if near else "expected one of " + ", ".join(known)
