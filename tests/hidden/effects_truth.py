"""Hidden effects as the generator knows them: neutral values, and what each does to torque, wheel and floor.

Written apart from the package: torques act between the 5 ms ticks, signs are smoothed by w / sqrt(w^2 + eps^2),
traction slip builds up within 10 ms, and the play of a transmission passes no torque while it is crossed.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

GRAVITY = 9.80665  # [m/s^2]
MU = 0.6  # of wheel on carpet, for traction slip
SLIP_BUILD_UP_S = 0.01
MOTOR_DRAG = 0.002  # of the motor alone while it crosses the play [N m s/rad]
PATCH_M = (0.0, 0.9, -0.7, 0.4)  # x_min, x_max, y_min, y_max of another floor
CABLE_M = (1.0, 0.8)  # where the cable is tied
COGS = 12  # torque ripples per turn of a wheel
WARM_S = 8.0  # time constant of the warm-up
DROP_S = 7.0  # when the supply drops, or bearings seize

EDGES = ("x_min_m", "x_max_m", "y_min_m", "y_max_m")

ROBOTS = ("omni", "pendulum")
WHEELS = {"omni": 4, "pendulum": 2}

_BOTH = {
    "command_delay": {"delay_s": 0.0},
    "torque_saturation": {"limit_n_m": np.inf},
    "torque_slew_limit": {"rate_n_m_s": np.inf},
    "actuator_dead_zone": {"width_n_m": 0.0},
    "torque_gain_error": {"share": 0.0},
    "weak_motor": {"wheel": 1, "loss": 0.0},
    "motor_offset": {"wheel": 1, "offset_n_m": 0.0},
    "battery_sag_time": {"rate_per_s": 0.0},
    "battery_sag_load": {"share_per_n_m": 0.0},
    "motor_lag": {"time_constant_s": 0.0},
    "viscous_friction": {"coefficient_n_m_s": 0.0},
    "coulomb_friction": {"torque_n_m": 0.0},
    "single_wheel_friction": {"wheel": 1, "torque_n_m": 0.0},
    "single_wheel_viscous_friction": {"wheel": 1, "coefficient_n_m_s": 0.0},
    "directional_friction": {"torque_n_m": 0.0},
    "wheel_drag": {"coefficient_n_m_s2": 0.0},
    "stribeck_friction": {"bump_n_m": 0.0, "speed_rad_s": 1.0},
    "presliding_friction": {"torque_n_m": 0.0, "reach_rad": 0.2},
    "load_dependent_friction": {"share": 0.0},
    "transmission_backlash": {"gap_rad": 0.0},
    "turn_scrub": {"moment_n_m": 0.0},
    "soft_floor": {"force_n": 0.0},
    "soft_patch": {"force_n": 0.0} | dict(zip(EDGES, PATCH_M, strict=True)),
    "quadratic_drag": {"coefficient_n_s2_m2": 0.0},
    "floor_tilt": {"slope_x_rad": 0.0, "slope_y_rad": 0.0},
    "mass_error": {"share": 0.0},
    "inertia_error": {"share": 0.0},
    "drive_inertia": {"inertia_kg_m2": 0.0},
    "wheel_radius_error": {"share": 0.0},
    "single_wheel_radius_error": {"wheel": 1, "share": 0.0},
    "track_error": {"share": 0.0},
    "encoder_scale": {"share": 0.0},
    "encoder_lost_counts": {"wheel": 1, "share": 0.0},
    "encoder_eccentricity": {"wheel": 1, "sine_rad": 0.0, "cosine_rad": 0.0},
    "camera_scale": {"share": 0.0},
    "camera_distortion": {"per_m2": 0.0},
    "camera_keystone": {"x_per_m": 0.0, "y_per_m": 0.0},
    "camera_rotation": {"angle_rad": 0.0},
    "camera_offset": {"x_m": 0.0, "y_m": 0.0},
    "marker_offset": {"x_m": 0.0, "y_m": 0.0},
    "camera_latency": {"latency_s": 0.0},
    "camera_dropouts": {"share": 0.0},
    "cornering_slip": {"time_s": 0.0},
    "clock_offset": {"offset_s": 0.0},
}

#: For each robot, every effect of the library with its parameters at the values that do nothing.
NEUTRAL = {
    "omni": _BOTH | {
        "constant_slip": {"ratio_x": 0.0, "ratio_y": 0.0},
        "wheel_slip": {"gain_x": 0.0, "gain_y": 0.0},
        "wheel_toe": {"wheel": 1, "angle_rad": 0.0},
        "centre_of_gravity_offset": {"x_m": 0.0, "y_m": 0.0},
    },
    "pendulum": _BOTH | {
        "constant_slip": {"ratio": 0.0},
        "wheel_slip": {"gain": 0.0},
        "centre_of_gravity_offset": {"height_m": 0.0},
        "yaw_inertia_error": {"share": 0.0},
        "gyro_bias": {"pitch_rad_s": 0.0, "yaw_rad_s": 0.0},
        "gyro_scale": {"share": 0.0},
        "accelerometer_bias": {"x_m_s2": 0.0, "z_m_s2": 0.0},
        "accelerometer_scale": {"share": 0.0},
        "imu_misalignment": {"about_x_rad": 0.0, "about_z_rad": 0.0},
        "imu_offset": {"ahead_m": 0.0, "above_m": 0.0},
        "imu_lag": {"time_constant_s": 0.0},
    },
}

#: Effects that no library names, with the unit of their size.
UNKNOWN = {
    "ramp_patch": "N",  # pull along x of W inside of PATCH_M
    "carpet_patch_slip": "1",  # slip inside of PATCH_M
    "motor_warm_up": "N m",  # Coulomb friction that fades with WARM_S
    "motor_warm_up_gain": "1",  # share of the torque missing at the start, fades with WARM_S
    "supply_drop": "1",  # share of the torque missing from DROP_S on
    "seized_bearings": "N m",  # further Coulomb friction of every wheel from DROP_S on
    "cogging": "N m",  # A sin(COGS theta_i)
    "cable_pull": "N/m",  # spring to CABLE_M
    "tight_spot": "N m",  # largest Coulomb friction of a wheel that rubs once a turn, each at an angle of its own
}


class Effects(NamedTuple):
    """What acts on torque, wheel and floor; at its defaults nothing does. Arrays: one entry per wheel or axis."""

    motor: np.ndarray  # share of the torque each motor gives
    lost: np.ndarray  # share of counts each encoder misses
    slip_ratio: np.ndarray  # along x, y of the body
    slip_gain: np.ndarray
    bend_s: float  # outward velocity over centripetal acceleration
    slope: np.ndarray  # of the floor along x, y of W [rad]
    own_dry: np.ndarray  # Coulomb friction of one wheel
    own_viscous: np.ndarray  # viscous friction of one
    offset: np.ndarray  # constant torque of one motor
    eccentric: np.ndarray  # (n, 2) of the encoders: amplitudes of sine and cosine
    delay_s: float
    limit_n_m: float
    slew_n_m_s: float
    dead_zone_n_m: float
    sag_per_s: float
    sag_per_n_m: float
    lag_s: float
    viscous: float
    coulomb: float
    bump: float
    bump_rad_s: float
    bristles_n_m: float
    bristles_rad: float
    load_share: float
    gap_rad: float
    scrub_n_m: float
    floor_n: float
    encoder_gain: float
    drag: float
    one_way: float
    wheel_drag: float
    patch_n: float
    patch_m: np.ndarray
    ramp_n: float
    patch_slip: float
    warm_n_m: float
    warm_gain: float
    drop: float
    seized_n_m: float
    cogging_n_m: float
    tight_n_m: float
    cable_n_m: float


def complete(robot: str, effects: dict) -> dict[str, dict[str, float]]:
    """Every effect of `robot` with all of its parameters: those of `effects`, else neutral ones.

    Raises:
        ValueError: an unknown robot, effect, parameter or wheel.
    """
    if robot not in ROBOTS:
        raise ValueError(f"robot is {robot!r}, expected one of {ROBOTS}")
    values = {name: dict(parameters) for name, parameters in NEUTRAL[robot].items()}
    for name, parameters in effects.items():
        if name not in values:
            raise ValueError(f"there is no effect {name!r} of robot {robot!r}")
        for key, value in parameters.items():
            if key not in values[name]:
                raise ValueError(f"effect {name!r} has no parameter {key!r}, expected {tuple(values[name])}")
            values[name][key] = value
        if not 1 <= values[name].get("wheel", 1) <= WHEELS[robot]:
            raise ValueError(f"{name}: wheel is {values[name]['wheel']}, expected 1 to {WHEELS[robot]}")
    return values


def of_one_wheel(robot: str, parameters: dict, key: str) -> np.ndarray:
    """(n,) zeros but for `parameters[key]` at `parameters["wheel"]`, 1..n."""
    shares = np.zeros(WHEELS[robot])
    shares[int(parameters["wheel"]) - 1] = parameters[key]
    return shares


def pack(robot: str, values: dict, unknown: tuple[str, float] | None) -> Effects:
    """The compiled code's view of `values`, of `complete`, and of one effect out of the library."""
    if unknown is not None and unknown[0] not in UNKNOWN:
        raise ValueError(f"there is no unknown effect {unknown[0]!r}, expected one of {tuple(UNKNOWN)}")
    sizes = dict.fromkeys(UNKNOWN, 0.0) | ({unknown[0]: float(unknown[1])} if unknown else {})
    slip, traction, tilt = values["constant_slip"], values["wheel_slip"], values["floor_tilt"]
    along = ("_x", "_y") if robot == "omni" else ("",)
    weak = of_one_wheel(robot, values["weak_motor"], "loss")
    return Effects(
        motor=(1.0 + values["torque_gain_error"]["share"]) * (1.0 - weak),
        lost=of_one_wheel(robot, values["encoder_lost_counts"], "share"),
        slip_ratio=np.array([slip["ratio" + axis] for axis in along], dtype=float),
        slip_gain=np.array([traction["gain" + axis] for axis in along], dtype=float),
        bend_s=float(values["cornering_slip"]["time_s"]),
        slope=np.array([tilt["slope_x_rad"], tilt["slope_y_rad"]], dtype=float),
        delay_s=float(values["command_delay"]["delay_s"]),
        limit_n_m=float(values["torque_saturation"]["limit_n_m"]),
        slew_n_m_s=float(values["torque_slew_limit"]["rate_n_m_s"]),
        dead_zone_n_m=float(values["actuator_dead_zone"]["width_n_m"]),
        sag_per_s=float(values["battery_sag_time"]["rate_per_s"]),
        sag_per_n_m=float(values["battery_sag_load"]["share_per_n_m"]),
        lag_s=float(values["motor_lag"]["time_constant_s"]),
        viscous=float(values["viscous_friction"]["coefficient_n_m_s"]),
        coulomb=float(values["coulomb_friction"]["torque_n_m"]),
        bump=float(values["stribeck_friction"]["bump_n_m"]),
        bump_rad_s=float(values["stribeck_friction"]["speed_rad_s"]),
        bristles_n_m=float(values["presliding_friction"]["torque_n_m"]),
        bristles_rad=float(values["presliding_friction"]["reach_rad"]),
        load_share=float(values["load_dependent_friction"]["share"]),
        gap_rad=float(values["transmission_backlash"]["gap_rad"]),
        scrub_n_m=float(values["turn_scrub"]["moment_n_m"]),
        floor_n=float(values["soft_floor"]["force_n"]),
        encoder_gain=1.0 + values["encoder_scale"]["share"],
        own_dry=of_one_wheel(robot, values["single_wheel_friction"], "torque_n_m"),
        own_viscous=of_one_wheel(robot, values["single_wheel_viscous_friction"], "coefficient_n_m_s"),
        offset=of_one_wheel(robot, values["motor_offset"], "offset_n_m"),
        eccentric=np.column_stack([
            of_one_wheel(robot, values["encoder_eccentricity"], key) for key in ("sine_rad", "cosine_rad")
        ]),
        drag=float(values["quadratic_drag"]["coefficient_n_s2_m2"]),
        one_way=float(values["directional_friction"]["torque_n_m"]),
        wheel_drag=float(values["wheel_drag"]["coefficient_n_m_s2"]),
        patch_n=float(values["soft_patch"]["force_n"]),
        patch_m=np.array([values["soft_patch"][edge] for edge in EDGES], dtype=float),
        ramp_n=sizes["ramp_patch"],
        patch_slip=sizes["carpet_patch_slip"],
        warm_n_m=sizes["motor_warm_up"],
        warm_gain=sizes["motor_warm_up_gain"],
        drop=sizes["supply_drop"],
        seized_n_m=sizes["seized_bearings"],
        cogging_n_m=sizes["cogging"],
        tight_n_m=sizes["tight_spot"],
        cable_n_m=sizes["cable_pull"],
    )


@njit(cache=True)
def soft_sign(rate, width):
    """The sign of `rate`, smooth within `width` of the same unit."""
    return rate / np.sqrt(rate * rate + width * width)


@njit(cache=True)
def drive(tick, command, before, tick_s, e, out):
    """Command (n) to what the driver holds (n) [N m]: limit, slew rate from `before` (n), dead zone, gain, supply.

    `before` becomes the slewed torque of this tick.
    """
    n = command.shape[0]
    load = 0.0
    for i in range(n):
        torque = min(max(command[i], -e.limit_n_m), e.limit_n_m)
        step = e.slew_n_m_s * tick_s
        torque = before[i] + min(max(torque - before[i], -step), step)
        before[i] = torque
        torque = torque - min(max(torque, -e.dead_zone_n_m), e.dead_zone_n_m)
        out[i] = e.motor[i] * torque
        load += abs(out[i])
    for i in range(n):
        out[i] = out[i] * max(1.0 - e.sag_per_n_m * load, 0.0)


@njit(cache=True)
def motor_torque(held, time_s, step_s, tick_s, e, lagged, gap, out):
    """Torque (n) [N m] on the wheels in the step of `step_s` around `time_s`.

    held (ticks, n): what the driver held; lagged, gap (n): torque of the slow motor [N m] and place of the motor in its
    play [rad], both moved on by the step.
    """
    index = int(np.floor((time_s - e.delay_s) / tick_s))
    supply = (1.0 - e.sag_per_s * time_s) * (1.0 - e.warm_gain * np.exp(-time_s / WARM_S))
    supply *= 1.0 - e.drop * (time_s > DROP_S)
    follow = 1.0 - np.exp(-step_s / e.lag_s) if e.lag_s > 0.0 else 1.0
    half = 0.5 * e.gap_rad
    for i in range(out.shape[0]):
        target = held[index, i] * supply if index >= 0 else 0.0
        lagged[i] += follow * (target - lagged[i])
        out[i] = lagged[i]
        if half > 0.0:
            free = gap[i] + step_s * lagged[i] / MOTOR_DRAG
            gap[i] = min(max(free, -half), half)
            if free == gap[i]:  # on its way through the play
                out[i] = 0.0


@njit(cache=True)
def rub(angle, before, bent, e, torque):
    """Take off `torque` (n) what bristles hold back that have bent as the wheels turned on to `angle` (n).

    before, bent (n): the angles of the last step, and how far bristles are bent, -1 to 1; both are moved on.
    """
    if e.bristles_n_m == 0.0:
        return
    for i in range(torque.shape[0]):
        turned = (angle[i] - before[i]) / e.bristles_rad
        kept = np.exp(-abs(turned))
        bent[i] = kept * bent[i] + (1.0 - kept) * np.sign(turned)
        before[i] = angle[i]
        torque[i] -= e.bristles_n_m * bent[i]


@njit(cache=True)
def dry_friction(wheel, torque, rate, angle, time_s, e):
    """How much torque [N m] the effects take against the direction of a wheel."""
    dry = e.coulomb + e.bump * np.exp(-((rate / e.bump_rad_s) ** 2))
    dry = dry + e.load_share * abs(torque) + e.warm_n_m * np.exp(-time_s / WARM_S) + e.own_dry[wheel]
    dry = dry + 0.5 * e.tight_n_m * (1.0 + np.sin(angle + 2.0 * wheel)) + e.seized_n_m * (time_s > DROP_S)
    return dry + (abs(e.one_way) if rate * e.one_way > 0.0 else 0.0)


@njit(cache=True)
def steady_torque(wheel, rate, angle, e):
    """Torque [N m] by the effects that does not jump with the direction of a wheel."""
    drag = (e.viscous + e.own_viscous[wheel] + e.wheel_drag * abs(rate)) * rate
    return e.offset[wheel] - drag + e.cogging_n_m * np.sin(COGS * angle)


@njit(cache=True)
def wheel_torque(wheel, torque, rate, angle, time_s, base_coulomb, base_viscous, steepest, e):
    """What is left [N m] of a motor's `torque` behind friction and cogging, at wheel `rate` [rad/s], `angle` [rad].

    steepest [N m s/rad]: slope of dry friction that the integration step allows.
    """
    dry = base_coulomb + dry_friction(wheel, torque, rate, angle, time_s, e)
    width = max(0.02, abs(dry) / steepest)
    return torque + steady_torque(wheel, rate, angle, e) - dry * soft_sign(rate, width) - base_viscous * rate


@njit(cache=True)
def is_in(edges, x, y):
    return edges[0] <= x and x <= edges[1] and edges[2] <= y and y <= edges[3]


@njit(cache=True)
def ground_force(x, y, vx, vy, mass, e):
    """Force [N] in W on a robot at (x, y) [m] that moves at (vx, vy) [m/s]: soft floor, slope and what no library has.

    The slope acts on `mass` [kg].
    """
    speed = np.sqrt(vx * vx + vy * vy + 4e-6)
    resistance = e.floor_n
    if is_in(e.patch_m, x, y):
        resistance += e.patch_n
    brake = resistance / speed + e.drag * speed
    pull = e.ramp_n if is_in(PATCH_M, x, y) else 0.0
    fx = pull - brake * vx - mass * GRAVITY * e.slope[0] + e.cable_n_m * (CABLE_M[0] - x)
    fy = -brake * vy - mass * GRAVITY * e.slope[1] + e.cable_n_m * (CABLE_M[1] - y)
    return fx, fy


@njit(cache=True)
def steady_slip(force, weight_n, gain):
    """Traction slip (signed) that a `force` [N] of the motors leads to."""
    return gain * min(max(force / (MU * weight_n), -1.0), 1.0)


@njit(cache=True)
def travelled(speed, ratio, traction, x, y, e):
    """Speed of the robot [m/s] for a wheel-consistent `speed`; driving it lags, braking it slides on."""
    s = ratio + (e.patch_slip if is_in(PATCH_M, x, y) else 0.0)
    return (1.0 - s) * speed - traction * abs(speed)
