"""Counters that began at other angles of their wheel: what errs once a turn has another phase in each run.

Most encoders count from where the wheel was when their power came on. A model has one phase for all runs. Where runs
show that error alike but for its phase, their counters are set to that of the run that shows it best.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.stats import chi2

from drake_ispace.blocks.frames import wrap
from drake_ispace.effects.places.encoder import EncoderEccentricity
from drake_ispace.explain.decide.clocks.clocks_set import is_short, unpredicted
from drake_ispace.explain.decide.proposals.detect import CLEAR_MINUS_LOG10_P
from drake_ispace.explain.decide.survey.signatures import signatures
from drake_ispace.explain.decide.survey.view import scales_of
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.levels import CERTAIN, LEAST_SPREAD
from drake_ispace.explain.predict.case import Case, joined
from drake_ispace.explain.predict.prediction import Prediction, predict

_CLEAR = float(np.sqrt(chi2.isf(10.0**-CLEAR_MINUS_LOG10_P, 2)))  # standard deviations of two components


@dataclass(frozen=True)
class _Error:
    """What a run shows of a wheel's error once a turn: size and phase [rad], and the standard deviation of the size."""

    size: float
    phase: float
    std: float

    def is_another_phase_of(self, other: "_Error") -> bool:
        """Whether both are clear and of a size, but for more than chance of another phase."""
        if min(self.size / self.std, other.size / other.std) < _CLEAR:
            return False
        std = np.hypot(self.std, other.std)
        alike = abs(self.size - other.size) < max(CERTAIN * std, LEAST_SPREAD * (self.size + other.size))
        apart = wrap(self.phase - other.phase)
        return bool(alike and abs(apart) > CERTAIN * np.hypot(self.std / self.size, other.std / other.size))


def with_counters_set(case: Case) -> Case:
    """The case with the counters of each wheel set to one zero, and a warning that says by how much they were moved."""
    name = EncoderEccentricity.card.name
    every = case.prediction if case.held_out is None else joined(case.prediction, case.held_out)
    moves = case.is_filtered and case.prediction.channels["motion"]
    if not moves or name not in case.effects_to_try or len(every.tracks) < 2:
        return case
    moved = {}
    for wheel, errors in enumerate(zip(*_errors(every, case.effects_to_try[name]), strict=True)):
        best = max(errors, key=lambda error: error.size / error.std)
        for i, error in enumerate(errors):
            if error.is_another_phase_of(best):
                moved[i, wheel] = float(wrap(error.phase - best.phase))
    if not moved:
        return case
    tracks = []
    for i, track in enumerate(every.tracks):
        measured = track.measured.copy()
        for wheel in range(case.replay.body.wheels):
            measured[:, wheel] += moved.get((i, wheel), 0.0)
        tracks.append(replace(track, measured=measured))
    said = ", ".join(f"of wheel {w + 1} in {tracks[i].name} by {by:.2f} rad" for (i, w), by in moved.items())
    ends, predictions = [0, len(case.prediction.tracks), len(tracks)], []
    for start, end in pairwise(ends):
        predictions.append(predict(case.replay, tracks[start:end]) if start < end else None)
    warning = "; ".join(filter(None, [case.warning, f"encoders' zeros were moved, to be the same in all runs: {said}"]))
    return replace(case, prediction=predictions[0], held_out=predictions[1], warning=warning)


def _errors(prediction: Prediction, effect) -> list[Sequence[_Error]]:
    """Of every run, the error of each wheel."""
    base, scales = prediction.residuals({}), scales_of(prediction)
    tried = candidates({effect.card.name: effect}, prediction.replay.body)
    of_wheels = {(s.candidate.label, s.at): s for s in signatures(prediction, {}, tried, scales, base)}
    if len(of_wheels) < 2 * prediction.replay.body.wheels:  # with some the model runs away
        return []
    per_rad = [[s.change[i]["motion"] / s.z[s.at] for s in of_wheels.values()] for i in range(len(base))]
    return [_of_run(run["motion"], changes) for run, changes in zip(base, per_rad, strict=True)]


def _of_run(rows, changes) -> list[_Error]:
    """The error of each wheel; changes: of the rows, by a sine and a cosine of each wheel."""
    if is_short(rows, len(changes)) or not np.isfinite([rows, *changes]).all():
        return [_Error(0.0, 0.0, np.inf)] * (len(changes) // 2)
    left, columns = unpredicted(rows, changes)
    inverse = np.linalg.pinv(columns.T @ columns)
    amounts, std = inverse @ (columns.T @ left), np.sqrt(np.diag(inverse))
    return [
        _Error(np.hypot(sine, cosine), np.arctan2(cosine, sine), max(own))
        for (sine, cosine), own in zip(amounts.reshape(-1, 2), std.reshape(-1, 2), strict=True)
    ]
