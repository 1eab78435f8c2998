"""Effects that no library names: forces in the generator, and flaws of sensors put upon its recordings.

`outside_cases.yaml` holds the cases of the campaign, drawn once: effect, size, robot, motions, seed, and the channel
and the variable in which each must show. `python -m hidden.outside` draws the file anew.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml
from scipy.signal import lfilter

from drake_ispace.files.recording import Channel, Recording
from hidden.effects_truth import UNKNOWN
from hidden.generator import generate
from hidden.motions import MOTIONS, TICK_S

FILE = Path(__file__).with_name("outside_cases.yaml")

#: Flaw of a sensor -> unit of its size.
FLAWS = {
    "keystone": "1/m",  # the scale of x grows with y
    "radial_distortion": "1/m^2",  # places move outwards with the square of their distance from the room's centre
    "mirrored_room": "1",  # y and heading change their signs
    "stamp_jitter": "s",  # of the fixes, uniform
    "imu_ahead": "m",  # the IMU is that far ahead of the axle
    "imu_above": "m",  # the IMU is that far above where the model has it
    "imu_low_pass": "s",  # time constant
}

#: (robot, effect) -> typical size, channel, variable.
TYPICAL = {
    ("omni", "one_wheel_friction"): (0.012, "encoder: wheel 1", "direction"),
    ("omni", "motor_offset"): (0.008, "encoder: wheel 2", "constant"),
    ("omni", "forward_friction"): (0.015, "encoder", "direction"),
    ("omni", "wheel_drag"): (0.00015, "encoder", "speed squared"),
    ("omni", "carpet_patch"): (1.2, "encoder", "place"),
    ("omni", "carpet_patch_slip"): (0.15, "kinect", "place"),
    ("omni", "cable_pull"): (0.8, "encoder", "place"),
    ("omni", "quadratic_drag"): (10.0, "encoder", "speed squared"),
    ("omni", "motor_warm_up"): (0.015, "encoder", "time"),
    ("omni", "eccentric_encoder"): (0.15, "encoder: wheel 1", "wheel angle"),
    ("omni", "keystone"): (0.08, "kinect", "place"),
    ("omni", "radial_distortion"): (0.08, "kinect", "place"),
    ("omni", "mirrored_room"): (1.0, "kinect", "speed"),
    ("omni", "stamp_jitter"): (0.09, "kinect", "speed"),
    ("pendulum", "one_wheel_friction"): (0.02, "encoder", "direction"),
    ("pendulum", "motor_offset"): (0.02, "encoder", "constant"),
    ("pendulum", "forward_friction"): (0.02, "encoder", "direction"),
    ("pendulum", "wheel_drag"): (0.0004, "encoder", "speed squared"),
    ("pendulum", "carpet_patch"): (0.7, "encoder", "place"),
    ("pendulum", "carpet_patch_slip"): (0.12, "kinect", "place"),
    ("pendulum", "cogging"): (0.015, "encoder", "wheel angle"),
    ("pendulum", "eccentric_encoder"): (0.05, "encoder: wheel 1", "wheel angle"),
    ("pendulum", "imu_ahead"): (0.06, "imu: az", "acceleration"),
    ("pendulum", "imu_above"): (0.06, "imu: ax", "acceleration"),
    ("pendulum", "imu_low_pass"): (0.02, "imu: wy", "acceleration"),
    ("pendulum", "keystone"): (0.08, "kinect", "place"),
    ("pendulum", "mirrored_room"): (1.0, "kinect", "speed"),
}
_RUNS = 4  # of a case, the last of them held out


def recorded(robot: str, motion: str, effect: str | None, size: float, seed: int, seconds: float = 20.0) -> Recording:
    """A run of `robot` with this effect or flaw; effect: None for a sound robot."""
    unknown = (effect, size) if effect in UNKNOWN else None
    recording = generate(robot, motion, {}, seconds, seed, unknown=unknown)
    return flawed(recording, effect, size, seed) if effect in FLAWS else recording


def flawed(recording: Recording, flaw: str, size: float, seed: int) -> Recording:
    """The recording as a sensor with this flaw would have made it."""
    channels = dict(recording.channels)
    if flaw.startswith("imu"):
        imu = channels["imu"]
        truth = channels["truth"].values[: len(imu.t)]
        channels["imu"] = replace(imu, values=_FLAWED_IMU[flaw](imu.values, truth, size))
        return replace(recording, channels=channels)
    kinect = channels["kinect"]
    t, poses = kinect.t, kinect.values.copy()
    x, y = poses[:, 0].copy(), poses[:, 1].copy()
    if flaw == "keystone":
        poses[:, 0] = x * (1.0 + size * y)
    elif flaw == "radial_distortion":
        stretch = 1.0 + size * (x * x + y * y)
        poses[:, 0], poses[:, 1] = x * stretch, y * stretch
    elif flaw == "mirrored_room":
        poses[:, 1:3] = -poses[:, 1:3]
    elif flaw == "stamp_jitter":
        t = np.round(t + size * np.random.default_rng([seed, 9]).uniform(-0.5, 0.5, len(t)), 6)
        t = np.maximum.accumulate(np.maximum(t, 0.0) + 1e-6 * np.arange(len(t)))
    period_s = None if flaw == "stamp_jitter" else kinect.period_s
    channels["kinect"] = Channel(t, kinect.columns[:3], poses[:, :3], {}, period_s)
    return replace(recording, channels=channels)


def _lever(values, truth, ahead, above):
    """The specific force at a point `ahead` and `above` [m] of the IMU, from the true rates of tilt and yaw."""
    tilt, yaw_rate, tilt_rate = truth[:, 3], truth[:, 5], truth[:, 6]
    turn = np.column_stack([-yaw_rate * np.sin(tilt), tilt_rate, yaw_rate * np.cos(tilt)])
    arm = np.array([ahead, 0.0, above])
    force = np.cross(np.gradient(turn, TICK_S, axis=0), arm) + np.cross(turn, np.cross(turn, arm))
    changed = values.copy()
    changed[:, :3] += force
    return changed


def _low_pass(values, truth, time_constant_s):
    keep = np.exp(-TICK_S / time_constant_s)
    return lfilter([1.0 - keep], [1.0, -keep], values, axis=0, zi=keep * values[:1])[0]


_FLAWED_IMU = {
    "imu_ahead": lambda values, truth, size: _lever(values, truth, size, 0.0),
    "imu_above": lambda values, truth, size: _lever(values, truth, 0.0, size),
    "imu_low_pass": _low_pass,
}


def runs_of(case: dict, sound: bool = False) -> list[Recording]:
    """The runs of a case; sound: of the same robot, motions and seed without the effect."""
    effect = None if sound else case["effect"]
    return [
        recorded(case["robot"], motion, effect, case["size"], 100 * case["seed"] + i)
        for i, motion in enumerate(case["motions"])
    ]


def cases() -> list[dict]:
    """The cases of the campaign."""
    return yaml.safe_load(FILE.read_text(encoding="utf-8"))


def draw(count: int = 60, seed: int = 14) -> list[dict]:
    """Cases drawn at random: every effect in turn, its size from half to twice the typical one."""
    generator, drawn = np.random.default_rng(seed), []
    for k in range(count):
        (robot, effect), (typical, channel, driver) = list(TYPICAL.items())[k % len(TYPICAL)]
        factor = 1.0 if effect == "mirrored_room" else float(2.0 ** generator.uniform(-1.0, 1.0))
        motions = [str(motion) for motion in generator.permutation(MOTIONS)[:_RUNS]]
        drawn.append({
            "robot": robot, "effect": effect, "size": float(f"{factor * typical:.3g}"), "motions": motions,
            "seed": 500 + k, "channel": channel, "driver": driver,
        })
    return drawn


if __name__ == "__main__":
    FILE.write_text(yaml.safe_dump(draw(), sort_keys=False), encoding="utf-8")
