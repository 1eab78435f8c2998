"""Effects that one run shows by itself and the other runs contradict.

All runs together have one size of an effect. If a marker was moved between two runs, the size is in between, unseen
runs are no nearer to it, and nothing is named; a run to which nothing is fitted is only judged by how large its errors
are. Every run, held out or not, is therefore tested by itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student_t

from drake_ispace.explain.decide.decide import detection_of
from drake_ispace.explain.decide.detect import CLEAR_MINUS_LOG10_P, trials
from drake_ispace.explain.decide.propose import Proposal, clearest_effects, proposals_of
from drake_ispace.explain.decide.survey.survey import Survey, blocks_of, survey, telling_blocks
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Point
from drake_ispace.explain.levels import CHANCE
from drake_ispace.explain.predict.case import part_of
from drake_ispace.explain.predict.prediction import Prediction


@dataclass(frozen=True)
class OfOneRun:
    """An effect that one run shows and others contradict.

    Attributes:
        run: its name. candidate, z: the effect and its coordinates, fitted to the run alone. p_value: probability that
            noise of the run shows as much.
    """

    run: str
    candidate: Candidate
    z: list[float]
    p_value: float


def shown_by_one(prediction: Prediction, point: Point, candidates: Sequence[Candidate], seed: int) -> list[OfOneRun]:
    """The effects that some runs show beside those of `point`, and that the other runs contradict; in their order.

    The effect must be clear (p < 1e-6), and its size in the run another than in the others by more than chance, of as
    many seconds as tell. Effects in a part of the room do not count: another run need not go there.

    Args:
        prediction: model and runs. candidates: effects to try. seed: of the bootstraps.
    """
    if len(prediction.tracks) < 2:
        return []
    tried = [candidate for candidate in candidates if candidate in point or not candidate.effect.is_local]
    surveys, leaders = [], []
    for i in range(len(prediction.tracks)):
        own = survey(part_of(prediction, slice(i, i + 1)), point, tried)
        leaders.append(_leader(own, seed))
        surveys.append(own.light())
    return [
        OfOneRun(track.name, leader.fitted.candidate, leader.fitted.fit.point[leader.fitted.candidate], leader.p_value)
        for i, (track, leader) in enumerate(zip(prediction.tracks, leaders, strict=True))
        if leader is not None and leader.is_contradicted_by(surveys[:i] + surveys[i + 1 :])
    ]


@dataclass(frozen=True)
class _Leader:
    """The effect that a run shows most clearly.

    Attributes:
        fitted: the effect. p_value: of the alarm. best: its size by the score that gains most. seconds: how many tell.
    """

    fitted: Proposal
    p_value: float
    best: "_Size"
    seconds: float

    def is_contradicted_by(self, others: Sequence[Survey]) -> bool:
        """Whether the size of the effect is another in these runs, by its score in each.

        What a second or two show may be chance, however improbable: Student's distribution of as many seconds as tell.
        """
        mine, candidate = self.best, self.fitted.candidate
        alike = [[one for one in _sizes(other, candidate) if one.at == mine.at] for other in others]
        theirs = [min(sizes, key=lambda one: abs(one.step - mine.step)) for sizes in alike if sizes]
        if not theirs or self.seconds <= 1.0:
            return False
        weights = np.array([1.0 / one.variance for one in theirs])
        apart = mine.size - np.average([one.size for one in theirs], weights=weights)
        statistic = apart / np.sqrt(mine.variance + 1.0 / weights.sum())
        return 2.0 * student_t.sf(abs(statistic), self.seconds - 1.0) < CHANCE


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
    detection = detection_of(own, proposals, trials(own.screen, own.by_instant, seed), seed)
    if not detection.found or detection.in_doubt:
        return None
    fitted = max(proposals, key=lambda proposal: proposal.penalised_gain)
    best = max(_sizes(own, fitted.candidate), key=lambda one: one.size**2 / one.variance)
    change = own.changes.of_run(0, slice(best.number, best.number + 1))
    blocks = blocks_of(own.view.prediction, own.likelihood.whitening, own.residuals)
    return _Leader(fitted, detection.p_value, best, float(telling_blocks(change, blocks)[0]))


def _sizes(survey, candidate) -> list[_Size]:
    """The sizes of a candidate by each of its signatures that the run shows."""
    screen, found = survey.screen, []
    for i, signature in enumerate(screen.signatures):
        if signature.candidate is candidate and screen.length[i] > 0.0:
            step = signature.z[signature.at] - candidate.neutral[signature.at]
            size, variance = survey.products[i] / screen.length[i], screen.overdispersion[i] / screen.length[i]
            found.append(_Size(i, signature.at, step, step * size, step**2 * variance))
    return found
