"""Memory of a plant from tick to tick: this tick's slip noise and the anchors of the wheels' bristles.

A plant whose slip is not random and whose friction is smooth needs none of it: it then has no discrete state at all,
and Drake's `Linearize` takes it as it is.
"""

import numpy as np

from drake_ispace.blocks.block import Phase, Update
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.noise import normal
from drake_ispace.plants.friction import Friction, dragged_anchor
from drake_ispace.plants.slip import NOISE_STD, Slip

NOISE, ANCHOR = 0, 3  # x_d: slip noise (3), bristle anchors (n) [rad]


def tick_memory(slip: Slip, friction: Friction, update, wheels: int) -> dict:
    """The `discrete_state` and `updates` of a plant's Spec, or nothing."""
    if any(slip.noise_std) or friction.model == "elastoplastic":
        return {"discrete_state": np.zeros(ANCHOR + wheels), "updates": (Update(update, Phase.COMPUTE),)}
    return {}


@kernel
def slip_noise(xd, axis):
    """This tick's slip noise of an axis."""
    return xd[NOISE + axis] if xd.shape[0] > 0 else 0.0


@kernel
def deflection(angle, xd, wheel):
    """The deflection of a wheel's bristle [rad], given the wheel's angle [rad]."""
    return angle - xd[ANCHOR + wheel] if xd.shape[0] > 0 else 0.0 * angle


@kernel
def remember(tick, angles, xd, noise_stream, friction, slip, out):
    """Draw this tick's slip noise and drag the anchors along to `angles` (n) [rad]."""
    for axis in range(3):
        std = slip[NOISE_STD + axis]
        out[NOISE + axis] = std * normal(noise_stream, tick, axis) if std > 0.0 else 0.0
    for i in range(angles.shape[0]):
        out[ANCHOR + i] = dragged_anchor(angles[i], xd[ANCHOR + i], friction)
