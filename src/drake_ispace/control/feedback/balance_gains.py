"""Gain of the pendulum's feedback, section 6.6.4: given, or designed by DLQR from the linearised plant block."""

import dataclasses
from dataclasses import dataclass, field

import numpy as np
from pydrake.systems.primitives import Linearize

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.control.feedback.balance_controller import from_printed
from drake_ispace.control.feedback.dlqr import dlqr
from drake_ispace.control.feedback.friction_compensator import FrictionCompensation
from drake_ispace.control.guide.tracker import Tracker
from drake_ispace.files.quantity import quantity
from drake_ispace.plants.friction import Friction
from drake_ispace.plants.pendulum import (
    S_RATE,
    TILT,
    TILT_RATE,
    YAW_RATE,
    PendulumPlant,
    PendulumPlantParameters,
)
from drake_ispace.plants.slip import Slip


@dataclass
class PendulumControl:
    """Settings of the pendulum's feedback, section 6.6.4."""

    # dlqr: designed from the plant with q and r; given: k_right and f1_right below
    gains: str = quantity("dlqr", choices=("dlqr", "given"))
    # q: weights of s, phi, theta and their rates, (6.40); r: weights of both torques, (6.41)
    q: list[float] = quantity([5e3, 1e3, 800.0, 50.0, 100.0, 1e3], minimum=0.0, length=6)
    r: list[float] = quantity([1e4, 1e4], above=0.0, length=2)
    # rows of the right wheel of K (s, phi) and F1 (theta, s_dot, phi_dot, theta_dot) in (6.42)-(6.43); the rows of the
    # left wheel have the opposite sign for phi and phi_dot
    k_right: list[float] = quantity([0.4351, -0.2217], length=2)
    f1_right: list[float] = quantity([1.3328, 0.5548, -0.0843, 0.2023], length=4)
    tracker: Tracker = field(default_factory=Tracker)
    friction_compensation: FrictionCompensation = field(default_factory=FrictionCompensation)
    # whether the position estimator (6.6) omits the rotation, as in print
    estimator_as_printed: bool = quantity(False)


def balance_gain(plant: PendulumPlantParameters, control: PendulumControl) -> np.ndarray:
    """Return K (2, 6) of u = -K x with x = [s, phi, theta, s_dot, phi_dot, theta_dot].

    K is the given gain, (6.42)-(6.43), or a DLQR design at 5 ms from the linearised plant.
    """
    if control.gains == "given":
        mirror_k, mirror_f1 = np.array([1.0, -1.0]), np.array([1.0, 1.0, -1.0, 1.0])
        k, f1 = np.array(control.k_right), np.array(control.f1_right)
        return from_printed(np.vstack([k, k * mirror_k]), np.vstack([f1, f1 * mirror_f1]))
    a, b = linearised(plant)
    return dlqr(a, b, control.q, control.r, TICK_S)


def linearised(plant: PendulumPlantParameters) -> tuple[np.ndarray, np.ndarray]:
    """Return (A (6, 6), B (6, 2)) of (2.54)-(2.57), linearised by Drake from the plant without slip and friction."""
    neutral = dataclasses.replace(plant, friction=Friction(), slip=Slip())
    block = PendulumPlant(neutral)
    context = block.CreateDefaultContext()
    block.get_input_port().FixValue(context, np.zeros(2))
    model = Linearize(block, context, block.get_input_port().get_index(), block.GetOutputPort("balance").get_index())
    rates = [S_RATE, YAW_RATE, TILT_RATE]
    a, b = np.zeros((6, 6)), np.zeros((6, 2))
    a[:3, 3:] = np.eye(3)
    a[3:, 2] = model.A()[rates, TILT]
    a[3:, 3:] = model.A()[np.ix_(rates, rates)]
    b[3:] = model.B()[rates]
    return a, b
