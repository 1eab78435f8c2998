"""Tests of all effects from one point, under the noise that no effect explains there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from drake_ispace.explain.decide.survey.generic import Generics, generic_signatures
from drake_ispace.explain.decide.survey.screen import Screen
from drake_ispace.explain.decide.survey.signatures import is_finite
from drake_ispace.explain.decide.survey.view import View, flaws_of_form, noise_of, view_from
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.changes import Changes, Marginal
from drake_ispace.explain.fit.likelihood import Fit, Likelihood, Point, covariance_of, fit, merged
from drake_ispace.explain.fit.shift import with_best_shift
from drake_ispace.explain.fit.whitening import Whitening
from drake_ispace.explain.levels import BLOCK_TICKS, CERTAIN
from drake_ispace.explain.predict.prediction import Prediction, Residuals, Speeds, past_speeds

MOST_TURNS = 8  # in which noise and sizes are fitted
STAYS = 0.3  # standard deviations by which a size may still move in the last turn


@dataclass(frozen=True)
class Survey:
    """Tests of all effects for a model that has the effects of `point`.

    Attributes:
        point: effects in the model. view: changes of the residuals. residuals: of the model; w: (rows,) the residuals
            whitened. likelihood: of the runs, with the noise at this point. tested: the same where effects of `point`
            may have any size; what other sizes could explain says nothing for another effect. changes: of the residuals
            by the signatures. Both are None where they were let go. screen: tests of every candidate. products: (k,) of
            w with what is left of each signature.
        noise: (rows,) what no candidate explains of w. by_instant: (k, instants) products with the noise.
    """

    point: Point
    view: View
    residuals: Residuals
    w: np.ndarray
    likelihood: Likelihood
    tested: Likelihood | None
    changes: Changes | None
    screen: Screen
    products: np.ndarray
    noise: np.ndarray
    by_instant: np.ndarray

    @property
    def minus_log10_p(self) -> np.ndarray:
        """(candidates,) of the score test of each candidate of the screen in w."""
        return self.screen.minus_log10_p(self.products)

    @property
    def channels(self) -> np.ndarray:
        """(rows,) the channel that each row belongs to, such as "kinect: x"."""
        return np.concatenate([
            np.tile(np.array(self.view.prediction.labels(name), dtype=object), noise.rows(run[name]))
            for run in self.residuals for name, noise in self.likelihood.whitening.noise.items()
        ])

    @property
    def runs(self) -> np.ndarray:
        """(rows,) the number of the run that each row belongs to."""
        return np.concatenate([
            np.full(noise.rows(run[name]) * run[name].shape[1], i)
            for i, run in enumerate(self.residuals) for name, noise in self.likelihood.whitening.noise.items()
        ])

    def moved(self, best: Fit) -> "Survey":
        """The Survey at a fit nearby, under the same noise and with the same signatures."""
        products = self.changes.dot(self.tested.marginalised(best.w))
        return replace(self, point=best.point, w=best.w, products=products)

    def light(self) -> "Survey":
        """The Survey without the changes of the residuals: nothing can be surveyed or moved from it any more."""
        screen = self.screen.light()
        none = {"changes": [], "by_sizes": [], "offset_stacks": [], "tolerated_stacks": [], "assumed_stacks": []}
        view = replace(self.view, signatures=screen.signatures, **none)
        nothing = np.empty((len(screen.signatures), 0))
        return replace(self, view=view, tested=None, changes=None, screen=screen, by_instant=nothing)

    def gain_of(self, point: Point) -> float:
        """Drop in deviance by the effects of `point` against a model without any, under the noise of this survey."""
        likelihood = self.likelihood
        return likelihood.deviance(likelihood.whitened({})) - likelihood.deviance(likelihood.whitened(point))


def survey(
    prediction: Prediction, point: Point, candidates: Sequence[Candidate],
    whitening: Whitening | None = None, near: bool = False, generics: Generics = generic_signatures,
    at: Mapping[Candidate, Sequence[list[float]]] = MappingProxyType({}), assuming: Point | None = None,
) -> Survey:
    """Test all effects for a model that has those of `point`.

    Args:
        prediction: model and runs. candidates: effects to try.
        whitening: noise, default that of the residuals at `point`. near: whether `point` is nearly the best one, so
            that the noise's memory is marginalised. generics: signatures of what competes with the candidates.
        at: further probes of some candidates. assuming: effects with which other assumptions about noise change the
            residuals, default those of `point`.
    """
    base = prediction.residuals(merged(point))
    view = view_from(prediction, point, candidates, base, generics, at)
    if assuming is not None:
        view = view.assuming_at(assuming, prediction.residuals(merged(assuming)))
    likelihood = view.likelihood(point, base, near) if whitening is None else view.with_noise(whitening, base, near)
    return _survey(point, view, base, likelihood)


def survey_of(view: View, point: Point) -> Survey:
    """Test the effects of a View, taken near `point`, for a model that has those of `point`."""
    base = view.prediction.residuals(merged(point))
    return _survey(point, view, base, view.likelihood(point, base, near=False))


def with_memory_marginalised(survey: Survey) -> Survey:
    """The Survey at the same point and with the same noise, whose memory is marginalised."""
    likelihood = survey.view.with_noise(survey.likelihood.whitening, survey.residuals, near=True)
    return _survey(survey.point, survey.view, survey.residuals, likelihood)


def with_noise_of_nothing_more(survey: Survey, speeds: Speeds | None = None) -> Survey:
    """The Survey at the same point, with the noise that the residuals have if nothing more is missing there.

    speeds: by which moments are scored, as in `Prediction.classes`.
    """
    whitening = noise_of(survey.view, survey.point, survey.residuals, speeds=speeds, sound=True)
    likelihood = survey.view.with_noise(whitening, survey.residuals, near=bool(survey.likelihood.memory))
    return _survey(survey.point, survey.view, survey.residuals, likelihood)


def with_past_speeds(survey: Survey) -> Survey:
    """As `with_noise_of_nothing_more`, of moments chosen by past speeds.

    Speeds around a moment contain later counts, whose rounding is in the residuals too. Moments at which a wheel has
    just come to rest are scored here, so that sizes are not to be taken from this Survey.
    """
    return with_noise_of_nothing_more(survey, past_speeds)


def with_flaws(survey: Survey) -> Survey:
    """The Survey at the same point, where small flaws in the form of its effects are nuisances, too."""
    residuals = survey.likelihood.raw(survey.point)
    return _survey(survey.point, survey.view, residuals, likelihood_with_flaws(survey, residuals, survey.point))


def likelihood_with_flaws(survey: Survey, residuals: Residuals, point: Point) -> Likelihood:
    """The Likelihood near `residuals`, where small flaws in the form of the effects of `point` are nuisances, too."""
    flaws = flaws_of_form(survey.view, point)
    return survey.view.with_noise(survey.likelihood.whitening, residuals, near=True, flaws=flaws)


def _survey(point, view, residuals, likelihood) -> Survey:
    whitening = likelihood.whitening
    w = whitening(residuals)
    changes = Changes(whitening, residuals, [s.change for s in view.signatures])
    tested = likelihood
    if view.by_sizes:
        by_sizes = Changes(whitening, residuals, view.by_sizes)
        tested = likelihood.freed(np.hstack([by_sizes.of_run(i) for i in range(len(residuals))]))
    marginal = Marginal(changes, tested.offsets, tested.memory, tested.remembered, tested.inner)
    screen, products = Screen(view.signatures, marginal.inner), changes.dot(tested.marginalised(w))
    noise = _unexplained(tested, marginal, screen, w, products)
    instants = whitening.instants(residuals)
    by_instant = marginal.by_instant(noise, instants).astype(np.float32)
    first = np.flatnonzero(np.diff(instants, prepend=-1))
    blocks = np.flatnonzero(np.diff(blocks_of(view.prediction, whitening, residuals)[first], prepend=-1))
    screen.calibrate(np.add.reduceat(by_instant, blocks, axis=1))
    if _are_few(marginal, w):  # to leave a candidate out because it happens to explain most would make noise small
        by_instant = marginal.by_instant(tested.marginalised(w), instants).astype(np.float32)
    return Survey(point, view, residuals, w, likelihood, tested, changes, screen, products, noise, by_instant)


def blocks_of(prediction: Prediction, whitening: Whitening, residuals: Residuals) -> np.ndarray:
    """(n,) number of the second, of a stream of a run, that each whitened number is of: noise may be correlated in it.
    """
    apart = np.concatenate([np.diff(track.fix_ticks) for track in prediction.tracks])
    row_ticks = {"motion": prediction.row_ticks, "room": np.median(apart) if apart.size else BLOCK_TICKS}
    together = {name: max(int(BLOCK_TICKS // ticks), 1) for name, ticks in row_ticks.items()}
    return whitening.instants(residuals, together)


def _unexplained(tested, marginal, screen, w, products):
    """(rows,) what no signature and no offset explains of `w`, scaled to unit variance again.

    Where these would explain more than half of `w` whatever it is, what the clearest candidate and nuisances leave.
    """
    if not _are_few(marginal, w):
        left, spent = w - marginal.combined(marginal.least_squares(w)), len(marginal.gram)
    else:
        amounts, which = np.zeros(len(marginal.gram)), screen.clearest(products)
        amounts[which], spent = screen.amounts(which, products), len(which)
        left = tested.marginalised(w - marginal.combined(amounts))
    return left * np.sqrt(len(w) / max(len(w) - spent, 1))


def _are_few(marginal, w):
    """Whether all signatures and offsets together would explain more than half of `w` whatever it is."""
    return 2 * len(marginal.gram) > len(w)


def fit_with_noise(view: View, start: Point) -> tuple[Likelihood, Fit]:
    """Fit the effects of `start` and the noise in turn until the sizes stay; the Likelihood with that noise, the Fit.

    Noise that was learned while a size was wrong holds the size back or drives it too far, so that a single fit would
    stop half-way, and fits in turn could go to and fro. Each turn therefore begins where the turns so far let sizes be
    expected that stay. If none does, the turn counts in which sizes moved least. If they moved far even there, it is
    tried with the noise's memory left in: to remove it hides effects that are far from their best sizes.
    """
    steadiest = _in_turns(view, start, near=True)
    if not steadiest[0] < CERTAIN:
        steadiest = min(steadiest, _in_turns(view, start, near=False), key=lambda found: found[0])
    return steadiest[1:]


def _in_turns(view, start, near) -> tuple[float, Likelihood, Fit]:
    """As `fit_with_noise`; before both, by how many standard errors a size moved in the steadiest turn."""
    point, regression, begun, ended, least = start, None, [], [], np.inf
    residuals = view.prediction.residuals(merged(point))
    for _ in range(MOST_TURNS):
        likelihood = view.assuming_at(point, residuals).likelihood(point, residuals, near=near, start=regression)
        best = fit(likelihood, _with_best_shifts(likelihood, point))
        sizes = np.array([view.sizes[c][i] for c, i in best.order])
        stds = np.maximum(np.sqrt(np.maximum(np.diag(covariance_of(likelihood, best)), 0.0)) * sizes, 1e-300)
        begun.append([point[c][i] for c, i in best.order])
        ended.append([best.point[c][i] for c, i in best.order])
        move = np.max(np.abs(np.subtract(ended[-1], begun[-1])) / stds, initial=0.0)
        if not move >= least:
            least, steadiest = move, (move, likelihood, best)
        if move < STAYS:
            break
        step = expected_to_stay(begun / stds, ended / stds) * stds - ended[-1]
        regression = regression or view.regression(likelihood.whitening, residuals)
        point = likelihood.moved(best.point, best.order, step / sizes)
        residuals = view.prediction.residuals(merged(point))
        if not is_finite(residuals):  # the model runs away where sizes were expected to stay
            point, residuals = best.point, view.prediction.residuals(merged(best.point))
    return steadiest


def _with_best_shifts(likelihood, point) -> Point:
    """The point with every shift in time where the deviance is least under this noise."""
    for candidate in point:
        if candidate.shifts:
            point = with_best_shift(likelihood, point, candidate)
    return point


def expected_to_stay(begun: np.ndarray, ended: np.ndarray) -> np.ndarray:
    """(k,) where turns (n, k) that lead from `begun` to `ended` would lead nowhere else, were they linear.

    Anderson's acceleration of a fixed-point iteration (J. ACM 12, 1965), with all turns.
    """
    moves = np.subtract(ended, begun)
    amounts = np.linalg.lstsq(np.diff(moves, axis=0).T, moves[-1], rcond=None)[0]
    return ended[-1] - amounts @ np.diff(ended, axis=0)
