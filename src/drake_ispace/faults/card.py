"""A fault's card: all that is known of a mistake of the data before any data."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """A mistake of a recording, or of the numbers with which a model was typed in.

    Attributes:
        name: in answers; title: for people.
        does: what it makes of a log. cause: how it comes about. shows: what gives it away. repair: what undoes it.
        same: faults that exact data cannot tell from it. effects: effects of the library that do the same.
        harmless: whether a model can be judged in spite of it, with what is left of the data.
        doubtful: whether what a model then seems to lack may be its doing.
    """

    name: str
    title: str
    does: str
    cause: str
    shows: str
    repair: str
    same: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    harmless: bool = False
    doubtful: bool = False
