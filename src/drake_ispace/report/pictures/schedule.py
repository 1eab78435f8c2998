"""The schedule of a Diagram: which block is updated when."""

import re
from collections.abc import Iterator

from pydrake.systems.framework import System

from drake_ispace.blocks.block import Phase, Spec
from drake_ispace.blocks.rates import TICK_S


def schedule(diagram: System) -> list[dict]:
    """Every periodic update in `diagram`, nested Diagrams included, in the order in which the blocks were added.

    Drake 1.51 does not list unrestricted events. A Block is therefore asked for its own updates, which are exactly
    those that it declares with Drake. Any other leaf system shows its discrete updates, if they share one timing. A
    discrete MultibodyPlant, which is updated by an unrestricted event, is left out.

    Returns:
        Rows of `block` (name, in a nested Diagram "diagram::name"), `phase` ("sense" before "compute" of the same
        instant), `period_ticks` (an int where it is a whole number), `period_s` and `offset_s` [s].
    """
    return [row for name, leaf in _leaves(diagram, "") for row in _rows(name, leaf)]


def block_name(system: System) -> str:
    """The name of `system`; without one the name of its class, not Drake's "class@address"."""
    return re.sub(r"^(?:.*[/.])?(.*)@[0-9a-f]{8,}$", r"\1", system.get_name())


def _leaves(system: System, prefix: str) -> Iterator[tuple[str, System]]:
    if not hasattr(system, "GetSystems"):  # a Diagram of any scalar
        yield prefix + block_name(system), system
        return
    for child in system.GetSystems():
        inside = f"{prefix}{block_name(child)}::" if hasattr(child, "GetSystems") else prefix
        yield from _leaves(child, inside)


def _rows(name: str, leaf: System) -> list[dict]:
    spec = getattr(leaf, "spec", None)
    if isinstance(spec, Spec):
        return [
            _row(name, update.phase, update.period_ticks * TICK_S, update.offset_ticks * TICK_S)
            for update in spec.updates
        ]
    timing = leaf.GetUniquePeriodicDiscreteUpdateAttribute()
    return [] if timing is None else [_row(name, Phase.COMPUTE, timing.period_sec(), timing.offset_sec())]


def _row(name, phase, period_s, offset_s):
    ticks = period_s / TICK_S
    return {
        "block": name, "phase": phase.value, "period_ticks": int(ticks) if ticks.is_integer() else ticks,
        "period_s": period_s, "offset_s": offset_s,
    }
