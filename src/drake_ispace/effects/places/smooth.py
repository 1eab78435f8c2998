"""The sign of a wheel's speed, smooth enough for the 5 ms step: sign(w) ~ tanh(w / w_s).

A dry torque C then has the slope C / w_s around standstill, and the fixed Runge-Kutta step becomes unstable where the
slopes of all friction at a wheel add up to 2.51 / (h lambda) (plants/friction.py; lambda = largest eigenvalue of
the wheels' mobility). An effect takes 0.8 of what the plant's own friction leaves of that, 2 / (h lambda) where it has
none:

    w_s = max(0.05 rad/s, |C| / slope).

Several effects of dry friction at once may exceed it; wheels then rattle around standstill, within some w_s.
"""


from drake_ispace.blocks.functions import tanh
from drake_ispace.blocks.kernels import kernel
from drake_ispace.effects.effect import Body

#: Smallest w_s [rad/s]: below it nothing that an encoder sees would change.
LEAST_SPEED_RAD_S = 0.05

_SHARE = 0.8  # of what is left, for one effect
_LEAST_SHARE = 0.05  # of it, left for effects by a plant whose friction takes all


@kernel
def smooth_sign(rate, width):
    """-1 to 1, steep within `width` of the same unit."""
    return tanh(rate / width)


@kernel
def dry(size, rate, width):
    """`size` with the smooth sign of `rate`; nothing is computed for an effect that is not there."""
    return size * smooth_sign(rate, width) if size != 0.0 else 0.0


def slope_left(body: Body) -> float:
    """Slope of friction [N m s/rad] that the step allows beyond the plant's own; infinite without torque."""
    left, most = body.friction_slopes
    return max(left, _LEAST_SHARE * most)


def steepest_slope(body: Body) -> float:
    """Slope [N m s/rad] around standstill that one effect of dry friction may have."""
    return _SHARE * slope_left(body)


def speed_scale(body: Body, torque: float) -> float:
    """w_s [rad/s] for a dry torque [N m]."""
    return max(LEAST_SPEED_RAD_S, abs(torque) / steepest_slope(body))
