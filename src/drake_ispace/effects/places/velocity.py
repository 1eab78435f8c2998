"""Between a commanded body velocity and the one that a robot follows: effects in the wire `velocity`.

Memory is kept as shaping.py says.
"""

import math

import numpy as np

from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.places.shaping import LEAST_LIMIT, Delay, Lag, keep, scale, shift
from drake_ispace.effects.places.wheel_speed import VelocityDeadZone, WheelSpeedDesaturation, WheelSpeedLimit
from drake_ispace.effects.wires import VelocityEffect


@kernel
def delayed(xd, velocity, delay_ticks, out):
    shift(xd, velocity, delay_ticks, out)


@kernel
def remember_commands(xd, velocity, out):
    keep(xd, velocity, out)


class VelocityDelay(Delay, VelocityEffect):
    """v(t - delay) of the held command; for a part of a tick the mean of the two commands that fall into the tick."""

    card = Card(
        name="velocity_delay", title="Delay of the velocity command", home="actuator", equation="v'(t) = v(t - delay)",
        source="radio, bus and computing time between command and drive",
        signature="encoders and pose follow the command in its shape, but late by the same time whatever its size",
        look_alikes=("velocity_lag", "camera_latency", "clock_offset"),
        excitation="steps of the command: a lag rounds them, a delay shifts them; a late camera shifts the pose alone, "
        "not the encoders",
    )
    parameters = (Parameter("delay_s", "s", 0.0, 0.0, 0.7, (0.01, 0.05), tolerance=1e-3, shifts=True),)
    output, update = delayed, remember_commands


@kernel
def saturated(velocity, limit_m_s, limit_rad_s, out):
    out[0], out[1] = velocity[0], velocity[1]
    speed = np.sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1])
    if speed > limit_m_s:
        out[0], out[1] = velocity[0] * (limit_m_s / speed), velocity[1] * (limit_m_s / speed)
    out[2] = min(max(velocity[2], -limit_rad_s), limit_rad_s)


class VelocitySaturation(VelocityEffect):
    """Speed at most limit_m_s, in the commanded direction; turning clip(wz, -limit_rad_s, limit_rad_s)."""

    card = Card(
        name="velocity_saturation", title="Speed limit", home="actuator",
        equation="v' = v min(1, limit_m_s / |v|), wz' = clip(wz, -limit_rad_s, limit_rad_s)",
        source="speed limit of the drive's firmware, largest speed of the motors",
        signature="encoders and pose fall behind fast commands only, and then move at one speed",
        look_alikes=("velocity_gain", "velocity_lag", "wheel_speed_limit", "wheel_speed_desaturation"),
        excitation="commands of several speeds, each held for a while: below the limit nothing is missing, where a "
        "gain error takes its share of every command; fast bends, where a limit of the wheels is met sooner",
    )
    parameters = (
        Parameter("limit_m_s", "m/s", math.inf, LEAST_LIMIT, math.inf, (0.15, 0.3), reciprocal=True),
        Parameter("limit_rad_s", "rad/s", math.inf, LEAST_LIMIT, math.inf, (0.5, 1.0), reciprocal=True),
    )
    output = saturated


def _ways(body):
    """The axes of the body along which its wheels let it move."""
    return ("x",) if body.plant.geometry.holds_sideways else ("x", "y")


@kernel
def scaled(velocity, gain, out):
    scale(velocity, gain, out)


class VelocityGain(VelocityEffect):
    """(1 + share) v, a share for each of vx, wz and, unless tyres hold the robot sideways, vy."""

    card = Card(
        name="velocity_gain", title="Gain of the velocity command", home="actuator",
        equation="vx' = (1 + share_x) vx, vy' = (1 + share_y) vy, wz' = (1 + share_yaw) wz",
        source="wheel radius or track in the drive's firmware other than those of encoder and odometry",
        signature="encoders and pose agree with each other, but not with the command, by a share of it",
        look_alikes=(
            "wheel_radius_error", "track_error", "constant_slip", "velocity_saturation", "velocity_dead_zone",
            "wheel_speed_limit", "wheel_speed_desaturation",
        ),
        excitation="straight driving and turning at several speeds: radius, track and slip show between encoder and "
        "camera, a gain between command and encoder; a speed limit spares slow commands",
    )
    output = scaled

    def parameters_of(self, body):
        names = [f"share_{way}" for way in _ways(body)] + ["share_yaw"]
        return tuple(Parameter(name, "1", 0.0, -0.7, 0.7, (0.05,), tolerance=1e-3) for name in names)

    def block_parameters(self, body, values):
        return {"gain": np.array([1.0 + values.get(f"share_{way}", 0.0) for way in ("x", "y", "yaw")])}


@kernel
def coupled(velocity, yaw_per_x, yaw_per_y, out):
    out[0], out[1] = velocity[0], velocity[1]
    out[2] = velocity[2] + (yaw_per_x * velocity[0] + yaw_per_y * velocity[1])


class VelocityCoupling(VelocityEffect):
    """wz + yaw_per_x vx + yaw_per_y vy: a robot that turns while it is told to go straight.

    Where tyres hold it sideways there is no yaw_per_y.
    """

    card = Card(
        name="velocity_coupling", title="Turning while driving", home="actuator",
        equation="wz' = wz + yaw_per_x vx + yaw_per_y vy",
        source="wheels that are driven with different gains, a drive that is not mounted straight",
        signature="an uncommanded turn in proportion to the speed, seen by encoders and camera alike",
        look_alikes=("single_wheel_radius_error", "encoder_lost_counts", "velocity_gain"),
        excitation="straight driving forwards, backwards and sideways: a wheel of another size turns the robot without "
        "its encoders noticing",
    )
    output = coupled

    def parameters_of(self, body):
        return tuple(Parameter(f"yaw_per_{way}", "rad/m", 0.0, -5.0, 5.0, (0.1,)) for way in _ways(body))

    def block_parameters(self, body, values):
        return {name: values.get(name, 0.0) for name in ("yaw_per_x", "yaw_per_y")}


@kernel
def mix_axes(xd, velocity, driving, turning, out):
    """A share of the state, the rest of the command: `driving` of vx and vy, `turning` of wz."""
    for i in range(2):
        out[i] = driving * xd[i] + (1.0 - driving) * velocity[i]
    out[2] = turning * xd[2] + (1.0 - turning) * velocity[2]


@kernel
def lagged(xd, velocity, blend, turning_blend, out):
    mix_axes(xd, velocity, blend, turning_blend, out)


@kernel
def remember_lagged(xd, velocity, memory, turning_memory, out):
    mix_axes(xd, velocity, memory, turning_memory, out)


class VelocityLag(Lag, VelocityEffect):
    """First-order lag of the held command, its mean over each tick (shaping.Lag).

    Where a speed control turns each wheel, the mass sets the lag of driving and the moment of inertia that of turning:
    the time constant of wz is time_constant_s + turning_extra_s, and at least zero.
    """

    card = Card(
        name="velocity_lag", title="Lag of the velocity", home="actuator",
        equation="time_constant d(v')/dt = v - v', for wz (time_constant + turning_extra) d(wz')/dt = wz - wz'",
        source="the drive's own speed control, mass and moment of inertia of the robot",
        signature="encoders and pose fall behind where the command rises and run on where it falls, in turns by "
        "another time than straight ahead where turns are easier or harder for the drive",
        look_alikes=("velocity_delay", "velocity_slew_limit", "velocity_saturation", "velocity_overshoot"),
        excitation="steps and fast reversals of the command, straight and turning: a delay shifts them, a lag rounds "
        "them; a speed limit acts on fast commands only",
    )
    parameters = (
        Parameter("time_constant_s", "s", 0.0, 0.0, 1.0, (0.02, 0.1), tolerance=1e-3),
        Parameter("turning_extra_s", "s", 0.0, -1.0, 1.0, (0.02,), tolerance=1e-3, added_to="time_constant_s"),
    )
    output, update = lagged, remember_lagged

    def block_parameters(self, body, values):
        turning_s = max(values["time_constant_s"] + values["turning_extra_s"], 0.0)
        turning = super().block_parameters(body, {"time_constant_s": turning_s})
        return super().block_parameters(body, values) | {f"turning_{name}": share for name, share in turning.items()}


@kernel
def ticks_away(xd, velocity, step, step_rad):
    """For how many ticks the way (vx, vy), and wz, must move on by `step` [m/s] and `step_rad` [rad/s] each."""
    x, y = velocity[0] - xd[0], velocity[1] - xd[1]
    return np.sqrt(x * x + y * y) / step, abs(velocity[2] - xd[2]) / step_rad


@kernel
def left_after(ticks):
    """The share of a difference that a tick leaves."""
    return 1.0 - min(1.0, 1.0 / max(ticks, 1e-300))


@kernel
def left_on_average(ticks):
    """The mean over a tick of the share of a difference that is left."""
    after = left_after(ticks)
    return after + 0.5 * (1.0 - after) * min(ticks, 1.0)


@kernel
def slew_limited(xd, velocity, step, step_rad, out):
    driving, turning = ticks_away(xd, velocity, step, step_rad)
    mix_axes(xd, velocity, left_on_average(driving), left_on_average(turning), out)


@kernel
def remember_reached(xd, velocity, step, step_rad, out):
    driving, turning = ticks_away(xd, velocity, step, step_rad)
    mix_axes(xd, velocity, left_after(driving), left_after(turning), out)


class VelocitySlewLimit(VelocityEffect):
    """A velocity that moves towards the held command by at most limit_m_s2, and by limit_rad_s2 in its turning rate.

    x_d = [what it reaches at the end of the tick (3)]; `output` gives the mean over the tick.
    """

    card = Card(
        name="velocity_slew_limit", title="Acceleration limit", home="actuator",
        equation="|d(vx', vy')/dt| <= limit_m_s2, |d(wz')/dt| <= limit_rad_s2",
        source="ramps in the drive's firmware, motors at the limit of their current",
        signature="encoders and pose answer a step of the command by a ramp whose slope is the same whatever the step",
        look_alikes=("velocity_lag", "velocity_delay", "velocity_braking_limit"),
        excitation="steps of the command of several sizes, straight and turning: a ramp takes longer for larger steps, "
        "a lag takes its time for each",
    )
    parameters = (
        Parameter("limit_m_s2", "m/s^2", math.inf, LEAST_LIMIT, math.inf, (3.0,), reciprocal=True, tolerance=1e-3),
        Parameter("limit_rad_s2", "rad/s^2", math.inf, LEAST_LIMIT, math.inf, (10.0,), reciprocal=True, tolerance=1e-3),
    )
    output, update = slew_limited, remember_reached

    def block_parameters(self, body, values):
        return {"step": values["limit_m_s2"] * TICK_S, "step_rad": values["limit_rad_s2"] * TICK_S}


@kernel
def braking(x, y, by_x, by_y, step):
    """How much of a change (by_x, by_y) of (x, y) brakes: (the share of it, how many ticks of `step` each it takes)."""
    size = np.sqrt(by_x * by_x + by_y * by_y)
    share = min(max(-(x * by_x + y * by_y), 0.0) / max(size * size, 1e-300), 1.0)
    return share, share * size / step


@kernel
def braking_of(xd, velocity, step, step_rad):
    """`braking` of (vx, vy) by `step` [m/s] a tick, then of wz by `step_rad` [rad/s]: share, ticks, share, ticks."""
    share, ticks = braking(xd[0], xd[1], velocity[0] - xd[0], velocity[1] - xd[1], step)
    turning, turning_ticks = braking(xd[2], 0.0, velocity[2] - xd[2], 0.0, step_rad)
    return share, ticks, turning, turning_ticks


@kernel
def left_after_braking(share, ticks):
    """The share of a change that a tick leaves, where `braking` takes so many ticks and the rest none."""
    return 1.0 - share / ticks if ticks >= 1.0 else 0.0


@kernel
def left_while_braking(share, ticks):
    """The mean over a tick of the share of a change that is left."""
    return 1.0 - 0.5 * share / ticks if ticks >= 1.0 else ticks * (1.0 - 0.5 * share)


@kernel
def braking_limited(xd, velocity, step, step_rad, out):
    share, ticks, turning, turning_ticks = braking_of(xd, velocity, step, step_rad)
    mix_axes(xd, velocity, left_while_braking(share, ticks), left_while_braking(turning, turning_ticks), out)


@kernel
def remember_braked(xd, velocity, step, step_rad, out):
    share, ticks, turning, turning_ticks = braking_of(xd, velocity, step, step_rad)
    mix_axes(xd, velocity, left_after_braking(share, ticks), left_after_braking(turning, turning_ticks), out)


class VelocityBrakingLimit(VelocitySlewLimit):
    """A velocity that moves towards the held command by at most limit_m_s2 while the speed falls, and then at once.

    The same goes for the turning rate and limit_rad_s2. x_d and `output` as of VelocitySlewLimit.
    """

    card = Card(
        name="velocity_braking_limit", title="Braking limit", home="actuator",
        equation="|d(vx', vy')/dt| <= limit_m_s2 while |(vx', vy')| falls, |d(wz')/dt| <= limit_rad_s2 while |wz'| "
        "does",
        source="ramp in the drive's firmware for slowing down alone, drives that cannot brake but only coast",
        signature="encoders and pose run on by a ramp where the command falls, and follow at once where it rises",
        look_alikes=("velocity_slew_limit", "velocity_lag", "velocity_delay"),
        excitation="steps of the command up and down: a lag, a delay and an acceleration limit err at both alike",
    )
    output, update = braking_limited, remember_braked


@kernel
def swung(xd, velocity, mean, out):
    for i in range(3):
        out[i] = velocity[i] + (mean[0] * (xd[i] - velocity[i]) + mean[1] * xd[3 + i])


@kernel
def remember_swing(xd, velocity, motion, out):
    for i in range(3):
        away = xd[i] - velocity[i]
        out[i] = velocity[i] + (motion[0] * away + motion[1] * xd[3 + i])
        out[3 + i] = motion[2] * away + motion[3] * xd[3 + i]


class VelocityOvershoot(VelocityEffect):
    """A velocity that swings around the held command; x_d = [what it reaches at the end of the tick (3), its rate (3)].

    `update` is the exact solution of the equation over a tick, `output` the mean over it. Damped by more than 0.7 it
    has no resonance, and steps pass the command by less than 5 %: that is a lag.
    """

    card = Card(
        name="velocity_overshoot", title="Overshoot of the velocity", home="actuator",
        equation="time_constant^2 d2(v')/dt2 + 2 damping time_constant d(v')/dt = v - v'",
        source="speed control with an integral part, tuned briskly; wheels on a springy shaft or belt",
        signature="encoders and pose pass the command after each of its steps and come back, in waves of one period",
        look_alikes=("velocity_lag", "velocity_delay", "velocity_slew_limit"),
        excitation="steps of the command that are held for some periods: a lag comes near from one side only",
    )
    parameters = (
        Parameter("time_constant_s", "s", 0.0, 0.0, 0.5, (0.02, 0.1), tolerance=1e-3),
        Parameter("damping", "1", 0.5, 0.05, 0.7, (0.2,), shape=True),
    )
    output, update = swung, remember_swing

    def memory_size(self, body):
        return 2 * super().memory_size(body)

    def block_parameters(self, body, values):
        constant_s, damping = values["time_constant_s"], values["damping"]
        if constant_s <= np.finfo(float).eps * TICK_S:
            return {"motion": np.zeros(4), "mean": np.zeros(2)}
        slowing, frequency = damping / constant_s, math.sqrt(1.0 - damping**2) / constant_s
        left, angle = math.exp(-slowing * TICK_S), frequency * TICK_S
        along, across = left * math.cos(angle), left * math.sin(angle) / frequency
        motion = np.array([along + slowing * across, across, -across / constant_s**2, along - slowing * across])
        # the integral of the difference over the tick, from the equation itself
        back = 2.0 * damping * constant_s * (motion[:2] - [1.0, 0.0]) + constant_s**2 * (motion[2:] - [0.0, 1.0])
        return {"motion": motion, "mean": -back / TICK_S}


EFFECTS = (
    VelocityDelay(), VelocitySaturation(), VelocitySlewLimit(), VelocityBrakingLimit(), VelocityGain(),
    VelocityCoupling(), VelocityDeadZone(), WheelSpeedDesaturation(), WheelSpeedLimit(), VelocityOvershoot(),
    VelocityLag(),
)
