"""All effects looked at from one point: their signatures, the noise that none explains, and a screen of tests."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.explain.decide.generic import generics
from drake_ispace.explain.decide.signatures import Screen, Signature, signatures
from drake_ispace.explain.fit.candidates import Candidate, probes
from drake_ispace.explain.fit.directions import Directions
from drake_ispace.explain.fit.likelihood import Fit, Likelihood, Point, fit, merged
from drake_ispace.explain.fit.whitening import Whitening
from drake_ispace.explain.predict.prediction import Prediction, Residuals

#: (prediction, point, residuals there, pool) -> a signature for every amplitude of what has no name.
Unnamed = Callable[[Prediction, Point, Residuals, ThreadPoolExecutor | None], list[Signature]]
_ROUNDS = 2
_MOST_TURNS, _STAYS = 8, 0.3  # of noise and sizes found in turn; standard deviations by which a size may still move
BLOCK_ROWS = {"motion": 200, "room": 10}  # a second, within which noise may still be alike


@dataclass(frozen=True)
class View:
    """All that can be seen from one point before the noise is known: raw changes of the residuals.

    Attributes:
        found: signature of every effect. changes: of those that the noise is cleaned of. offsets: (run, change) of
            every nuisance of a run's own; tolerated: changes by whatever a sound robot may be off.
        sizes: natural size of each coordinate of each candidate.
    """

    prediction: Prediction
    found: list[Signature]
    changes: list[Residuals]
    offsets: list[tuple[int, dict[str, np.ndarray]]]
    tolerated: list[Residuals]
    sizes: Mapping[Candidate, Sequence[float]]
    pool: ThreadPoolExecutor | None

    def likelihood(self, residuals: Residuals, near: bool, start: Whitening | None = None) -> Likelihood:
        """Of the runs, with the noise that is in these residuals; start: noise of a point nearby."""
        return self.with_noise(noise_of(self, residuals, start), residuals, near)

    def with_noise(self, whitening: Whitening, residuals: Residuals, near: bool) -> Likelihood:
        """near: whether these residuals are nearly those of the best point, and can tell what the noise remembers."""
        offsets = whitening.directions(residuals, self.tolerated, self.offsets, self.pool)
        memory = whitening.memory(residuals) if near else ()
        return Likelihood(self.prediction, whitening, offsets, self.sizes, self.pool, memory)


@dataclass(frozen=True)
class Survey:
    """Where a model with the effects of `point` stands.

    Attributes:
        point: effects in the model. view: raw. residuals: left by it; w: the same, whitened. likelihood: with the noise
            of here. screen: tests of every candidate. minus_log10_p: of each of them in w. noise: (rows,) what none of them
            explains. instants: see Whitening.
    """

    point: Point
    view: View
    residuals: Residuals
    w: np.ndarray
    likelihood: Likelihood
    screen: Screen
    minus_log10_p: np.ndarray
    noise: np.ndarray
    instants: np.ndarray

    def moved(self, found: Fit) -> "Survey":
        """At a fit near by, under the same noise and with the same signatures."""
        return replace(self, point=found.point, w=found.w, minus_log10_p=self.screen.minus_log10_p(found.w))


def survey(
    prediction: Prediction, point: Point, tried: Sequence[Candidate], pool: ThreadPoolExecutor | None = None,
    whitening: Whitening | None = None, near: bool = False, unnamed: Unnamed = generics,
) -> Survey:
    """Look around `point`. whitening: that of another point, default fitted here. near: see View.with_noise. unnamed:
    what races with the effects that are tried."""
    base = prediction.residuals(merged(point), pool)
    view = _view(prediction, point, tried, base, pool, unnamed)
    likelihood = view.likelihood(base, near) if whitening is None else view.with_noise(whitening, base, near)
    return _survey(point, view, base, likelihood)


def doubted(here: Survey) -> Survey:
    """The same with the noise's own coefficients marginalised."""
    likelihood = here.view.with_noise(here.likelihood.whitening, here.residuals, near=True)
    return _survey(here.point, here.view, here.residuals, likelihood)


def _survey(point, view, residuals, likelihood) -> Survey:
    whitening = likelihood.whitening
    w = whitening(residuals)
    changes = whitening.directions(residuals, [s.change for s in view.found], pool=view.pool).everywhere
    screen = Screen(likelihood, view.found, changes)
    noise = _noise(likelihood, screen, w)
    screen.calibrate(noise, whitening.instants(residuals, BLOCK_ROWS))
    instants = whitening.instants(residuals)
    return Survey(point, view, residuals, w, likelihood, screen, screen.minus_log10_p(w), noise, instants)


def settled(view: View, start: Point) -> tuple[Likelihood, Fit]:
    """The best sizes of the effects in `start`, and the noise that is left by them, found in turn until they stay.

    What noise is taken for while a size is wrong holds the size back; a single fit would stop half-way.
    """
    point, whitening = start, None
    for _ in range(_MOST_TURNS):
        likelihood = view.likelihood(view.prediction.residuals(merged(point), view.pool), True, whitening)
        found = fit(likelihood, point)
        moves = [
            abs(found.point[c][i] - point[c][i]) / max(found.std(c, i, view.sizes), 1e-300) for c, i in found.order
        ]
        point, whitening = found.point, likelihood.whitening
        if max(moves, default=0.0) < _STAYS:
            break
    return likelihood, found


def _view(prediction, point, tried, base, pool, unnamed) -> View:
    scales = scales_of(prediction)
    names = {c.name for c in point}
    others = [c for c in tried if c.name not in names]
    sizes = {c: _sizes(c, scales) for c in tried}
    found = signatures(prediction, point, others, scales, base, pool) + unnamed(prediction, point, base, pool)
    steady = [s.change for s in found if not getattr(s.candidate.effect, "is_local", False)]
    noise, timing = (
        [_difference(base, other) for other in assumed(merged(point))]
        for assumed in (prediction.under_other_noise, prediction.under_other_timing)
    )
    changes = steady + _own_changes(prediction, point, sizes, base, pool) + timing
    offsets = prediction.nuisances(merged(point), pool)
    return View(prediction, found, changes, offsets, _tolerated(found, scales) + noise + timing, sizes, pool)


def _own_changes(prediction, point, sizes, base, pool):
    """What other sizes of the effects in `point` would change."""
    changes = []
    for candidate, z in point.items():
        for i, (low, high) in enumerate(candidate.bounds):
            step = 0.2 * max(abs(z[i] - candidate.neutral[i]), sizes[candidate][i])
            moved = [*z[:i], z[i] + step if z[i] + step <= high else max(z[i] - step, low), *z[i + 1 :]]
            raw = prediction.residuals(merged({**point, candidate: moved}), pool)
            if all(np.isfinite(part).all() for run in raw for part in run.values()):
                changes.append(_difference(base, raw))
    return changes


def scales_of(prediction: Prediction) -> dict[str, float]:
    """Root mean square of commanded torque [N m] and wheel speed [rad/s] over all runs."""
    wheels = prediction.replay.body.wheels
    commands = np.concatenate([track.command[: track.ticks] for track in prediction.tracks])
    turned = [track.measured[: track.ticks, :wheels] for track in prediction.tracks]
    speeds = np.concatenate([(angle[20::20] - angle[:-20:20]) / 0.1 for angle in turned])
    return {"torque": float(np.sqrt(np.mean(commands**2))) or 1.0, "speed": float(np.sqrt(np.mean(speeds**2))) or 1.0}


def _sizes(candidate, scales):
    found = probes(candidate, scales)
    neutral = candidate.neutral
    moved = [[abs(z[i] - neutral[i]) for z in found if z[i] != neutral[i]] for i in range(len(neutral))]
    return [min(sizes) if sizes else 1.0 for sizes in moved]


def _difference(base, other):
    return [{name: run[name] - rows for name, rows in before.items()} for before, run in zip(base, other, strict=True)]


def _tolerated(found, scales):
    """What each effect does to the residuals at the size that a sound robot may have."""
    changes, seen = [], set()
    for signature in found:
        candidate = signature.candidate
        at = signature.at
        if signature.z == candidate.neutral or (candidate, at) in seen or not candidate.parameters[at].tolerance:
            continue
        seen.add((candidate, at))
        parameter = candidate.parameters[at]
        share = parameter.tolerance * scales.get(parameter.scale, 1.0) / abs(signature.z[at] - candidate.neutral[at])
        changes.append([{name: share * rows for name, rows in run.items()} for run in signature.change])
    return changes


def noise_of(view: View, residuals: Residuals, start: Whitening | None = None) -> Whitening:
    """The noise of the residuals without what the changes and the offsets of `view` explain of them; start: noise that
    is nearly this already.

    Noise and explanation are found in turn. To take the explanation away first, by plain least squares, would let a
    signature pass for physics that only repeats how the noise itself is correlated.
    """
    classes = view.prediction.classes()
    whitening = start or Whitening(residuals, classes)
    for _ in range(1 if start else _ROUNDS):
        directions = whitening.directions(residuals, view.changes, view.offsets, view.pool)
        amounts = directions.least_squares(whitening(residuals))
        whitening = Whitening(without(residuals, amounts, view.changes, view.offsets), classes, len(amounts))
    return whitening


def without(
    residuals: Residuals, amounts: np.ndarray, changes: Sequence[Residuals],
    offsets: Sequence[tuple[int, dict[str, np.ndarray]]] = (),
) -> Residuals:
    """Residuals less so much of every change, then of every offset (run, change of its own)."""
    left = [{name: rows.copy() for name, rows in run.items()} for run in residuals]
    for amount, change in zip(amounts, changes, strict=False):
        for run, part in zip(left, change, strict=True):
            for name in run:
                run[name] -= amount * part[name]
    for amount, (i, change) in zip(amounts[len(changes) :], offsets, strict=True):
        for name in left[i]:
            left[i][name] -= amount * change[name]
    return left


def _noise(likelihood, screen, w):
    """What no signature and no offset explains of `w`, of unit variance again."""
    offsets = likelihood.offsets
    every = Directions(np.vstack([screen.changes, offsets.everywhere]), offsets.own)
    left = w - every.combined(every.least_squares(w))
    return left * np.sqrt(len(w) / max(len(w) - len(every), 1))
