"""Between motor and wheel: friction of gears and bearings in the wire `torque`, play in the wire `wheel_angle`.

Friction is beyond what the plant has itself, so it may be negative as far as the plant's own goes. Signs are smooth
(smooth.py), or come on as the wheel turns (presliding).
"""

import math

from drake_ispace.blocks.functions import exp
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.places.shaping import one_wheel, tolerated
from drake_ispace.effects.places.smooth import LEAST_SPEED_RAD_S, dry, slope_left, speed_scale, steepest_slope
from drake_ispace.effects.wires import TorqueEffect, WheelAngleEffect


@kernel
def viscous(torque, wheel_rate, coefficient_n_m_s, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] - coefficient_n_m_s * wheel_rate[i]


class ViscousFriction(TorqueEffect):
    """-c w on every wheel, beyond what the plant has; at most what the 5 ms step can integrate."""

    card = Card(
        name="viscous_friction", title="Viscous friction", home="transmission", equation="tau' = tau - c w",
        source="(3.35), c_v",
        signature="an unmodelled torque against the wheel's speed and in proportion to it",
        look_alikes=("coulomb_friction", "single_wheel_viscous_friction", "soft_floor", "torque_gain_error"),
        excitation="several speeds: at one speed alone it equals Coulomb friction",
    )
    output = viscous

    def parameters_of(self, body):
        least, most = body.robot.least_friction(body.plant, "viscous_n_m_s"), slope_left(body)
        name, unit, scale = "coefficient_n_m_s", "N*m*s/rad", "torque/speed"
        return (Parameter(name, unit, 0.0, least, most, (0.03, 0.15), scale, tolerance=0.008),)


@kernel
def coulomb(torque, wheel_rate, torque_n_m, speed_scale_rad_s, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] - dry(torque_n_m, wheel_rate[i], speed_scale_rad_s)


class CoulombFriction(TorqueEffect):
    """-C tanh(w / w_s) on every wheel, beyond what the plant has.

    Where C takes friction of the plant away, w_s is the plant's own: wider, it would leave some of it at low speeds.
    """

    card = Card(
        name="coulomb_friction", title="Coulomb friction", home="transmission", equation="tau' = tau - C sign(w)",
        source="(3.35), c_cu: seals and preloaded gears",
        signature="an unmodelled torque of one size against the wheel's direction, which jumps when it reverses",
        look_alikes=(
            "viscous_friction", "stribeck_friction", "load_dependent_friction", "actuator_dead_zone", "soft_floor",
        ),
        excitation="slow and fast runs in both directions: viscous friction grows with speed, a soft floor acts along "
        "the robot's way and not on each wheel, a dead zone takes torque away at standstill and from braking as well",
    )
    output = coulomb

    def parameters_of(self, body):
        least = body.robot.least_friction(body.plant, "coulomb_n_m")
        return (Parameter("torque_n_m", "N*m", 0.0, least, math.inf, (0.03, 0.15), "torque", tolerance=0.008),)

    def block_parameters(self, body, values):
        torque = values["torque_n_m"]
        own = body.friction_width if torque < 0.0 else 0.0
        return {"torque_n_m": torque, "speed_scale_rad_s": own or speed_scale(body, torque)}


@kernel
def one_coulomb(torque, wheel_rate, torques_n_m, speed_scale_rad_s, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] - dry(torques_n_m[i], wheel_rate[i], speed_scale_rad_s)


class SingleWheelFriction(TorqueEffect):
    """-C tanh(w / w_s) on the wheel that is named, 1 to n."""

    least_wheels = 2  # of one it would be Coulomb friction
    choices = ("wheel",)
    card = Card(
        name="single_wheel_friction", title="Friction of one wheel", home="transmission",
        equation="tau'_i = tau_i - C sign(w_i), i = wheel", source="one tight bearing, hair around one axle",
        signature="an unmodelled torque of one size against the direction of one wheel; none on the others",
        look_alikes=(
            "coulomb_friction", "single_wheel_viscous_friction", "weak_motor", "motor_offset", "turn_scrub",
        ),
        excitation="both directions, at several torques: a weak motor misses in proportion to its command, an offset "
        "does not turn its sign with the wheel",
    )
    output = one_coulomb

    def parameters_of(self, body):
        tolerance = tolerated(body, 0.008)
        return (Parameter("torque_n_m", "N*m", 0.0, 0.0, math.inf, (0.05, 0.3), "torque", tolerance=tolerance),)

    def block_parameters(self, body, values):
        torque = values["torque_n_m"]
        return {"torques_n_m": one_wheel(body, values, torque, 0.0), "speed_scale_rad_s": speed_scale(body, torque)}


@kernel
def one_viscous(torque, wheel_rate, coefficients_n_m_s, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] - coefficients_n_m_s[i] * wheel_rate[i]


class SingleWheelViscousFriction(TorqueEffect):
    """-c w on the wheel that is named, 1 to n; at most what the 5 ms step can integrate."""

    least_wheels = 2  # of one it would be viscous friction
    choices = ("wheel",)
    card = Card(
        name="single_wheel_viscous_friction", title="Viscous friction of one wheel", home="transmission",
        equation="tau'_i = tau_i - c w_i, i = wheel", source="one bearing with stiff grease, a motor that brakes",
        signature="an unmodelled torque against the speed of one wheel and in proportion to it; none on the others",
        look_alikes=("single_wheel_friction", "viscous_friction", "weak_motor"),
        excitation="several speeds in both directions: Coulomb friction of the wheel is the same at each; a weak motor "
        "misses in proportion to its command",
    )
    output = one_viscous

    def parameters_of(self, body):
        name, unit, scale, tolerance = "coefficient_n_m_s", "N*m*s/rad", "torque/speed", tolerated(body, 0.008)
        return (Parameter(name, unit, 0.0, 0.0, slope_left(body), (0.03, 0.15), scale, tolerance=tolerance),)

    def block_parameters(self, body, values):
        return {"coefficients_n_m_s": one_wheel(body, values, values["coefficient_n_m_s"], 0.0)}


@kernel
def one_way(torque, wheel_rate, torque_n_m, way, speed_scale_rad_s, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] - 0.5 * torque_n_m - dry(0.5 * torque_n_m * way, wheel_rate[i], speed_scale_rad_s)


class DirectionalFriction(TorqueEffect):
    """-C (1 + tanh(w / w_s)) / 2 on every wheel for C > 0: forwards only; -C (1 - tanh(w / w_s)) / 2 for C < 0."""

    least_wheels = 2  # of one it would be Coulomb friction and an offset, half of it each
    card = Card(
        name="directional_friction", title="Friction in one direction", home="transmission",
        equation="tau' = tau - C for w > 0 where C > 0, tau' = tau - C for w < 0 where C < 0",
        source="asymmetric brushes, gear flanks or seals",
        signature="an unmodelled torque against the wheel while it turns one way, none the other way",
        look_alikes=("coulomb_friction", "motor_offset", "load_dependent_friction", "floor_tilt"),
        excitation="the same speeds forwards and backwards: Coulomb friction brakes both ways alike, an offset pushes "
        "one way and brakes the other",
    )
    output = one_way

    def parameters_of(self, body):
        tolerance = tolerated(body, 0.008)
        return (Parameter("torque_n_m", "N*m", 0.0, -math.inf, math.inf, (0.05, 0.2), "torque", tolerance=tolerance),)

    def block_parameters(self, body, values):
        torque = values["torque_n_m"]
        scale = speed_scale(body, 0.5 * torque)
        return {"torque_n_m": torque, "way": -1.0 if torque < 0.0 else 1.0, "speed_scale_rad_s": scale}


@kernel
def dragged(torque, wheel_rate, coefficient_n_m_s2, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] - coefficient_n_m_s2 * abs(wheel_rate[i]) * wheel_rate[i]


class WheelDrag(TorqueEffect):
    """-k |w| w on every wheel."""

    general = False
    card = Card(
        name="wheel_drag", title="Drag of the wheels with the square of speed", home="transmission",
        equation="tau' = tau - k |w| w", source="churning grease, brushes and bristles that a fast wheel whips",
        signature="an unmodelled torque against the wheel that grows with the square of its speed",
        look_alikes=("viscous_friction", "quadratic_drag", "coulomb_friction"),
        excitation="slow and fast runs: viscous friction doubles where this goes up fourfold; turning on the spot, "
        "where drag of the body is absent",
    )
    parameters = (Parameter("coefficient_n_m_s2", "N*m*s^2/rad^2", 0.0, 0.0, 1.0, (1e-5, 1e-4)),)
    output = dragged


@kernel
def stribeck(torque, wheel_rate, bump_n_m, speed_rad_s, speed_scale_rad_s, out):
    for i in range(out.shape[0]):
        out[i] = torque[i]
        if bump_n_m != 0.0:
            share = wheel_rate[i] / speed_rad_s
            out[i] -= dry(bump_n_m * exp(-share * share), wheel_rate[i], speed_scale_rad_s)


class StribeckFriction(TorqueEffect):
    """-B exp(-(w / w_S)^2) tanh(w / w_s) on every wheel: what breaking loose costs beyond Coulomb friction."""

    card = Card(
        name="stribeck_friction", title="Stribeck friction", home="transmission",
        equation="tau' = tau - B exp(-(w/w_S)^2) sign(w)",
        source="boundary lubrication of gears and bearings, which lift off at w_S",
        signature="an unmodelled torque against the wheel's direction at low speed only, none once the wheel is fast",
        look_alikes=("coulomb_friction", "actuator_dead_zone", "transmission_backlash"),
        excitation="creeping, with many starts and reversals, and fast runs beside them: Coulomb friction stays when "
        "the wheel is fast; a dead zone follows the command and not the speed",
    )
    parameters = (
        Parameter("bump_n_m", "N*m", 0.0, 0.0, math.inf, (0.05, 0.2), "torque", tolerance=0.04),
        Parameter("speed_rad_s", "rad/s", 1.0, LEAST_SPEED_RAD_S, math.inf, (0.1, 0.4), "speed", shape=True),
    )
    output = stribeck

    def block_parameters(self, body, values):
        bump, speed = values["bump_n_m"], values["speed_rad_s"]
        return {"bump_n_m": bump, "speed_rad_s": speed, "speed_scale_rad_s": speed_scale(body, bump)}


@kernel
def bent(before, turned_rad, reach_rad):
    """How far bristles are bent, -1 to 1, when the wheel has turned on by `turned_rad`; before: until then."""
    end = 1.0 if turned_rad > 0.0 else -1.0
    return end + (before - end) * exp(-abs(turned_rad) / reach_rad)


@kernel
def rubbed(xd, torque, wheel_rate, torque_n_m, reach_rad, out):
    for i in range(out.shape[0]):
        out[i] = torque[i]
        if torque_n_m != 0.0:  # half a tick after x_d
            out[i] -= torque_n_m * bent(xd[i], 0.5 * TICK_S * wheel_rate[i], reach_rad)


@kernel
def remember_bent(xd, wheel_rate, torque_n_m, reach_rad, out):
    for i in range(out.shape[0]):
        out[i] = bent(xd[i], TICK_S * wheel_rate[i], reach_rad) if torque_n_m != 0.0 else xd[i]


class PreslidingFriction(TorqueEffect):
    """-C z on every wheel; z, -1 to 1, follows the direction of the wheel as it turns on (Dahl); x_d = [z (n)].

    Bristles bend before they slide: a wheel that reverses feels the whole friction only after it has turned by some a.
    At rest z stays, so that the friction holds the wheel like a spring.
    """

    generalises = ("coulomb_friction",)
    card = Card(
        name="presliding_friction", title="Presliding friction", home="transmission",
        equation="tau' = tau - C z, dz/dtheta = (sign(w) - z) / a",
        source="P. R. Dahl, A solid friction model, 1968: bristles, belts or tyres that wind up before they slip",
        signature="an unmodelled torque against the wheel's direction, which comes on over an angle after each "
        "reversal and holds the wheel at rest like a spring",
        look_alikes=("coulomb_friction", "transmission_backlash", "stribeck_friction"),
        excitation="many reversals, slow and fast: Coulomb friction jumps at once, whatever the angle; backlash shows "
        "in the encoder's angle and not in the torque",
    )
    parameters = (
        Parameter("torque_n_m", "N*m", 0.0, 0.0, math.inf, (0.03, 0.15), "torque", tolerance=0.008),
        Parameter("reach_rad", "rad", 0.2, 0.05, 5.0, (0.1,), shape=True),
    )
    output, update = rubbed, remember_bent


@kernel
def load_dependent(torque, wheel_rate, share, least_speed_rad_s, slope_n_m_s, out):
    copy(torque, out)
    if share == 0.0:
        return
    for i in range(out.shape[0]):
        drag = share * abs(torque[i])
        out[i] = torque[i] - dry(drag, wheel_rate[i], max(least_speed_rad_s, drag / slope_n_m_s))


class LoadDependentFriction(TorqueEffect):
    """-share |tau| tanh(w / w_s) on every wheel, tau the torque that arrives here; w_s grows with |tau| (smooth.py)."""

    card = Card(
        name="load_dependent_friction", title="Load-dependent friction", home="transmission",
        equation="tau' = tau - share |tau| sign(w)",
        source="gear meshes that lose a share of what they carry, worm gears above all",
        signature="torque missing in proportion to the command while the motor drives, and braking that is too strong",
        look_alikes=("torque_gain_error", "coulomb_friction", "battery_sag_load"),
        excitation="acceleration and braking in turn: a gain error scales both alike, this one weakens the drive and "
        "strengthens the brake; coasting, where only Coulomb friction acts",
    )
    parameters = (Parameter("share", "1", 0.0, 0.0, 0.9, (0.05, 0.2), tolerance=5e-3),)
    output = load_dependent

    def block_parameters(self, body, values):
        slope = steepest_slope(body)
        return {"share": values["share"], "least_speed_rad_s": LEAST_SPEED_RAD_S, "slope_n_m_s": slope}


@kernel
def lead(xd, torque, half_gap_rad, rate_rad_s_n_m, out):
    """By how much each motor is ahead of its wheel at the end of the tick (n) [rad]; x_d: at its start."""
    for i in range(out.shape[0]):
        crossed = xd[i] + rate_rad_s_n_m * torque[i] * TICK_S
        out[i] = min(max(crossed, -half_gap_rad), half_gap_rad)


@kernel
def motor_angle(xd, wheel_angle, torque, half_gap_rad, rate_rad_s_n_m, out):
    lead(xd, torque, half_gap_rad, rate_rad_s_n_m, out)
    for i in range(out.shape[0]):
        out[i] += wheel_angle[i]


class TransmissionBacklash(WheelAngleEffect):
    """The encoder sits on the motor's side of a play: it reads the wheel's angle plus a lead of at most gap / 2.

    The motor crosses the play as fast as its torque drives it when nothing else resists: at `rate` times the torque.
    It starts in the middle. The torque that the play does not pass meanwhile is left out.
    """

    needs = ("torque",)
    kinematic = False
    card = Card(
        name="transmission_backlash", title="Backlash", home="transmission",
        equation="theta' = theta + l, dl/dt = rate tau, |l| <= gap/2",
        source="play of the gears between motor, where the encoder sits, and wheel",
        signature="odometry that jumps by the gap at every reversal of a wheel and is right over a closed way",
        look_alikes=("stribeck_friction", "encoder_scale", "encoder_lost_counts"),
        excitation="many reversals: the error does not grow with the way, as it does where the encoder's scale is "
        "wrong or counts are lost; a pose from the room at rest shows it without any torque, which friction cannot do",
    )
    parameters = (
        Parameter("gap_rad", "rad", 0.0, 0.0, 0.5, (0.02, 0.1), tolerance=2e-3),
        Parameter("rate_rad_s_n_m", "rad/(s*N*m)", 1000.0, 10.0, 1e5, (500.0,), shape=True),
    )
    output, update = motor_angle, lead

    def block_parameters(self, body, values):
        return {"half_gap_rad": 0.5 * values["gap_rad"], "rate_rad_s_n_m": values["rate_rad_s_n_m"]}


EFFECTS = (
    ViscousFriction(), WheelDrag(), CoulombFriction(), SingleWheelFriction(), SingleWheelViscousFriction(),
    DirectionalFriction(), StribeckFriction(), PreslidingFriction(), LoadDependentFriction(), TransmissionBacklash(),
)
