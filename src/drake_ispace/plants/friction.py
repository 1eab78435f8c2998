"""Friction between body and wheel, (3.35), in two forms that the fixed 5 ms step can integrate.

*smooth*: C tanh(w / w_s) + c w, with wheel speed w, Coulomb friction C and viscous friction c. The torque is zero at
zero speed, so under a constant load the wheel creeps at about w_s * load / C instead of sticking. The slope C / w_s
must stay below 2.51 / (h lambda), where the fixed Runge-Kutta step h becomes unstable. Here lambda is the largest
eigenvalue of the wheels' mobility E' M^-1 E. With a margin, w_s >= 0.5 C h lambda. Viscous friction adds c to the
slope.

*elastoplastic*: one bristle per wheel, which deflects by theta - anchor and slips when its torque exceeds C. The anchor
is dragged along once per tick. A load below C is held without creep. (LuGre and Karnopp need far smaller steps.)
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.functions import tanh
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.quantity import quantity


@dataclass
class Friction:
    """Friction at each wheel, (3.35); none by default. Table 4.2 gives the thesis's coefficients."""

    model: str = quantity("smooth", choices=("smooth", "elastoplastic"))
    # c_cu of (3.35)
    coulomb_n_m: float = quantity(0.0, "N*m", minimum=0.0)
    # c_v of (3.35)
    viscous_n_m_s: float = quantity(0.0, "N*m*s/rad", minimum=0.0)
    # w_s of the smooth model; null: the smallest value that the 5 ms step allows
    speed_scale_rad_s: float | None = quantity(None, "rad/s", above=0.0)


COULOMB, VISCOUS, SPEED_SCALE, BRISTLE, STIFFNESS, DAMPING = range(6)
_BRISTLE_FREQUENCY = 0.5  # natural frequency times step, a quarter of the stability limit of Runge-Kutta 3
_BRISTLE_DAMPING_RATIO = 0.7
_STABLE_SLOPE = 2.51  # slope times step times mobility at which Runge-Kutta 3 becomes unstable


def stable_slope(mobility: float) -> float:
    """Return the slope of the friction torque [N m s/rad] at which the fixed 5 ms step becomes unstable.

    mobility: largest eigenvalue of E' M^-1 E [rad/s^2 per N m].
    """
    return _STABLE_SLOPE / (TICK_S * mobility)


def dry_slope(parameters: Mapping[str, float]) -> float:
    """Return the slope of the dry friction at standstill [N m s/rad].

    parameters: the group that `friction_parameters` returns.
    """
    if parameters["bristle"] > 0.0 and parameters["coulomb"] > 0.0:
        return parameters["damping"]
    return parameters["coulomb"] / parameters["speed_scale"]


def friction_parameters(friction: Friction, mobility: np.ndarray, where: str) -> dict[str, float]:
    """Return the friction as a parameter group of a plant.

    Args:
        friction: the settings from the scenario.
        mobility: E' M^-1 E (n, n), wheel acceleration [rad/s^2] per wheel torque [N m].
        where: path of these settings in the scenario, for messages.

    Raises:
        InputError: the speed scale is too small, or the viscous friction too large, for the fixed 5 ms step.
    """
    largest = float(np.linalg.eigvalsh(mobility)[-1])
    smallest_scale = 0.5 * friction.coulomb_n_m * TICK_S * largest
    scale = friction.speed_scale_rad_s
    if friction.model == "smooth" and scale is not None and scale < smallest_scale:
        raise InputError(
            f"{where}.speed_scale_rad_s: {scale:g} rad/s is too steep for the 5 ms step with coulomb_n_m = "
            f"{friction.coulomb_n_m:g}, expected at least {smallest_scale:.4g} rad/s (or null to use that)"
        )
    scale = scale or max(smallest_scale, 1e-6)
    stiffness = (_BRISTLE_FREQUENCY / TICK_S) ** 2 / largest
    damping = 2.0 * _BRISTLE_DAMPING_RATIO * np.sqrt(stiffness / largest)
    parameters = {
        "coulomb": friction.coulomb_n_m, "viscous": friction.viscous_n_m_s, "speed_scale": scale,
        "bristle": float(friction.model == "elastoplastic"), "stiffness": stiffness, "damping": damping,
    }
    most = stable_slope(largest) - dry_slope(parameters)
    if friction.viscous_n_m_s > most:
        raise InputError(
            f"{where}.viscous_n_m_s: {friction.viscous_n_m_s:g} N*m*s/rad is too much for the 5 ms step, "
            f"expected at most {most:.3g}"
        )
    return parameters


@kernel
def friction_torque(rate, deflection, friction):
    """Return the friction torque [N m] that opposes a wheel's `rate` [rad/s].

    deflection: theta - anchor [rad] of the wheel's bristle, which the smooth model does not use.
    """
    limit = friction[COULOMB]
    if friction[BRISTLE] > 0.0:
        dry = friction[STIFFNESS] * deflection + friction[DAMPING] * rate
        dry = min(max(dry, -limit), limit)
    else:
        # no friction costs no time, and one division serves all wheels
        dry = limit * tanh(rate * (1.0 / friction[SPEED_SCALE])) if limit > 0.0 else 0.0 * rate
    return dry + friction[VISCOUS] * rate


@kernel
def dragged_anchor(angle, anchor, friction):
    """Return the bristle's anchor [rad] after a tick, at most C / stiffness from the wheel's `angle` [rad]."""
    reach = friction[COULOMB] / friction[STIFFNESS]
    return min(max(anchor, angle - reach), angle + reach)
