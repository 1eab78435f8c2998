"""Recordings of robots with hidden effects.

`generate("omni", "square", {"weak_motor": {"wheel": 2, "loss": 0.4}})` is a run of the omni robot's nominal multi-rate
controller on a plant that has this effect and is integrated apart from the package: other step, other friction
smoothing, coloured force noise. The recording is aligned as the package's own are.
"""

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from drake_ispace.control.feedback.balance_gains import balance_gain
from drake_ispace.control.feedback.omni_gains import omni_gains
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.scenario import load_scenario
from hidden import omni_creep, omni_truth, pendulum_truth
from hidden.control_truth import Camera, Encoder
from hidden.effects_truth import WHEELS, complete, pack
from hidden.motions import TICK_S, VISION_TICKS, way_points
from hidden.noise_truth import coloured, stream

#: Rms of the outer force noise: along x, y of B [N] and yaw [N m]; along s [N], yaw and pitch [N m].
FORCE_RMS = {"omni": (0.15, 0.15, 0.02), "pendulum": (0.1, 0.01, 0.003)}
#: Rms of the random slip, share of speed: x, y, yaw; s, yaw.
SLIP_RMS = {"omni": (0.003, 0.003, 0.003), "pendulum": (0.003, 0.003)}
PIXEL_RMS = 0.3
OWN, FOREIGN = "own", "foreign"  # physics
START_M, START_RAD = 0.003, np.radians(0.5)  # rms error of the first pose

_NAMES = {"omni": ("1", "2", "3", "4"), "pendulum": ("r", "l")}
_TRUTH = {
    "omni": (("vx_w", "vy_w", "wz_w"), ("m/s", "m/s", "rad/s")),
    "pendulum": (("tilt", "s_rate", "yaw_rate", "tilt_rate"), ("rad", "m/s", "rad/s", "rad/s")),
}


class RobotLost(RuntimeError):
    """The robot fell or left the room for good."""


def generate(
    robot: str, motion: str, effects: dict[str, dict[str, float]] | None = None, seconds: float = 20.0, seed: int = 0,
    process_noise: float = 1.0, unknown: tuple[str, float] | None = None, sensor_noise: float = 1.0,
    physics: str = OWN,
) -> Recording:
    """A run of `robot` ("omni", "pendulum") with hidden `effects`.

    Args:
        motion: one of `motions.MOTIONS`.
        effects: name -> parameters, SI units; those left out are neutral. Names as `effects_truth.NEUTRAL`.
        seconds: of the run; seed: of every random draw.
        process_noise: level of the outer forces and of the random slip, in units of FORCE_RMS and SLIP_RMS.
        unknown: (name, size) of an effect that no library names, `effects_truth.UNKNOWN`.
        sensor_noise: level of camera and IMU noise, IMU offsets and first pose error; counts and pixels stay whole.
        physics: OWN, or FOREIGN: the pendulum in MuJoCo, the omni robot on wheels that creep. There slip is what the
            contacts make of it, so effects on slip are OWN's.

    Raises:
        ValueError: an unknown name.
        RobotLost: the pendulum fell, or a robot left the room by more than 2 m.
    """
    points = way_points(robot, motion, round(seconds / TICK_S))
    return follow(robot, points, effects, seconds, seed, process_noise, unknown, sensor_noise, motion, physics)


def follow(
    robot: str, points: np.ndarray, effects: dict[str, dict[str, float]] | None = None, seconds: float = 20.0,
    seed: int = 0, process_noise: float = 1.0, unknown: tuple[str, float] | None = None, sensor_noise: float = 1.0,
    name: str = "way points", physics: str = OWN,
) -> Recording:
    """As `generate`, along way points (m, 10) of ticks 0, 19, ...: tick, pose, its rates and accelerations.

    Args:
        name: of the motion, for notes and messages.
    """
    values = complete(robot, effects or {})
    hidden = pack(robot, values, unknown)
    scenario = _scenario(robot)
    ticks = round(seconds / TICK_S)
    told = points[0, 1:4].copy()
    random = stream(seed, "start")
    start = told + sensor_noise * random.standard_normal(3) * np.array([START_M, START_M, START_RAD])
    push = _columns(seed, "force", process_noise * np.array(FORCE_RMS[robot]), ticks + 1)
    wander = _columns(seed, "slip", process_noise * np.array(SLIP_RMS[robot]), ticks + 1)
    encoder = _encoder(getattr(scenario, robot).encoder, WHEELS[robot], ticks, seed, sensor_noise)
    camera = _camera(scenario.space, values, ticks, seed, sensor_noise)
    if robot == "omni":
        body, law = omni_truth.true_body(scenario.omni.plant, values), _omni_law()
        if physics == OWN:
            torque, angles, fixes, truth = omni_truth.run(
                ticks, start, told, points, push, wander, body, law, encoder, camera, hidden
            )
        else:
            torque, angles, fixes, truth = omni_creep.run(
                ticks, start, told, points, push, body, law, encoder, camera, hidden
            )
        felt = None
    else:
        body, law = pendulum_truth.true_body(scenario.pendulum.plant, values), _pendulum_law()
        imu = _imu(scenario.pendulum.imu, values, ticks, seed, sensor_noise)
        if physics == OWN:
            torque, angles, felt, fixes, truth = pendulum_truth.run(
                ticks, start, points, push, wander, body, law, encoder, imu, camera, hidden
            )
        else:
            from hidden import mujoco_pendulum  # MuJoCo is an extra

            model = mujoco_pendulum.model_of(scenario.pendulum.plant, values, imu.height_m, imu.ahead_m)
            torque, angles, felt, fixes, truth = mujoco_pendulum.run(
                ticks, start, points, push, model, law, encoder, imu, camera, hidden
            )
        if np.abs(truth[:, 3]).max() > 1.5 or not np.isfinite(truth).all():
            raise RobotLost(f"the pendulum fell ({name}, seed {seed})")
    if not np.abs(truth[:, :2]).max() < 3.2:
        raise RobotLost(f"the robot left the room ({name}, seed {seed})")
    # notes without the effects: whoever explains the run reads them too
    return _recording(robot, f"{name}, seed {seed}", points, torque, angles, felt, fixes, truth)


def _recording(robot, notes, points, torque, angles, felt, fixes, truth):
    # what is sampled in the last instant is no longer part of the run; the state reached then is
    points, fixes = points[points[:, 0] < len(torque)], fixes[fixes[:, 1] < len(torque)]
    period_s, vision_s = round(TICK_S, 6), round(TICK_S * VISION_TICKS, 6)
    every, wheels = np.arange(len(truth)), _NAMES[robot]
    columns, units = _TRUTH[robot]
    channels = {
        "reference": Channel(_time(points[:, 0]), ("x", "y", "phi"), points[:, 1:4], {}, vision_s),
        "torque": Channel(_time(every[:-1]), tuple(f"tau_{w}" for w in wheels), torque, {}, period_s),
        "encoder": Channel(_time(every[:-1]), tuple(f"theta_{w}" for w in wheels), angles[:-1], {}, period_s),
        "truth": Channel(
            _time(every), ("x", "y", "phi", *columns), truth, dict(zip(columns, units, strict=True)), period_s
        ),
    }
    if len(fixes):
        seen = np.column_stack([fixes[:, 2:], _time(fixes[:, 1])])
        channels["kinect"] = Channel(_time(fixes[:, 0]), ("x", "y", "phi", "t_received"), seen, {}, vision_s)
    if felt is not None:
        channels["imu"] = Channel(_time(every[:-1]), ("ax", "ay", "az", "wx", "wy", "wz"), felt[:-1], {}, period_s)
    return Recording(robot, f"{robot}_multirate", channels, notes)


def _time(ticks):
    """Seconds to the microsecond."""
    return np.round(np.asarray(ticks) * TICK_S, 6)


@cache
def _scenario(robot):
    return load_scenario(f"{robot}_multirate")


@cache
def _omni_law():
    scenario = _scenario("omni")
    return omni_truth.nominal_law(scenario.omni, omni_gains(scenario.omni.plant, scenario.omni.control, TICK_S))


@cache
def _pendulum_law():
    settings = _scenario("pendulum").pendulum
    return pendulum_truth.nominal_law(settings, balance_gain(settings.plant, settings.control))


def _columns(seed, name, rms, rows):
    return np.column_stack([coloured(seed, f"{name}/{i}", level, rows, TICK_S) for i, level in enumerate(rms)])


def _encoder(nominal, wheels, ticks, seed, level):
    random = stream(seed, "encoder")
    phase = random.uniform(0.0, 1.0, wheels) if level > 0.0 else np.full(wheels, 0.5)
    return Encoder(
        2.0 * np.pi / nominal.counts_per_turn, float(np.exp(-TICK_S / nominal.filter_time_constant_s)), phase,
        random.uniform(0.0, 1.0, (ticks + 1, wheels)),
    )


def _camera(space, values, ticks, seed, level):
    captures = ticks // VISION_TICKS + 1
    random = stream(seed, "camera")
    noise = level * PIXEL_RMS * random.standard_normal((captures, 4))
    missed = random.uniform(0.0, 1.0, captures) < values["camera_dropouts"]["share"]
    offset, marker = values["camera_offset"], values["marker_offset"]
    age_s = values["camera_latency"]["latency_s"] + values["clock_offset"]["offset_s"]
    return Camera(
        *space.localizer.pixel_m, space.localizer.marker_spacing_m, space.width_m / 2.0, space.depth_m / 2.0,
        age_s / TICK_S, 1.0 + values["camera_scale"]["share"], float(values["camera_rotation"]["angle_rad"]),
        np.array([offset["x_m"], offset["y_m"]], dtype=float), np.array([marker["x_m"], marker["y_m"]], dtype=float),
        float(values["camera_distortion"]["per_m2"]),
        np.array([values["camera_keystone"][f"{axis}_per_m"] for axis in "xy"], dtype=float), noise, missed,
    )


def _imu(nominal, values, ticks, seed, level):
    """The scenario's noise times 0.7 to 1.4, small offsets of its own, and the effects."""
    random = stream(seed, "imu")
    force_rms, turn_rms = random.uniform(0.7, 1.4, 2)
    own_force, own_turn = random.uniform(-0.02, 0.02, 3), random.uniform(-0.002, 0.002, 3)
    mounted = random.uniform(-0.003, 0.003)
    noise = random.standard_normal((ticks + 1, 6)) / np.sqrt(TICK_S)
    noise[:, :3] *= force_rms * nominal.accelerometer_noise_density
    noise[:, 3:] *= turn_rms * nominal.gyro_noise_density
    force, turn, off = values["accelerometer_bias"], values["gyro_bias"], values["imu_misalignment"]
    bias = level * np.concatenate([own_force, own_turn])
    bias += [force["x_m_s2"], 0.0, force["z_m_s2"], 0.0, turn["pitch_rad_s"], turn["yaw_rad_s"]]
    axes = Rotation.from_rotvec([off["about_x_rad"], level * mounted, off["about_z_rad"]]).as_matrix()
    gain = np.repeat([1.0 + values["accelerometer_scale"]["share"], 1.0 + values["gyro_scale"]["share"]], 3)
    offset = values["imu_offset"]
    return pendulum_truth.Imu(
        nominal.height_m + offset["above_m"], offset["ahead_m"], np.ascontiguousarray(axes.T), gain, bias,
        level * noise, float(values["imu_lag"]["time_constant_s"]),
    )
