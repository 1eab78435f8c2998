"""Between the commanded torque and what the motor gives: effects in the wire `torque`, all wheels alike or one.

Memory is kept in the sensing phase: at t_k+1 it stores what went through on [t_k, t_k+1), before the next command
acts. So the output follows the command of its own tick, and nothing is a tick late. Torque is constant over a tick;
what changes within one enters with its mean.
"""

import math

import numpy as np

from drake_ispace.block import Output, Phase, Spec, Update
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.effect import BlockEffect
from drake_ispace.kernels import kernel
from drake_ispace.rates import TICK_S

_LEAST = 1e-6  # smallest limit that a scenario may set


def _torque_spec(body, function, parameters, update=None, state_size=0):
    """Of a block from torque to torque, with one update of `state_size` numbers in the sensing phase or none."""
    memory = {"discrete_state": np.zeros(state_size), "updates": (Update(update, Phase.SENSE),)} if update else {}
    return Spec(
        inputs={"torque": body.wheels}, outputs={"torque": Output(body.wheels, function)}, parameters=parameters,
        **memory,
    )


@kernel
def held_before(xd, torque, age, i):
    """What was held on wheel i `age` ticks ago; x_d as in `remember_commands`."""
    return torque[i] if age == 0 else xd[(age - 1) * torque.shape[0] + i]


@kernel
def delayed(xd, torque, delay_ticks, out):
    whole = int(delay_ticks)
    share = delay_ticks - whole
    for i in range(out.shape[0]):
        newer, older = held_before(xd, torque, whole, i), held_before(xd, torque, whole + 1, i)
        out[i] = (1.0 - share) * newer + share * older


@kernel
def remember_commands(xd, torque, out):
    """x_d = the torques held on the last ticks, the newest (n) first."""
    n = torque.shape[0]
    for i in range(n):
        out[i] = torque[i]
    for i in range(n, out.shape[0]):
        out[i] = xd[i - n]


class CommandDelay(BlockEffect):
    """tau(t - delay) of the held command; for a part of a tick the mean of the two commands that fall into the tick."""

    wire = "torque"
    general = True
    card = Card(
        name="command_delay", title="Command delay", home="actuator", equation="tau'(t) = tau(t - delay)",
        source="bus and computing time between controller and driver",
        signature="torque missing where the command rises and as much too late where it falls, the same for any size",
        look_alikes=("motor_lag", "torque_slew_limit", "camera_latency"),
        excitation="steps and fast reversals of the command: a lag rounds them and a slew limit makes ramps of them, a "
        "delay shifts them; a late camera shifts the pose alone, not the encoders",
    )
    longest_s = 0.06

    def parameters(self, body):
        return (Parameter("delay_s", "s", 0.0, 0.0, self.longest_s, (0.001, 0.005, 0.02), tolerance=2e-4),)

    def spec(self, body, values):
        rows = math.ceil(self.longest_s / TICK_S) + 1
        ticks = round(values["delay_s"] / TICK_S, 6)  # 0.005 s is one tick
        return _torque_spec(body, delayed, {"delay_ticks": ticks}, remember_commands, rows * body.wheels)


@kernel
def saturated(torque, limit_n_m, out):
    for i in range(out.shape[0]):
        out[i] = min(max(torque[i], -limit_n_m), limit_n_m)


class TorqueSaturation(BlockEffect):
    """clip(tau, -limit, limit) on every wheel."""

    wire = "torque"
    general = True
    card = Card(
        name="torque_saturation", title="Torque limit", home="actuator", equation="tau' = clip(tau, -limit, limit)",
        source="current limit of the driver, stall torque of the motor",
        signature="torque missing at the peaks of the command only, by what they exceed one size",
        look_alikes=("battery_sag_load", "torque_slew_limit", "torque_gain_error"),
        excitation="commands of several sizes held for a while: below the limit nothing is missing, where a gain error "
        "and a sagging supply take something of every command; a slew limit spares what is held",
    )

    def parameters(self, body):
        return (Parameter("limit_n_m", "N*m", math.inf, _LEAST, math.inf, (1.0, 2.0), "torque", reciprocal=True),)

    def spec(self, body, values):
        return _torque_spec(body, saturated, {"limit_n_m": values["limit_n_m"]})


@kernel
def slewed(xd, torque, most_n_m, out):
    for i in range(out.shape[0]):
        out[i] = min(max(torque[i], xd[i] - most_n_m), xd[i] + most_n_m)


class TorqueSlewLimit(BlockEffect):
    """From tick to tick the torque changes by rate T at most; x_d = [torque that went through (n)]."""

    wire = "torque"
    general = True
    card = Card(
        name="torque_slew_limit", title="Torque slew limit", home="actuator", equation="|tau'_k - tau'_k-1| <= rate T",
        source="ramp in the driver that spares gears and supply",
        signature="torque missing after large steps of the command only, and none of it after small ones",
        look_alikes=("motor_lag", "command_delay", "torque_saturation"),
        excitation="steps of several sizes: a lag takes the same time for all of them, a slew limit takes longer for "
        "larger ones",
    )

    def parameters(self, body):
        return (
            Parameter("rate_n_m_s", "N*m/s", math.inf, _LEAST, math.inf, (10.0, 50.0), "torque", reciprocal=True),
        )

    def spec(self, body, values):
        return _torque_spec(body, slewed, {"most_n_m": values["rate_n_m_s"] * TICK_S}, slewed, body.wheels)


@kernel
def beyond_dead_zone(torque, width_n_m, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] - min(max(torque[i], -width_n_m), width_n_m)


class ActuatorDeadZone(BlockEffect):
    """tau - clip(tau, -width, width) on every wheel."""

    wire = "torque"
    general = True
    card = Card(
        name="actuator_dead_zone", title="Dead zone", home="actuator", equation="tau' = tau - clip(tau, -width, width)",
        source="driver that switches late, magnets' drag in the motor",
        signature="torque of one size missing from every command, whichever way the wheel turns",
        look_alikes=("coulomb_friction", "stribeck_friction", "load_dependent_friction"),
        excitation="braking: friction helps to brake, a dead zone weakens the brake as it weakens the drive; coasting, "
        "where friction acts and a dead zone does not",
    )

    def parameters(self, body):
        return (Parameter("width_n_m", "N*m", 0.0, 0.0, math.inf, (0.05, 0.2), "torque", tolerance=0.01),)

    def spec(self, body, values):
        return _torque_spec(body, beyond_dead_zone, {"width_n_m": values["width_n_m"]})


@kernel
def scaled(torque, gain, out):
    for i in range(out.shape[0]):
        out[i] = gain[i] * torque[i]


class TorqueGainError(BlockEffect):
    """(1 + share) tau."""

    wire = "torque"
    general = True
    card = Card(
        name="torque_gain_error", title="Torque gain error", home="actuator", equation="tau' = (1 + share) tau",
        source="motor constant or amplifier gain other than assumed",
        signature="an unmodelled torque in proportion to the command, equal for all wheels",
        look_alikes=("mass_error", "inertia_error", "load_dependent_friction", "battery_sag_load"),
        excitation="acceleration along all axes and turning: a mass error scales forces only, not the yaw moment",
    )

    def parameters(self, body):
        return (Parameter("share", "1", 0.0, -0.7, 0.7, (0.05,), tolerance=0.005),)

    def spec(self, body, values):
        return _torque_spec(body, scaled, {"gain": np.full(body.wheels, 1.0 + values["share"])})


class WeakMotor(BlockEffect):
    """(1 - loss) tau on the wheel that is named, 1 to n."""

    wire = "torque"
    general = True
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

    def parameters(self, body):
        return (Parameter("loss", "1", 0.0, -0.5, 0.95, (0.05, 0.3), tolerance=0.005),)

    def applies_to(self, body):
        """Of one wheel it would be the torque gain error."""
        return super().applies_to(body) and body.wheels > 1

    def spec(self, body, values):
        gain = np.ones(body.wheels)
        gain[int(values["wheel"]) - 1] = 1.0 - values["loss"]
        return _torque_spec(body, scaled, {"gain": gain})


@kernel
def sagged_in_time(xd, torque, rate_per_s, out):
    for i in range(out.shape[0]):
        out[i] = (1.0 - rate_per_s * xd[0]) * torque[i]


@kernel
def remember_time(tick, out):
    """x_d = [time of the tick (1)] [s], the same over the whole tick."""
    out[0] = tick * TICK_S


class BatterySagTime(BlockEffect):
    """(1 - rate t) tau, t the time of the tick since the start of the run."""

    wire = "torque"
    general = True
    card = Card(
        name="battery_sag_time", title="Battery that runs down", home="actuator", equation="tau' = (1 - rate t) tau",
        source="supply of a driver without current control, a winding that gets warm",
        signature="an unmodelled torque in proportion to the command and to the time since the start",
        look_alikes=("torque_gain_error", "battery_sag_load", "weak_motor"),
        excitation="the same acceleration early and late in a long run: a gain error is the same in both",
    )

    def parameters(self, body):
        return (Parameter("rate_per_s", "1/s", 0.0, -0.03, 0.03, (0.003, 0.01), tolerance=5e-4),)

    def spec(self, body, values):
        return _torque_spec(body, sagged_in_time, {"rate_per_s": values["rate_per_s"]}, remember_time, 1)


@kernel
def sagged_by_load(torque, share_per_n_m, out):
    load = 0.0
    for i in range(out.shape[0]):
        load = load + abs(torque[i])
    left = max(1.0 - share_per_n_m * load, 0.0)
    for i in range(out.shape[0]):
        out[i] = left * torque[i]


class BatterySagLoad(BlockEffect):
    """(1 - share sum |tau|) tau, all wheels from one supply; the factor does not fall below 0."""

    wire = "torque"
    general = True
    card = Card(
        name="battery_sag_load", title="Battery that sags under load", home="actuator",
        equation="tau'_i = (1 - share sum |tau_j|) tau_i",
        source="internal resistance of the supply that all motors share",
        signature="an unmodelled torque in proportion to the command and to the load of all wheels together",
        look_alikes=("torque_gain_error", "torque_saturation", "load_dependent_friction"),
        excitation="weak and strong acceleration, along one axis and along several at once: a gain error takes the "
        "same share of all of them, a torque limit takes nothing of weak ones",
    )

    def parameters(self, body):
        return (Parameter("share_per_n_m", "1/(N*m)", 0.0, 0.0, math.inf, (0.1, 0.5), tolerance=0.02),)

    def spec(self, body, values):
        return _torque_spec(body, sagged_by_load, {"share_per_n_m": values["share_per_n_m"]})


@kernel
def lagged(xd, torque, blend, out):
    for i in range(out.shape[0]):
        out[i] = blend * xd[i] + (1.0 - blend) * torque[i]


@kernel
def remember_lagged(xd, torque, memory, out):
    """x_d = [torque of the lag at the end of the tick (n)]."""
    for i in range(out.shape[0]):
        out[i] = memory * xd[i] + (1.0 - memory) * torque[i]


class MotorLag(BlockEffect):
    """First-order lag of the held command.

    At the end of a tick it has reached y_k = a y_k-1 + (1 - a) tau_k, a = exp(-T/time_constant). Over the tick it
    gives its mean, b y_k-1 + (1 - b) tau_k with b = (1 - a) time_constant/T. (The value at the end would come half a
    tick early: a lag of 5 ms would pass for one of 7 ms.)
    """

    wire = "torque"
    general = True
    card = Card(
        name="motor_lag", title="Motor lag", home="actuator", equation="time_constant d(tau')/dt = tau - tau'",
        source="electrical time constant of winding and driver, M(q) of (3.27)",
        signature="torque missing where the command rises, too much where it falls",
        look_alikes=("command_delay", "torque_slew_limit"),
        excitation="steps and fast reversals of the command: a delay shifts them, a lag rounds them",
    )

    def parameters(self, body):
        return (Parameter("time_constant_s", "s", 0.0, 0.0, 0.2, (0.001, 0.005, 0.02), tolerance=2e-4),)

    def spec(self, body, values):
        constant = values["time_constant_s"]
        memory = math.exp(-TICK_S / constant) if constant > 0.0 else 0.0
        parameters = {"memory": memory, "blend": (1.0 - memory) * constant / TICK_S}
        return _torque_spec(body, lagged, parameters, remember_lagged, body.wheels)


EFFECTS = (
    CommandDelay(), TorqueSaturation(), TorqueSlewLimit(), ActuatorDeadZone(), TorqueGainError(), WeakMotor(),
    BatterySagTime(), BatterySagLoad(), MotorLag(),
)
