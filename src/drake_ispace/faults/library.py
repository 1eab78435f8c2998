"""All faults by name."""

from drake_ispace.faults import imu, room, runs, samples, stamps, units, wheels
from drake_ispace.faults.card import Fault

FAULTS: dict[str, Fault] = {
    fault.name: fault for part in (units, wheels, room, imu, stamps, samples, runs) for fault in part.FAULTS
}


def same_as(effect: str) -> list[str]:
    """Names of the faults that do the same as an effect of the library."""
    return [fault.name for fault in FAULTS.values() if effect in fault.effects]
