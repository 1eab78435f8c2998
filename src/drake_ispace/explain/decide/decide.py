"""Stage 4, decide: which effects the model lacks, and which others these runs cannot tell from them.

Effects are added one at a time, each joint with those found before, then taken away again where the others suffice.
Every comparison is one of deviances under the same noise: a rival that does nearly as well stands beside the name, and
one without a name that does better makes the verdict "unknown".
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from drake_ispace.explain.decide.detect import Detection, detect, trials
from drake_ispace.explain.decide.generic import Generic, generics
from drake_ispace.explain.decide.signatures import minus_log10_p_of_gain
from drake_ispace.explain.decide.survey import Survey, Unnamed, doubted, settled, survey
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Fit, Point, fit
from drake_ispace.explain.predict.prediction import Prediction

MARGIN = 7.0  # of deviance, by which the best must lead for a rival to be ruled out: a wrong name in about 0.4 % then
_RELATIVE_MARGIN = 0.01  # and of what was gained: no model is better than that
_LEAST_SHARE = 0.05  # of what the others explain, below which a further effect is a flaw of these
_LEAST_SHARE_OF_END = 0.01  # the same under the noise that is left by the others
_LEAST_FURTHER = 24.0  # of deviance, that a further effect must explain
_LEAST_UNNAMED_SHARE = 0.15  # the same for a disagreement without a name, and how clear it must be (-log10 p)
_LEAST_UNNAMED_MINUS_LOG10_P = 6.0
_BEYOND_DOUBT = 25.0  # minus_log10_p, below which an alarm must hold whatever the noise remembers
_SHORTLIST = 6
_NEAR, _NEAR_MINUS_LOG10_P = 0.4, 0.25  # of the leader's penalised_gain and minus_log10_p, from which on another try is followed, too
_MOST_NEAR = 2
_UNNAMED = 60.0  # of deviance, that a disagreement without a name must explain to be believed
_UNNAMED_LOCAL = 120.0  # the same where it is free in every part of the room
_MOST_EFFECTS = 4


@dataclass(frozen=True)
class Rival:
    """An effect that could stand in the place of a named one: by how much worse the deviance is then."""

    candidate: Candidate
    behind: float


@dataclass
class Decision:
    """What the runs say.

    Attributes:
        detection: of anything at all. named: the best fit, None where nothing was found. rivals: of each named effect,
            those that cannot be ruled out. unknown: a generic disagreement that explains more than any effect.
        gains: effect -> how much the deviance grows without it. start: survey of the model as given; end: with the
            named effects in it. nearest: where unknown, the effect that explains most, and by how much.
        left_over: what is still to be seen beside the named effects. total_gain, first_gain: of deviance by the
            named effects, under the noise of the end and of the start. A model without them makes the latter larger,
            so that it is what little further effects are measured by.
    """

    detection: Detection
    start: Survey
    end: Survey
    named: Fit | None = None
    rivals: dict[Candidate, list[Rival]] = field(default_factory=dict)
    gains: dict[Candidate, float] = field(default_factory=dict)
    unknown: tuple[Generic, float] | None = None
    nearest: tuple[Candidate, float] | None = None
    left_over: "LeftOver | None" = None
    total_gain: float = 0.0
    first_gain: float = 0.0

    @property
    def least(self) -> float:
        """Of deviance, that a further effect must explain not to be taken for a flaw of the others' form."""
        return max(_LEAST_FURTHER, _LEAST_SHARE * self.first_gain, _LEAST_SHARE_OF_END * self.total_gain)


@dataclass(frozen=True)
class _Try:
    """A candidate, fitted; gain: of deviance, in units in which noise alone gains one a parameter; own_gain: what its
    signatures lower the deviance by, less its cost, to be compared with that of the generic_tries."""

    candidate: Candidate
    fit: Fit
    gain: float
    own_gain: float
    minus_log10_p: float

    @property
    def penalised_gain(self) -> float:
        """Gain less what free parameters and a free choice of wheel gain by chance."""
        return self.gain - cost(self.candidate)


@dataclass(frozen=True)
class GenericTry:
    """A generic disagreement; gain, own_gain, minus_log10_p: as of an effect that is tried."""

    candidate: Candidate
    gain: float
    own_gain: float
    minus_log10_p: float

    @property
    def generic(self) -> Generic:
        return self.candidate.effect


@dataclass(frozen=True)
class LeftOver:
    """An effect or a generic_tries disagreement that is still to be seen, perhaps as a flaw of the form of the named ones.

    gain: by how much it would lower the deviance. p_value: of so much minus_log10_p on noise alone.
    """

    candidate: Candidate
    gain: float
    p_value: float


def cost(candidate: Candidate) -> float:
    """Of its parameters and its choice of wheel, in deviance."""
    return 2.0 * len(candidate.parameters) + (2.0 * np.log(4.0) if candidate.choices else 0.0)


def decide(
    prediction: Prediction, tried: Sequence[Candidate], seed: int, pool: ThreadPoolExecutor | None,
    tell: Callable[[str], None] = lambda text: None, unnamed: Unnamed = generics,
) -> Decision:
    """Stages 1, 3 and 4 in one: detect, rank, fit, compare. unnamed: as `survey` takes it."""
    look = partial(survey, prediction, tried=tried, pool=pool, unnamed=unnamed)
    tell("looking at every effect")
    start = here = look({})
    point: Point = {}
    decision, first, best, tries = None, None, None, None
    while len(point) < _MOST_EFFECTS:
        limit = trials(here.screen, here.noise, here.instants, seed)
        tell(f"fitting the leaders{' for what is left' if point else ''}")
        tries = leaders(here)
        generic_tries = _believed(here, bool(point))
        tested = [*tries, *generic_tries]
        found = detect(max([one.minus_log10_p for one in tested], default=0.0), limit)
        if not point and found.found and found.minus_log10_p < _BEYOND_DOUBT:
            found = _doubted(here, tested, seed)
        first = first or found
        if not found.found:
            break
        unknown = _better_unknown(tries, generic_tries)
        leader = max(tries, key=lambda t: t.penalised_gain, default=None)
        if point and _gain_of(leader, unknown) < decision.least:
            break
        if point and unknown is not None and unknown[1] < _LEAST_UNNAMED_SHARE * decision.first_gain:
            break
        if unknown is not None or leader is None:
            decision = decision or Decision(first, start, here)
            decision.unknown = unknown
            decision.nearest = (leader.candidate, leader.gain) if leader else None
            break
        best = _settled_leader(here, tries, leader)
        tell(f"looking again with {', '.join(c.label for c in best.point)}")
        here = look(best.point, near=True)
        best = fit(here.likelihood, best.point)
        here, point, tries = here.moved(best), best.point, None
        decision = Decision(first, start, here, best, total_gain=_gain_at(here, best), first_gain=_gain_at(start, best))
    if decision is None:
        return Decision(first, start, start)
    decision.end = here
    if decision.named is not None:
        decision = pruned(look, decision)
        compare(decision)
        if decision.unknown is None:
            known = decision.end is here and tries is not None
            decision.left_over = left_over(decision, seed, *((tries, limit) if known else ()))
    return decision


def left_over(
    decision: Decision, seed: int, tries: Sequence[_Try] | None = None, limit: np.ndarray | None = None
) -> LeftOver | None:
    """The clearest of what is still to be seen at the end, if noise alone would hardly show it.

    tries, limit: leaders and trials there, default found here.
    """
    here = decision.end
    tested = [*(leaders(here) if tries is None else tries), *ranked_generics(here)]
    one = max(tested, key=lambda t: t.minus_log10_p, default=None)
    if one is None or one.gain < _LEAST_SHARE_OF_END * decision.total_gain:
        return None
    found = detect(one.minus_log10_p, trials(here.screen, here.noise, here.instants, seed) if limit is None else limit)
    return LeftOver(one.candidate, one.gain, found.p_value) if found.found else None


def _doubted(here, tested, seed) -> Detection:
    """The Detection, given that the noise may remember in another way than it was found to.

    Where noise is far from what the filter expects, what a finite memory leaves of it can pass for an effect.
    """
    again = doubted(here)
    minus_log10_p = dict(zip(again.screen.candidates, again.minus_log10_p, strict=True))
    held = max(min(one.minus_log10_p, minus_log10_p[one.candidate]) for one in tested)
    return detect(held, trials(again.screen, again.noise, again.instants, seed))


def _settled_leader(here: Survey, tries: Sequence[_Try], leader: _Try) -> Fit:
    """Of the leader and the tries that come near it the one that does best under the noises that they leave.

    Under a noise that was found while the effect was missing, one that only looks like it may gain more.
    """
    near = [
        t for t in sorted(tries, key=lambda t: -t.penalised_gain)
        if t.penalised_gain > _NEAR * leader.penalised_gain and t.minus_log10_p > _NEAR_MINUS_LOG10_P * leader.minus_log10_p and t is not leader
    ]
    followed = [leader, *near[:_MOST_NEAR]]
    settlements = [settled(here.view, one.fit.point) for one in followed]
    if len(followed) == 1:
        return settlements[0][1]
    best, least = None, np.inf
    for one, (_, found) in zip(followed, settlements, strict=True):
        deviances = [fit(likelihood, found.point, iterations=4).deviance for likelihood, _ in settlements]
        value = np.mean(deviances) + cost(one.candidate)
        if value < least:
            best, least = found, value
    return best


def _gain_at(here: Survey, named: Fit) -> float:
    """By how much the named effects lower the deviance under the noise of `here`."""
    likelihood = here.likelihood
    return likelihood.deviance(likelihood.whitened({})) - likelihood.deviance(likelihood.whitened(named.point))


def _gain_of(leader, unknown):
    return max(leader.gain if leader else 0.0, unknown[1] if unknown else 0.0)


def leaders(here: Survey) -> list[_Try]:
    """The effects that could explain most, fitted together with those that the model has."""
    screen, likelihood = here.screen, here.likelihood
    minus_log10_p = here.minus_log10_p
    base = likelihood.deviance(here.w)
    ranked = [i for i in np.argsort(-minus_log10_p) if not isinstance(screen.candidates[i].effect, Generic)]
    found = []
    for i in ranked[:_SHORTLIST]:
        if minus_log10_p[i] < 1.3:  # one in twenty, before correction
            break
        candidate = screen.candidates[i]
        fitted = fit(likelihood, {**here.point, candidate: screen.start(candidate, here.w)})
        whole = max(base - fitted.deviance, 0.0)
        gain = whole / screen.overdispersion_of(candidate)
        clear = min(minus_log10_p[i], minus_log10_p_of_gain(gain, len(candidate.parameters)))
        own_gain = min(whole, screen.joint_gain(candidate, here.w)) - cost(candidate)
        found.append(_Try(candidate, fitted, gain, own_gain, clear))
    return found


def ranked_generics(here: Survey) -> list[GenericTry]:
    """All of them, the largest gain first."""
    screen = here.screen
    found = []
    for i, candidate in enumerate(screen.candidates):
        if isinstance(candidate.effect, Generic):
            own_gain = screen.joint_gain(candidate, here.w)
            gain = own_gain / screen.overdispersion_of(candidate)
            found.append(GenericTry(candidate, gain, own_gain - 2.0 * candidate.effect.columns, here.minus_log10_p[i]))
    return sorted(found, key=lambda f: -f.gain)


def _believed(here, further):
    """Of `ranked_generics`, those that explain enough; further: beside named effects."""
    def enough(one):
        if further:
            return one.minus_log10_p > _LEAST_UNNAMED_MINUS_LOG10_P
        return one.gain - 2.0 * one.generic.columns > (_UNNAMED_LOCAL if one.generic.is_local else _UNNAMED)

    return [one for one in ranked_generics(here) if enough(one)]


def _better_unknown(tries: Sequence[_Try], generic_tries: Sequence[GenericTry]) -> tuple[Generic, float] | None:
    """The first of the generic_tries that explains more than every effect, if there is one."""
    best = max([t.own_gain for t in tries], default=0.0)
    least = best + max(MARGIN, 0.03 * best)
    return next(((one.generic, one.gain) for one in generic_tries if one.own_gain > least), None)


def without_each(here: Survey, named: Fit) -> dict[Candidate, Fit]:
    """Each effect of `named` -> the best fit of all others, under the noise of `here`."""
    return {
        candidate: fit(here.likelihood, {c: z for c, z in named.point.items() if c is not candidate})
        for candidate in named.point
    }


def pruned(look: Callable[..., Survey], decision: Decision) -> Decision:
    """Backward deletion: effects without which the others do as well are taken away, all but one if it does as well.

    look: `survey` of these runs, given a point and `near`.
    """
    named = decision.named
    one = _one_for_all(decision) if len(named.point) > 1 else None
    if one is not None:
        decision = _renamed(look, decision, one)
        named = decision.named
    while len(named.point) > 1:
        rests = without_each(decision.end, named)
        refits = {c: rest.deviance - named.deviance for c, rest in rests.items()}
        weakest = min(refits, key=refits.get)
        if refits[weakest] > max(2.0 * MARGIN, decision.least):
            decision.gains = refits
            return decision
        decision = _renamed(look, decision, rests[weakest].point)
        named = decision.named
    decision.gains = {next(iter(named.point)): decision.total_gain}
    return decision


def _one_for_all(decision) -> Point | None:
    """A single effect that does as well as all named ones: of two wheels one is larger, or both are and the other is
    smaller."""
    start, likelihood = decision.start, decision.end.likelihood
    singles = [i for i in np.argsort(-start.minus_log10_p) if not isinstance(start.screen.candidates[i].effect, Generic)]
    fits = []
    for i in singles[: 2 * _SHORTLIST]:
        candidate = start.screen.candidates[i]
        fits.append(fit(likelihood, {candidate: start.screen.start(candidate, start.w)}, iterations=6))
    best = min(fits, key=lambda f: f.deviance)
    return best.point if best.deviance - decision.named.deviance < max(2.0 * MARGIN, decision.least) else None


def _renamed(look, decision, point) -> Decision:
    """The Decision for other effects."""
    here = look(point, near=True)
    named = fit(here.likelihood, point)
    gains = {"total_gain": _gain_at(here, named), "first_gain": _gain_at(decision.start, named)}
    return replace(decision, end=here, named=named, **gains)


def compare(decision: Decision) -> None:
    """Try every look-alike in the place of every named effect, under the noise of the end."""
    likelihood, named = decision.end.likelihood, decision.named
    start = decision.start
    minus_log10_p = start.minus_log10_p
    margin = max(MARGIN, _RELATIVE_MARGIN * decision.total_gain)
    for effect in named.point:
        rest = {c: z for c, z in named.point.items() if c is not effect}
        rivals = []
        for i in np.argsort(-minus_log10_p):
            other = start.screen.candidates[i]
            if other.name == effect.name or isinstance(other.effect, Generic) or other.name in {c.name for c in rest}:
                continue
            if not start.screen.knows(effect) or start.screen.alike(effect, other) < 0.6 or minus_log10_p[i] < 1.3:
                continue
            fitted = fit(likelihood, {**rest, other: start.screen.start(other, start.w)}, iterations=6)
            behind = fitted.deviance - named.deviance + cost(other) - cost(effect)
            if behind < margin and all(r.candidate.name != other.name for r in rivals):
                rivals.append(Rival(other, behind))
        decision.rivals[effect] = rivals
