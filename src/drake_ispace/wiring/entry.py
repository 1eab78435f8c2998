"""The catalog's entry of a Diagram."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydrake.systems.framework import Diagram

from drake_ispace.wiring.bench import Bench

if TYPE_CHECKING:
    from drake_ispace.scenario import Scenario


@dataclass(frozen=True)
class Entry:
    """A Diagram of the catalog.

    Attributes:
        wire: puts everything that a scenario says on a Bench. robots: names of those in it.
        has_feedback: whether it commands torque by what its robot senses, its room sees and its way point says, and by
            nothing else, so that a recorded torque can be compared with it.
    """

    wire: Callable[["Scenario", Bench], None]
    robots: Sequence[str]
    has_feedback: bool = False

    @property
    def name(self) -> str:
        return self.wire.__name__

    @property
    def title(self) -> str:
        """The first line of the function's docstring."""
        return self.wire.__doc__.strip().splitlines()[0]

    def build(self, scenario: "Scenario", bench: Bench | None = None) -> Diagram:
        """The Diagram of a scenario. bench: where to wire it, default a new one.

        Raises:
            InputError: values that do not go together.
        """
        bench = Bench() if bench is None else bench
        self.wire(scenario, bench)
        return bench.build(self.name)
