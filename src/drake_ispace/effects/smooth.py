"""The sign of a wheel's speed, smooth enough for the 5 ms step: sign(w) ~ tanh(w / w_s).

A dry torque C then has the slope C / w_s around standstill, and the fixed Runge-Kutta step becomes unstable where the
slopes of all friction at a wheel add up to 2.51 / (h lambda) (robots/friction.py; lambda = largest eigenvalue of the
wheels' mobility). An effect takes 0.8 of what the plant's own friction leaves of that, 2 / (h lambda)
where it has none:

    w_s = max(0.05 rad/s, |C| / slope).

Several effects of dry friction at once may exceed it; wheels then rattle around standstill, within some w_s.
"""

import math

import numpy as np

from drake_ispace.effects.effect import Body
from drake_ispace.errors import InputError
from drake_ispace.kernels import kernel
from drake_ispace.robots.plants import omni, pendulum
from drake_ispace.robots.plants.friction import dry_slope, friction_parameters, stable_slope

#: Smallest w_s [rad/s]: below it nothing that an encoder sees would change.
LEAST_SPEED_RAD_S = 0.05

_SHARE = 0.8  # of what is left, for one effect
_LEAST_SHARE = 0.05  # of it, left for effects by a plant whose friction takes all


@kernel
def smooth_sign(rate, width):
    """-1 to 1, steep within `width` of the same unit."""
    return np.tanh(rate / width)


def slope_left(body: Body) -> float:
    """Slope of friction [N m s/rad] that the step allows beyond the plant's own; infinite for a plant unknown here."""
    if isinstance(body.plant, omni.OmniPlantParameters):
        mobility_of = omni.mobility
    elif isinstance(body.plant, pendulum.PendulumPlantParameters):
        mobility_of = pendulum.mobility
    elif hasattr(body.plant, "mobility"):  # of a user's own
        return stable_slope(max(float(np.abs(np.linalg.eigvals(body.plant.mobility)).max()), 1e-300))
    else:
        return math.inf
    try:
        with np.errstate(all="ignore"):
            mobility = mobility_of(body.plant)
            own = friction_parameters(body.plant.friction, mobility, f"{body.name}.plant.friction")
            most = stable_slope(float(np.linalg.eigvalsh(mobility)[-1]))
    except (InputError, ValueError):  # the plant refuses such numbers itself, and says why
        return math.inf
    return max(most - dry_slope(own) - own["viscous"], _LEAST_SHARE * most)


def steepest_slope(body: Body) -> float:
    """Slope [N m s/rad] around standstill that one effect of dry friction may have."""
    return _SHARE * slope_left(body)


def speed_scale(body: Body, torque: float) -> float:
    """w_s [rad/s] for a dry torque [N m]."""
    return max(LEAST_SPEED_RAD_S, abs(torque) / steepest_slope(body))
