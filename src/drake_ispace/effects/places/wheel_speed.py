"""What motors make of the speeds that a commanded velocity asks of the wheels: effects in the wire `velocity`.

G (n, 3) gives the rates of the wheels for a velocity of the body, its inverse J (3, n) the velocity for their rates. Of
more wheels than ways to move, J gives the motion of the body that comes nearest to that of the wheels. As arguments of
kernels both are flat: `wheels` is G row by row, `motion` is J column by column.
"""

import math

from drake_ispace.blocks.kernels import kernel
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.places.shaping import LEAST_LIMIT
from drake_ispace.effects.wires import VelocityEffect


@kernel
def wheel_rate(wheels, velocity, i):
    """Rate of wheel `i` [rad/s]."""
    j = 3 * i
    return wheels[j] * velocity[0] + wheels[j + 1] * velocity[1] + wheels[j + 2] * velocity[2]


class _OfEachWheel(VelocityEffect):
    """What becomes of each wheel's speed by itself; the kernel takes `wheels` and `motion`."""

    def block_parameters(self, body, values):
        geometry = body.plant.nominal_geometry
        return dict(values) | {"wheels": geometry.inverse.ravel(), "motion": geometry.forward.T.ravel()}


@kernel
def beyond_dead_zone(velocity, width_rad_s, wheels, motion, out):
    out[0], out[1], out[2] = velocity[0], velocity[1], velocity[2]
    for i in range(wheels.shape[0] // 3):
        lost = min(max(wheel_rate(wheels, velocity, i), -width_rad_s), width_rad_s)
        for k in range(3):
            out[k] -= motion[3 * i + k] * lost


class VelocityDeadZone(_OfEachWheel):
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


@kernel
def wheels_limited(velocity, limit_rad_s, wheels, motion, out):
    out[0], out[1], out[2] = velocity[0], velocity[1], velocity[2]
    for i in range(wheels.shape[0] // 3):
        rate = wheel_rate(wheels, velocity, i)
        lost = rate - min(max(rate, -limit_rad_s), limit_rad_s)
        for k in range(3):
            out[k] -= motion[3 * i + k] * lost


class WheelSpeedLimit(_OfEachWheel):
    """Every wheel at most as fast as limit_rad_s, each by itself: clip(w, -limit, limit)."""

    card = Card(
        name="wheel_speed_limit", title="Speed limit of each wheel", home="actuator",
        equation="v' = v + J (clip(G v, -limit_rad_s, limit_rad_s) - G v), G v the rates of the wheels, J its inverse",
        source="motors at their full voltage, a speed limit in each motor's own controller",
        signature="of fast bends only the outer wheel falls behind and stays at one speed, so that the robot turns "
        "less than told; encoders show it as the pose does",
        look_alikes=("velocity_saturation", "wheel_speed_desaturation", "velocity_gain"),
        excitation="fast bends beside driving straight on and turning on the spot: a limit of the body's axes acts on "
        "one of them and is the same in bends, one of all wheels together keeps the curvature",
    )
    parameters = (
        # where a limit is met, it is the largest speed; one below that shows what it would leave of other runs
        Parameter("limit_rad_s", "rad/s", math.inf, LEAST_LIMIT, math.inf, (1.0, 0.8), "top speed", reciprocal=True),
    )
    output = wheels_limited


@kernel
def slowed_together(velocity, limit_rad_s, wheels, out):
    fastest = 0.0
    for i in range(wheels.shape[0] // 3):
        fastest = max(fastest, abs(wheel_rate(wheels, velocity, i)))
    share = min(1.0, limit_rad_s / max(fastest, 1e-300))
    for k in range(3):
        out[k] = share * velocity[k]


class WheelSpeedDesaturation(VelocityEffect):
    """All wheels slowed by one share, by which the fastest keeps to limit_rad_s: v min(1, limit / max|w|)."""

    card = Card(
        name="wheel_speed_desaturation", title="Slowing of all wheels to the limit of one", home="actuator",
        equation="v' = v min(1, limit_rad_s / max|G v|), G v the rates of the wheels",
        source="a controller that keeps the curvature of the way where a wheel cannot follow",
        signature="in fast bends the robot is slower than told, in driving and in turning by one share, while its way "
        "bends as told; encoders show it as the pose does",
        look_alikes=("velocity_saturation", "wheel_speed_limit", "velocity_gain"),
        excitation="fast bends beside driving straight on and turning on the spot: wheels that are limited each by "
        "itself bend the way less, a limit of the body's axes is the same in bends",
    )
    parameters = WheelSpeedLimit.parameters
    output = slowed_together

    def block_parameters(self, body, values):
        return dict(values) | {"wheels": body.plant.nominal_geometry.inverse.ravel()}
