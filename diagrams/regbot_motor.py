"""REGBOT's gear motors under voltage steps, wheels in the air: which friction does an ideal DC motor lack?

Base: w' = (V / k_e - w) / time_constant for either wheel, a motor with back-EMF k_e and inertia alone. No data sheet
comes with the logs: k_e is what the training runs' own voltage, current and speed say, V = k_e w + R I, friction or
not; the time constant is fitted. "Torque" is the voltage here, so friction is in V (over R, times k_e: N m). Angles are
the integral of the logged speed; the robot rests before t = 0, which is added to each run for the filter to settle.

A run is 0.4 s long, too short for a filter's statistics, and does not drift: friction terms are told apart by the
simulated speed itself, every set of them fitted together with the time constant to one half of the training runs and
judged on the other. The fewest terms within 2 % of the best are named. `held_out`: root mean square error of speed
[rad/s], voltage replayed open loop, on the other robots' logs and on three logs with other steps.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
from real_data import arguments, print_answer, spread
from scipy.optimize import least_squares

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.library import library
from drake_ispace.explain.predict.own_model import OwnModel, own_replay, own_track
from drake_ispace.files.importers import regbot
from drake_ispace.files.recording import Channel, Recording

REST_S = 0.4  # added before each run
OTHER_STEPS = ("vel_step.txt", "vel_step_2.txt", "vel_step_-2.txt")
SAME = "vel_step_29.txt"  # as number 28
TERMS = ("viscous_friction", "coulomb_friction", "stribeck_friction")
#: Sizes at which fits begin, twice over: V s/rad, V, V, rad/s.
START = {"coefficient_n_m_s": 0.02, "torque_n_m": 0.5, "bump_n_m": 0.3, "speed_rad_s": 10.0}
WORTH = 1.02  # times the best error: what validates as well


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


def speed_errors(replay, tracks, values, constant) -> np.ndarray:
    """Errors of speed over 10 ms [rad/s] with the voltage replayed open loop, all runs and wheels."""
    errors = []
    for track in tracks:
        found = replay.simulated(track, values, {"time_constant_s": constant}) - track.measured[: track.ticks + 1]
        errors.append(((found[2:] - found[:-2])[int(REST_S / TICK_S) :] / (2.0 * TICK_S)).ravel())
    return np.nan_to_num(np.concatenate(errors), nan=1e3)


def rms(errors) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def fitted(replay, tracks, names) -> tuple[dict, float]:
    """(values of the effects `names`, time constant [s]) that simulate these runs best."""
    order = [(name, p, START[p]) for name in names for p in replay.effects[name].neutral(replay.body)]

    def parts(z):
        values = {}
        for (name, p, size), share in zip(order, z[1:], strict=True):
            values.setdefault(name, {})[p] = float(share * size)
        return values, float(z[0] * 0.04)

    # a friction that helps the motor, or a Stribeck speed of none, is no friction
    found = least_squares(
        lambda z: speed_errors(replay, tracks, *parts(z)), np.full(1 + len(order), 0.5),
        bounds=(0.02, 10.0), diff_step=1e-3,
    )
    return parts(found.x)


def validated(replay, tracks, names) -> float:
    """Error on each half of the runs of what is fitted to the other half."""
    halves = tracks[::2], tracks[1::2]
    errors = [speed_errors(replay, halves[1 - i], *fitted(replay, halves[i], names)) for i in (0, 1)]
    return rms(np.concatenate(errors))


def chosen(replay, tracks, tell) -> tuple[tuple[str, ...], list[tuple[str, ...]], dict[str, float]]:
    """(the fewest terms that validate as well as the best, other sets of as many that do too, error of every set)."""
    sets = [names for k in range(len(TERMS) + 1) for names in combinations(TERMS, k)]
    errors = {}
    for names in sets:
        errors[names] = validated(replay, tracks, names)
        tell(f"{' + '.join(names) or 'base'}: {errors[names]:.3f} rad/s")
    enough = [names for names in sets if errors[names] <= WORTH * min(errors.values())]
    fewest = [names for names in enough if len(names) == len(enough[0])]
    best = min(fewest, key=errors.get)
    table = {" + ".join(names) or "base": error for names, error in errors.items()}
    return best, [names for names in fewest if names != best], table


def main() -> None:
    options, _, tell = arguments(__doc__)
    logs = {log.path.name: log for log in regbot.load_folder(options.data / "regbot" / "motor_steps")}
    usual = [log for name, log in logs.items() if name not in (*OTHER_STEPS, SAME)]
    training, rest = spread(usual[::2], options.runs), spread(usual[1::2], options.runs)
    model = model_of(1.0 / back_emf(training), 0.04)
    tracks = [own_track(prepared(log), model, log.path.name) for log in training]
    replay = own_replay(model, tracks, [library()[name] for name in TERMS])
    best, rivals, table = chosen(replay, tracks, tell)
    _, base_constant = fitted(replay, tracks, ())
    values, constant = fitted(replay, tracks, best)
    held_out = {}
    for kind, found in (("same steps", rest), ("other steps", [logs[name] for name in OTHER_STEPS if name in logs])):
        others = [own_track(prepared(log), model, log.path.name) for log in found]
        held_out[kind] = {
            "before": rms(speed_errors(replay, others, {}, base_constant)),
            "after": rms(speed_errors(replay, others, values, constant)), "unit": "rad/s",
        }
    answer = "set" if rivals else "named" if best else "none"
    print_answer(options, answer, [*best], held_out, {
        "equivalents": [list(names) for names in rivals], "parameters": values, "validated": table,
        "base": {"back_emf_v_s": back_emf(training), "time_constant_s": base_constant},
    })


if __name__ == "__main__":
    main()
