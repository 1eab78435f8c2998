"""Typical sizes of the hidden effects: plausible, clearly visible, and no robot falls over them."""

import numpy as np

from hidden.effects_truth import EDGES, NEUTRAL, PATCH_M, UNKNOWN

PATCH = dict(zip(EDGES, PATCH_M, strict=True))

_BOTH = {
    "weak_motor": {"wheel": 2, "loss": 0.4},
    "camera_distortion": {"per_m2": 0.06},
    "camera_keystone": {"x_per_m": 0.05, "y_per_m": -0.03},
    "torque_gain_error": {"share": -0.3},
    "battery_sag_time": {"rate_per_s": 0.02},
    "floor_tilt": {"slope_x_rad": 0.015, "slope_y_rad": -0.01},
    "mass_error": {"share": 0.4},
    "wheel_radius_error": {"share": 0.06},
    "single_wheel_radius_error": {"wheel": 2, "share": 0.05},
    "track_error": {"share": 0.08},
    "encoder_scale": {"share": -0.05},
    "encoder_lost_counts": {"wheel": 1, "share": 0.06},
    "camera_scale": {"share": 0.04},
    "camera_rotation": {"angle_rad": 0.08},
    "camera_offset": {"x_m": 0.05, "y_m": -0.03},
    "marker_offset": {"x_m": 0.04, "y_m": 0.02},
    "camera_latency": {"latency_s": 0.08},
    "camera_dropouts": {"share": 0.4},
    "clock_offset": {"offset_s": -0.08},
    "cornering_slip": {"time_s": 0.08},
}

#: For each robot and effect the parameters of a typical case.
TYPICAL = {
    "omni": _BOTH | {
        "command_delay": {"delay_s": 0.012},
        "torque_saturation": {"limit_n_m": 0.035},
        "torque_slew_limit": {"rate_n_m_s": 2.0},
        "actuator_dead_zone": {"width_n_m": 0.006},
        "battery_sag_load": {"share_per_n_m": 1.2},
        "motor_lag": {"time_constant_s": 0.02},
        "viscous_friction": {"coefficient_n_m_s": 0.0015},
        "coulomb_friction": {"torque_n_m": 0.01},
        "stribeck_friction": {"bump_n_m": 0.012, "speed_rad_s": 2.0},
        "presliding_friction": {"torque_n_m": 0.01, "reach_rad": 0.3},
        "load_dependent_friction": {"share": 0.35},
        "transmission_backlash": {"gap_rad": 0.12},
        "constant_slip": {"ratio_x": 0.08, "ratio_y": 0.05},
        "wheel_slip": {"gain_x": 0.9, "gain_y": 0.9},
        "wheel_toe": {"wheel": 3, "angle_rad": 0.06},
        "turn_scrub": {"moment_n_m": 0.12},
        "soft_floor": {"force_n": 1.0},
        "soft_patch": {"force_n": 2.5} | PATCH,
        "single_wheel_friction": {"wheel": 1, "torque_n_m": 0.012},
        "single_wheel_viscous_friction": {"wheel": 4, "coefficient_n_m_s": 0.003},
        "directional_friction": {"torque_n_m": 0.015},
        "wheel_drag": {"coefficient_n_m_s2": 0.00015},
        "motor_offset": {"wheel": 2, "offset_n_m": 0.008},
        "quadratic_drag": {"coefficient_n_s2_m2": 12.0},
        "encoder_eccentricity": {"wheel": 1, "sine_rad": 0.12, "cosine_rad": 0.09},
        "inertia_error": {"share": 0.8},
        "drive_inertia": {"inertia_kg_m2": 4e-4},
        "centre_of_gravity_offset": {"x_m": 0.05, "y_m": -0.03},
    },
    "pendulum": _BOTH | {
        "command_delay": {"delay_s": 0.006},
        "torque_gain_error": {"share": -0.2},
        "torque_saturation": {"limit_n_m": 0.115},
        "torque_slew_limit": {"rate_n_m_s": 0.7},
        "actuator_dead_zone": {"width_n_m": 0.02},
        "battery_sag_load": {"share_per_n_m": 0.7},
        "motor_lag": {"time_constant_s": 0.04},
        "viscous_friction": {"coefficient_n_m_s": 0.006},
        "coulomb_friction": {"torque_n_m": 0.02},
        "stribeck_friction": {"bump_n_m": 0.02, "speed_rad_s": 1.0},
        "presliding_friction": {"torque_n_m": 0.02, "reach_rad": 0.2},
        "load_dependent_friction": {"share": 0.25},
        "transmission_backlash": {"gap_rad": 0.03},
        "constant_slip": {"ratio": 0.08},
        "wheel_slip": {"gain": 0.9},
        "turn_scrub": {"moment_n_m": 0.06},
        "soft_floor": {"force_n": 0.6},
        "soft_patch": {"force_n": 2.0} | PATCH,
        "single_wheel_friction": {"wheel": 1, "torque_n_m": 0.02},
        "single_wheel_viscous_friction": {"wheel": 2, "coefficient_n_m_s": 0.008},
        "directional_friction": {"torque_n_m": 0.02},
        "wheel_drag": {"coefficient_n_m_s2": 0.0004},
        "motor_offset": {"wheel": 2, "offset_n_m": 0.02},
        "quadratic_drag": {"coefficient_n_s2_m2": 8.0},
        "encoder_eccentricity": {"wheel": 1, "sine_rad": 0.04, "cosine_rad": 0.03},
        "inertia_error": {"share": 2.5},
        "drive_inertia": {"inertia_kg_m2": 4e-3},
        "yaw_inertia_error": {"share": 1.5},
        "centre_of_gravity_offset": {"height_m": 0.025},
        "gyro_bias": {"pitch_rad_s": 0.02, "yaw_rad_s": 0.02},
        "gyro_scale": {"share": 0.1},
        "accelerometer_bias": {"x_m_s2": 0.15, "z_m_s2": 0.15},
        "accelerometer_scale": {"share": 0.05},
        "imu_misalignment": {"about_x_rad": 0.03, "about_z_rad": 0.03},
        "imu_offset": {"ahead_m": 0.04, "above_m": 0.04},
        "imu_lag": {"time_constant_s": 0.02},
    },
}

#: For each robot the size of the effects that no library names.
TYPICAL_UNKNOWN = {
    "omni": {
        "ramp_patch": 1.2, "carpet_patch_slip": 0.2, "motor_warm_up": 0.02, "motor_warm_up_gain": 0.5,
        "supply_drop": 0.25, "seized_bearings": 0.02, "cogging": 0.012, "cable_pull": 1.0, "tight_spot": 0.012,
    },
    "pendulum": {
        "ramp_patch": 0.8, "carpet_patch_slip": 0.15, "motor_warm_up": 0.03, "motor_warm_up_gain": 0.3,
        "supply_drop": 0.25, "seized_bearings": 0.03, "cogging": 0.015, "cable_pull": 0.4, "tight_spot": 0.03,
    },
}

#: Largest factor of `scaled` at which no robot was lost on any motion; 1.5 and more for the effects not listed.
LARGEST_FACTOR = {
    "omni": {"command_delay": 1.2, "battery_sag_load": 1.2},
    "pendulum": {
        "command_delay": 1.0, "torque_saturation": 1.0, "weak_motor": 1.2, "battery_sag_time": 1.2,
        "battery_sag_load": 1.0,
    },
}

_LIMITS = ("limit_n_m", "rate_n_m_s")  # the tighter, the larger the effect
_KEPT = ("wheel", "speed_rad_s", "reach_rad", *EDGES)  # no sizes


def effects_of(robot: str) -> tuple[str, ...]:
    """Names of the effects that `robot` can have."""
    return tuple(NEUTRAL[robot])


def scaled(name: str, robot: str, factor: float = 1.0) -> dict[str, float]:
    """The typical parameters of an effect, `factor` times as large; a limit is divided by it, 0 is no effect."""
    parameters = {}
    for key, value in TYPICAL[robot][name].items():
        if key in _KEPT:
            parameters[key] = value
        elif key in _LIMITS:
            parameters[key] = value / factor if factor > 0.0 else np.inf
        else:
            parameters[key] = value * factor
    return parameters


def scaled_unknown(name: str, robot: str, factor: float = 1.0) -> tuple[str, float]:
    """An effect out of the library, `factor` times its typical size, as `generate` takes it."""
    if name not in UNKNOWN:
        raise ValueError(f"there is no unknown effect {name!r}, expected one of {tuple(UNKNOWN)}")
    return name, factor * TYPICAL_UNKNOWN[robot][name]
