"""EMPS, a carriage on a rail, as a user's own model: base = a mass alone; which frictions does it lack?

The model is the plant below: M q'' = F, M = 95.1 kg (A. Janot, M. Gautier, M. Brunot, "Data Set and Reference Models of
EMPS", 2019). `force_offset` is an effect of one's own, as everybody can add one. Effects are named by what the model
held on the measured motion could not predict (5 ms innovations): a replay of the recorded force drifts by 30 times the
motion, and adding one effect alone hardly mends it, so a search that looks at the replay stops too early. Their sizes
are then polished on that replay, which small biases of the force spoil first, all named effects together.

`steps`: relative error ||q - q^|| / ||q|| of the position with the *recorded force replayed open loop*, with the base
alone and with one named effect more at a time, largest first, sizes fitted anew at each step on the whole run.
`held_out`: effects named and fitted on the first half of the run, error of the second half, before and after.
"""

import numpy as np
from real_data import arguments, halves, named, print_answer
from scipy.optimize import least_squares

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.kernels import kernel
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.effect import BlockEffect
from drake_ispace.effects.library import library
from drake_ispace.explain.decide.joint import decide_jointly
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.fit.likelihood import merged
from drake_ispace.explain.predict.own_model import OwnModel, own_replay, own_track
from drake_ispace.explain.predict.prediction import predict
from drake_ispace.files.importers import emps

MASS_KG = 95.1
RADIUS_M = 0.02  # of a wheel that stands for the rail: force = torque / radius; 5 ms then resolve its friction


@kernel
def accelerate(xc, torque, inertia_kg_m2, out):
    out[0] = xc[1]
    out[1] = torque[0] / inertia_kg_m2


@kernel
def angle(xc, out):
    out[0] = xc[0]


@kernel
def rate(xc, out):
    out[0] = xc[1]


class Carriage(Block):
    """A mass that a torque drives through a wheel of RADIUS_M; wheel_angle [rad], wheel_rate [rad/s]."""

    def __init__(self):
        super().__init__(Spec(
            inputs={"torque": 1}, outputs={"wheel_angle": Output(1, angle), "wheel_rate": Output(1, rate)},
            parameters={"inertia_kg_m2": MASS_KG * RADIUS_M**2}, continuous_state=np.zeros(2), derivatives=accelerate,
        ))


@kernel
def shifted(torque, offset_n_m, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] + offset_n_m


class ForceOffset(BlockEffect):
    """tau + offset: a drive that pushes a little when told to rest."""

    wire = "torque"
    general = True
    card = Card(
        name="force_offset", title="Force offset", home="actuator", equation="tau' = tau + offset",
        source="offset of the amplifier, a rail that is not level", signature="a constant unmodelled torque",
        look_alikes=("coulomb_friction",), excitation="motion both ways: friction turns its sign, an offset does not",
    )

    def parameters(self, body):
        return (Parameter("offset_n_m", "N*m", 0.0, -np.inf, np.inf, (0.03, 0.1), "torque"),)

    def spec(self, body, values):
        return Spec(
            inputs={"torque": body.wheels}, outputs={"torque": Output(body.wheels, shifted)},
            parameters={"offset_n_m": values["offset_n_m"]},
        )


def relative_error(replay, track, point) -> float:
    """||q - q^|| / ||q|| of the recorded force replayed open loop."""
    measured = track.measured[: track.ticks + 1]
    return float(np.linalg.norm(replay.simulated(track, merged(point)) - measured) / np.linalg.norm(measured))


def polished(replay, track, point) -> dict:
    """The point with the sizes of its effects fitted to the open-loop replay."""
    order = [(candidate, i) for candidate in point for i in range(len(candidate.parameters))]
    sizes = np.array([abs(point[c][i]) or 1e-3 for c, i in order])
    measured = track.measured[: track.ticks + 1]

    def moved(z):
        new = {candidate: list(values) for candidate, values in point.items()}
        for (candidate, i), value in zip(order, z * sizes, strict=True):
            new[candidate][i] = value
        return new

    def errors(z):
        found = replay.simulated(track, merged(moved(z))) - measured
        return np.clip(np.nan_to_num(found, nan=1e6), -1e6, 1e6).ravel()

    start = np.array([point[c][i] for c, i in order]) / sizes
    return moved(least_squares(errors, start, diff_step=1e-4, x_scale=1.0).x)


def explained(track, pool, tell):
    """(replay, Decision, polished point) of one track."""
    model = OwnModel(Carriage())
    replay = own_replay(model, [track], [*library().values(), ForceOffset()])
    decision = decide_jointly(predict(replay, [track]), candidates(replay.effects, replay.body), 0, pool, tell)
    point = {} if decision.named is None else decision.named.point
    return replay, decision, polished(replay, track, point) if point else {}


def main() -> None:
    options, pool, tell = arguments(__doc__)
    recording = emps.load_run(options.data / "emps" / "DATA_EMPS.mat", RADIUS_M)
    model = OwnModel(Carriage())
    whole = own_track(recording, model, "EMPS")
    replay, decision, point = explained(whole, pool, tell)
    order = sorted(point, key=lambda candidate: -decision.gains[candidate])
    steps = [{"effect": "base", "relative_error": relative_error(replay, whole, {})}]
    for k in range(1, len(order) + 1):
        with_k = polished(replay, whole, {candidate: point[candidate] for candidate in order[:k]})
        steps.append({"effect": order[k - 1].name, "relative_error": relative_error(replay, whole, with_k)})
    first, second = (own_track(half, model, "half of EMPS") for half in halves(recording))
    early, _, fitted = explained(first, pool, tell)
    held_out = {"second half": {
        "before": relative_error(early, second, {}), "after": relative_error(early, second, fitted), "unit": "1",
    }}
    print_answer(options, decision, named(decision), held_out, {
        "steps": steps, "simulation": "recorded force replayed open loop", "parameters": {
            c.name: c.values(z) for c, z in point.items()
        }, "named_on_first_half": [c.name for c in fitted],
    })


if __name__ == "__main__":
    main()
