"""Effects that one run shows by itself and the other runs contradict.

All runs together have one size of an effect. If a marker was moved between two runs, the size is in between, unseen
runs are no nearer to it, and nothing is named; a run to which nothing is fitted is only judged by how large its errors
are. Every run, held out or not, is therefore tested by itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.decide.decide import detection_of
from drake_ispace.explain.decide.detect import CLEAR_MINUS_LOG10_P, trials
from drake_ispace.explain.decide.propose import clearest_effects, proposals_of
from drake_ispace.explain.decide.survey.screen import gain_at
from drake_ispace.explain.decide.survey.survey import Survey, survey
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Point
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

    The effect must be clear (p < 1e-6), and its size in the run must be as clearly another than in the others. Effects
    in a part of the room do not count: another run need not go there.

    Args:
        prediction: model and runs. candidates: effects to try. seed: of the bootstraps.
    """
    if len(prediction.tracks) < 2:
        return []
    tried = [candidate for candidate in candidates if not candidate.effect.is_local]
    surveys, leaders = [], []
    for i in range(len(prediction.tracks)):
        own = survey(part_of(prediction, slice(i, i + 1)), point, tried)
        leaders.append(_leader(own, seed))
        surveys.append(own.light())
    return [
        OfOneRun(track.name, leader.candidate, leader.fit.point[leader.candidate], detection.p_value)
        for i, (track, (leader, detection)) in enumerate(zip(prediction.tracks, leaders, strict=True))
        if leader is not None and _is_contradicted(leader.candidate, surveys[i], surveys[:i] + surveys[i + 1 :])
    ]


def _leader(own: Survey, seed):
    """The effect that the run shows most clearly, and its Detection; None, None where none is clear."""
    if not any(clear >= CLEAR_MINUS_LOG10_P for _, clear in clearest_effects(own)):
        return None, None
    proposals = proposals_of(own)
    detection = detection_of(own, proposals, trials(own.screen, own.by_instant, seed), seed)
    if not detection.found or detection.in_doubt:
        return None, None
    return max(proposals, key=lambda proposal: proposal.penalised_gain), detection


def _is_contradicted(candidate, own: Survey, others: Sequence[Survey]) -> bool:
    """Whether the size of an effect in a run is another than in the others, by its score in each."""
    at, step, size, variance = max(_sizes(own, candidate), key=lambda one: one[2] ** 2 / one[3])
    alike = [[one for one in _sizes(other, candidate) if one[0] == at] for other in others]
    theirs = [min(sizes, key=lambda one: abs(one[1] - step)) for sizes in alike if sizes]
    if not theirs:
        return False
    _, _, sizes, variances = np.transpose(theirs)
    apart = size - np.average(sizes, weights=1.0 / variances)
    return apart**2 >= gain_at(CLEAR_MINUS_LOG10_P) * (variance + 1.0 / np.sum(1.0 / variances))


def _sizes(survey, candidate):
    """(coordinate, step of it, size, its variance) by the score of each signature of a candidate that the run shows."""
    screen = survey.screen
    numbers = zip(screen.signatures, survey.products, screen.length, screen.overdispersion, strict=True)
    steps = [(s.at, s.z[s.at] - candidate.neutral[s.at], *rest) for s, *rest in numbers if s.candidate is candidate]
    return [(at, d, d * p / length, d**2 * over / length) for at, d, p, length, over in steps if length > 0.0]
