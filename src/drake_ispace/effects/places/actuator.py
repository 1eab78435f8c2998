"""Between the commanded torque and what the motor gives: effects in the wire `torque`, all wheels alike or one.

Memory is kept as shaping.py says.
"""

import math

import numpy as np

from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.places.shaping import LEAST_LIMIT, Delay, Lag, keep, mix, one_wheel, scale, shift, tolerated
from drake_ispace.effects.wires import TorqueEffect


@kernel
def delayed(xd, torque, delay_ticks, out):
    shift(xd, torque, delay_ticks, out)


@kernel
def remember_commands(xd, torque, out):
    keep(xd, torque, out)


class CommandDelay(Delay, TorqueEffect):
    """tau(t - delay) of the held command; for a part of a tick the mean of the two commands that fall into the tick."""

    card = Card(
        name="command_delay", title="Command delay", home="actuator", equation="tau'(t) = tau(t - delay)",
        source="bus and computing time between controller and driver",
        signature="torque missing where the command rises and as much too late where it falls, the same for any size",
        look_alikes=("motor_lag", "torque_slew_limit", "camera_latency"),
        excitation="steps and fast reversals of the command: a lag rounds them and a slew limit makes ramps of them, a "
        "delay shifts them; a late camera shifts the pose alone, not the encoders",
    )
    parameters = (Parameter("delay_s", "s", 0.0, 0.0, 0.06, (0.001, 0.005, 0.02), tolerance=2e-4, shifts=True),)
    output, update = delayed, remember_commands


@kernel
def saturated(torque, limit_n_m, out):
    for i in range(out.shape[0]):
        out[i] = min(max(torque[i], -limit_n_m), limit_n_m)


class TorqueSaturation(TorqueEffect):
    """clip(tau, -limit, limit) on every wheel."""

    card = Card(
        name="torque_saturation", title="Torque limit", home="actuator", equation="tau' = clip(tau, -limit, limit)",
        source="current limit of the driver, stall torque of the motor",
        signature="torque missing at the peaks of the command only, by what they exceed one size",
        look_alikes=("battery_sag_load", "torque_slew_limit", "torque_gain_error"),
        excitation="commands of several sizes held for a while: below the limit nothing is missing, where a gain error "
        "and a sagging supply take something of every command; a slew limit spares what is held",
    )
    parameters = (
        Parameter("limit_n_m", "N*m", math.inf, LEAST_LIMIT, math.inf, (1.0, 2.0), "torque", reciprocal=True),
    )
    output = saturated


@kernel
def slewed(xd, torque, most_n_m, out):
    for i in range(out.shape[0]):
        out[i] = min(max(torque[i], xd[i] - most_n_m), xd[i] + most_n_m)


class TorqueSlewLimit(TorqueEffect):
    """From tick to tick the torque changes by rate T at most; x_d = [torque that went through (n)]."""

    card = Card(
        name="torque_slew_limit", title="Torque slew limit", home="actuator", equation="|tau'_k - tau'_k-1| <= rate T",
        source="ramp in the driver that spares gears and supply",
        signature="torque missing after large steps of the command only, and none of it after small ones",
        look_alikes=("motor_lag", "command_delay", "torque_saturation"),
        excitation="steps of several sizes: a lag takes the same time for all of them, a slew limit takes longer for "
        "larger ones",
    )
    parameters = (
        Parameter("rate_n_m_s", "N*m/s", math.inf, LEAST_LIMIT, math.inf, (10.0, 50.0), "torque", reciprocal=True),
    )
    output = update = slewed

    def block_parameters(self, body, values):
        return {"most_n_m": values["rate_n_m_s"] * TICK_S}


@kernel
def beyond_dead_zone(torque, width_n_m, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] - min(max(torque[i], -width_n_m), width_n_m)


class ActuatorDeadZone(TorqueEffect):
    """tau - clip(tau, -width, width) on every wheel."""

    card = Card(
        name="actuator_dead_zone", title="Dead zone", home="actuator", equation="tau' = tau - clip(tau, -width, width)",
        source="driver that switches late, magnets' drag in the motor",
        signature="torque of one size missing from every command, whichever way the wheel turns",
        look_alikes=("coulomb_friction", "stribeck_friction", "load_dependent_friction"),
        excitation="braking: friction helps to brake, a dead zone weakens the brake as it weakens the drive; coasting, "
        "where friction acts and a dead zone does not",
    )
    parameters = (Parameter("width_n_m", "N*m", 0.0, 0.0, math.inf, (0.05, 0.2), "torque", tolerance=0.01),)
    output = beyond_dead_zone


@kernel
def scaled(torque, gain, out):
    scale(torque, gain, out)


class TorqueGainError(TorqueEffect):
    """(1 + share) tau."""

    card = Card(
        name="torque_gain_error", title="Torque gain error", home="actuator", equation="tau' = (1 + share) tau",
        source="motor constant or amplifier gain other than assumed",
        signature="an unmodelled torque in proportion to the command, equal for all wheels",
        look_alikes=("mass_error", "inertia_error", "drive_inertia", "load_dependent_friction", "battery_sag_load"),
        excitation="acceleration along all axes and turning: a mass error scales forces only, not the yaw moment",
    )
    parameters = (Parameter("share", "1", 0.0, -0.7, 0.7, (0.05,), tolerance=0.005),)
    output = scaled

    def block_parameters(self, body, values):
        return {"gain": np.full(body.wheels, 1.0 + values["share"])}


class WeakMotor(TorqueEffect):
    """(1 - loss) tau on the wheel that is named, 1 to n."""

    least_wheels = 2  # of one it would be the torque gain error
    choices = ("wheel",)
    card = Card(
        name="weak_motor", title="Weak motor", home="actuator", equation="tau'_i = (1 - loss) tau_i, i = wheel",
        source="worn brushes, a warm winding or a bad contact of one motor",
        signature="an unmodelled torque in proportion to the command of one wheel, so driving and turning disturb each "
        "other",
        look_alikes=("torque_gain_error", "single_wheel_radius_error", "centre_of_gravity_offset"),
        excitation="acceleration along all axes and turning, so that every wheel has its own command; a wheel of "
        "another size shows at constant speed too, where a weak motor does not",
    )
    parameters = (Parameter("loss", "1", 0.0, -0.5, 0.95, (0.05, 0.3), tolerance=0.005),)
    output = scaled

    def block_parameters(self, body, values):
        return {"gain": one_wheel(body, values, 1.0 - values["loss"])}


@kernel
def offset(torque, offsets_n_m, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] + offsets_n_m[i]


class MotorOffset(TorqueEffect):
    """A constant torque added on the wheel that is named, 1 to n."""

    choices = ("wheel",)
    card = Card(
        name="motor_offset", title="Torque offset of one motor", home="actuator",
        equation="tau'_i = tau_i + offset, i = wheel", source="zero level of one motor's driver or D/A converter",
        signature="an unmodelled torque of one wheel that is always the same, also at rest and whichever way it turns",
        look_alikes=("single_wheel_friction", "weak_motor", "floor_tilt", "centre_of_gravity_offset"),
        excitation="both directions and several headings: friction turns its sign with the wheel, a slope with the "
        "robot, a weak motor with the command",
    )
    output = offset

    def parameters_of(self, body):
        tolerance = tolerated(body, 0.008)
        return (Parameter("offset_n_m", "N*m", 0.0, -math.inf, math.inf, (0.05, 0.2), "torque", tolerance=tolerance),)

    def block_parameters(self, body, values):
        return {"offsets_n_m": one_wheel(body, values, values["offset_n_m"], 0.0)}


@kernel
def sagged_in_time(xd, torque, rate_per_s, out):
    for i in range(out.shape[0]):
        out[i] = (1.0 - rate_per_s * xd[0]) * torque[i]


@kernel
def remember_time(tick, since_s, out):
    """x_d = [time of the tick (1)] [s], the same over the whole tick; since_s: of tick 0."""
    out[0] = since_s + tick * TICK_S


class BatterySagTime(TorqueEffect):
    """(1 - rate t) tau, t the time of the tick since the start of the run."""

    card = Card(
        name="battery_sag_time", title="Battery that runs down", home="actuator", equation="tau' = (1 - rate t) tau",
        source="supply of a driver without current control, a winding that gets warm",
        signature="an unmodelled torque in proportion to the command and to the time since the start",
        look_alikes=("torque_gain_error", "battery_sag_load", "weak_motor"),
        excitation="the same acceleration early and late in a long run: a gain error is the same in both",
    )
    parameters = (
        Parameter("rate_per_s", "1/s", 0.0, -0.03, 0.03, (0.003, 0.01), tolerance=5e-4, sensible=(0.0, math.inf)),
    )
    output, update = sagged_in_time, remember_time

    def memory_size(self, body):
        return 1

    def block_parameters(self, body, values):
        return super().block_parameters(body, values) | {"since_s": 0.0}


@kernel
def sagged_by_load(torque, share_per_n_m, out):
    load = 0.0
    for i in range(out.shape[0]):
        load = load + abs(torque[i])
    left = max(1.0 - share_per_n_m * load, 0.0)
    for i in range(out.shape[0]):
        out[i] = left * torque[i]


class BatterySagLoad(TorqueEffect):
    """(1 - share sum |tau|) tau, all wheels from one supply; the factor does not fall below 0."""

    card = Card(
        name="battery_sag_load", title="Battery that sags under load", home="actuator",
        equation="tau'_i = (1 - share sum |tau_j|) tau_i",
        source="internal resistance of the supply that all motors share",
        signature="an unmodelled torque in proportion to the command and to the load of all wheels together",
        look_alikes=("torque_gain_error", "torque_saturation", "load_dependent_friction"),
        excitation="weak and strong acceleration, along one axis and along several at once: a gain error takes the "
        "same share of all of them, a torque limit takes nothing of weak ones",
    )
    parameters = (
        Parameter("share_per_n_m", "1/(N*m)", 0.0, 0.0, math.inf, (0.05, 0.2), "1/torque", tolerance=5e-3),
    )
    output = sagged_by_load


@kernel
def lagged(xd, torque, blend, out):
    mix(xd, torque, blend, out)


@kernel
def remember_lagged(xd, torque, memory, out):
    mix(xd, torque, memory, out)


class MotorLag(Lag, TorqueEffect):
    """First-order lag of the held command, its mean over each tick (shaping.Lag)."""

    card = Card(
        name="motor_lag", title="Motor lag", home="actuator", equation="time_constant d(tau')/dt = tau - tau'",
        source="electrical time constant of winding and driver, M(q) of (3.27)",
        signature="torque missing where the command rises, too much where it falls",
        look_alikes=("command_delay", "torque_slew_limit"),
        excitation="steps and fast reversals of the command: a delay shifts them, a lag rounds them",
    )
    parameters = (Parameter("time_constant_s", "s", 0.0, 0.0, 0.2, (0.001, 0.005, 0.02), tolerance=2e-4),)
    output, update = lagged, remember_lagged


EFFECTS = (
    CommandDelay(), TorqueSaturation(), TorqueSlewLimit(), ActuatorDeadZone(), TorqueGainError(), WeakMotor(),
    MotorOffset(), BatterySagTime(), BatterySagLoad(), MotorLag(),
)
