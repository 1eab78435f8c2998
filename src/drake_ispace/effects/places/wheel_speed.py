"""What motors make of the speeds that a commanded velocity asks of the wheels: effects in the wire `velocity`.

G (n, 3) gives the rates of the wheels for a velocity of the body, its inverse J (3, n) the velocity for their rates. Of
more wheels than ways to move, J gives the motion of the body that comes nearest to that of the wheels. As arguments of
kernels both are flat: `wheels` is G row by row, `motion` is J column by column.
"""

import math

from drake_ispace.blocks.kernels import kernel
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.wires import VelocityEffect


@kernel
def wheel_rate(wheels, velocity, i):
    """Rate of wheel `i` [rad/s]."""
    j = 3 * i
    return wheels[j] * velocity[0] + wheels[j + 1] * velocity[1] + wheels[j + 2] * velocity[2]


@kernel
def beyond_dead_zone(velocity, width_rad_s, wheels, motion, out):
    out[0], out[1], out[2] = velocity[0], velocity[1], velocity[2]
    for i in range(wheels.shape[0] // 3):
        lost = min(max(wheel_rate(wheels, velocity, i), -width_rad_s), width_rad_s)
        for k in range(3):
            out[k] -= motion[3 * i + k] * lost


class VelocityDeadZone(VelocityEffect):
    """Every wheel slower than told by width_rad_s, and at rest where it is told less: w - clip(w, -width, width)."""

    card = Card(
        name="velocity_dead_zone", title="Dead zone of the drive", home="actuator",
        equation="v' = v - J clip(G v, -width_rad_s, width_rad_s), G v the rates of the wheels, J its inverse",
        source="motors without speed control, which need some voltage to turn at all",
        signature="wheels that are slower than told by one speed whatever the command, and do not move for a small one",
        look_alikes=("velocity_gain", "velocity_saturation"),
        excitation="commands of several sizes, both ways: a gain takes its share of each, a dead zone the same of all",
    )
    parameters = (Parameter("width_rad_s", "rad/s", 0.0, 0.0, math.inf, (0.05, 0.2), "speed", tolerance=1e-3),)
    output = beyond_dead_zone

    def block_parameters(self, body, values):
        geometry = body.plant.nominal_geometry
        return dict(values) | {"wheels": geometry.inverse.ravel(), "motion": geometry.forward.T.ravel()}
