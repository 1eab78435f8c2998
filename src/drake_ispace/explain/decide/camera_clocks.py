"""Is the camera's clock of a run off against that of its wheels? What no effect explains of the fixes tells it.

A clock that drifts by a thousandth is off by a tenth of a second after a hundred, and one that is set anew for every
run is another one in each. What a model lacks is the same in all runs. Rates and offsets of every run are therefore
fitted together with all effects and generic disagreements, of any size. An offset that all runs have is not looked for:
it may be a latency.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.compare.clocks.paths import OFFSET
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.decide.decision import LEAST_FURTHER
from drake_ispace.explain.decide.survey.generic import Generic, generic_signatures
from drake_ispace.explain.decide.survey.signatures import Signature, difference
from drake_ispace.explain.decide.survey.survey import Survey, blocks_of, survey
from drake_ispace.explain.fit.candidates import Candidate, candidates
from drake_ispace.explain.fit.directions import inverse_of
from drake_ispace.explain.fit.likelihood import merged
from drake_ispace.explain.predict.case import Case, joined
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.room_view import LEAD_TICKS, SIGHTING
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.faults.library import same_as
from drake_ispace.faults.repair import Clock

_MOST_S = LEAD_TICKS * TICK_S  # by which a clock may be off at any time of a run
_PROBE_S = 0.1 * _MOST_S
_CLOCK = Generic("the camera's clock", "clock", "time", 2)
_TIMES = Candidate(_CLOCK, (), _CLOCK.parameters)
_MOST_TURNS = 4  # in which rates and offsets are found
_STAYS = 0.3  # standard deviations by which they may still move in the last turn


def camera_clocks(case: Case) -> dict[int, Finding]:
    """Number of a run, held-out ones after the others -> what is wrong with its camera's clock."""
    prediction = case.prediction if case.held_out is None else joined(case.prediction, case.held_out)
    if len(case.prediction.tracks) != len(case.runs) or not prediction.channels["room"]:
        return {}
    tried = [
        c for c in candidates(case.effects_to_try, case.replay.body)
        if c.effect.kinematic and not c.effect.is_local and OFFSET not in same_as(c.name)
    ]
    times = times_of(prediction, tried)
    usual = _usual(list(times.values()))
    findings = {i: _finding(prediction.tracks[i], one, usual) for i, one in times.items()}
    return {i: finding for i, finding in findings.items() if finding is not None}


@dataclass(frozen=True)
class Time:
    """What a run tells of its camera's clock.

    Attributes:
        late_s: in the middle of the run, against other runs. drift_s: by how much later it is at the end of the run
            than at its beginning. variances: (2,) of both. apart, of_apart: (seconds, 2) both numbers without each
            second of the run, and their variances.
    """

    late_s: float
    drift_s: float
    variances: np.ndarray
    apart: np.ndarray
    of_apart: np.ndarray

    @property
    def drifts(self) -> bool:
        """Whether the clock drifts for certain, whichever second of the run is left out."""
        return bool(np.all(self.apart[:, 1] ** 2 >= LEAST_FURTHER * self.of_apart[:, 1]))

    def differs_from(self, other: "Time") -> bool:
        """Whether the clock is later or earlier than that of another run, in the same way."""
        apart, variances = self.apart[:, 0] - other.late_s, self.of_apart[:, 0] + other.variances[0]
        return bool(np.all(apart**2 >= LEAST_FURTHER * variances))


def _usual(times: Sequence[Time]) -> Time | None:
    """The one to which the others are nearest, each in its standard deviations."""
    def apart(usual):
        return sum(abs(one.late_s - usual.late_s) / np.sqrt(one.variances[0]) for one in times)

    return min(times, key=apart, default=None)


def _finding(track: Track, time: Time, usual: Time) -> Finding | None:
    """What is wrong with the clock of a run, None where nothing is for certain; usual: of all runs."""
    later_s, drift_s = _certain(time, usual)
    middle_s, rate, said = track.since_s + float(np.mean(track.fix_t)), drift_s / np.ptp(track.fix_t), []
    gain = later_s**2 / (time.variances[0] + usual.variances[0]) + drift_s**2 / time.variances[1]
    if rate:
        said.append(f"{100 * abs(rate):.2g} % {'fast' if rate > 0 else 'slow'} against the wheels'")
    if later_s:
        where = "in the middle of the run" if said else "against the wheels'"
        said.append(f"{abs(later_s):.2g} s {'later' if later_s > 0 else 'earlier'} {where} than in other runs")
    return None if not said else Finding(
        "clock_drift" if rate else OFFSET, f"clock {', '.join(said)}", "kinect", run=track.name, harmless=True,
        drop_in_deviance=float(gain), repairs=(Clock("kinect", 1.0 - rate, rate * middle_s - later_s),),
    )


def times_of(prediction: Prediction, tried: Sequence[Candidate]) -> dict[int, Time]:
    """Number of a run -> what it tells; runs that do not are left out."""
    prediction = replace(prediction, channels=prediction.channels | {"motion": []}, columns=[])  # the fixes alone
    late = np.zeros((len(prediction.tracks), 2))
    for _ in range(_MOST_TURNS):
        found = _times(_survey(prediction, late, tried), late)
        usual, before = _usual(found), late
        late = np.array([_certain(one, usual) for one in found])
        late[np.abs(late) @ [1.0, 0.5] > _MOST_S] = 0.0
        variances = np.array([one.variances for one in found])
        stays = np.all((late - before) ** 2 <= _STAYS**2 * variances, axis=1)
        if stays.all():
            break
    return {i: one for i, one in enumerate(found) if stays[i]}


def _certain(time: Time, usual: Time) -> tuple[float, float]:
    """By how much the clock of a run is later than usual, and by how much it drifts; zeros where that is uncertain."""
    later_s = time.late_s - usual.late_s if time is not usual and time.differs_from(usual) else 0.0
    return later_s, time.drift_s if time.drifts else 0.0


def _later(prediction: Prediction, late: np.ndarray) -> Prediction:
    """The prediction of the runs as if their camera's clocks were late by (runs, 2) `late_s` and `drift_s`."""
    tracks = []
    for track, (late_s, drift_s) in zip(prediction.tracks, late, strict=True):
        sightings, t = track.sightings.copy(), track.fix_t
        if len(t) > 1:
            sightings[track.fix_rows, SIGHTING.after_s] -= late_s + drift_s * (t - np.mean(t)) / np.ptp(t)
        tracks.append(replace(track, sightings=sightings))
    return replace(prediction, tracks=tracks)


def _survey(prediction, late, tried) -> Survey:
    """The Survey with the cameras' clocks this late; last two signatures of each run: its offset and its drift."""
    def disagreements(prediction, point, base):
        nothing = [{name: np.zeros(rows.shape, np.float32) for name, rows in run.items()} for run in base]
        later = [
            difference(base, _later(prediction, np.tile(probe, (len(base), 1))).residuals(merged(point)))
            for probe in _PROBE_S * np.eye(2)
        ]
        return [*generic_signatures(prediction, point, base), *(
            Signature(_TIMES, [1.0, 0.0], at, False, [*nothing[:i], change[i], *nothing[i + 1 :]])
            for i in range(len(base)) for at, change in enumerate(later)
        )]

    return survey(_later(prediction, late), {}, tried, generics=disagreements)


def _times(own: Survey, late: np.ndarray) -> list[Time]:
    """What each run tells; late: as it is in the Survey."""
    inner, count = own.screen.inner, late.size
    rows = np.hstack([own.changes.of_run(i) for i in range(len(late))])
    wanted, others = np.arange(len(inner) - count, len(inner)), np.arange(len(inner) - count)
    others = others[own.screen.length[others] > 0.0]
    # one combination for each number wanted, of which nothing else has any
    kept = np.concatenate([others, wanted])
    unit = 1.0 / np.sqrt(np.maximum(np.diag(inner)[kept], 1e-300))
    inverse = unit[:, None] * np.linalg.pinv(unit[:, None] * inner[np.ix_(kept, kept)] * unit, 1e-8, True) * unit
    sums = own.tested.marginalised(inverse[len(others) :] @ rows[kept])
    blocks = blocks_of(own.view.prediction, own.likelihood.whitening, own.residuals)
    begun = np.flatnonzero(np.diff(blocks, prepend=-1))
    by_second = lambda rows: np.add.reduceat(rows, begun, axis=1)  # noqa: E731
    products, noise = by_second(sums * own.w), by_second(sums * own.noise)
    lengths = by_second(sums * (inverse[len(others) :] @ rows[kept]))
    steps, total = products.sum(axis=1), lengths.sum(axis=1, keepdims=True)
    more = np.maximum(np.sum(noise**2, axis=1) / total[:, 0], 1.0)
    share = 1.0 - lengths / total
    without = (steps[:, None] - products) / share
    variances = _PROBE_S**2 * more * total[:, 0]
    numbers = late.ravel() + _PROBE_S * steps
    apart = late.ravel()[:, None] + _PROBE_S * without
    own_runs = own.runs[begun]
    found = []
    for i in range(len(late)):
        two, mine = slice(2 * i, 2 * i + 2), own_runs == i
        found.append(Time(*numbers[two], variances[two], apart[two, mine].T, (variances[two, None] / share[two, mine]).T))
    return found
