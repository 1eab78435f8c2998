"""Effects that no library names: forces in the generator, and flaws of sensors put upon its recordings.

`outside_cases.yaml` holds the cases of the campaign, drawn once: effect, size, robot, motions, seed, and the channel
and the variable in which each must show. `python -m hidden.outside` draws the file anew.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from drake_ispace.blocks.frames import wrap
from drake_ispace.files.recording import Channel, Recording
from hidden.effects_truth import UNKNOWN
from hidden.generator import generate
from hidden.motions import MOTIONS

FILE = Path(__file__).with_name("outside_cases.yaml")

#: Flaw of a sensor -> unit of its size.
FLAWS = {
    "skewed_axes": "1",  # the room's axes are not square: x grows with y
    "warped_heading": "rad/m",  # the heading is off in proportion to x
    "mirrored_room": "1",  # y and heading change their signs
    "stamp_jitter": "s",  # of the fixes, uniform
    "encoder_ripple": "rad",  # A sin(2 theta) on every encoder
    "bent_gyro": "s/rad",  # w + k |w| w
}

#: (robot, effect) -> typical size, channel, variable.
TYPICAL = {
    ("omni", "ramp_patch"): (1.2, "encoder", "place"),
    ("omni", "carpet_patch_slip"): (0.15, "kinect", "place"),
    ("omni", "cable_pull"): (0.8, "encoder", "place"),
    ("omni", "motor_warm_up"): (0.015, "encoder", "time"),
    ("omni", "motor_warm_up_gain"): (0.4, "encoder", "time"),
    ("omni", "cogging"): (0.012, "encoder", "wheel angle"),
    ("omni", "skewed_axes"): (0.08, "kinect", "place"),
    ("omni", "warped_heading"): (0.08, "kinect", "place"),
    ("omni", "mirrored_room"): (1.0, "kinect", "speed"),
    ("omni", "stamp_jitter"): (0.09, "kinect", "speed"),
    ("omni", "encoder_ripple"): (0.05, "encoder", "wheel angle"),
    ("pendulum", "ramp_patch"): (0.7, "encoder", "place"),
    ("pendulum", "carpet_patch_slip"): (0.12, "kinect", "place"),
    ("pendulum", "cable_pull"): (0.4, "encoder", "place"),
    ("pendulum", "motor_warm_up"): (0.03, "encoder", "time"),
    ("pendulum", "motor_warm_up_gain"): (0.3, "encoder", "time"),
    ("pendulum", "cogging"): (0.015, "encoder", "wheel angle"),
    ("pendulum", "skewed_axes"): (0.08, "kinect", "place"),
    ("pendulum", "warped_heading"): (0.08, "kinect", "place"),
    ("pendulum", "encoder_ripple"): (0.03, "encoder", "wheel angle"),
    ("pendulum", "bent_gyro"): (0.1, "imu", "speed squared"),
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
    if flaw == "bent_gyro":
        imu = channels["imu"]
        values = imu.values.copy()
        values[:, 3:] += size * np.abs(values[:, 3:]) * values[:, 3:]
        channels["imu"] = replace(imu, values=values)
        return replace(recording, channels=channels)
    if flaw == "encoder_ripple":
        encoder = channels["encoder"]
        channels["encoder"] = replace(encoder, values=encoder.values + size * np.sin(2.0 * encoder.values))
        return replace(recording, channels=channels)
    kinect = channels["kinect"]
    t, poses = kinect.t, kinect.values.copy()
    if flaw == "skewed_axes":
        poses[:, 0] += size * poses[:, 1]
    elif flaw == "warped_heading":
        poses[:, 2] = wrap(poses[:, 2] + size * poses[:, 0])
    elif flaw == "mirrored_room":
        poses[:, 1:3] = -poses[:, 1:3]
    elif flaw == "stamp_jitter":
        t = np.round(t + size * np.random.default_rng([seed, 9]).uniform(-0.5, 0.5, len(t)), 6)
        t = np.maximum.accumulate(np.maximum(t, 0.0) + 1e-6 * np.arange(len(t)))
    period_s = None if flaw == "stamp_jitter" else kinect.period_s
    channels["kinect"] = Channel(t, kinect.columns[:3], poses[:, :3], {}, period_s)
    return replace(recording, channels=channels)


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


def draw(count: int = 60, seed: int = 16) -> list[dict]:
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
