"""Discrete state of a plant: the slip noise of the present tick and the anchors of the wheels' bristles.

A plant without slip noise and with smooth friction has no discrete state, so Drake's `Linearize` accepts it directly.
"""

import numpy as np

from drake_ispace.blocks.block import Phase, Update
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.noise import normal
from drake_ispace.plants.friction import Friction, dragged_anchor
from drake_ispace.plants.slip import NOISE_STD, Slip

NOISE, ANCHOR = 0, 3  # x_d: slip noise (3), bristle anchors (n) [rad]


def tick_memory(slip: Slip, friction: Friction, update, wheels: int) -> dict:
    """Return the entries `discrete_state` and `updates` of a plant's Spec, or {} if the plant needs neither."""
    if any(slip.noise_std) or friction.model == "elastoplastic":
        return {"discrete_state": np.zeros(ANCHOR + wheels), "updates": (Update(update, Phase.COMPUTE),)}
    return {}


@kernel
def slip_noise(xd, axis):
    """Return the slip noise of an axis in the present tick."""
    return xd[NOISE + axis] if xd.shape[0] > 0 else 0.0


@kernel
def deflection(angle, xd, wheel):
    """Return the deflection of a wheel's bristle [rad] at the wheel's angle [rad]; zero without discrete state."""
    return angle - xd[ANCHOR + wheel] if xd.shape[0] > 0 else 0.0 * angle


@kernel
def remember(tick, angles, xd, noise_stream, friction, slip, out):
    """Draw the slip noise of this tick and drag the anchors along to the wheel angles `angles` (n) [rad]."""
    for axis in range(3):
        std = slip[NOISE_STD + axis]
        out[NOISE + axis] = std * normal(noise_stream, tick, axis) if std > 0.0 else 0.0
    for i in range(angles.shape[0]):
        out[ANCHOR + i] = dragged_anchor(angles[i], xd[ANCHOR + i], friction)
