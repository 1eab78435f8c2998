"""Counters that began at other angles of their wheel: what errs once a turn has another phase in each run.

Most encoders count from where the wheel was when their power came on. A model has one phase for all runs. Where runs
show that error alike but for its phase, their counters are set to that of the run that shows it best. Whatever else
the model lacks turns the phases, too: this is for runs that have no answer otherwise, and counts if it gives one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.blocks.frames import wrap
from drake_ispace.effects.places.encoder import EncoderEccentricity
from drake_ispace.explain.decide.clocks.clocks_set import is_short, unpredicted
from drake_ispace.explain.decide.proposals.detect import CLEAR_MINUS_LOG10_P
from drake_ispace.explain.decide.survey.screen import gain_at
from drake_ispace.explain.decide.survey.signatures import signatures
from drake_ispace.explain.decide.survey.view import scales_of
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.levels import CERTAIN, LEAST_SPREAD
from drake_ispace.explain.predict.case import Case, joined
from drake_ispace.explain.predict.prediction import Prediction

SHOWS = EncoderEccentricity.card.name  # the effect that tells counters from each other
_CLEAR = np.sqrt(gain_at(CLEAR_MINUS_LOG10_P, 2))  # standard deviations of two components


@dataclass(frozen=True)
class _Error:
    """What a run shows of a wheel's error once a turn [rad]: its sine, its cosine, and their standard deviation."""

    sine: float
    cosine: float
    std: float

    @property
    def size(self) -> float:
        return float(np.hypot(self.sine, self.cosine))

    @property
    def phase(self) -> float:
        return float(np.arctan2(self.cosine, self.sine))

    @property
    def clear(self) -> float:
        """How clear it is, in standard deviations."""
        return self.size / self.std

    def is_another_phase_of(self, other: "_Error") -> bool:
        """Whether both are clear and about as large, but for more than chance of another phase."""
        if min(self.clear, other.clear) < _CLEAR:
            return False
        alike = abs(self.size - other.size) < max(
            CERTAIN * np.hypot(self.std, other.std), LEAST_SPREAD * (self.size + other.size)
        )
        apart = abs(wrap(self.phase - other.phase))
        return bool(alike and apart > CERTAIN * np.hypot(1.0 / self.clear, 1.0 / other.clear))


def with_counters_set(case: Case) -> Case:
    """The case with the counters of each wheel set to one zero, and a warning that says by how much they were moved.

    It is the case itself where nothing is to be moved.
    """
    every = case.prediction if case.held_out is None else joined(case.prediction, case.held_out)
    moves = case.scenario is not None and case.prediction.channels["motion"]
    if not moves or SHOWS not in case.effects_to_try or len({track.recording for track in every.tracks}) < 2:
        return case
    shifts: dict[tuple[str, int], float] = {}
    by_run = _errors(every, case.effects_to_try[SHOWS])
    for wheel in range(case.replay.body.wheels if by_run else 0):
        best = max((errors[wheel] for errors in by_run.values()), key=lambda error: error.clear)
        for recording, errors in by_run.items():
            if errors[wheel].is_another_phase_of(best):
                shifts[recording, wheel] = float(wrap(errors[wheel].phase - best.phase))
    if not shifts:
        return case
    moves = ", ".join(f"of wheel {wheel + 1} in {name} by {by:.2f} rad" for (name, wheel), by in shifts.items())
    said = [case.warning, f"encoders' zeros were moved, to be the same in all runs: {moves}"]
    return replace(case.with_tracks(lambda track: _moved(track, shifts)), warning="; ".join(filter(None, said)))


def _moved(track, shifts):
    """The track with the wheels of its recording moved."""
    measured = track.measured.copy()
    for (recording, wheel), by in shifts.items():
        if recording == track.recording:
            measured[:, wheel] += by
    return replace(track, measured=measured)


def _errors(prediction: Prediction, effect) -> dict[str, list[_Error]]:
    """Recording -> the error of each wheel; empty where the model runs away with one."""
    base, scales, wheels = prediction.residuals({}), scales_of(prediction), prediction.replay.body.wheels
    tried = candidates({effect.card.name: effect}, prediction.replay.body)
    of_wheels = {(s.candidate.label, s.at): s for s in signatures(prediction, {}, tried, scales, base)}
    if len(of_wheels) < 2 * wheels:
        return {}
    by_recording: dict[str, list[list[_Error]]] = {}
    for i, (track, run) in enumerate(zip(prediction.tracks, base, strict=True)):
        per_rad = [s.change[i]["motion"] / s.z[s.at] for s in of_wheels.values()]
        by_recording.setdefault(track.recording, []).append(_of_track(run["motion"], per_rad))
    return {name: [_mean(of) for of in zip(*tracks, strict=True)] for name, tracks in by_recording.items()}


def _of_track(rows: np.ndarray, changes: Sequence[np.ndarray]) -> list[_Error]:
    """The error of each wheel; changes: of the rows, by a sine and a cosine of each wheel."""
    unknown = [_Error(0.0, 0.0, np.inf)] * (len(changes) // 2)
    if is_short(rows, len(changes)) or not np.isfinite([rows, *changes]).all() or not np.ptp(rows, axis=0).all():
        return unknown
    left, columns = unpredicted(rows, changes)
    lengths = np.linalg.norm(columns, axis=0)
    if not lengths.all():
        return unknown
    unit = columns / lengths
    inverse = np.linalg.inv(unit.T @ unit + np.sqrt(np.finfo(float).eps) * np.eye(len(changes)))
    amounts, std = inverse @ (unit.T @ left) / lengths, np.sqrt(np.diag(inverse)) / lengths
    return [
        _Error(float(sine), float(cosine), float(max(own)))
        for (sine, cosine), own in zip(amounts.reshape(-1, 2), std.reshape(-1, 2), strict=True)
    ]


def _mean(errors: Sequence[_Error]) -> _Error:
    """What all stretches of a recording show together."""
    weights = [error.std**-2 for error in errors]
    if not sum(weights):
        return errors[0]
    sine, cosine = np.average([(error.sine, error.cosine) for error in errors], axis=0, weights=weights)
    return _Error(float(sine), float(cosine), sum(weights) ** -0.5)
