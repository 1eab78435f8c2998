"""Gains of the omni robot's feedback, section 6.5.3: given, or designed by DLQR from the linearised plant block."""

import dataclasses
from dataclasses import dataclass

import numpy as np
from pydrake.systems.primitives import Linearize

from drake_ispace.control.feedback.dlqr import dlqr
from drake_ispace.files.quantity import quantity
from drake_ispace.plants.friction import Friction
from drake_ispace.plants.omni import OmniPlant, OmniPlantParameters
from drake_ispace.plants.slip import Slip


@dataclass
class OmniControl:
    """Settings of the omni robot's feedback, section 6.5.3."""

    # dlqr: designed from the plant with q and r; given: k_p and k_d below
    gains: str = quantity("dlqr", choices=("dlqr", "given"))
    # weights of x, y, phi and their rates: (6.24) with the weights of x and y multiplied by 1000, that of phi by 100,
    # and those of the rates of x and y divided by 10. A higher weight on phi would destabilise vision feedback, whose
    # yaw loop is the first to become unstable at 95 ms
    q: list[float] = quantity([1.4e7, 1.4e7, 9.75e4, 1.75e4, 1.75e4, 1.0e4], minimum=0.0, length=6)
    # weights of force and moment, (6.25)
    r: list[float] = quantity([2.3e3, 2.3e3, 5.0e2], above=0.0, length=3)
    # diagonals of K_p and K_d, (6.26) and (6.27)
    k_p: list[float] = quantity([2.45, 2.45, 1.23], "N/m, N*m/rad", minimum=0.0, length=3)
    k_d: list[float] = quantity([10.0, 10.0, 4.0], "N*s/m, N*m*s/rad", minimum=0.0, length=3)
    # integral gains, used by the vision-feedback PID only; zero as printed
    k_i: list[float] = quantity([0.0, 0.0, 0.0], minimum=0.0, length=3)
    # largest force and moment of the vision-feedback PID, for anti-windup; null: none
    force_limit: list[float] | None = quantity(None, "N, N, N*m", above=0.0, length=3)
    # feed-forward of the way point's motion; (6.13) has none, which causes a lag of K_d v / K_p = 1 m
    velocity_feed_forward: bool = quantity(True)
    acceleration_feed_forward: bool = quantity(True)
    # whether the position estimator (6.6) omits the rotation, as in print, with J at odometry's own heading
    estimator_as_printed: bool = quantity(False)


def omni_gains(plant: OmniPlantParameters, control: OmniControl, period_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (K_p, K_d), (3, 3) each, from pose error and velocity error to the force F in W of (6.16).

    The gains are the given ones, or a DLQR design at the sampling period `period_s` from the linearised plant.
    """
    if control.gains == "given":
        return np.diag(control.k_p), np.diag(control.k_d)
    a, b = linearised(plant)
    gain = dlqr(a, b, control.q, control.r, period_s)
    return gain[:, :3], gain[:, 3:]


def linearised(plant: OmniPlantParameters) -> tuple[np.ndarray, np.ndarray]:
    """Return (A (6, 6), B (6, 3)) of (6.15)-(6.16), linearised by Drake from the plant without slip and friction.

    The state is x, y, phi and their rates; the input is the force and moment in W.
    """
    neutral = dataclasses.replace(plant, friction=Friction(), slip=Slip())
    block = OmniPlant(neutral)
    context = block.CreateDefaultContext()
    block.get_input_port().FixValue(context, np.zeros(len(plant.geometry.wheels)))
    model = Linearize(block, context, block.get_input_port().get_index(), block.GetOutputPort("pose").get_index())
    return model.A()[:6, :6], model.B()[:6] @ plant.geometry.forward.T
