"""A plant of one's own: the two gear motors of REGBOT, ideal DC motors with back-EMF and inertia, and their logs.

Base: w' = (V / k_e - w) / time_constant for either wheel. No data sheet comes with the logs: k_e is what the training
runs' own voltage, current and speed say, V = k_e w + R I, friction or not; the time constant is a free parameter.
"Torque" is the voltage here, so friction is in V (over R, times k_e: N m). Speed was logged, angles are its integral.
A run is 0.4 s long, too short for a filter's statistics, and does not drift, so that effects can be chosen by
simulations of whole runs. The robot rests before t = 0, which is added to each run.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from real_data import spread

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.kernels import kernel
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.files.importers import regbot
from drake_ispace.files.recording import Channel, Recording

REST_S = 0.4  # added before each run
TIME_CONSTANT_S = 0.04  # to begin with
OTHER_STEPS = ("vel_step.txt", "vel_step_2.txt", "vel_step_-2.txt")
SAME = "vel_step_29.txt"  # as number 28


@kernel
def accelerate(xc, voltage, speed_per_volt, time_constant_s, out):
    n = voltage.shape[0]
    for i in range(n):
        out[i] = xc[n + i]
        out[n + i] = (speed_per_volt * voltage[i] - xc[n + i]) / time_constant_s


@kernel
def angle(xc, out):
    for i in range(out.shape[0]):
        out[i] = xc[i]


@kernel
def rate(xc, out):
    for i in range(out.shape[0]):
        out[i] = xc[out.shape[0] + i]


class Motors(Block):
    """Two ideal DC motors; voltage (2,) [V] -> position (2,) [rad], speed (2,) [rad/s]."""

    def __init__(self, speed_per_volt, time_constant_s):
        super().__init__(Spec(
            inputs={"voltage": 2}, outputs={"position": Output(2, angle), "speed": Output(2, rate)},
            parameters={"speed_per_volt": speed_per_volt, "time_constant_s": time_constant_s},
            continuous_state=np.zeros(4), derivatives=accelerate,
        ))


def motors(runs: list[Recording]) -> OwnModel:
    """The model, with the back-EMF of these runs."""
    return OwnModel(
        Motors(1.0 / back_emf(runs), TIME_CONSTANT_S), torque="voltage", wheel_angle="position", wheel_rate="speed",
        name="motors", logged="speed", free=("time_constant_s",),
    )


def back_emf(runs: list[Recording]) -> float:
    """k_e [V s/rad] of V = k_e w + R I + c, all runs together; c takes the current sensor's own offset."""
    rows, volts = [], []
    for run in runs:
        truth = run.channels["truth"]
        for side in "rl":
            current = np.convolve(truth.column(f"current_{side}"), np.ones(9) / 9.0, "same")
            speed = truth.column(f"speed_{side}") / regbot.WHEEL_RADIUS_M
            rows.append(np.column_stack([speed, current, np.ones(len(speed))])[20:-5])
            volts.append(truth.column(f"voltage_{side}")[20:-5])
    return float(np.linalg.lstsq(np.vstack(rows), np.concatenate(volts), rcond=None)[0][0])


def voltage_steps(data: Path, count: int | None) -> tuple[list[Recording], dict[str, list[Recording]]]:
    """(training runs, held-out ones by kind), `count` at most of those with the usual steps."""
    logs = {log.path.name: prepared(log) for log in regbot.load_folder(data / "regbot" / "motor_steps")}
    usual = [log for name, log in logs.items() if name not in (*OTHER_STEPS, SAME)]
    other = [logs[name] for name in OTHER_STEPS if name in logs]
    return spread(usual[::2], count), {"same steps": spread(usual[1::2], count), "other steps": other}


def prepared(log: Recording) -> Recording:
    """With voltage as `torque` and the integral of speed as `encoder`, after a rest."""
    truth = log.channels["truth"]
    period = float(np.median(np.diff(truth.t)))
    rest = np.arange(0.0, REST_S, period)
    t = np.concatenate([rest, REST_S + truth.t - truth.t[0]])
    volts = np.column_stack([truth.column("voltage_r"), truth.column("voltage_l")])
    speed = np.column_stack([truth.column("speed_r"), truth.column("speed_l")]) / regbot.WHEEL_RADIUS_M
    still = np.zeros((len(rest), 2))
    turned = np.cumsum(np.vstack([still, speed]), axis=0) * period
    return replace(log, channels={
        "truth": truth,
        "torque": Channel(t, ("tau_r", "tau_l"), np.vstack([still, volts]), {}, period),
        "encoder": Channel(t, ("theta_r", "theta_l"), turned, {}, period),
    })
