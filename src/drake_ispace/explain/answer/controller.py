"""The fourth prediction: measured sensors -> torque, which tests the controller itself.

Everything else drives the model with the recorded torque and cannot see a controller that is not the scenario's. Here
the scenario's own Diagram runs without its plant, its camera and its way point: what these would say is what was
recorded, and what its actuator is told is compared with the torque that was. Effects play no part in it: whatever they
did to the sensors is in the recording.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.blocks.messages import TICK
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.predict.tracks import in_force, nearest_ticks
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.files.reference import direction_of, turn_of
from drake_ispace.robots.library import robots
from drake_ispace.rollout.compile import compile_diagram
from drake_ispace.room.link import delay_ticks
from drake_ispace.scenario import Scenario
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.catalog import entry_of

_SETTLING_TICKS = 400  # of estimates that start from the scenario's pose, not from the robot's
_CORNER_TICKS = 120  # around a corner of the reference, whose jump of speed no camera's period shows
_NEEDED = ("reference", "torque", "encoder", "kinect")


@dataclass(frozen=True)
class ControllerCheck:
    """How well the scenario's controller explains a recorded torque.

    Attributes:
        unexplained: share of the torque's root mean square that is left, over all wheels. gain: by which the predicted
            torque fits the recorded one best, 1 where the controller is the scenario's.
    """

    unexplained: float
    gain: float


class Playback(Bench):
    """A Bench on which some blocks are left out: what they would say comes in from outside, an input for each wire.

    Args:
        left_out: names of blocks.
    """

    def __init__(self, left_out: tuple[str, ...]):
        super().__init__()
        self._left_out = left_out
        self.inputs: dict[str, str] = {}  # name of an input -> "block.port" that would have said it

    def add(self, name, block):
        return block if name in self._left_out else super().add(name, block)

    def show(self, **ports):
        super().show(**{signal: port for signal, port in ports.items() if self._is_there(port)})

    def build(self, name):
        cut = [(source, end) for source, end in self._wires if not self._is_there(source) and self._is_there(end)]
        self._wires = [(a, b) for a, b in self._wires if self._is_there(a) and self._is_there(b)]
        for source, end in cut:
            self.let_in(**{end.replace(".", "_"): end})
            self.inputs[end.replace(".", "_")] = source
        return super().build(name)

    def _is_there(self, port):
        return port.rpartition(".")[0] not in self._left_out


def check_controller(model: Scenario, robot: str, recording: Recording) -> ControllerCheck | None:
    """Compare a recorded torque with what `model`'s controller makes of the recorded sensors.

    Returns:
        None where the recording lacks a channel, or the model's Diagram has no such controller.
    """
    needed = (*_NEEDED, "imu") if robots()[robot].has_imu else _NEEDED
    if not entry_of(model).has_feedback or any(len(recording.channels.get(name, _NONE).t) < 4 for name in needed):
        return None
    if getattr(model, robot).encoder.velocity == "exact":  # the wheels' own speed is not recorded
        return None
    told = predicted_torque(model, robot, recording)
    measured = recording.channels["torque"]
    ticks = nearest_ticks(measured.t).astype(int)
    scored = (ticks < len(told)) & (ticks > _SETTLING_TICKS) & ~_near_corner(recording.channels["reference"], ticks)
    if scored.sum() < _SETTLING_TICKS:
        return None
    mine, theirs = told[ticks[scored]].ravel(), measured.values[scored].ravel()
    size = float(np.linalg.norm(theirs))
    if size == 0.0 or not np.isfinite(mine).all():
        return None
    return ControllerCheck(float(np.linalg.norm(theirs - mine)) / size, float(mine @ theirs / max(mine @ mine, 1e-300)))


def predicted_torque(model: Scenario, robot: str, recording: Recording) -> np.ndarray:
    """(ticks, n) what the model's actuator is told on [t_k, t_k+1), given the recorded sensors [N m]."""
    scenario = _listening(model, robot, recording)
    bench = Playback((f"{robot}_plant", "kinect", f"{robot}_way_point"))
    rollout = compile_diagram(entry_of(model).build(scenario, bench))
    ticks = int(nearest_ticks(recording.channels["encoder"].t[-1])) + 1
    said = _said(scenario, robot, recording, ticks)
    inputs = {name: said[source.rpartition(".")[2]] for name, source in bench.inputs.items()}
    return rollout.run(ticks, inputs=inputs)[f"{robot}_torque"][1:]


def _listening(model, robot, recording):
    """The model with sensors and link that pass on what they are given, at the recording's start."""
    scenario = copy.deepcopy(model)
    section, link = getattr(scenario, robot), scenario.space.link
    section.effects, section.initial_pose = {}, recording.channels["reference"].values[0, :3].tolist()
    section.encoder = replace(section.encoder, counts_per_turn=0)
    if robots()[robot].has_imu:
        still = {"accelerometer_noise_density": 0.0, "gyro_noise_density": 0.0}
        section.imu = replace(section.imu, accelerometer_bias_m_s2=[0.0] * 3, gyro_bias_rad_s=[0.0] * 3, **still)
    scenario.space = replace(scenario.space, link=replace(link, loss=0.0, corruption=0.0))
    return scenario


def _said(scenario, robot, recording, ticks) -> Mapping[str, np.ndarray]:
    """Port of a block that is left out -> (ticks, size) what it would say at every tick."""
    channels = recording.channels
    wheels = len(channels["encoder"].columns)
    said = {
        "wheel_angle": _each_tick(channels["encoder"], ticks), "wheel_rate": np.zeros((ticks, wheels)),
        "way_point": way_points(channels["reference"], ticks),
        "fixes": _fixes(channels["kinect"], delay_ticks(scenario.space.link, robots()[robot].order_size), ticks),
    }
    if "imu" in channels:
        said["body_motion"] = _each_tick(channels["imu"], ticks)
    return said


_NONE = Channel(np.empty(0), (), np.empty((0, 0)), {}, None)


def _each_tick(channel, ticks):
    return channel.values[np.maximum(in_force(nearest_ticks(channel.t), ticks), 0)]


def _messages(rows, since, ticks):
    """(ticks, m) the message in force at every tick, each of `rows` from its tick `since` on; before them that of tick
    -1, which every block takes for none."""
    before = np.zeros((1, rows.shape[1]))
    before[:, TICK] = -1.0
    return np.vstack([before, rows])[in_force(since, ticks) + 1]


def way_points(reference: Channel, ticks: int) -> np.ndarray:
    """(ticks, 10) messages WAY_POINT, rates and accelerations by differences; at corners no acceleration."""
    direction, speed = direction_of(reference)
    phi = np.unwrap(reference.column("phi"))
    velocity = np.column_stack([speed * np.cos(direction), speed * np.sin(direction), np.gradient(phi, reference.t)])
    acceleration = np.gradient(velocity, reference.t, axis=0)
    acceleration[turn_of(reference, direction, speed)[1]] = 0.0
    stamp = nearest_ticks(reference.t)
    return _messages(np.column_stack([stamp, reference.values[:, :2], phi, velocity, acceleration]), stamp, ticks)


def _fixes(kinect, delay, ticks):
    """(ticks, 5) messages FIX of the camera as the room's computer has them, `delay` before the robot received them."""
    capture = nearest_ticks(kinect.t)
    received = kinect.column("t_received") if "t_received" in kinect.columns else kinect.t + delay * TICK_S
    known = np.maximum(nearest_ticks(received) - delay, capture)
    return _messages(np.column_stack([capture, np.ones(len(capture)), kinect.values[:, :3]]), known, ticks)


def _near_corner(reference, ticks):
    direction, speed = direction_of(reference)
    corners = nearest_ticks(reference.t[turn_of(reference, direction, speed)[1]])
    if not len(corners):
        return np.zeros(len(ticks), bool)
    nearest = np.clip(np.searchsorted(corners, ticks), 0, len(corners) - 1)
    apart = np.minimum(np.abs(corners[nearest] - ticks), np.abs(corners[np.maximum(nearest - 1, 0)] - ticks))
    return apart < _CORNER_TICKS
