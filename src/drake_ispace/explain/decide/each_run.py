"""Effects that one run shows by itself and the other runs contradict.

All runs together have one size of an effect. If a marker was moved between two runs, the size is in between, unseen
runs are no nearer to it, and nothing is named; a run to which nothing is fitted is only judged by how large its errors
are. Every run, held out or not, is therefore tested by itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.explain.decide.decision import LEAST_FURTHER, MARGIN
from drake_ispace.explain.decide.detect import CLEAR_MINUS_LOG10_P, Detection, trials
from drake_ispace.explain.decide.propose import Proposal, clearest_effects, proposals_of
from drake_ispace.explain.decide.shown import alarm_of, held
from drake_ispace.explain.decide.survey.generic import Generic
from drake_ispace.explain.decide.survey.survey import Survey, blocks_of, survey, survey_of
from drake_ispace.explain.decide.survey.view import View, scales_of
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Point
from drake_ispace.explain.levels import CERTAIN
from drake_ispace.explain.predict.case import part_of
from drake_ispace.explain.predict.prediction import Prediction


@dataclass(frozen=True)
class OfOneRun:
    """An effect that one run shows and others contradict.

    Attributes:
        run: its name. candidate, z: the effect and its coordinates, fitted to the run alone. p_value: probability that
            noise of the run shows as much. alike: other effects, which explain about as much of the run.
    """

    run: str
    candidate: Candidate
    z: list[float]
    p_value: float
    alike: list[Candidate]


def shown_by_one(
    prediction: Prediction, point: Point, candidates: Sequence[Candidate], seed: int, known: View | None = None,
    sound_others: bool = False,
) -> list[OfOneRun]:
    """The effects that some runs show beside those of `point`, and that the other runs contradict; in their order.

    The effect must be clear (p < 1e-6), also under the noise that the run has without it, and its size in the run
    another than in the others by more than chance, both whichever second of the run is left out: what a single second
    shows may be chance, however improbable. As chance counts, too, that any sound robot may be off a little. Effects in
    a part of the room do not count: another run need not go there.

    Args:
        prediction: model and runs. candidates: effects to try. seed: of the bootstraps. known: the View of the first
            runs near `point`, where there is one already. sound_others: whether none is wanted but of a minority of
            runs, beside which no other run shows anything.
    """
    if len(prediction.tracks) < 2:
        return []
    tried = [candidate for candidate in candidates if candidate in point or not candidate.effect.is_local]

    def survey_by_itself(i):
        if known is not None and i < len(known.prediction.tracks):
            return survey_of(_everywhere(known.of_run(i)), point)
        return survey(part_of(prediction, slice(i, i + 1)), point, tried)

    surveys, leaders = [], []
    for i in range(len(prediction.tracks)):
        own = survey_by_itself(i)
        leaders.append(_leader(own, seed))
        surveys.append(own.light())
    shown, clear = [], sum(leader is not None for leader in leaders)
    if sound_others and 2 * clear >= len(leaders):
        return []
    for i, leader in enumerate(leaders):
        if leader is not None and leader.is_contradicted_by(surveys[:i] + surveys[i + 1 :]):
            detection, _ = held(leader.detection, survey_by_itself(i), leader.proposals, seed)
            if _is_clear(detection):
                shown.append(leader.in_run(prediction.tracks[i].name, detection.p_value))
    return [] if sound_others and clear > len(shown) else shown


def _is_clear(detection: Detection) -> bool:
    return detection.found and not detection.in_doubt


def _everywhere(view) -> View:
    """The View without the effects that act in a part of the room only."""
    steady = [s for s in view.signatures if isinstance(s.candidate.effect, Generic) or not s.candidate.effect.is_local]
    return replace(view, signatures=steady)


@dataclass(frozen=True)
class _Leader:
    """The effect that a run shows most clearly.

    Attributes:
        fitted: the effect. alike: others that explain about as much. detection, proposals: of the alarm. best: its size
            by the score that gains most. sizes, variances: of the same without each of the seconds of the run.
        tolerance: by how much the size may differ between runs of a sound robot (a standard deviation).
    """

    fitted: Proposal
    alike: list[Candidate]
    detection: Detection
    proposals: list[Proposal]
    best: "_Size"
    sizes: np.ndarray
    variances: np.ndarray
    tolerance: float

    def in_run(self, name: str, p_value: float) -> OfOneRun:
        """The effect as that of the run of this name, with this probability."""
        candidate = self.fitted.candidate
        return OfOneRun(name, candidate, self.fitted.fit.point[candidate], p_value, self.alike)

    def is_contradicted_by(self, others: Sequence[Survey]) -> bool:
        """Whether the size of the effect is another in these runs, by its score in each."""
        mine, candidate = self.best, self.fitted.candidate
        alike = [[one for one in _sizes(other, candidate) if one.at == mine.at] for other in others]
        theirs = [min(sizes, key=lambda one: abs(one.step - mine.step)) for sizes in alike if sizes]
        if not theirs:
            return False
        weights = np.array([1.0 / one.variance for one in theirs])
        apart = self.sizes - np.average([one.size for one in theirs], weights=weights)
        return bool(np.all(apart**2 > CERTAIN**2 * (self.variances + 1.0 / weights.sum() + self.tolerance**2)))


@dataclass(frozen=True)
class _Size:
    """The size of an effect by the score of one signature: number, coordinate and step of that, size, variance."""

    number: int
    at: int
    step: float
    size: float
    variance: float


def _leader(own: Survey, seed) -> _Leader | None:
    """The effect that the run of this Survey shows most clearly; None where none is clear."""
    if not any(clear >= CLEAR_MINUS_LOG10_P for _, clear in clearest_effects(own)):
        return None
    proposals = proposals_of(own)
    detection = alarm_of(proposals, trials(own.screen, own.by_instant, seed))
    if not _is_clear(detection):
        return None
    fitted = max(proposals, key=lambda proposal: proposal.penalised_gain)
    best = max(_sizes(own, fitted.candidate), key=lambda one: one.size**2 / one.variance)
    sizes, variances = _without_each_second(own, best)
    if not np.all(sizes**2 >= LEAST_FURTHER * variances):
        return None
    near = [p.candidate for p in proposals if p is not fitted and p.penalised_gain > fitted.penalised_gain - MARGIN]
    tolerance = fitted.candidate.tolerances(scales_of(own.view.prediction))[best.at]
    return _Leader(fitted, near, detection, proposals, best, sizes, variances, tolerance)


def _without_each_second(own, of) -> tuple[np.ndarray, np.ndarray]:
    """(seconds,) a size without each of the seconds of the run, and its variance; no numbers where nothing else tells.
    """
    change = own.changes.of_run(0, slice(of.number, of.number + 1))[0]
    blocks = blocks_of(own.view.prediction, own.likelihood.whitening, own.residuals)
    begun = np.flatnonzero(np.diff(blocks, prepend=-1))
    parts = (np.add.reduceat(change * own.tested.marginalised(by), begun) for by in (own.w, change))
    product, length = (np.sum(part) - part for part in parts)
    length[length <= np.finfo(float).eps * own.screen.length[of.number]] = np.nan
    return of.step * product / length, of.step**2 * own.screen.overdispersion[of.number] / length


def _sizes(survey, candidate) -> list[_Size]:
    """The sizes of a candidate by each of its signatures that the run shows."""
    screen, found = survey.screen, []
    for i, signature in enumerate(screen.signatures):
        if signature.candidate is candidate and screen.length[i] > 0.0:
            step = signature.z[signature.at] - candidate.neutral[signature.at]
            size, variance = survey.products[i] / screen.length[i], screen.overdispersion[i] / screen.length[i]
            found.append(_Size(i, signature.at, step, step * size, step**2 * variance))
    return found
