"""The Explanation of what was decided: names, sizes with intervals, where it shows, what these runs cannot show."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student_t

from drake_ispace.explain.answer.confirm import drift, on_bound
from drake_ispace.explain.answer.explanation import (
    DetectionResult,
    Estimate,
    Explanation,
    NamedEffect,
    Unknown,
    Untestable,
    Validated,
)
from drake_ispace.explain.answer.free_run import Sizes, unit_of
from drake_ispace.explain.answer.localize import localize, onset
from drake_ispace.explain.answer.next_experiment import needs, next_experiment
from drake_ispace.explain.answer.validate import Choice
from drake_ispace.explain.decide.decision import Decision, LeftOver
from drake_ispace.explain.decide.generic import Generic
from drake_ispace.explain.decide.view import without
from drake_ispace.explain.fit.candidates import Candidate, value_of
from drake_ispace.explain.fit.profile import profile_interval
from drake_ispace.explain.predict.prediction import Residuals
from drake_ispace.explain.predict.replay import Replay

_VISIBLE = 3.0  # length of an effect's signature at its largest probe, in noise, from which on these runs can show it
_FORM_SHARE = 0.025  # of a parameter: how far its estimate is off because no model has exactly the robot's form


def described(case, decision: Decision) -> Explanation:
    """The Explanation of a Case before anything is added and confirmed."""
    start, named = decision.start, decision.named
    found = decision.detection
    detection = DetectionResult(found.p_value, found.threshold, found.false_alarm_rate, found.minus_log10_p)
    left = _left(decision)
    places = localize(case.prediction, start, left) if found.found else []
    effects = [] if named is None else [_named(case, decision, candidate) for candidate in named.point]
    unknown = None if decision.unknown is None else _unknown(decision, left)
    verdict = "none"
    if unknown is not None:
        verdict = "unknown"
    elif effects:
        verdict = "set" if any(effect.equivalents for effect in effects) else "named"
    untestable = _untestable(case, decision)
    warnings = drift(decision) if named is not None else []
    for channel in sorted(frozenset.intersection(*(t.has for t in case.prediction.tracks)) - case.replay.feeds):
        warnings.append(f"channel {channel} was not used, because not every held-out run has it")
    if decision.left_over is not None:
        warnings.append(_besides(decision.left_over, decision.total_gain))
    return Explanation(
        verdict, effects, detection, places, untestable, unknown=unknown, warnings=warnings + _on_bounds(effects),
        next_experiment=next_experiment(effects, unknown, untestable if verdict == "none" else []),
    )


def described_choice(case, choice: Choice) -> Explanation:
    """The Explanation of a Case whose effects were chosen by validation, before it is confirmed."""
    effects = [_chosen(case, choice, candidate) for candidate in choice.named]
    validated = [
        Validated([candidate.label for candidate in names], error, unit_of(case.replay))
        for names, error in choice.errors.items()
    ]
    verdict = "set" if choice.rivals else "named" if effects else "none"
    return Explanation(
        verdict, effects, None, [], [], validated=validated, warnings=_on_bounds(effects),
        next_experiment=next_experiment(effects, None, []),
    )


def with_free_run(effects: Sequence[NamedEffect], replay: Replay, sizes: Sizes) -> list[NamedEffect]:
    """The effects with the sizes that simulate best beside their estimates."""
    free = {
        (candidate.name, parameter.name): _size(replay, candidate, i, z[i])
        for candidate, z in sizes.point.items() for i, parameter in enumerate(candidate.parameters)
    }
    return [
        replace(effect, parameters={
            name: replace(p, free_run=free.get((effect.name, name))) for name, p in effect.parameters.items()
        }) for effect in effects
    ]


def _on_bounds(effects):
    return [
        f"{name} of {effect.name} sits on its bound" for effect in effects
        for name, p in effect.parameters.items() if p.on_bound
    ]


def _besides(left: LeftOver, explained: float) -> str:
    effect = left.candidate.effect
    what = f"a {effect.link} that goes with {effect.driver}" if isinstance(effect, Generic) else left.candidate.name
    share = 100.0 * left.gain / max(left.gain + explained, 1e-12)
    return f"besides, perhaps {what} (p = {left.p_value:.2g}, {share:.0f} % of what is explained)"


def _left(decision) -> Residuals:
    """Residuals of the best explanation, with a name or without; as they are where there is none."""
    start = decision.start
    if decision.named is not None:
        return start.likelihood.raw(decision.named.point)
    if decision.unknown is None:
        return start.residuals
    return without(start.residuals, *start.screen.use_of(decision.unknown[0], start.w))


def _named(case, decision, candidate: Candidate) -> NamedEffect:
    named, card = decision.named, candidate.effect.card
    likelihood = decision.end.likelihood
    parameters = {name: Estimate(wheel, (wheel, wheel), "wheel") for name, wheel in candidate.choices}
    overdispersion = decision.start.screen.overdispersion_of(candidate)
    for i, (parameter, z) in enumerate(zip(candidate.parameters, named.point[candidate], strict=True)):
        form = 1.645 * _FORM_SHARE * abs(z - candidate.neutral[i])
        lower, upper = profile_interval(likelihood, named, candidate, i, 1.645**2 * overdispersion)
        ends = z - np.hypot(z - lower, form), z + np.hypot(upper - z, form)
        parameters[parameter.name] = _estimate(case.replay, named, candidate, i, ends)
    rivals = list(dict.fromkeys(rival.candidate.name for rival in decision.rivals.get(candidate, [])))
    share = decision.gains.get(candidate, 0.0) / max(decision.total_gain, 1e-12)
    return NamedEffect(card.name, card.home, rivals, parameters, float(min(share, 1.0)), card.excitation)


def _chosen(case, choice, candidate) -> NamedEffect:
    card, sizes = candidate.effect.card, choice.sizes
    z = sizes.point[candidate]
    parameters = {name: Estimate(wheel, (wheel, wheel), "wheel") for name, wheel in candidate.choices}
    factor = student_t.ppf(0.95, len(case.prediction.tracks) - 1)
    for i, parameter in enumerate(candidate.parameters):
        reach = factor * sizes.stds[candidate, i]
        parameters[parameter.name] = _estimate(
            case.replay, sizes, candidate, i, (z[i] - reach, z[i] + reach)
        )
    others = {c.name for rival in choice.rivals if candidate not in rival for c in rival}
    rest = tuple(c for c in choice.named if c is not candidate)
    gains = [choice.errors[names] ** 2 - choice.errors[choice.named] ** 2 for names in (rest, ())]
    share = float(np.clip(gains[0] / gains[1], 0.0, 1.0))
    equivalents = sorted(others - {c.name for c in choice.named})
    return NamedEffect(card.name, card.home, equivalents, parameters, share, card.excitation)


def _estimate(replay, found, candidate, i, ends) -> Estimate:
    """Of a coordinate of `found` (a Fit or Sizes) whose interval ends at `ends`."""
    low, high = candidate.bounds[i]
    lower, upper = sorted(_size(replay, candidate, i, min(max(end, low), high)) for end in ends)
    at = _size(replay, candidate, i, found.point[candidate][i])
    return Estimate(at, (lower, upper), candidate.parameters[i].unit, on_bound(found, candidate, i))


def _size(replay, candidate, i, z) -> float:
    """The parameter at a coordinate; what is found of an effect that the model has comes on top of it."""
    parameter = candidate.parameters[i]
    known = replay.known.get(candidate.name, {}).get(parameter.name, parameter.neutral)
    return float(value_of(parameter, z) + (known - parameter.neutral if np.isfinite(known) else 0.0))


def _unknown(decision, left) -> Unknown:
    generic, gain = decision.unknown
    nearest, explained = decision.nearest or (None, 0.0)
    memory = "wears off with time" if "time" in generic.driver else "none beyond the model's own"
    symmetry = "alike in both directions" if generic.columns == 1 else "differs with place or phase"
    share = gain / max(gain + decision.total_gain, 1e-12)
    return Unknown(
        generic.link, generic.driver, float(share), symmetry, memory, onset(decision.start, left),
        nearest.name if nearest else "none", float(np.sqrt(max(gain - explained, 0.0))),
    )


def _untestable(case, decision) -> list[Untestable]:
    """Effects whose signature these runs would not show even at the largest size that a search begins with."""
    screen, longest = decision.start.screen, {}
    named = {candidate.name for candidate in decision.named.point} if decision.named else ()
    for signature, length in zip(screen.signatures, screen.length, strict=True):
        if not isinstance(signature.candidate.effect, Generic):
            name = signature.candidate.name
            longest[name] = max(longest.get(name, 0.0), float(np.sqrt(max(length, 0.0))))
    return [
        Untestable(name, needs(case.replay.effects[name])) for name in case.replay.effects
        if name not in named and longest.get(name, 0.0) < _VISIBLE
    ]


