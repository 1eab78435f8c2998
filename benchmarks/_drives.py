"""EMPS and REGBOT simulated by plain arithmetic: what a user would do with the sizes that `explain` names.

Euler's rule in steps of a tenth of a sample, dry friction with a sign; nothing of `explain` or of the package's plants.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "diagrams"))
_FINE = 10


def cases(data: Path):
    """(name, model, training runs, held out by kind, effects to try, function of run, effects and plant -> errors).

    Effects to try: None for the whole library.
    """
    from emps_carriage import MASS_KG, RADIUS_M, carriage, rail_runs
    from regbot_motors import motors, voltage_steps

    import drake_ispace as di

    _, first, second = rail_runs(data)
    inertia = MASS_KG * RADIUS_M**2
    yield (
        "EMPS", carriage(), [first], {"second half": [second]}, None,
        lambda run, effects, plant: _angles(run, effects, lambda torque, w: torque / inertia),
    )
    runs, held_out = voltage_steps(data, None)
    model = motors(runs)
    gain, frictions = model.parameters["speed_per_volt"], ["viscous_friction", "coulomb_friction", "stribeck_friction"]
    yield (
        "REGBOT", model, runs, held_out, [di.effects()[name] for name in frictions],
        lambda run, effects, plant: _speeds(
            run, effects, lambda volts, w: (gain * volts - w) / plant.get("time_constant_s", 0.04)
        ),
    )


def _rates(run, effects, acceleration):
    """(k, n) wheel rates and (k, n) angles at the samples of the torque."""
    t, torque = run.channels["torque"].t, run.channels["torque"].values
    viscous = effects.get("viscous_friction", {}).get("coefficient_n_m_s", 0.0)
    dry = effects.get("coulomb_friction", {}).get("torque_n_m", 0.0)
    offset = effects.get("motor_offset", {}).get("offset_n_m", 0.0)
    w, angle = np.zeros(torque.shape[1]), run.channels["encoder"].values[0].astype(float).copy()
    rates, angles = [], []
    for k, h in enumerate(np.append(np.diff(t), 0.0)):
        rates.append(w.copy())
        angles.append(angle.copy())
        for _ in range(_FINE):
            drive = torque[k] + offset - viscous * w
            moved = w + h / _FINE * acceleration(drive - dry * np.where(w != 0.0, np.sign(w), np.sign(drive)), w)
            stuck = ((w * moved < 0.0) | (w == 0.0)) & (np.abs(drive) <= dry)
            w = np.where(stuck, 0.0, moved)
            angle = angle + h / _FINE * w
    return np.array(rates), np.array(angles)


def _angles(run, effects, acceleration):
    encoder = run.channels["encoder"]
    angles = _rates(run, effects, acceleration)[1]
    t = run.channels["torque"].t
    return np.column_stack([np.interp(encoder.t, t, column) for column in angles.T]) - encoder.values


def _speeds(run, effects, acceleration):
    t, torque = run.channels["torque"].t, run.channels["torque"].values
    driven = int(np.argmax(np.any(torque != 0.0, axis=1)))
    measured = run.channels["encoder"].values
    rates = _rates(run, effects, acceleration)[0]
    gap = 5  # over ten samples, 10 ms, as the wheels' speed is told
    told = (measured[2 * gap :] - measured[: -2 * gap]) / (t[2 * gap :] - t[: -2 * gap])[:, None]
    return (rates[gap:-gap] - told)[max(driven - gap, 0) :]
