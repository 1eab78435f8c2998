"""Options that several commands have."""

from typing import Annotated

from cyclopts import Parameter

from drake_ispace.blocks.errors import shown


def whole(kind, tokens):
    """cyclopts alone would cut 1.5 to 1."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f"expected a whole number, got {shown(tokens[0].value)}") from None


Json = Annotated[bool, Parameter(name="--json", negative="", help="one JSON document on standard output, nothing else")]
Sets = Annotated[
    list[str] | None,
    Parameter(name="--set", negative="", help="key=value over the scenario, as omni.plant.mass_kg=8"),
]
Seconds = Annotated[float | None, Parameter(help="simulated time [s]")]
Seed = Annotated[int | None, Parameter(help="of every random draw", converter=whole)]
