"""Gain of the pendulum's feedback, section 6.6.4: given, or designed from the plant block's own linearisation."""

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
    """Feedback of the pendulum, section 6.6.4."""

    gains: str = quantity("dlqr", choices=("dlqr", "given"))
    # weights of s, phi, theta and their rates, (6.40), and of both torques, (6.41)
    q: list[float] = quantity([5e3, 1e3, 800.0, 50.0, 100.0, 1e3], minimum=0.0, length=6)
    r: list[float] = quantity([1e4, 1e4], above=0.0, length=2)
    # K (right wheel: s, phi) and F1 (right wheel: theta, s', phi', theta') of (6.42)-(6.43); left: yaw entries negated
    k_right: list[float] = quantity([0.4351, -0.2217], length=2)
    f1_right: list[float] = quantity([1.3328, 0.5548, -0.0843, 0.2023], length=4)
    tracker: Tracker = field(default_factory=Tracker)
    friction_compensation: FrictionCompensation = field(default_factory=FrictionCompensation)
    # (6.6) without its rotation
    estimator_as_printed: bool = quantity(False)


def balance_gain(plant: PendulumPlantParameters, control: PendulumControl) -> np.ndarray:
    """K (2, 6) of u = -K x: DLQR at 5 ms from the plant's own linearisation, or the given one, (6.42)-(6.43)."""
    if control.gains == "given":
        mirror_k, mirror_f1 = np.array([1.0, -1.0]), np.array([1.0, 1.0, -1.0, 1.0])
        k, f1 = np.array(control.k_right), np.array(control.f1_right)
        return from_printed(np.vstack([k, k * mirror_k]), np.vstack([f1, f1 * mirror_f1]))
    a, b = linearised(plant)
    return dlqr(a, b, control.q, control.r, TICK_S)


def linearised(plant: PendulumPlantParameters) -> tuple[np.ndarray, np.ndarray]:
    """(A (6, 6), B (6, 2)) of (2.54)-(2.57), linearised by Drake from the plant block, slip and friction left out."""
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
