"""Effects that a part of what was recorded shows by itself and the rest contradicts.

All runs together have one size of an effect. If a marker was moved between two runs, the size is in between, unseen
runs are no nearer to it, and nothing is named; a run to which nothing is fitted is only judged by how large its errors
are. Every run, held out or not, is therefore tested by itself. So are the first and the second halves of all training
runs: what begins on the way, such as the friction of a bearing that seizes, is half as large in whole runs, and what
it does in one half passes there for noise that is larger at times.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.stats import t as student_t

from drake_ispace.effects.card import Parameter
from drake_ispace.explain.decide.decision import LEAST_FURTHER, MARGIN
from drake_ispace.explain.decide.proposals.detect import CLEAR_MINUS_LOG10_P, FALSE_ALARM_RATE, Detection, trials
from drake_ispace.explain.decide.proposals.propose import Proposal, clearest_effects, proposals_of
from drake_ispace.explain.decide.shown import alarm_of, held
from drake_ispace.explain.decide.survey.generic import Generic
from drake_ispace.explain.decide.survey.signatures import Signature, is_finite
from drake_ispace.explain.decide.survey.survey import Survey, blocks_of, survey, survey_of
from drake_ispace.explain.decide.survey.view import View, scales_of
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Point, merged
from drake_ispace.explain.levels import BLOCK_TICKS, CHANCE, LEAST_SPREAD
from drake_ispace.explain.predict.case import part_of
from drake_ispace.explain.predict.prediction import Prediction, predict
from drake_ispace.explain.predict.stretches import stretch
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.explain.threads import each

_HALVES = ("the first half of the runs", "the second half of the runs")


@dataclass(frozen=True)
class OfAPart:
    """An effect that a part of what was recorded shows and the rest contradicts.

    Attributes:
        part: its name. candidate, z: the effect and its coordinates, fitted to the part alone. p_value: probability
            that noise of the part shows as much. alike: other effects, which explain about as much of the part.
            sizes: of all parts, if another one shows the effect as well, only smaller or larger; empty: none does.
            is_half: whether the part is a half of all runs and not a run.
    """

    part: str
    candidate: Candidate
    z: list[float]
    p_value: float
    alike: list[Candidate]
    sizes: tuple["SizeIn", ...] = ()
    is_half: bool = False


@dataclass(frozen=True)
class SizeIn:
    """The size of an effect in a part, by its score there.

    Attributes:
        part: its name. parameter, value: the size. is_clear: whether the part shows the effect by itself.
    """

    part: str
    parameter: Parameter
    value: float
    is_clear: bool


def shown_by_run(
    prediction: Prediction, point: Point, candidates: Sequence[Candidate], seed: int, known: View | None = None,
    sound_others: bool = False,
) -> list[OfAPart]:
    """The effects that some runs show beside those of `point`, and that the other runs contradict; in their order.

    The effect must be clear (p < 1e-6), also under the noise that the run has without it, and its size in the run
    another than in the others by more than chance, both whichever second of the run is left out: what a single second
    shows may be chance, however improbable. As chance counts, too, that any sound robot may be off a little. Effects in
    a part of the room do not count: another run need not go there. A run in which nothing is scored shows nothing.
    Where another run clearly shows the effect, too, of the same sign, they contradict its size alone: that of each is
    given.

    Args:
        prediction: model and runs. candidates: effects to try. seed: of the bootstraps. known: the View of the first
            runs near `point`, where there is one already. sound_others: whether none is wanted but of a minority of
            runs, beside which no other run shows anything.
    """
    shows = [i for i, track in enumerate(prediction.tracks) if not _has_nothing(prediction, track)]
    if len(shows) < 2:
        return []
    tried = _anywhere(candidates, point)

    def survey_by_itself(i):
        if known is not None and i < len(known.prediction.tracks):
            return survey_of(_everywhere(known.of_run(i)), point)
        return survey(part_of(prediction, slice(i, i + 1)), point, tried)

    names = [prediction.tracks[i].name for i in shows]
    return _shown(lambda number: survey_by_itself(shows[number]), names, seed, sound_others)[0]


def shown_by_half(prediction: Prediction, point: Point, candidates: Sequence[Candidate], seed: int) -> list[OfAPart]:
    """As `shown_by_run`, what one half of all runs shows and the other contradicts: it begins or ends on the way.

    So may an effect of `point`. Each is tested beside the others, under the noise with all of them: noise that was
    learned while an effect was missing takes up some of it, in one half more than in the other. It is tried at its
    size, too: what it changes is there in both halves if that is its size, however little it is linear in the size.
    Nothing is told where a half has nothing that is scored, or where a model that falls by itself runs away in one that
    begins in motion.
    """
    halves = [
        predict(prediction.replay, half, tune=False)
        for half in zip(*(_halved(track, prediction.replay.settling_ticks) for track in prediction.tracks), strict=True)
    ]
    if any(all(_has_nothing(half, track) for track in half.tracks) for half in halves):
        return []
    if not all(is_finite(half.residuals(merged(point))) for half in halves):
        return []
    survey_of_half = partial(survey, generics=_no_generics)
    found, surveys = _shown(lambda i: survey_of_half(halves[i], point, _anywhere(candidates, point)), _HALVES, seed)
    noises = [own.likelihood.whitening for own in surveys]
    for effect in _anywhere(point, {}):
        found += _shown(partial(_survey_under, survey_of_half, halves, noises, point, effect), _HALVES, seed)[0]
    return [replace(one, sizes=(), is_half=True) for one in found]


def _survey_under(survey_of_half, halves, noises, point, effect, i) -> Survey:
    """The Survey of a half that tests one effect of `point` beside the others, under a noise that is known.

    What other assumptions about noise change is that with the effect: without it they change what looks like it.
    """
    rest = {other: z for other, z in point.items() if other is not effect}
    at = [
        [*effect.neutral[:k], size, *effect.neutral[k + 1 :]] for k, size in enumerate(point[effect])
        if size != effect.neutral[k]
    ]
    return survey_of_half(halves[i], rest, [effect, *rest], whitening=noises[i], at={effect: at}, assuming=point)


def _no_generics(prediction, point, base) -> list[Signature]:
    """No generic disagreements: none is told of a half, and they cost a third of its Survey."""
    return []


def _halved(track, settling_ticks) -> tuple[Track, Track]:
    """The first and the second half of what is scored of a track; settling_ticks: as `stretch` takes them."""
    middle = (track.unscored_ticks + track.ticks) // 2
    return stretch(track, 0, middle, settling_ticks), stretch(track, middle, track.ticks, settling_ticks)


def _has_nothing(prediction, track) -> bool:
    """Whether so little of a track is scored that a noise could not be learned: less than a second, or two fixes."""
    moves = prediction.channels["motion"] and len(track.scored_ticks) * prediction.row_ticks >= BLOCK_TICKS
    seen = prediction.channels["room"] and len(track.fix_t[track.scored_fixes]) >= 2
    return not (moves or seen)


def _anywhere(candidates, point) -> list[Candidate]:
    """The candidates without those that act in a part of the room and are not in the model."""
    return [candidate for candidate in candidates if candidate in point or not candidate.effect.is_local]


def _shown(survey_by_itself, names, seed, sound_others=False) -> tuple[list[OfAPart], list[Survey]]:
    """What shows in the Survey of a part, made by its number, and those of the others contradict; these Surveys."""
    surveys, leaders, p_values = [], [], []
    for i in range(len(names)):
        own = survey_by_itself(i)
        leader = _leader(own, seed)
        detection = None if leader is None else held(leader.detection, own, leader.proposals, seed)[0]
        leaders.append(leader)
        p_values.append(detection.p_value if detection is not None and _is_clear(detection) else None)
        surveys.append(own.light())
    clear = sum(leader is not None for leader in leaders)
    if sound_others and 2 * clear >= len(leaders):
        return [], surveys
    shown = []
    for i, (leader, p_value) in enumerate(zip(leaders, p_values, strict=True)):
        if p_value is not None and leader.is_contradicted_by(surveys[:i] + surveys[i + 1 :]):
            shown.append(leader.in_part(i, p_value, list(zip(names, surveys, strict=True))))
    return [] if sound_others and clear > len(shown) else shown, surveys


def _is_clear(detection: Detection) -> bool:
    return detection.found and not detection.in_doubt


def _everywhere(view) -> View:
    """The View without the effects that act in a part of the room only."""
    steady = [s for s in view.signatures if isinstance(s.candidate.effect, Generic) or not s.candidate.effect.is_local]
    return replace(view, signatures=steady)


@dataclass(frozen=True)
class _Leader:
    """The effect that a part shows most clearly.

    Attributes:
        fitted: the effect. alike: others that explain about as much. detection, proposals: of the alarm. best: its size
            by the score of the signature nearest to what was fitted. sizes, variances: of the same without each of the
            seconds of the part.
        tolerance: by how much the size may differ between parts of a sound robot, or by torques as strong as the model
            of a user's own plant assumes (a standard deviation).
    """

    fitted: Proposal
    alike: list[Candidate]
    detection: Detection
    proposals: list[Proposal]
    best: "_Size"
    sizes: np.ndarray
    variances: np.ndarray
    tolerance: float

    def in_part(self, number: int, p_value: float, parts: Sequence[tuple[str, Survey]]) -> OfAPart:
        """The effect as that of the part of this number, with this probability; parts: name and Survey of all."""
        of_each = [[self._size_in(name, size) for size in self._there([own])] for name, own in parts]
        is_elsewhere = any(one.is_clear for i, sizes in enumerate(of_each) if i != number for one in sizes)
        candidate = self.fitted.candidate
        point = self.fitted.fit.point[candidate]
        sizes = tuple(size for of_part in of_each for size in of_part) if is_elsewhere else ()
        return OfAPart(parts[number][0], candidate, point, p_value, self.alike, sizes)

    def _size_in(self, part, size) -> SizeIn:
        """A size in a part: clear if it is more than chance and a sound robot make, and of the sign of the effect."""
        candidate, z = self.fitted.candidate, self.fitted.candidate.neutral
        z[size.at] += size.size
        by_chance = student_t.isf(CHANCE, size.freedom) * np.hypot(np.sqrt(size.variance), self.tolerance)
        is_clear = bool(size.size * np.sign(self.best.size) > by_chance)
        parameter = candidate.parameters[size.at]
        return SizeIn(part, parameter, candidate.values(z)[parameter.name], is_clear)

    def _there(self, others) -> list["_Size"]:
        """The size in each of these parts that shows it, by its score there."""
        mine, candidate = self.best, self.fitted.candidate
        alike = [[one for one in _sizes(other, candidate) if one.at == mine.at] for other in others]
        return [min(sizes, key=lambda one: abs(one.step - mine.step)) for sizes in alike if sizes]

    def is_contradicted_by(self, others: Iterable[Survey]) -> bool:
        """Whether the size of the effect is another in these parts, by its score in each, by more than chance."""
        mine, theirs = self.best, self._there(others)
        if not theirs:
            return False
        weights = np.array([1.0 / one.variance for one in theirs])
        mean, variance = np.average([one.size for one in theirs], weights=weights), 1.0 / weights.sum()
        apart, both = np.abs(self.sizes - mean), self.variances + variance + self.tolerance**2
        # as many degrees of freedom as Welch and Satterthwaite give a sum of variances
        doubt = self.variances**2 / mine.freedom + variance**2 / sum(one.freedom for one in theirs)
        chance = student_t.isf(CHANCE, both**2 / doubt) * np.sqrt(both)
        return bool(np.all((apart > chance) & (apart > LEAST_SPREAD * np.abs(self.sizes + mean))))


@dataclass(frozen=True)
class _Size:
    """The size of an effect by the score of one signature: number, coordinate and step of that, size, variance, and the
    degrees of freedom of the latter."""

    number: int
    at: int
    step: float
    size: float
    variance: float
    freedom: int


def _leader(own: Survey, seed) -> _Leader | None:
    """The effect that the part of this Survey shows most clearly; None where none is clear."""
    if not any(clear >= CLEAR_MINUS_LOG10_P for _, clear in clearest_effects(own)):
        return None
    proposals = proposals_of(own)
    detection = alarm_of(proposals, trials(own.screen, own.by_instant, seed))
    if not _is_clear(detection):
        return None
    fitted = max(proposals, key=lambda proposal: proposal.penalised_gain)
    best = _nearest(_sizes(own, fitted.candidate), fitted)
    sizes, variances = _without_each_second(own, best)
    if not np.all(sizes**2 >= LEAST_FURTHER * variances):
        return None
    near = [p.candidate for p in proposals if p is not fitted and p.penalised_gain > fitted.penalised_gain - MARGIN]
    tolerance = fitted.candidate.tolerances(scales_of(own.view.prediction))[best.at]
    tolerance = float(np.hypot(tolerance, _by_unknown_torques(own, best, seed)))
    return _Leader(fitted, near, detection, proposals, best, sizes, variances, tolerance)


def _by_unknown_torques(own, of, seed) -> float:
    """By how much unknown torques, as strong as the model of a user's own plant assumes, move a size; 0 of a robot.

    Of a slow one a part has a mean, which the noise of the part, a matter of a second, knows nothing of. Where they are
    all noise, what the filter could not predict is white, and plain least squares tells the size best.
    """
    prediction = own.view.prediction
    if prediction.replay.body.robot.in_room or not prediction.replay.unknown_torque:
        return 0.0
    change, as_given = _in_a_row(own.screen.signatures[of.number].change), _in_a_row(own.residuals)

    def moved(draw):
        tracks = [prediction.replay.disturbed(track, [seed, 8, draw, i]) for i, track in enumerate(prediction.tracks)]
        after = _in_a_row(replace(prediction, tracks=tracks).residuals(merged(own.point)))
        return of.step * (change @ (after - as_given)) / (change @ change)

    return float(np.std(each(moved, range(round(1.0 / FALSE_ALARM_RATE)))))


def _in_a_row(runs) -> np.ndarray:
    """All numbers of residuals, or of their changes."""
    return np.concatenate([rows.ravel() for run in runs for rows in run.values()])


def _nearest(sizes, fitted) -> "_Size":
    """The size by the score of the signature that is nearest to what was fitted, of the coordinate that shows most."""
    clearest, candidate = max(sizes, key=lambda one: one.size**2 / one.variance), fitted.candidate
    moved = fitted.fit.point[candidate][clearest.at] - candidate.neutral[clearest.at]
    return min((one for one in sizes if one.at == clearest.at), key=lambda one: abs(one.step - moved))


def _without_each_second(own, of) -> tuple[np.ndarray, np.ndarray]:
    """(seconds,) a size without each of the seconds of a part, and its variance; no numbers where nothing else tells.
    """
    some = slice(of.number, of.number + 1)
    change = np.concatenate([own.changes.of_run(i, some)[0] for i in range(len(own.residuals))])
    blocks = blocks_of(own.view.prediction, own.likelihood.whitening, own.residuals)
    begun = np.flatnonzero(np.diff(blocks, prepend=-1))
    parts = (np.add.reduceat(change * own.tested.marginalised(by), begun) for by in (own.w, change))
    product, length = (np.sum(part) - part for part in parts)
    rounding = np.sqrt(np.finfo(float).eps)  # of what is left when nuisances are taken away, as a share
    length[length <= rounding * own.screen.length[of.number]] = np.nan
    return of.step * product / length, of.step**2 * own.screen.overdispersion[of.number] / length


def _sizes(survey, candidate) -> list[_Size]:
    """The sizes of a candidate by each of its signatures that the part shows."""
    screen, found = survey.screen, []
    for i, signature in enumerate(screen.signatures):
        if signature.candidate is candidate and screen.length[i] > 0.0:
            step = signature.z[signature.at] - candidate.neutral[signature.at]
            size, variance = survey.products[i] / screen.length[i], screen.overdispersion[i] / screen.length[i]
            found.append(_Size(i, signature.at, step, step * size, step**2 * variance, max(screen.blocks - 1, 1)))
    return found
