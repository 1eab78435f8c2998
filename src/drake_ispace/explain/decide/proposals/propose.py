"""Propose effects: those that score tests favour, fitted together with the effects that the model has."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.decide.proposals.where import start_in_room
from drake_ispace.explain.decide.survey.generic import Generic
from drake_ispace.explain.decide.survey.screen import minus_log10_p_of_gain
from drake_ispace.explain.decide.survey.survey import Survey
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Fit, Likelihood, Point, fit
from drake_ispace.explain.fit.limits import has_several_limits, with_best_limits
from drake_ispace.explain.fit.shift import with_best_shift
from drake_ispace.explain.threads import each

SHORTLIST = 6  # effects that are fitted, besides limits like the clearest


@dataclass(frozen=True)
class Proposal:
    """An effect of the library, fitted.

    Attributes:
        candidate: the effect. fit: of it and the effects that the model has. gain: drop in deviance over the
            overdispersion; noise alone gains about 1 per parameter. penalised_drop: drop in deviance by its signatures,
            or by its fit where it acts in a part of the room, less the complexity penalty; to compare with a generic
            disagreement. minus_log10_p: of the gain.
    """

    candidate: Candidate
    fit: Fit
    gain: float
    penalised_drop: float
    minus_log10_p: float

    @property
    def penalised_gain(self) -> float:
        """The gain less the complexity penalty."""
        return self.gain - penalty(self.candidate)


def proposals_of(survey: Survey) -> list[Proposal]:
    """The effects that could explain most, the clearest score test first; without those that have become another.

    A limit that looks like the clearest effect is one of them, whatever its score: it looks otherwise at every size.
    """
    screen, likelihood = survey.screen, survey.likelihood
    base = likelihood.deviance(survey.w)
    every = clearest_effects(survey)
    clearest = every[:SHORTLIST] + [one for one in every[SHORTLIST:] if _is_a_limit_like(one[0], every[0][0])]
    best = fits_beside(survey.point, [candidate for candidate, _ in clearest], survey, likelihood)
    proposals = []
    for (candidate, minus_log10_p), fitted in zip(clearest, best, strict=True):
        if candidate.has_become_another(fitted.point[candidate]):
            continue
        drop = max(base - fitted.deviance, 0.0)
        gain = drop / screen.overdispersion_of(candidate)
        clear = minus_log10_p_of_gain(gain, len(candidate.parameters))
        if candidate.effect.is_local:  # whose fit has searched for a place
            clear = min(clear, minus_log10_p)
        else:  # whose signature is that of the place at which the fit began
            drop = min(drop, screen.joint_drop(candidate, survey.products))
        proposals.append(Proposal(candidate, fitted, gain, drop - penalty(candidate), clear))
    return proposals


def _is_a_limit_like(candidate, clearest) -> bool:
    """Whether an effect is a limit, and a look-alike of the clearest one."""
    return candidate.name in clearest.effect.card.look_alikes and any(p.reciprocal for p in candidate.parameters)


def clearest_effects(survey: Survey) -> list[tuple[Candidate, float]]:
    """(effect of the library, -log10 p of its score test), the largest first.

    One that generalises another does not stand beside it. One that acts in a part of the room comes once: its fit goes
    on from where it explains most.
    """
    found, ranked, names = survey.minus_log10_p, [], set()
    for i in np.argsort(-found):
        candidate = survey.screen.candidates[i]
        if isinstance(candidate.effect, Generic) or (candidate.effect.is_local and candidate.name in names):
            continue
        if not any(candidate.generalises(other) or other.generalises(candidate) for other in survey.point):
            ranked.append((candidate, found[i]))
            names.add(candidate.name)
    return ranked


def fits_beside(
    rest: Point, candidates: Sequence[Candidate], survey: Survey, likelihood: Likelihood, iterations: int = 12
) -> list[Fit]:
    """The Fit of each of `candidates` beside the effects of `rest`, from where it explains most in the survey.

    likelihood: of the fits. iterations: of each, at most.
    """
    return fits_of([[candidate] for candidate in candidates], survey, likelihood, iterations, rest)


def fits_of(
    sets: Sequence[Sequence[Candidate]], survey: Survey, likelihood: Likelihood, iterations: int = 12,
    rest: Point | None = None,
) -> list[Fit]:
    """The Fit of each set of candidates, beside the effects of `rest`; others: as of `fits_beside`."""
    def start(candidates):
        """Where the fit of the candidates should begin."""
        point = dict(rest or {})
        for candidate in candidates:
            if candidate.effect.is_local:
                point[candidate] = _placed(survey, candidate)
            elif candidate.shifts:
                point = with_best_shift(likelihood, {**point, candidate: list(candidate.neutral)}, candidate)
            else:
                point[candidate] = survey.screen.start(candidate, survey.products)
                if has_several_limits(candidate):
                    point = with_best_limits(likelihood, point, candidate, survey.screen.probes_of(candidate))
        return point

    return each(lambda candidates: fit(likelihood, start(candidates), iterations), sets)


def _placed(survey, candidate) -> list[float]:
    """The best size and edges with edges as soft as usual; were they free, soft ones would hide that they are off."""
    point = {**survey.point, candidate: start_in_room(survey, candidate)}
    return fit(survey.likelihood, point, held=(candidate, len(candidate.parameters) - 1)).point[candidate]


def penalty(candidate: Candidate) -> float:
    """Complexity penalty in deviance: 2 per parameter, and 2 ln n for a free choice among n wheels or places."""
    return 2.0 * len(candidate.parameters) + 2.0 * np.log(candidate.among)
