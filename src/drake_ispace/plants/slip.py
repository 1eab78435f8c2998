"""Wheel slip on carpet, (6.4)-(6.5), as kinematics: the wheels turn as the dynamics say, but the robot travels less.

The velocities in the dynamics agree with the wheels; only the rates of the pose are scaled by 1 - s. Encoders
therefore measure the wheels and the room measures the robot, as in the thesis. The price is that **energy is not
conserved**: with s != 0 not all work of the motors becomes kinetic energy of the robot. (States for the slip velocity
itself would need steps of 20 us or less.)

The setting `frame` selects a reading of (6.4):
* body (default): s acts on the axes of the robot, s < 1. This is a correction of the thesis.
* world: s acts on the world's axes, as printed; s > 1 moves the robot backwards.
* additive: P_act = P_odo + P_er with (6.5) taken literally, on the world's axes. Only this reading makes sense of
  s = 1.3 in Fig. 6.11.

The slip s is a constant that may have another value inside a rectangle of other carpet. Four further parts are
optional: traction slip s = gain * F / (mu N), whose sign follows the force; a relaxation length over which traction
slip builds up; cornering slip, a velocity towards the outside of a bend in proportion to the centripetal acceleration;
and noise, drawn once per tick.
"""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import kernel
from drake_ispace.files.quantity import quantity

FRAMES = ("body", "world", "additive")
GRAVITY = 9.80665


@dataclass
class Slip:
    """Slip per axis [x, y, yaw]; none by default."""

    frame: str = quantity("body", choices=FRAMES)
    ratio: list[float] = quantity([0.0, 0.0, 0.0], length=3)
    # slip at full traction, F = mu N
    traction_gain: list[float] = quantity([0.0, 0.0, 0.0], minimum=0.0, below=1.0, length=3)
    # friction coefficient mu of wheel on carpet, assumed
    friction_coefficient: float = quantity(0.6, above=0.0)
    # distance over which traction slip builds up; 0: at once
    relaxation_length_m: float = quantity(0.0, "m", minimum=0.0)
    # outward velocity in a bend as a multiple of the centripetal acceleration
    cornering_s: float = quantity(0.0, "s")
    # standard deviation of the slip drawn at every tick
    noise_std: list[float] = quantity([0.0, 0.0, 0.0], minimum=0.0, length=3)
    # x_min, x_max, y_min, y_max in W of a rectangle of other carpet, where patch_ratio holds; null: none
    patch_m: list[float] | None = quantity(None, "m", length=4)
    patch_ratio: list[float] = quantity([0.0, 0.0, 0.0], length=3)


(FRAME, RATIO, GAIN, MU, LEVER, RELAXATION, CORNERING, PATCHED, PATCH, PATCH_RATIO, NOISE_STD) = (
    0, 1, 4, 7, 8, 9, 10, 11, 12, 16, 19,
)


def slip_parameters(slip: Slip, lever_m: float, where: str) -> dict[str, float]:
    """Return the slip as a parameter group of a plant.

    Args:
        slip: the settings from the scenario.
        lever_m: lever arm that converts the largest traction force into the largest traction moment.
        where: path of these settings in the scenario, for messages.

    Raises:
        InputError: there is traction or cornering slip in a frame other than body, or a slip ratio in the body frame is
            1 or more.
    """
    if slip.frame != "body" and any(slip.traction_gain):
        raise InputError(f"{where}.traction_gain: expected zeros with frame {slip.frame}, traction acts on the body")
    if slip.frame != "body" and slip.cornering_s:
        raise InputError(f"{where}.cornering_s: expected 0 with frame {slip.frame}, it acts on the body")
    for key, ratios in (("ratio", slip.ratio), ("patch_ratio", slip.patch_ratio)):
        if slip.frame == "body" and max(ratios) >= 1.0:
            raise InputError(f"{where}.{key}: {max(ratios):g} drives backwards, expected less than 1 with frame body")
    patch = slip.patch_m or [0.0] * 4
    axes = ("x", "y", "yaw")
    return {
        "frame": float(FRAMES.index(slip.frame)),
        **{f"ratio_{a}": s for a, s in zip(axes, slip.ratio, strict=True)},
        **{f"traction_gain_{a}": g for a, g in zip(axes, slip.traction_gain, strict=True)},
        "friction_coefficient": slip.friction_coefficient,
        "lever_m": lever_m,
        "relaxation_length_m": slip.relaxation_length_m,
        "cornering_s": slip.cornering_s,
        "patched": float(slip.patch_m is not None),
        **dict(zip(("patch_x_min", "patch_x_max", "patch_y_min", "patch_y_max"), patch, strict=True)),
        **{f"patch_ratio_{a}": s for a, s in zip(axes, slip.patch_ratio, strict=True)},
        **{f"noise_std_{a}": s for a, s in zip(axes, slip.noise_std, strict=True)},
    }


@kernel
def place_ratio(axis, x, y, slip):
    """Return the constant part of s for axis 0, 1 or 2 (x, y, yaw) at the position (x, y) [m] in W."""
    if slip[PATCHED] > 0.0:
        inside = slip[PATCH] <= x and x <= slip[PATCH + 1] and slip[PATCH + 2] <= y and y <= slip[PATCH + 3]
        if inside:
            return slip[PATCH_RATIO + axis]
    return slip[RATIO + axis]


@kernel
def traction_slip(axis, force, mass, slip):
    """Return the signed steady traction slip, limited to +-gain.

    force: traction force (axis 0, 1) [N] or moment (axis 2) [N m] in body axes; mass: of the robot [kg].
    """
    if slip[GAIN + axis] == 0.0:
        return 0.0 * force
    normal = slip[MU] * mass * GRAVITY
    if axis == 2:
        normal = normal * slip[LEVER]
    share = force / normal
    return slip[GAIN + axis] * min(max(share, -1.0), 1.0)


@kernel
def axis_rate(axis, rate, traction, noise, x, y, slip):
    """Return the rate at which the robot moves along an axis, given the wheel-consistent `rate`.

    traction: traction slip of the axis; the robot lags behind its wheels when driving and slides on when braking.
    noise: slip noise of the tick. x, y: position in W [m].
    """
    s = place_ratio(axis, x, y, slip) + noise
    if slip[FRAME] == 2.0:
        return (1.0 + s) * rate
    return (1.0 - s) * rate - traction * abs(rate)


@kernel
def axis_acceleration(axis, rate, acceleration, traction, noise, x, y, slip):
    """Return d/dt of the rate that `axis_rate` returns, for constant slip."""
    return axis_rate(axis, acceleration, 0.0, noise, x, y, slip) - traction * np.sign(rate) * acceleration


@kernel
def pose_rates(vx, vy, wz, pose, traction, noise, slip, out):
    """Write d/dt [x, y, phi] of the robot into out[0:3].

    vx, vy [m/s], wz [rad/s]: wheel-consistent body velocity; pose: x, y [m], phi [rad] in W; traction, noise: (3,).
    """
    c, s = cos(pose[2]), sin(pose[2])
    out[2] = axis_rate(2, wz, traction[2], noise[2], pose[0], pose[1], slip)
    if slip[FRAME] == 0.0:
        vx = axis_rate(0, vx, traction[0], noise[0], pose[0], pose[1], slip)
        vy = axis_rate(1, vy, traction[1], noise[1], pose[0], pose[1], slip)
        slide = slip[CORNERING] * out[2]
        vx, vy = vx + slide * vy, vy - slide * vx
        out[0] = c * vx - s * vy
        out[1] = s * vx + c * vy
    else:
        out[0] = axis_rate(0, c * vx - s * vy, 0.0, noise[0], pose[0], pose[1], slip)
        out[1] = axis_rate(1, s * vx + c * vy, 0.0, noise[1], pose[0], pose[1], slip)


@kernel
def traction_rate(axis, target, state, speed, slip):
    """Return d/dt of the lagged traction slip, which follows `target` over the relaxation length.

    Without a relaxation length the result is zero. speed: of the wheels along the axis.
    """
    if slip[RELAXATION] > 0.0:
        return abs(speed) / slip[RELAXATION] * (target - state)
    return 0.0
