"""REGBOT's gear motors under voltage steps, wheels in the air: which friction does an ideal DC motor lack?

Base: w' = (V / k_e - w) / time_constant for either wheel, a motor with back-EMF k_e and inertia alone. No data sheet
comes with the logs: k_e is what the training runs' own voltage, current and speed say, V = k_e w + R I, friction or
not; the time constant is fitted. "Torque" is the voltage here, so friction is in V (over R, times k_e: N m). Angles are
the integral of the logged speed; the robot rests before t = 0, which is added to each run for the filter to settle.

Effects are named on the logs of every other robot; `held_out`: root mean square error of the simulated speed [rad/s]
with the voltage replayed open loop, on the others (of the same kind of step), and on three logs with other steps.
"""

from dataclasses import replace

import numpy as np
from real_data import arguments, named, print_answer, spread
from scipy.optimize import minimize_scalar

from drake_ispace.block import Block, Output, Spec
from drake_ispace.discrepancy.candidates import candidates
from drake_ispace.discrepancy.joint import decide_jointly
from drake_ispace.discrepancy.likelihood import merged
from drake_ispace.discrepancy.own_model import OwnModel, own_replay, own_track
from drake_ispace.discrepancy.predict import predict
from drake_ispace.effects.library import library
from drake_ispace.importers import regbot
from drake_ispace.kernels import kernel
from drake_ispace.rates import TICK_S
from drake_ispace.recording import Channel, Recording

REST_S = 0.4  # added before each run
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


def model_of(speed_per_volt, time_constant_s) -> OwnModel:
    return OwnModel(
        Motors(speed_per_volt, time_constant_s), torque="voltage", wheel_angle="position", wheel_rate="speed",
    )


def prepared(log: Recording) -> Recording:
    """voltage as `torque`, the integral of speed as `encoder`, after a rest."""
    truth = log.channels["truth"]
    period = float(np.median(np.diff(truth.t)))
    rest = np.arange(0.0, REST_S, period)
    t = np.concatenate([rest, REST_S + truth.t - truth.t[0]])
    volts = np.column_stack([truth.column("voltage_r"), truth.column("voltage_l")])
    speed = np.column_stack([truth.column("speed_r"), truth.column("speed_l")]) / regbot.WHEEL_RADIUS_M
    still = np.zeros((len(rest), 2))
    turned = np.cumsum(np.vstack([still, speed]), axis=0) * period
    return replace(log, channels={
        "torque": Channel(t, ("tau_r", "tau_l"), np.vstack([still, volts]), {}, period),
        "encoder": Channel(t, ("theta_r", "theta_l"), turned, {}, period),
    })


def back_emf(logs) -> float:
    """k_e [V s/rad] of V = k_e w + R I + c, all runs together; c takes the current sensor's own offset."""
    rows, volts = [], []
    for log in logs:
        truth = log.channels["truth"]
        for side in "rl":
            current = np.convolve(truth.column(f"current_{side}"), np.ones(9) / 9.0, "same")
            speed = truth.column(f"speed_{side}") / regbot.WHEEL_RADIUS_M
            rows.append(np.column_stack([speed, current, np.ones(len(speed))])[20:-5])
            volts.append(truth.column(f"voltage_{side}")[20:-5])
    return float(np.linalg.lstsq(np.vstack(rows), np.concatenate(volts), rcond=None)[0][0])


def speed_error(replay, tracks, values) -> float:
    """Root mean square error of speed over 10 ms [rad/s] with the voltage replayed open loop."""
    errors = []
    for track in tracks:
        found = replay.simulated(track, values) - track.measured[: track.ticks + 1]
        errors.append((found[2:] - found[:-2])[int(REST_S / TICK_S) :] / (2.0 * TICK_S))
    return float(np.sqrt(np.mean(np.vstack(errors) ** 2)))


def main() -> None:
    options, pool, tell = arguments(__doc__)
    folder = options.data / "regbot" / "motor_steps"
    logs = {log.path.name: log for log in regbot.load_folder(folder)}
    usual = [log for name, log in logs.items() if name not in (*OTHER_STEPS, SAME)]
    training, rest = spread(usual[::2], options.runs), spread(usual[1::2], options.runs)
    per_volt = 1.0 / back_emf(training)
    dummy = model_of(per_volt, 0.04)
    tracks = [own_track(prepared(log), dummy, log.path.name) for log in training]
    constant = minimize_scalar(
        lambda tau: speed_error(own_replay(model_of(per_volt, tau), tracks, []), tracks, {}), bounds=(0.01, 0.12),
        method="bounded", options={"maxiter": 12},
    ).x
    model = model_of(per_volt, constant)
    replay = own_replay(model, tracks, list(library().values()))
    tried = candidates(replay.effects, replay.body)
    decision = decide_jointly(predict(replay, tracks), tried, 0, pool, tell)
    values = {} if decision.named is None else merged(decision.named.point)
    held_out = {}
    for kind, found in (("same steps", rest), ("other steps", [logs[name] for name in OTHER_STEPS if name in logs])):
        others = [own_track(prepared(log), model, log.path.name) for log in found]
        held_out[kind] = {
            "before": speed_error(replay, others, {}), "after": speed_error(replay, others, values), "unit": "rad/s",
        }
    print_answer(options, decision, named(decision), held_out, {
        "parameters": values, "base": {"back_emf_v_s": 1.0 / per_volt, "time_constant_s": constant},
    })


if __name__ == "__main__":
    main()
