"""A simulated robot held on a measured motion: what it takes beyond the recorded torque is what its model lacks.

A balancing robot cannot be simulated from its torque (it falls), and from its reference the chatter of encoder counts
soon falls out of step with the measured one. Here the simulated plant gets the recorded torque plus K (measured state -
its own), and the correction is the prediction error: zero but for noise where the model is right.
"""

import numpy as np
from pydrake.systems.framework import Diagram
from scipy.signal import savgol_filter

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.recording import Recording
from drake_ispace.plants.pendulum import PendulumPlant, PendulumPlantParameters
from drake_ispace.robots.pendulum import Pendulum
from drake_ispace.thesis.structures import tilt_of
from drake_ispace.wiring.bench import Bench, Part

MEASURED = 8  # s, phi, theta, s_dot, phi_dot, theta_dot, tau_r, tau_l


@kernel
def follow(measured, wheel_angle, balance, gain, radius_m, half_track_m, out):
    """x_d = [torque (2), correction (2)]."""
    s = 0.5 * radius_m * (wheel_angle[0] + wheel_angle[1]) + radius_m * balance[0]
    phi = 0.5 * radius_m / half_track_m * (wheel_angle[0] - wheel_angle[1])
    own = (s, phi, balance[0], balance[1], balance[2], balance[3])
    for i in range(2):
        correction = 0.0
        for j in range(6):
            correction += gain[6 * i + j] * (measured[j] - own[j])
        out[i], out[2 + i] = measured[6 + i] + correction, correction


@kernel
def torque(xd, out):
    copy(xd[:2], out)


@kernel
def correction(xd, out):
    copy(xd[2:], out)


class MotionFollower(Block):
    """Recorded torque plus what keeps the plant on the measured motion.

    .. pydrake_system::

        name: MotionFollower
        input_ports:
        - measured
        - wheel_angle
        - balance
        output_ports:
        - torque
        - correction

    measured (8,): s [m], phi, theta [rad], their rates, torque right and left [N m], of this tick. wheel_angle (2,)
    [rad], balance (4,): of the plant that follows (wheel *and* body rotation, (2.38)). torque, correction (2,): right,
    left [N m].

    Args:
        gain: K (2, 6); radius_m, half_track_m: of the wheels.
    """

    def __init__(self, gain, radius_m: float, half_track_m: float):
        super().__init__(Spec(
            inputs={"measured": MEASURED, "wheel_angle": 2, "balance": 4},
            outputs={"torque": Output(2, torque), "correction": Output(2, correction)},
            parameters={"gain": np.ravel(gain), "radius_m": radius_m, "half_track_m": half_track_m},
            discrete_state=np.zeros(4), updates=(Update(follow, Phase.COMPUTE),),
        ))


def following_diagram(plant: PendulumPlantParameters, gain: np.ndarray) -> Diagram:
    """The plant and its follower; input `measured`, output `correction`."""
    bench = Bench()
    part = Part(bench, Pendulum.name)
    part.add("plant", PendulumPlant(plant))
    bench.add("follower", MotionFollower(gain, plant.wheel_radius_m, plant.half_track_m))
    bench.wire(
        (part.block("plant.wheel_angle"), "follower.wheel_angle"), (part.block("plant.balance"), "follower.balance"),
        ("follower.torque", part.block("plant.torque")),
    )
    bench.let_in(measured="follower.measured")
    bench.show(correction="follower.correction")
    return bench.build("motion_follower")


def measured_motion(recording: Recording, radius_m: float, half_track_m: float) -> np.ndarray:
    """(N, 8) `measured` of MotionFollower from the channels encoder, imu and torque of a run that starts at t = 0.

    The rates of s and phi are slopes of parabolas over 21 samples of the encoders; the others come from the IMU.

    Raises:
        InputError: a channel that is missing, has gaps or does not start at t = 0.
    """
    for name in ("torque", "encoder", "imu"):
        channel = recording.channels.get(name)
        if channel is None:
            raise InputError(f"the run has no channel {name}, expected torque, encoder and imu")
        ticks = np.round(channel.t / TICK_S)
        if len(ticks) < 400 or not np.array_equal(ticks, np.arange(len(ticks))):
            raise InputError(f"channel {name}: expected at least 400 samples, one every 5 ms from t = 0 without gaps")
    count = min(len(recording.channels[name].t) for name in ("torque", "encoder", "imu"))
    imu, angle = recording.channels["imu"].values[:count], recording.channels["encoder"].values[:count]
    tilt = tilt_of(imu, angle, radius_m)
    wheels = np.column_stack([angle.sum(axis=1), angle[:, 0] - angle[:, 1]]) * 0.5 * radius_m
    speed = savgol_filter(wheels, 21, 2, deriv=1, delta=TICK_S, axis=0)
    rate = imu[:, 4] - imu[:, 4].mean()
    return np.column_stack([
        wheels[:, 0] + radius_m * tilt, wheels[:, 1] / half_track_m, tilt, speed[:, 0] + radius_m * rate,
        speed[:, 1] / half_track_m, rate, recording.channels["torque"].values[:count],
    ])
