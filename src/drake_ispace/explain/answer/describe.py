"""A decision as an Explanation.

Names, sizes with intervals, the channels that show the disagreement, and the effects that these runs cannot show.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student_t

from drake_ispace.explain.answer.cancel import cancelling
from drake_ispace.explain.answer.drift import drift
from drake_ispace.explain.answer.explanation import Estimate, Explanation, NamedEffect, Unknown, Validated
from drake_ispace.explain.answer.localize import localize, onset
from drake_ispace.explain.answer.next_experiment import next_experiment
from drake_ispace.explain.answer.sentences import p_in_words
from drake_ispace.explain.answer.untestable import cannot_show, in_motion
from drake_ispace.explain.decide.decision import Decision, LeftOver, Rival
from drake_ispace.explain.decide.survey.generic import Generic, motion_of
from drake_ispace.explain.decide.survey.view import FORM_SHARE
from drake_ispace.explain.decide.validate import Choice
from drake_ispace.explain.fit.candidates import Candidate, value_of
from drake_ispace.explain.fit.changes import without
from drake_ispace.explain.fit.free_run import Sizes, unit_of
from drake_ispace.explain.fit.likelihood import Fit, Point
from drake_ispace.explain.fit.profile import profile_intervals
from drake_ispace.explain.predict.case import Case
from drake_ispace.explain.predict.prediction import Residuals
from drake_ispace.explain.prove.errors.repeats import are_one_motion
from drake_ispace.robots.robot import COMMAND


def describe(case: Case, decision: Decision | Choice) -> Explanation:
    """Put a decision into words and numbers: all of the Explanation that the training runs can tell."""
    return _described_choice(case, decision) if isinstance(decision, Choice) else _described(case, decision)


def _described(case, decision: Decision) -> Explanation:
    start, named, detection = decision.start, decision.named, decision.detection
    explained = _explained(decision)
    places = localize(case.prediction, start, explained) if detection.found else []
    effects = [] if named is None else [_named(case, decision, candidate) for candidate in named.point]
    unknown = None if decision.unknown is None else _unknown(decision, explained)
    verdict = "none"
    if unknown is not None:
        verdict = "unknown"
    elif effects:
        verdict = named_or_set(effects)
        verdict = "incomplete" if decision.left_over is not None and decision.left_over.is_more else verdict
    untestable = cannot_show(case, decision.start.screen, effects)
    warnings = _missing(case)
    if decision.left_over is not None:
        warnings.append(_besides(decision.left_over, decision.total_gain))
    asked = [effect.label for effect in decision.kept if named is not None and effect in named.point]
    if asked and case.scenario is None:
        warnings.append(f"whole runs ask for {', '.join(asked)}: without, they end further off than by chance")
    if case.replay.body.robot.driven == COMMAND:
        same = {effect.name: case.replay.effects[effect.name].card.same for effect in effects}
        warnings += [f"{name}: {text}" for name, text in same.items() if text]
    if effects and case.held_out is None:
        if are_one_motion([motion_of(case.prediction, track).body for track in case.prediction.tracks]):
            warnings.append("all runs repeat one motion: what explains it may be wrong for another")
    return Explanation(
        verdict, effects,
        detection, places, untestable, unknown=unknown, warnings=warnings,
        drifts=[] if named is None else drift(decision) + cancelling(decision),
        next_experiment=next_experiment(effects, unknown, in_motion(case, untestable) if verdict == "none" else []),
    )


def _missing(case) -> list[str]:
    """A sentence for each channel that some runs have and others have not: which, and what that costs."""
    tracks, said = [*case.prediction.tracks, *(case.held_out.tracks if case.held_out else [])], []
    for channel in sorted(frozenset.union(*(track.has for track in tracks))):
        without = list(dict.fromkeys(track.recording or track.name for track in tracks if channel not in track.has))
        names = ", ".join(without)
        if without and channel in case.replay.feeds:
            said.append(f"no channel {channel} in {names}: it is compared in the other runs only")
        elif without:
            said.append(f"channel {channel} was not used, because some runs have none: leave out {names} to use it")
    return said


def _described_choice(case, choice: Choice) -> Explanation:
    effects = [_chosen(case, choice, candidate) for candidate in choice.named]
    validated = [
        Validated([candidate.label for candidate in names], error, unit_of(case.replay))
        for names, error in choice.errors.items()
    ]
    verdict = "set" if choice.rivals else "named" if effects else "none"
    return Explanation(
        verdict, effects, None, [], [], validated=validated,
        next_experiment=next_experiment(effects, None, []),
    )


def named_or_set(effects: Sequence[NamedEffect]) -> str:
    """The verdict on effects that suffice."""
    return "set" if any(effect.equivalents for effect in effects) else "named"


def rule_out_rivals(answer: Explanation, decision: Decision, may_stand: Callable[[Rival], bool]) -> None:
    """Take look-alikes out of the answer that do not suffice on unseen runs where the named effects do.

    may_stand: tells whether one does suffice.
    """
    named = {candidate.name: candidate for candidate in decision.named.point}
    effects = []
    for effect in answer.effects:
        rivals = decision.rivals.get(named[effect.name], [])
        stand = {rival.candidate.name for rival in rivals if may_stand(rival)}
        effects.append(replace(effect, equivalents=[name for name in effect.equivalents if name in stand]))
    if effects != answer.effects:
        answer.effects, answer.next_experiment = effects, next_experiment(effects, answer.unknown, [])
        answer.verdict = named_or_set(effects) if answer.verdict == "set" else answer.verdict


def with_sizes(
    effects: Sequence[NamedEffect], case: Case, sizes: Point, plain: Mapping[Candidate, Sequence[float | None]],
    without: Sequence[Point] = (),
) -> list[NamedEffect]:
    """The effects at these sizes, beside those of plain least squares; intervals grow to hold the sizes.

    sizes, plain: effects and their coordinates, None for one that plain least squares cannot tell. without: the sizes
    without each run in turn; intervals then also hold Student's interval of the jackknife, which knows how far runs
    disagree.
    """
    by_name = {candidate.name: candidate for candidate in sizes}

    def changed(effect):
        candidate, parameters = by_name[effect.name], dict(effect.parameters)
        for i, parameter in enumerate(candidate.parameters):
            p = parameters[parameter.name]
            z, by_plain = sizes[candidate][i], plain[candidate][i]
            reach = _jackknife_reach([point[candidate][i] for point in without])
            at, *ends = (_size(case.replay, candidate, i, one) for one in (z, z - reach, z + reach))
            parameters[parameter.name] = replace(
                p, estimate=at, ci90=(min(*p.ci90, *ends), max(*p.ci90, *ends)),
                least_squares=None if by_plain is None else _size(case.replay, candidate, i, by_plain),
                on_bound=_on_bound(case, sizes, candidate, i),
            )
        return replace(effect, parameters=parameters)

    return [changed(effect) for effect in effects]


def _jackknife_reach(without: Sequence[float]) -> float:
    """How far a 90 % interval reaches from a size; without: the size without each run in turn, none: not at all."""
    n = len(without)
    if n < 2:
        return 0.0
    return float(student_t.ppf(0.95, n - 1) * np.sqrt((n - 1) * np.var(without)))


def _besides(left_over: LeftOver, explained: float) -> str:
    """The warning of what is still detectable beside the named effects; explained: drop in deviance by these."""
    effect = left_over.candidate.effect
    is_generic = isinstance(effect, Generic)
    what = f"a {effect.link} that goes with {effect.driver}" if is_generic else left_over.candidate.name
    share = 100.0 * left_over.gain / max(left_over.gain + explained, 1e-12)
    perhaps, part = "" if left_over.is_more else "perhaps ", f"{share:.0f}" if share >= 1.0 else "less than 1"
    return f"besides, {perhaps}{what} ({p_in_words(left_over.p_value)}, {part} % of what is explained)"


def _explained(decision) -> Residuals:
    """Residuals with the best explanation in the model: named effects, else an unknown disagreement, else nothing."""
    start = decision.start
    if decision.named is not None:
        return start.likelihood.raw(decision.named.point)
    if decision.unknown is None:
        return start.residuals
    return without(start.residuals, *start.screen.use_of(decision.unknown[0], start.products))


def _named(case, decision, candidate: Candidate) -> NamedEffect:
    """The effect with its profile-likelihood intervals, widened by the overdispersion and by FORM_SHARE."""
    named, card = decision.named, candidate.effect.card
    likelihood = decision.end.likelihood
    parameters = _wheels(case.replay.body, candidate)
    overdispersion = decision.start.screen.overdispersion_of(candidate)
    intervals = profile_intervals(likelihood, named, candidate, 1.645**2 * overdispersion)
    for i, (parameter, z, (lower, upper)) in enumerate(
        zip(candidate.parameters, named.point[candidate], intervals, strict=True)
    ):
        form = 1.645 * FORM_SHARE * abs(z - candidate.neutral[i])
        ends = z - np.hypot(z - lower, form), z + np.hypot(upper - z, form)
        parameters[parameter.name] = _estimate(case, named, candidate, i, ends)
    rivals = list(dict.fromkeys(rival.candidate.name for rival in decision.rivals.get(candidate, [])))
    share = decision.gains.get(candidate, 0.0) / max(decision.total_gain, 1e-12)
    return NamedEffect(card.name, card.home, rivals, parameters, float(np.clip(share, 0.0, 1.0)), card.excitation)


def _chosen(case, choice, candidate) -> NamedEffect:
    """The effect with intervals by Student's t from the spread between runs."""
    card, sizes = candidate.effect.card, choice.sizes
    z = sizes.point[candidate]
    parameters = _wheels(case.replay.body, candidate)
    factor = student_t.ppf(0.95, len(case.prediction.tracks) - 1)
    for i, parameter in enumerate(candidate.parameters):
        reach = factor * sizes.stds[candidate, i]
        parameters[parameter.name] = _estimate(case, sizes, candidate, i, (z[i] - reach, z[i] + reach))
    others = {c.name for rival in choice.rivals if candidate not in rival for c in rival}
    rest = tuple(c for c in choice.named if c is not candidate)
    gains = [choice.errors[names] ** 2 - choice.errors[choice.named] ** 2 for names in (rest, ())]
    share = float(np.clip(gains[0] / gains[1], 0.0, 1.0))
    equivalents = sorted(others - {c.name for c in choice.named})
    return NamedEffect(card.name, card.home, equivalents, parameters, share, card.excitation)


def _wheels(body, candidate) -> dict[str, Estimate]:
    """Each choice of wheel as an Estimate without an interval, with the name of the wheel if it has one."""
    names = [labels[0] for labels in body.robot.wheel_labels(body.plant)]
    return {
        name: Estimate(wheel, (wheel, wheel), "wheel", called="" if names[wheel - 1].isdecimal() else names[wheel - 1])
        for name, wheel in candidate.choices
    }


def _estimate(case, best: Fit | Sizes, candidate, i, ends) -> Estimate:
    """The Estimate of a coordinate of `best` whose interval ends at `ends`."""
    lower, upper = sorted(_size(case.replay, candidate, i, end) for end in ends)
    at = _size(case.replay, candidate, i, best.point[candidate][i])
    called = candidate.effect.called(case.replay.body)
    on_bound = _on_bound(case, best.point, candidate, i)
    return Estimate(at, (lower, upper), candidate.parameters[i].unit, on_bound, called=called)


def _on_bound(case, point: Point, candidate, i) -> bool:
    """Whether a coordinate was stopped by what is physically possible, or is beyond what makes sense.

    A torque that a wheel never had makes none: a friction of that size would have held the wheel. A part of the room
    may reach up to its walls.
    """
    (low, high), parameter = candidate.bounds[i], candidate.parameters[i]
    z = point[candidate][i]
    value = value_of(parameter, z)
    makes_sense = parameter.makes_sense(value)
    if parameter.scale == "torque" and not parameter.reciprocal:
        makes_sense &= abs(value) <= max(np.abs(track.command).max() for track in case.prediction.tracks)
    at_a_wall = candidate.effect.is_local and parameter.shape
    # a fit by least squares stays inside of its bounds; next to neutral it says that there is nothing
    ends = [end for end in (low, high) if np.isfinite(end) and end != candidate.neutral[i]]
    stopped = any(abs(z - end) <= np.sqrt(np.finfo(float).eps) * max(map(abs, ends)) for end in ends)
    return z != candidate.neutral[i] and not at_a_wall and (stopped or not low < z < high or not makes_sense)


def _size(replay, candidate, i, z) -> float:
    """The parameter at a coordinate within its bounds, on top of what the model has of the effect already."""
    (low, high), parameter = candidate.bounds[i], candidate.parameters[i]
    known = replay.known.get(candidate.name, {}).get(parameter.name, parameter.neutral)
    value = value_of(parameter, min(max(z, low), high))
    return float(value + (known - parameter.neutral if np.isfinite(known) else 0.0))


def _unknown(decision, explained) -> Unknown:
    generic, gain = decision.unknown
    nearest, nearest_gain = decision.nearest or (None, 0.0)
    memory = "changes with time" if "time" in generic.driver else "none beyond the model's own"
    is_alike = generic.columns == 1 or generic.is_in_time or generic.driver == "command"
    symmetry = "alike in both directions" if is_alike else "differs with place or phase"
    share = gain / max(gain + decision.total_gain, 1e-12)
    return Unknown(
        generic.link, generic.driver, float(share), symmetry, memory, onset(decision.start, explained),
        nearest.name if nearest else "none", float(np.sqrt(max(gain - nearest_gain, 0.0))),
        _course(decision.start, generic),
    )


def _course(start, generic):
    """How something unknown goes with time, where it may in any way and all of it shows; else empty."""
    if not generic.is_in_time:
        return ()
    amounts, _ = start.screen.use_of(generic, start.products)
    candidate = next(candidate for candidate in start.screen.candidates if candidate.effect is generic)
    covariance = start.screen.covariance_of(candidate)
    return generic.course(amounts, covariance) if len(amounts) == generic.columns else ()
