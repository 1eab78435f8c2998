"""Changes of the residuals by effects and nuisances around one point, and the noise that none explains."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from drake_ispace.explain.decide.survey.generic import Generics
from drake_ispace.explain.decide.survey.signatures import Signature, difference, is_finite, signatures
from drake_ispace.explain.fit.candidates import Candidate, probes
from drake_ispace.explain.fit.changes import Changes, Marginal, added_up, without
from drake_ispace.explain.fit.directions import errors_of
from drake_ispace.explain.fit.likelihood import Likelihood, Point, merged
from drake_ispace.explain.fit.offsets import Stack, members, offsets_of, stacks_of, stacks_of_runs
from drake_ispace.explain.fit.whitening import Whitening, is_bounded
from drake_ispace.explain.predict.case import part_of
from drake_ispace.explain.predict.prediction import Prediction, Residuals, Speeds, wheel_speeds
from drake_ispace.explain.threads import each

FORM_SHARE = 0.025  # standard deviation of an effect's form, as a share of the effect: no model has the exact one
_ROUNDS = 2  # in which noise and what explains it are learned in turn
_ERRORS = 4  # by which those of all amounts are represented


@dataclass(frozen=True)
class View:
    """Changes of the residuals around one point, before the noise is known.

    Attributes:
        prediction: model and runs. signatures: of every effect and every generic disagreement. changes: those that
            are explained away while the noise is learned. offset_stacks: per run, changes by every nuisance of it.
            tolerated_stacks: per run, changes by what a sound robot may be off. assumed_stacks: per run, changes by
            other assumptions about noise. sizes: natural size of each coordinate of each candidate.
    """

    prediction: Prediction
    signatures: list[Signature]
    changes: list[Residuals]
    by_sizes: list[Residuals]
    offset_stacks: list[Stack]
    tolerated_stacks: list[Stack]
    assumed_stacks: list[Stack]
    sizes: Mapping[Candidate, Sequence[float]]

    @property
    def offsets(self) -> list[tuple[int, dict[str, np.ndarray]]]:
        """(run, change) of every nuisance of a single run."""
        return [(i, change) for i, stack in enumerate(self.offset_stacks) for change in members(stack)]

    def assuming_at(self, point: Point, residuals: Residuals) -> "View":
        """The View whose changes by other assumptions about noise are those of the `residuals` at `point`.

        Where an effect is missing, a filter with other gains follows it otherwise: the change looks like the effect.
        """
        return replace(self, assumed_stacks=_by_assumptions(self.prediction, point, residuals))

    def of_run(self, i: int) -> "View":
        """The View of one of its runs."""
        own = lambda changes: [[change[i]] for change in changes]  # noqa: E731
        return replace(
            self, prediction=part_of(self.prediction, slice(i, i + 1)),
            signatures=[replace(signature, change=[signature.change[i]]) for signature in self.signatures],
            changes=own(self.changes), by_sizes=own(self.by_sizes),
            offset_stacks=self.offset_stacks[i : i + 1], tolerated_stacks=self.tolerated_stacks[i : i + 1],
            assumed_stacks=self.assumed_stacks[i : i + 1],
        )

    def regression(self, whitening: Whitening, residuals: Residuals) -> "Regression":
        """Least squares by all changes and offsets, under this noise."""
        changes = Changes(whitening, residuals, self.changes)
        return Regression(whitening, Marginal(changes, offsets_of(whitening, residuals, [], self.offset_stacks)))

    def errors(self, regression: "Regression", residuals: Residuals) -> list[Residuals]:
        """What errors of the amounts of a regression add up to, together as large as is expected."""
        offsets, amounts = self.offsets, errors_of(regression.marginal.gram, _ERRORS)
        return each(lambda error: added_up(residuals, error, self.changes, offsets), amounts)

    def likelihood(
        self, point: Point, residuals: Residuals, near: bool, start: "Regression | None" = None
    ) -> Likelihood:
        """The Likelihood of the runs with the noise of these residuals, at `point`.

        near: as in `with_noise`. start: as in `noise_of`.
        """
        return self.with_noise(noise_of(self, point, residuals, start), residuals, near)

    def with_noise(
        self, whitening: Whitening, residuals: Residuals, near: bool, flaws: Sequence[Residuals] = ()
    ) -> Likelihood:
        """The Likelihood of the runs with this noise.

        near: whether the residuals are nearly those of the best point. Only then is their past the noise's memory, and
            the memory is marginalised. flaws: further changes to be tolerated, one standard deviation each.
        """
        everywhere = [self.tolerated_stacks, self.assumed_stacks, stacks_of(flaws, residuals)]
        offsets = offsets_of(whitening, residuals, everywhere, self.offset_stacks)
        memory = whitening.memory(residuals) if near else ()
        return Likelihood(self.prediction, whitening, offsets, self.sizes, memory)


@dataclass(frozen=True)
class Regression:
    """Least squares by changes of the residuals under a noise, the same for all sizes of the effects.

    Attributes:
        whitening: the noise. marginal: products of the changes and offsets.
    """

    whitening: Whitening
    marginal: Marginal

    def amounts(self, residuals: Residuals) -> np.ndarray:
        """How much of every change is in the residuals."""
        return self.marginal.least_squares(self.whitening(residuals))

    def is_overfitted(self, residuals: Residuals, name: str) -> bool:
        """Whether the changes explain more than half of a stream whatever is in it: what they leave is no noise."""
        if is_bounded(name):
            return False
        which = self.whitening.of_stream(residuals, name)
        numbers = np.count_nonzero(which)
        return 2 * len(self.marginal.gram) > numbers and 2.0 * self.marginal.spent_on(which) > numbers


def view_from(
    prediction: Prediction, point: Point, candidates: Sequence[Candidate], base: Residuals,
    generics: Generics, at: Mapping[Candidate, Sequence[list[float]]] = MappingProxyType({}),
) -> View:
    """The View around `point`.

    Args:
        prediction: model and runs. point: effects that the model has. candidates: effects to try; those in `point`
            are not tried again. base: residuals at `point`. generics: signatures of generic disagreements.
        at: as of `signatures`.
    """
    scales = scales_of(prediction)
    named = {c.name for c in point}
    others = [c for c in candidates if c.name not in named]
    sizes = {c: _sizes(c, scales) for c in candidates}
    tested = signatures(prediction, point, others, scales, base, at) + generics(prediction, point, base)
    steady = [s.change for s in tested if not s.candidate.effect.is_local]
    timing = [difference(other, base) for other in prediction.under_other_timing(merged(point))]
    by_sizes = _changes_by_sizes(prediction, point, sizes, base)
    offsets = stacks_of_runs(prediction.nuisances(merged(point)), base)
    tolerated, assumed = stacks_of(_tolerated(tested, scales) + timing, base), _by_assumptions(prediction, point, base)
    return View(prediction, tested, steady + by_sizes + timing, by_sizes, offsets, tolerated, assumed, sizes)


def _by_assumptions(prediction, point, residuals):
    """Per run, changes of the residuals at `point` by each other assumption about noise."""
    changes = [difference(other, residuals) for other in prediction.under_other_noise(merged(point))]
    return stacks_of(changes, residuals)


def scales_of(prediction: Prediction) -> dict[str, float]:
    """The scales of effects' parameters: RMS of torque [N m] and wheel speed [rad/s] over all runs, and top speed."""
    wheels = prediction.replay.body.wheels
    commands = np.concatenate([track.command[: track.ticks] for track in prediction.tracks])
    speeds = np.concatenate([wheel_speeds(track.measured[: track.ticks, :wheels]) for track in prediction.tracks])
    torque, speed = (float(np.sqrt(np.mean(numbers**2))) or 1.0 for numbers in (commands, speeds))
    top_speed = float(np.abs(speeds).max()) or 1.0
    return {
        "torque": torque, "1/torque": 1.0 / torque, "speed": speed, "torque/speed": torque / speed,
        "top speed": top_speed,
    }


def _sizes(candidate, scales):
    """Natural size of each coordinate: the smallest step of a probe, 1 where no probe moves it."""
    at, neutral = probes(candidate, scales), candidate.neutral
    steps = [[abs(z[i] - neutral[i]) for z in at if z[i] != neutral[i]] for i in range(len(neutral))]
    return [min(sizes) if sizes else 1.0 for sizes in steps]


def _changes_by_sizes(prediction, point, sizes, base):
    """Changes of the residuals by other sizes of the effects in `point`."""
    changes = []
    for candidate, z in point.items():
        for i, (low, high) in enumerate(candidate.bounds):
            step = 0.2 * max(abs(z[i] - candidate.neutral[i]), sizes[candidate][i])
            moved = [*z[:i], z[i] + step if z[i] + step <= high else max(z[i] - step, low), *z[i + 1 :]]
            change = difference(prediction.residuals(merged({**point, candidate: moved})), base)
            if is_finite(change):
                changes.append(change)
    return changes


def _tolerated(signatures, scales):
    """Changes of the residuals by each effect at the size that a sound robot may have."""
    changes, seen = [], set()
    for signature in signatures:
        candidate, at = signature.candidate, signature.at
        if signature.z == candidate.neutral or (candidate, at) in seen:
            continue
        seen.add((candidate, at))
        tolerance = candidate.tolerances(scales)[at]
        if not tolerance or candidate.parameters[at].reciprocal:  # a limit has one sign
            continue
        share = tolerance / abs(signature.z[at] - candidate.neutral[at])
        changes.append([{name: share * rows for name, rows in run.items()} for run in signature.change])
    return changes


def flaws_of_form(view: View, point: Point) -> list[Residuals]:
    """Changes of the residuals if an effect of `point` were a little larger or smaller with speed, load, time or place.

    No model has the robot's exact form; what such a flaw leaves is not to be taken for a further effect.
    """
    changes, modulations = [], view.prediction.modulations()
    residuals = view.prediction.residuals(merged(point))
    for candidate in point:
        others = {c: z for c, z in point.items() if c is not candidate}
        whole = difference(view.prediction.residuals(merged(others)), residuals)
        if is_finite(whole):
            changes += [
                [
                    {name: FORM_SHARE * rows * by.get(name, 0.0) for name, rows in run.items()}
                    for run, by in zip(whole, modulation, strict=True)
                ] for modulation in modulations
            ]
    return changes


def noise_of(
    view: View, point: Point, residuals: Residuals, start: Regression | None = None, speeds: Speeds | None = None,
    sound: bool = False,
) -> Whitening:
    """The noise of the residuals at `point` without what the changes and the offsets of `view` explain of them.

    start: from noise that is nearly right already. Otherwise noise and explanation are learned in turn. If plain least
    squares took the explanation away first, a signature that only repeats how the noise is correlated could pass for
    physics. speeds: by which moments are scored, as in `Prediction.classes`.

    sound: whether nothing is missing at `point`. What is taken away is then noise, in short runs nearly all that is
    slow, and as much as is expected of it counts as noise: each turn is a step of expectation and maximisation
    (Dempster, Laird and Rubin, J. Royal Statistical Society B 39, 1977).
    """
    classes, ticks = view.prediction.classes(merged(point), speeds), view.prediction.row_ticks
    whitening = start.whitening if start else Whitening(residuals, classes, ticks=ticks)
    for _ in range(1 if start else _ROUNDS):
        regression = start or view.regression(whitening, residuals)
        amounts = regression.amounts(residuals)
        left = without(residuals, amounts, view.changes, view.offsets)
        if sound:
            whitening = Whitening(left, classes, ticks=ticks, errors=view.errors(regression, residuals))
            continue
        for name in whitening.noise:
            if regression.is_overfitted(residuals, name):
                for run, own in zip(left, residuals, strict=True):
                    run[name] = own[name]
        whitening = Whitening(left, classes, len(amounts), ticks)
    return whitening
