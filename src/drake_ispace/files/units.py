"""Units of the columns of a recording, and how each becomes its SI unit."""

import math
from typing import Any

from drake_ispace.blocks.errors import InputError, shown

_SI_UNIT = {
    **dict.fromkeys(("t", "t_received"), "s"),
    **dict.fromkeys(("x", "y"), "m"),
    "phi": "rad",
    **dict.fromkeys(("vx", "vy"), "m/s"),
    **dict.fromkeys(("ax", "ay", "az"), "m/s^2"),
    **dict.fromkeys(("wx", "wy", "wz"), "rad/s"),
}


# Unit: (its SI unit, value in SI = value * numerator / denominator). Two numbers, as 5 / 1000 is the double nearest to
# 0.005 and 5 * 0.001 need not be.
_UNITS: dict[str, tuple[str, float, float]] = {
    "s": ("s", 1, 1), "ms": ("s", 1, 1e3), "us": ("s", 1, 1e6), "ns": ("s", 1, 1e9),
    "m": ("m", 1, 1), "cm": ("m", 1, 1e2), "mm": ("m", 1, 1e3),
    "rad": ("rad", 1, 1), "mrad": ("rad", 1, 1e3), "deg": ("rad", math.pi, 180), "rev": ("rad", 2 * math.pi, 1),
    "m/s": ("m/s", 1, 1), "cm/s": ("m/s", 1, 1e2), "mm/s": ("m/s", 1, 1e3), "km/h": ("m/s", 1, 3.6),
    "rad/s": ("rad/s", 1, 1), "deg/s": ("rad/s", math.pi, 180), "rpm": ("rad/s", 2 * math.pi, 60),
    "m/s^2": ("m/s^2", 1, 1), "mm/s^2": ("m/s^2", 1, 1e3), "g": ("m/s^2", 9.80665, 1),
    "N*m": ("N*m", 1, 1), "N*cm": ("N*m", 1, 1e2), "N*mm": ("N*m", 1, 1e3), "mN*m": ("N*m", 1, 1e3),
    "1": ("1", 1, 1), "N": ("N", 1, 1), "A": ("A", 1, 1), "V": ("V", 1, 1),
}  # fmt: skip
_LETTERS = str.maketrans({" ": "", "·": "*", "⋅": "*", "²": "^2", "µ": "u", "μ": "u", "°": "deg"})
_SPELLINGS = {"Nm": "N*m", "Ncm": "N*cm", "Nmm": "N*mm", "mNm": "mN*m", "m/s2": "m/s^2", "mm/s2": "mm/s^2"}


def si_unit(column: str) -> str | None:
    """The SI unit of a column that has a known name, None for others."""
    if column.startswith("theta_"):
        return "rad"
    return "N*m" if column.startswith("tau_") else _SI_UNIT.get(column)


def in_si(unit: str) -> float:
    """What a number in a unit that recordings may have must be multiplied by to be in its SI unit."""
    _, numerator, denominator = _UNITS[unit]
    return numerator / denominator


def conversion(column: str, unit: Any, where: str) -> tuple[str, float, float]:
    """SI unit, numerator and denominator that take a column of a recording in `unit` to SI.

    Raises:
        InputError: the unit is unknown, or does not fit the column.
    """
    spelled = str(unit).translate(_LETTERS).replace("**", "^")
    spelled = _SPELLINGS.get(spelled, spelled)
    wanted = si_unit(column)
    choices = [name for name, (si, *_) in _UNITS.items() if wanted in (None, si)]
    if not isinstance(unit, str) or spelled not in choices:
        raise InputError(f"{where}.{column} is {shown(unit)}, expected one of {', '.join(choices)}")
    return _UNITS[spelled]
