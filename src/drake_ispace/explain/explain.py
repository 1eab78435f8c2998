"""`explain`: where do simulation and measurement disagree, which effect is missing, and does adding it close the gap?

An effect is a named physical cause that a model may lack, such as Coulomb friction or a late camera (`effects/`). At
its neutral value it changes nothing. A track is one recorded run, a look-alike an effect that the same runs show in
nearly the same way; docs/glossary.md has the other words. Six stages, a folder each:

0. check    The channels of the recordings are compared with each other: a wheel that counts backwards, a camera in
            millimetres, a clock that is off. Where the data contradict each other no physics is blamed; what is wrong
            for a while only is cut out.
1. predict  The model is driven by the recorded commands and held on the measured motion by a Kalman filter. What the
            model could not predict from the past is the residual. Every effect of the library is in the compiled
            Diagram at its neutral value, so that an effect is tried by changing run-time numbers.
2. fit      The likelihood of the residuals under an autoregressive noise model, which is estimated from them. Offsets
            that a sound robot may have are nuisance parameters and are marginalised. A fit finds the sizes of given
            effects at which the deviance, -2 log likelihood, is least.
3. decide   Is there a disagreement at all, at a false-alarm rate of 1 %? Which effects lower the deviance most, and
            which look-alikes nearly as much? Stage 3 calls stage 2 for every set of effects that it considers.
4. prove    The gap as a user would measure it: errors of free-run simulations before and after, on runs to which no
            size was fitted, beside what sensors and chance leave and what plain least squares finds. And a test of
            what is left: is it noise of a sound robot?
5. answer   The verdict (named, a set of look-alikes, incomplete, unknown, none, data), sizes with 90 % intervals, the
            recorded channels that show the disagreement, what is left of it, and a new scenario with the effects in it
            (where the model is a scenario). For a scenario also how well its controller explains the recorded torque.

Of a plant of the user's own (OwnModel) whose runs last less than a second there is no filter: stage 2 fits free-run
simulations by least squares, and stage 3 compares sets of effects by cross-validation over the runs.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.effects.effect import Effect
from drake_ispace.explain.answer.contradiction import add_findings, contradiction
from drake_ispace.explain.answer.controller import check_controllers
from drake_ispace.explain.answer.describe import describe, rule_out_rivals
from drake_ispace.explain.answer.explanation import Explanation
from drake_ispace.explain.answer.new_model import add_effects
from drake_ispace.explain.answer.verdict import (
    add_chance,
    add_nonsense,
    add_proof,
    add_runs_apart,
    add_trace,
    doubtful,
    lacks_little,
    nonsense,
)
from drake_ispace.explain.check.examine import examine
from drake_ispace.explain.check.runs import Runs, solvable
from drake_ispace.explain.decide.clocks_set import with_clocks_set
from drake_ispace.explain.decide.decide import MOST_EFFECTS, decide
from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.decide.each_run import OfOneRun, shown_by_one
from drake_ispace.explain.decide.validate import validated_choice
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.explain.predict.case import joined, prepare
from drake_ispace.explain.predict.stretches import MOST_S
from drake_ispace.explain.prove.own.gap import prove_own
from drake_ispace.explain.prove.prove import prove
from drake_ispace.explain.threads import side_by_side
from drake_ispace.robots.robot import COMMAND
from drake_ispace.scenario import Scenario, as_scenario


def explain(
    model: Scenario | OwnModel | str | Path, runs: Runs, held_out: Runs | Mapping[str, Runs] = (),
    effects: Sequence[Effect] | None = None, seed: int = 0, tell: Callable[[str], None] = lambda text: None,
    trust_data: bool = False, most_s: float = MOST_S,
) -> Explanation:
    """Find what the model lacks.

    Args:
        model: a Scenario, the name or file of one, or a plant of your own (own_model.py).
        runs: measured: one or several, or by name as `hide` returns them; a folder stands for the run in it.
        held_out: other runs, to prove the answer on; a mapping has kinds of runs, whose errors are reported apart.
        effects: to try, default the whole library. seed: of the bootstraps. tell: called with the name of each step.
        trust_data: whether to go on although the recordings contradict each other. most_s: how much of the training
            runs of a robot under torque is used [s], and half as much of each kind of held-out runs: of longer ones,
            stretches from all over them. Where no run is held out, some of the other stretches are.

    Raises:
        InputError: a run that the model cannot predict; `most_s` that is no positive number.
    """
    if not most_s > 0.0:
        raise InputError(f"most_s: {shown(most_s)}, expected a positive number of seconds")
    started = time.perf_counter()

    # 0 check
    model = model if isinstance(model, OwnModel) else as_scenario(model)
    examined = examine(model, runs, held_out, trust_data, tell)
    if examined.serious and not trust_data:
        return contradiction(examined, time.perf_counter() - started)
    runs, held_out = examined.runs, examined.held_out

    # 1 predict
    tell("preparing the predictions")
    case = prepare(model, runs, held_out, effects, most_s)

    with side_by_side(), solvable():
        if not trust_data:
            tell("comparing the clocks")
            case, off = with_clocks_set(case, examined.names)
            examined = replace(examined, findings=[*examined.findings, *off])

        # 2 fit: an effect, and for an effect on one wheel which wheel, is a candidate; a fit moves its sizes
        tried = candidates(case.effects_to_try, case.replay.body)

        # 3 decide: fits candidates, alone and together, and compares the deviances (or the errors of whole runs)
        if case.is_filtered:
            decision = decide(case.prediction, tried, seed, tell)
        else:
            decision = validated_choice(case.prediction, tried, tell)

        decision, answer = _best_answered(case, decision, lambda one: _answered(case, one, seed, tell))
        if case.is_filtered and decision.may_stand is not None:
            rule_out_rivals(answer, decision)
        if case.is_filtered and answer.verdict != "incomplete":
            tell("looking at each run by itself")
            add_runs_apart(answer, _runs_apart(case, decision, tried, seed))
    add_chance(answer)
    answer.warnings += [said for said in (*examined.warnings, case.warning) if said]
    add_findings(answer, examined)
    if case.scenario is not None:
        tell("checking the controller")
        check_controllers(answer, case)
    answer.runs = [track.name for track in case.prediction.tracks]
    answer.held_out = [track.name for track in case.held_out.tracks] if case.held_out else []
    answer.seconds = time.perf_counter() - started
    return answer


def _runs_apart(case, decision, tried, seed) -> list[OfOneRun]:
    """What single runs show beside the effects of the decision, held-out ones as well."""
    every = case.prediction if case.held_out is None else joined(case.prediction, case.held_out)
    point, end = decision.named.point if decision.named else {}, decision.end
    known = end.view if end.changes is not None and end.point.keys() == point.keys() else None
    return shown_by_one(every, point, tried, seed, known)


def _best_answered(case, decision, answered) -> tuple[Decision, Explanation]:
    """A decision, or another one that unseen runs prefer, and what it comes to.

    answered: gives what a decision comes to.
    """
    answer = answered(decision)
    if not case.is_filtered:
        return decision, answer
    decision, answer = _with_asked(decision, answer, answered)
    if answer.verdict == "incomplete" or (answer.verdict == "unknown" and case.replay.body.robot.driven == COMMAND):
        decision, answer = _with_further(decision, answer, answered)
    doubted = answer.verdict == "incomplete" and decision.otherwise is not None
    if doubted and not lacks_little(answer, decision):
        decision = decision.otherwise
        answer = answered(decision)
    decision, answer = _without_nonsense(decision, answer, answered)
    needed = _needed(case, decision, answer) if answer.effects else decision
    if needed is not decision and _suffices(without := answered(needed)):
        add_trace(without, answer)
        return needed, without
    return decision, answer


def _with_asked(decision, answer, answered) -> tuple[Decision, Explanation]:
    """The decision with what training runs ask for as long as the answer gets no worse, and the answer.

    Where it is known that something is missing, but not what, all that they ask for must suffice.
    """
    further, left = decision, answer
    while further.asked is not None and (asked := further.asked()) is not None:
        kept = {**further.kept, asked.effect: asked.rivals}
        other = further.renamed(replace(further, kept=kept), asked.point)
        answer_with_it = answered(other)
        spoilt = _suffices(left) and not _suffices(answer_with_it)
        if spoilt or _too_large(answer_with_it) > _too_large(left):
            break
        further, left = other, answer_with_it
    return (decision, answer) if answer.verdict == "unknown" and not _suffices(left) else (further, left)


def _with_further(decision, answer, answered) -> tuple[Decision, Explanation]:
    """The decision with traces without which the others do not suffice, and its answer; unchanged if none do.

    Each is the clearest one, so that the next ones explain less. What is left is divided by the number of effects that
    may still be named: one that takes less than this share is the last that is tried.
    """
    further, left = decision, answer
    while further.further and left.proof and left.remainders:
        clearest = further.further[0]
        may_follow = MOST_EFFECTS - len(clearest)
        further, before = further.renamed(further, clearest), _too_large(left)
        left = answered(further)
        if _suffices(left):
            return further, left
        if not before - _too_large(left) >= before / (1 + may_follow):
            break
    return decision, answer


def _without_nonsense(decision, answer, answered) -> tuple[Decision, Explanation]:
    """The decision without effects that make no sense, as of `nonsense`, and its answer."""
    if not (names := nonsense(answer)):
        return decision, answer
    kept = {c: z for c, z in decision.named.point.items() if c.name not in names}
    other = decision.renamed(decision, kept) if kept else decision.without_effects()
    without = answered(other)
    add_nonsense(without, answer)
    return other, without


def _too_large(answer) -> float:
    """How much unseen runs leave in the channels that have too much left."""
    return sum(remainder.ratio**2 for remainder in answer.remainders)


def _suffices(answer) -> bool:
    """Whether unseen runs show nothing that the answer lacks."""
    return answer.verdict in (("named", "set") if answer.effects else ("none",))


def _needed(case, decision, answer) -> Decision:
    """The decision without doubtful effects, or without any where it is in doubt and nothing was asked for."""
    why = doubtful(answer, case)
    kept = {c: z for c, z in decision.named.point.items() if c.name not in why}
    if why and kept:
        return decision.renamed(decision, kept)
    in_doubt = decision.detection.in_doubt and not decision.kept
    return decision.without_effects() if why or in_doubt else decision


def _answered(case, decision, seed, tell) -> Explanation:
    """What a decision comes to."""
    # 4 prove: free runs of the model with the effects, on runs that the sizes were not fitted to
    tell("measuring the gap")
    proof = prove_own(case, decision, seed) if case.scenario is None else prove(case, decision, seed)
    if case.is_filtered:
        decision.asked, decision.may_stand = proof.asked, proof.may_stand

    # 5 answer
    tell("finding the channels that show it")
    answer = describe(case, decision)
    add_proof(answer, case, proof)
    if answer.effects and case.scenario is not None:
        add_effects(answer, case, proof.sizes)
    return answer
