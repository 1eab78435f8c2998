"""A plant of one's own: EMPS, a carriage on a rail, and its runs.

M q'' = F, M = 95.1 kg (A. Janot, M. Gautier, M. Brunot, "Data Set and Reference Models of EMPS", 2019).
"""

import dataclasses
from pathlib import Path

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.kernels import kernel
from drake_ispace.explain.answer.explanation import Explanation
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.fit.free_run import error_of, fitted, measured, rms
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.explain.predict.case import prepare
from drake_ispace.files.importers import emps
from drake_ispace.files.recording import Channel, Recording

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


def carriage() -> OwnModel:
    """The model."""
    return OwnModel(Carriage(), name="carriage")


def rail_runs(data: Path) -> tuple[Recording, Recording, Recording]:
    """(the run, its first half, its second half), cut where it rests longest within its middle third."""
    whole = emps.load_run(data / "emps" / "DATA_EMPS.mat", RADIUS_M)
    encoder = whole.channels["encoder"]
    n = len(encoder.t)
    step = max(n // 500, 1)
    moved = np.abs(encoder.values[2 * step :] - encoder.values[: -2 * step]).sum(axis=1)
    cut = encoder.t[step + n // 3 + int(np.argmin(moved[n // 3 : 2 * n // 3]))]
    return whole, _part(whole, encoder.t[0], cut), _part(whole, cut, np.inf)


def steps(model: OwnModel, run: Recording, answer: Explanation) -> list[dict]:
    """Relative errors of free-run simulations with one effect of the answer more at a time, their sizes fitted anew."""
    named = {effect.name: effect for effect in sorted(answer.effects, key=lambda effect: -effect.share)}
    case = prepare(model, [run])
    tried = {candidate.name: candidate for candidate in candidates(case.replay.effects, case.replay.body)}
    tracks, point, found = case.prediction.tracks, {}, []
    size = rms(measured(case.replay, tracks[0]))
    for name, effect in {"none": None, **named}.items():
        if effect is not None:
            point[tried[name]] = [effect.parameters[p.name].estimate for p in tried[name].parameters]
        error = error_of(case.replay, tracks, fitted(case.replay, tracks, point))
        found.append({"effect": name, "relative_error": error / size})
    return found


def _part(recording, start, end):
    """What lies between two times, with a clock of its own."""
    channels = {}
    for name, channel in recording.channels.items():
        inside = (channel.t >= start) & (channel.t < end)
        channels[name] = Channel(
            channel.t[inside] - start, channel.columns, channel.values[inside], channel.units, channel.period_s
        )
    return dataclasses.replace(recording, channels=channels)
