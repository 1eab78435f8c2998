"""Is the camera's clock of a run off against that of its wheels? What no effect explains of the fixes tells it.

A clock that drifts by a thousandth is off by a tenth of a second after a hundred, and one that is set anew for every
run is another one in each. What a model lacks is the same in all runs. Offsets and drifts of every run are therefore
fitted together with all effects and generic disagreements, of any size. An offset that all runs have is not looked for:
it may be a latency.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.compare.clocks.paths import OFFSET
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.runs import name_of
from drake_ispace.explain.decide.decision import LEAST_FURTHER
from drake_ispace.explain.decide.survey.generic import Generic, generic_signatures
from drake_ispace.explain.decide.survey.signatures import Signature, difference
from drake_ispace.explain.decide.survey.survey import MOST_TURNS, STAYS, Survey, blocks_of, survey
from drake_ispace.explain.fit.candidates import Candidate, candidates
from drake_ispace.explain.fit.likelihood import merged
from drake_ispace.explain.levels import CERTAIN
from drake_ispace.explain.predict.case import Case, joined
from drake_ispace.explain.predict.prediction import COARSE_COUNT, Prediction
from drake_ispace.explain.predict.room_view import SIGHTING
from drake_ispace.explain.predict.tracks import Track, coarsest_count
from drake_ispace.faults.library import same_as
from drake_ispace.faults.repair import Clock
from drake_ispace.files.recording import Recording

_PROBE_S = 4 * TICK_S  # that a clock is later, by which a change of the residuals is taken
_OWN_SCALE = 0.01  # of all angles of a run, by which a change of the residuals is taken
_CLOCK = Generic("a run's own clock and scale", "clock", "time", 3)
_OF_RUN = Candidate(_CLOCK, (), _CLOCK.parameters)


def camera_clocks(case: Case, runs: Sequence[Recording]) -> dict[int, Finding]:
    """Number of a run -> what is wrong with its camera's clock.

    runs: all of the case, held-out ones after the others. Where stretches stand for them, or in coarse counts, nothing
        is looked for.
    """
    prediction = case.prediction if case.held_out is None else joined(case.prediction, case.held_out)
    is_whole = [track.name for track in prediction.tracks] == [name_of(run, i) for i, run in enumerate(runs)]
    is_coarse = coarsest_count(prediction.tracks) > COARSE_COUNT  # how the wheels move between two counts is a guess
    if not is_whole or is_coarse or not any(len(track.fix_t) for track in prediction.tracks):
        return {}
    tried = [
        c for c in candidates(case.effects_to_try, case.replay.body)
        if c.effect.kinematic and not c.effect.is_local and OFFSET not in same_as(c.name)
    ]
    times, usual = _times(prediction, tried)
    findings = {i: _finding(prediction.tracks[i], of_run, usual) for i, of_run in times.items()}
    return {i: finding for i, finding in findings.items() if finding is not None}


@dataclass(frozen=True, eq=False)
class _Number:
    """A number [s] of a run and its variance; without, variances: (seconds,) the same without each second of the run.
    """

    value: float
    variance: float
    without: np.ndarray
    variances: np.ndarray

    def differs_from(self, value: float = 0.0, variance: float = 0.0) -> bool:
        """Whether it is another one for certain, whichever second of the run is left out."""
        return bool(np.all((self.without - value) ** 2 >= LEAST_FURTHER * (self.variances + variance)))

    def unless_chance(self, value: float) -> float:
        """The number, or this value where it is that but for chance."""
        return self.value if abs(self.value - value) > CERTAIN * np.sqrt(self.variance) else value


@dataclass(frozen=True, eq=False)
class _Lateness:
    """How late the camera's clock of a run is in the middle of it, by how much more at its end than at its begin, and
    how late at its begin."""

    middle: _Number
    drift: _Number
    begin: _Number

    @property
    def without_drift(self) -> _Number:
        """How late it is without its drift: at the begin of a run in which it drifts for certain.

        Two clocks are set, or counted from, when a recording begins. Were the middle taken for right, half of what the
        clock drifts by would be a latency.
        """
        return self.begin if self.drift.differs_from() else self.middle

    def differs_from(self, other: "_Lateness") -> bool:
        """Whether it is later or earlier without its drift than another one for certain."""
        return self.without_drift.differs_from(other.without_drift.value, other.without_drift.variance)

    def certain_part(self, usual: "_Lateness") -> tuple[float, float]:
        """By how much it is later than usual, and drifts [s]; zeros where that is not certain."""
        same = self is usual or not self.differs_from(usual)
        later_s = 0.0 if same else self.without_drift.value - usual.without_drift.value
        return later_s, self.drift.value * self.drift.differs_from()


def _usual(found: Sequence[_Lateness]) -> _Lateness:
    """The one from which the fewest others differ for certain; of several the one that is nearest to none."""
    return min(found, key=lambda usual: (sum(one.differs_from(usual) for one in found), abs(usual.without_drift.value)))


def _finding(track: Track, of_run: _Lateness, usual: _Lateness) -> Finding | None:
    """What is wrong with the clock of a run; None where nothing is for certain."""
    later_s, drift_s = of_run.certain_part(usual)
    variance = of_run.without_drift.variance + usual.without_drift.variance
    gain = later_s**2 / variance + drift_s**2 / of_run.drift.variance
    said = []
    rate = drift_s / float(np.ptp(track.fix_t)) if drift_s else 0.0
    if rate:
        said.append(f"{100 * abs(rate):.2g} % {'fast' if rate > 0 else 'slow'} against the wheels'")
    if later_s:
        where = "at the begin of the run" if rate else "against the wheels'"
        said.append(f"{abs(later_s):.2g} s {'later' if later_s > 0 else 'earlier'} {where} than in other runs")
    if not said:
        return None
    begin_s = track.begun_s + float(np.mean(track.fix_t) - 0.5 * np.ptp(track.fix_t))
    return Finding(
        "clock_drift" if rate else OFFSET, f"clock {', '.join(said)}", "kinect", run=track.name, harmless=True,
        drop_in_deviance=gain, repairs=(Clock("kinect", 1.0 - rate, rate * begin_s - later_s),),
    )


def _times(prediction: Prediction, tried: Sequence[Candidate]) -> tuple[dict[int, _Lateness], _Lateness]:
    """Number of a run -> how late its clock is, and the usual lateness; runs whose numbers do not settle are left out.
    """
    prediction = replace(  # nothing but the fixes
        prediction, replay=replace(prediction.replay, motion=False), columns=[],
        channels=prediction.channels | {"motion": []},
    )
    late, common_s, is_near = np.zeros((len(prediction.tracks), 2)), 0.0, False
    stays = np.zeros(len(late), bool)
    for turn in range(MOST_TURNS):
        found = _of_runs(_survey(prediction, late, tried), late)
        usual, before, before_s = _usual(found), late, common_s
        common_s = usual.middle.unless_chance(0.0)
        late = np.tile([common_s, 0.0], (len(found), 1))
        is_near |= abs(common_s - before_s) <= STAYS * np.sqrt(usual.middle.variance) or 2 * turn >= MOST_TURNS
        if not is_near:
            continue  # far from it all runs are late otherwise than they seem
        late = np.array([(one.middle.unless_chance(common_s), one.drift.unless_chance(0.0)) for one in found])
        variances = [(one.middle.variance, one.drift.variance) for one in found]
        stays = np.all((late - before) ** 2 <= STAYS**2 * np.array(variances), axis=1)
        if stays.all():
            break
    return {i: one for i, one in enumerate(found) if stays[i]}, usual


def _survey(prediction, late, tried) -> Survey:
    """The Survey with clocks this late, (runs, 2) as in `_lateness`; last are the signatures of each run.

    These are its clock, in the middle and at its ends, and a scale of its wheels' angles, for which a clock that drifts
    passes where the motion is steady.
    """
    def disagreements(prediction, point, base):
        nothing = [{name: np.zeros_like(rows, np.float32) for name, rows in run.items()} for run in base]
        values = merged(point)
        later = [_later(prediction, probe).residuals(values) for probe in _PROBE_S * np.eye(2)]
        scaled = [_OWN_SCALE * track.measured[:, : prediction.replay.body.wheels] for track in prediction.tracks]
        changes = [difference(base, after) for after in (*later, prediction.read_off(scaled, values))]
        # what may go with time in any way would be a clock, too
        return generic_signatures(prediction, point, base, in_time=False) + [
            Signature(_OF_RUN, [1.0, 0.0, 0.0], at, False, [*nothing[:i], change[i], *nothing[i + 1 :]])
            for at, change in enumerate(changes) for i in range(len(base))
        ]

    tracks = [
        track.with_fixes_at(track.fix_t - _lateness(track, of_run))
        for track, of_run in zip(prediction.tracks, late, strict=True)
    ]
    return survey(replace(prediction, tracks=tracks), {}, tried, generics=disagreements)


def _lateness(track: Track, late: np.ndarray) -> np.ndarray:
    """(k,) by how much each fix is late [s]; late: (2,) in the middle of the run, and the drift."""
    t = track.fix_t
    return late[0] + late[1] * (t - np.mean(t)) / np.ptp(t) if len(t) > 1 else np.zeros(len(t))


def _later(prediction: Prediction, late: np.ndarray) -> Prediction:
    """The prediction of the runs as if all of their cameras' clocks were a little late, as in `_lateness`."""
    tracks = []
    for track in prediction.tracks:
        sightings = track.sightings.copy()
        sightings[track.fix_rows, SIGHTING.after_s] -= _lateness(track, late)
        tracks.append(replace(track, sightings=sightings))
    return replace(prediction, tracks=tracks)


def _of_runs(own: Survey, late: np.ndarray) -> list[_Lateness]:
    """What each run tells by a Survey with clocks this late, whatever the sizes of effects and disagreements are."""
    known = np.flatnonzero(own.screen.length > 0.0)
    inner = own.screen.inner[np.ix_(known, known)]
    unit = 1.0 / np.sqrt(np.diag(inner))
    apart = np.zeros_like(own.screen.inner)  # for each signature a combination that has none of the others
    apart[np.ix_(known, known)] = unit[:, None] * np.linalg.pinv(unit[:, None] * inner * unit, 1e-8, True) * unit
    middles, drifts, _ = np.arange(len(apart) - 3 * len(late), len(apart)).reshape(3, -1)
    of_middle, of_drift = apart[middles], apart[drifts]
    wanted = np.stack([of_middle, of_drift, of_middle - 0.5 * of_drift], axis=1).reshape(-1, len(apart))
    values = np.column_stack([late, late @ [1.0, -0.5]]).ravel()
    changes = np.hstack([wanted @ own.changes.of_run(i) for i in range(len(late))])
    left = own.tested.marginalised(changes)
    blocks = blocks_of(own.view.prediction, own.likelihood.whitening, own.residuals)
    begun = np.flatnonzero(np.diff(blocks, prepend=-1))
    products, noise, squares = (np.add.reduceat(left * rows, begun, axis=1) for rows in (own.w, own.noise, changes))

    def number(i):
        in_run, value, square = own.runs[begun] == i // 3, values[i], squares[i].sum()
        if not square:
            return _Number(value, np.inf, np.array([value]), np.array([np.inf]))
        share = 1.0 - squares[i, in_run] / square  # that the other seconds have
        variance, step = _PROBE_S**2 * max(square, np.sum(noise[i] ** 2)), products[i].sum()
        without, variances = np.full(len(share), value), np.full(len(share), np.inf)
        known = share > np.finfo(float).eps
        without[known] += _PROBE_S * (step - products[i, in_run][known]) / share[known]
        variances[known] = variance / share[known]
        return _Number(float(value + _PROBE_S * step), float(variance), without, variances)

    return [_Lateness(*map(number, range(3 * i, 3 * i + 3))) for i in range(len(late))]
