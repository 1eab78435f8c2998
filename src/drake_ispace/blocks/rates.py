"""Sampling periods, and the conversion between time and ticks.

The sampling periods of the thesis (Table 6.1) are T_u = T_y = 5 ms and T_v = 95 ms = 19 T_u. Multiples of 0.005 and of
0.095 do not coincide as floating-point numbers, so Drake would insert near-zero steps and deliver samples a tick late.
The tick is therefore 0.005 s rounded to 30 significant bits. Every multiple k * TICK_S is then exact up to k = 2**23
(11.6 hours).
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
#: The largest tick up to which every time k * TICK_S is exact.
MAX_TICK = 2 ** (53 - _BITS)


def tick_at(time_s: float) -> int:
    """Return the tick k whose interval [k T_u, (k+1) T_u) contains `time_s` [s]; exact on multiples of TICK_S."""
    return math.floor(time_s / TICK_S)


def ticks_in(duration_s: float) -> int:
    """Return the number of ticks nearest to `duration_s` [s]; 20 s are 4000 ticks."""
    return round(duration_s / TICK_S)
