"""The only place where time is counted.

The thesis's rates (Table 6.1) are T_u = T_y = 5 ms and T_v = 95 ms = 19 T_u. As floating-point numbers multiples of
0.005 and of 0.095 do not coincide, and Drake would then insert near-zero steps and deliver samples a tick late. So the
tick is 0.005 s rounded to 30 significant bits: every multiple k * TICK_S is exact for k < 2**23 (11.6 hours).
"""

import math

_BITS = 30
_mantissa, _exponent = math.frexp(0.005)

#: T_u = T_y, the period of encoders, IMU and torque [s].
TICK_S = math.ldexp(round(math.ldexp(_mantissa, _BITS)), _exponent - _BITS)
#: N = T_v / T_u in (6.3).
VISION_TICKS = 19
#: T_v, the period of the room's camera and of its messages [s].
VISION_S = VISION_TICKS * TICK_S
#: Largest tick whose time k * TICK_S is exact.
MAX_TICK = 2 ** (53 - _BITS)


def tick_at(time_s: float) -> int:
    """The tick whose interval [k T_u, (k+1) T_u) holds `time_s` [s]; exact on multiples of TICK_S."""
    return math.floor(time_s / TICK_S)


def ticks_in(duration_s: float) -> int:
    """The number of ticks nearest to `duration_s` [s], so that 20 s means 4000 ticks."""
    return round(duration_s / TICK_S)
