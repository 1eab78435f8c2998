"""A check of the controller: the torque that the scenario's controller computes from the measured sensors.

All other predictions drive the model with the recorded torque, and cannot see a controller that is not the scenario's.
For this check the scenario's Diagram runs without its plant, its camera and its way point. The outputs of these blocks
are taken from the recording, and the torque command of the Diagram is compared with the recorded torque. Effects play
no part in the check: whatever they did to the sensors is in the recording.
"""

import copy
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_ispace.blocks.messages import TICK
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.answer.explanation import ControllerCheck, Explanation
from drake_ispace.explain.predict.case import Case
from drake_ispace.explain.predict.tracks import in_force, nearest_ticks
from drake_ispace.faults.repair import from_zero
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.files.reference import direction_of, turn_of
from drake_ispace.robots.library import robots
from drake_ispace.rollout.compile import compile_diagram
from drake_ispace.room.link import delay_ticks
from drake_ispace.scenario import Scenario
from drake_ispace.wiring.bench import Bench
from drake_ispace.wiring.catalog import entry_of

_SETTLING_TICKS = 400  # until estimates that start from the scenario's pose have reached the robot's
_CORNER_TICKS = 120  # around a corner of the reference, whose jump of speed lies between two samples of the camera
FOREIGN = 0.12  # share of the torque that the scenario's controller may leave (its own one leaves 0 to 0.09)
_NEEDED = ("reference", "torque", "encoder", "kinect")


def check_controllers(answer: Explanation, case: Case) -> None:
    """Add the median check of the training runs to the answer, and a warning where the controller is another."""
    checks = [check_controller(case.scenario, case.robot, run) for run in case.runs]
    known = [check for check in checks if check is not None]
    if not known:
        return
    share, gain = (float(np.median([getattr(check, name) for check in known])) for name in ("unexplained", "gain"))
    answer.controller = ControllerCheck(share, gain)
    if share > FOREIGN:
        answer.warnings.append(
            "the controller is not the model's, or it acted on other fixes than the log has (lost or late ones): "
            f"{100.0 * share:.0f} % of the recorded torque is not what it makes of the measured sensors (it fits best "
            f"{gain:.2f} times as large); effects are found from the recorded torque all the same, but closed-loop "
            "simulations of the model will differ"
        )


class Playback(Bench):
    """A Bench on which some blocks are left out: each wire from one of them becomes an input of the Diagram.

    Args:
        left_out: names of blocks.

    Attributes:
        inputs: name of an input -> "block.port" that it stands for.
    """

    def __init__(self, left_out: tuple[str, ...]):
        super().__init__()
        self._left_out = left_out
        self.inputs: dict[str, str] = {}

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
    """Compare the recorded torque with the torque that the model's controller computes from the recorded sensors.

    Returns:
        None where the recording lacks a channel or is too short, or where the model's Diagram has no such controller.
    """
    needed = (*_NEEDED, "imu") if robots()[robot].has_imu else _NEEDED
    long_enough = {name for name, channel in recording.channels.items() if len(channel.t) > 3}
    if not entry_of(model).has_feedback or not long_enough.issuperset(needed):
        return None
    if getattr(model, robot).encoder.velocity == "exact":  # the wheels' own speed is not recorded
        return None
    recording = from_zero(recording, needed)
    torque = predicted_torque(model, robot, recording)
    measured = recording.channels["torque"]
    ticks = nearest_ticks(measured.t).astype(int)
    scored = (ticks < len(torque)) & (ticks > _SETTLING_TICKS) & ~_near_corner(recording.channels["reference"], ticks)
    if scored.sum() < _SETTLING_TICKS:
        return None
    predicted, recorded = torque[ticks[scored]].ravel(), measured.values[scored].ravel()
    size = float(np.linalg.norm(recorded))
    if size == 0.0 or not np.isfinite(predicted).all():
        return None
    unexplained = float(np.linalg.norm(recorded - predicted)) / size
    return ControllerCheck(unexplained, float(predicted @ recorded / max(predicted @ predicted, 1e-300)))


def predicted_torque(model: Scenario, robot: str, recording: Recording) -> np.ndarray:
    """(ticks, n) torque command of the model's controller on [t_k, t_k+1) [N m], given the recorded sensors."""
    scenario = _transparent(model, robot, recording)
    bench = Playback((f"{robot}_plant", "kinect", f"{robot}_way_point"))
    rollout = compile_diagram(entry_of(model).build(scenario, bench))
    ticks = int(nearest_ticks(recording.channels["encoder"].t[-1])) + 1
    outputs = _outputs(scenario, robot, recording, ticks)
    inputs = {name: outputs[source.rpartition(".")[2]] for name, source in bench.inputs.items()}
    return rollout.run(ticks, inputs=inputs)[f"{robot}_torque"][1:]


def _transparent(model, robot, recording):
    """The model at the recording's first pose, with sensors and a link that pass on their inputs unchanged."""
    scenario = copy.deepcopy(model)
    section, link = getattr(scenario, robot), scenario.space.link
    section.effects, section.initial_pose = {}, recording.channels["reference"].values[0, :3].tolist()
    section.encoder = replace(section.encoder, counts_per_turn=0)
    if robots()[robot].has_imu:
        still = {"accelerometer_noise_density": 0.0, "gyro_noise_density": 0.0}
        section.imu = replace(section.imu, accelerometer_bias_m_s2=[0.0] * 3, gyro_bias_rad_s=[0.0] * 3, **still)
    scenario.space = replace(scenario.space, link=replace(link, loss=0.0, corruption=0.0))
    return scenario


def _outputs(scenario, robot, recording, ticks) -> Mapping[str, np.ndarray]:
    """Output port of a block that is left out -> (ticks, size) recorded values at every tick."""
    channels = recording.channels
    wheels = len(channels["encoder"].columns)
    outputs = {
        "wheel_angle": _each_tick(channels["encoder"], ticks), "wheel_rate": np.zeros((ticks, wheels)),
        "way_point": way_points(channels["reference"], ticks),
        "fixes": _fixes(channels["kinect"], delay_ticks(scenario.space.link, robots()[robot].order_size), ticks),
    }
    if "imu" in channels:
        outputs["body_motion"] = _each_tick(channels["imu"], ticks)
    return outputs


def _each_tick(channel, ticks):
    return channel.values[np.maximum(in_force(nearest_ticks(channel.t), ticks), 0)]


def _messages(rows, since, ticks):
    """(ticks, m) the message in force at every tick, each of `rows` from its tick `since` on.

    Before the first of them the stamp is -1, which every block takes for no message.
    """
    before = np.zeros((1, rows.shape[1]))
    before[:, TICK] = -1.0
    return np.vstack([before, rows])[in_force(since, ticks) + 1]


def way_points(reference: Channel, ticks: int) -> np.ndarray:
    """(ticks, 10) messages of the way point: stamp, pose, rates, accelerations; at corners of the path no acceleration.

    Rates and accelerations are differences of the recorded reference.
    """
    direction, speed = direction_of(reference)
    phi = np.unwrap(reference.column("phi"))
    velocity = np.column_stack([speed * np.cos(direction), speed * np.sin(direction), np.gradient(phi, reference.t)])
    acceleration = np.gradient(velocity, reference.t, axis=0)
    acceleration[turn_of(reference, direction, speed)[1]] = 0.0
    stamp = nearest_ticks(reference.t)
    return _messages(np.column_stack([stamp, reference.values[:, :2], phi, velocity, acceleration]), stamp, ticks)


def _fixes(kinect, delay, ticks):
    """(ticks, 5) messages of the camera on the room's computer, `delay` ticks before the robot received them."""
    capture = nearest_ticks(kinect.t)
    received = kinect.column("t_received") if "t_received" in kinect.columns else kinect.t + delay * TICK_S
    known = np.maximum(nearest_ticks(received) - delay, capture)
    return _messages(np.column_stack([capture, np.ones(len(capture)), kinect.values[:, :3]]), known, ticks)


def _near_corner(reference, ticks):
    """(k,) whether each tick lies within _CORNER_TICKS of a corner of the reference."""
    direction, speed = direction_of(reference)
    corners = nearest_ticks(reference.t[turn_of(reference, direction, speed)[1]])
    if not len(corners):
        return np.zeros(len(ticks), bool)
    nearest = np.clip(np.searchsorted(corners, ticks), 0, len(corners) - 1)
    apart = np.minimum(np.abs(corners[nearest] - ticks), np.abs(corners[np.maximum(nearest - 1, 0)] - ticks))
    return apart < _CORNER_TICKS
