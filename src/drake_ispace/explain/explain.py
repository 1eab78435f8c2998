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
from drake_ispace.explain.answer.missing_motion import advise_missing_motion
from drake_ispace.explain.answer.new_model import add_effects
from drake_ispace.explain.answer.verdict import add_chance, add_parts, add_proof, left_out
from drake_ispace.explain.best_answer import Answered, best_answered
from drake_ispace.explain.check.examine import examine
from drake_ispace.explain.check.runs import Runs, solvable
from drake_ispace.explain.decide.clocks.camera_clocks import camera_clocks
from drake_ispace.explain.decide.clocks.clocks_set import with_clocks_set
from drake_ispace.explain.decide.counters import SHOWS, with_counters_set
from drake_ispace.explain.decide.decide import decide
from drake_ispace.explain.decide.each_part import OfAPart, shown_by_half, shown_by_run
from drake_ispace.explain.decide.validate import validated_choice
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.explain.predict.case import joined, prepare
from drake_ispace.explain.predict.stretches import MOST_S
from drake_ispace.explain.prove.own.gap import prove_own
from drake_ispace.explain.prove.prove import prove
from drake_ispace.explain.threads import side_by_side
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

    # 1 predict
    tell("preparing the predictions")
    case = prepare(model, examined.runs, examined.held_out, effects, most_s)

    with side_by_side(), solvable():
        if not trust_data:
            tell("comparing the clocks")
            if drifts := camera_clocks(case, examined.every):
                examined = examined.with_repaired(drifts)
                case = prepare(model, examined.runs, examined.held_out, effects, most_s)
            case, off = with_clocks_set(case, examined.names)
            examined = replace(examined, findings=[*examined.findings, *off])
        answer = _explained(case, seed, tell)
        if answer.verdict in ("unknown", "incomplete") and (moved := with_counters_set(case)) is not case:
            tell("asking again, with other zeros of the counters")
            again = _explained(moved, seed, tell, needed=SHOWS)
            if again is not None and again.verdict in ("named", "set") and SHOWS in again.mentioned:
                case, answer = moved, again
    add_chance(answer)
    advise_missing_motion(answer, case)
    answer.warnings += [said for said in (*examined.warnings, case.warning) if said]
    add_findings(answer, examined)
    if case.scenario is not None:
        tell("checking the controller")
        check_controllers(answer, case)
    answer.runs = [track.name for track in case.prediction.tracks]
    answer.held_out = [track.name for track in case.held_out.tracks] if case.held_out else []
    answer.seconds = time.perf_counter() - started
    return answer


def _explained(case, seed, tell, needed=None) -> Explanation | None:
    """Stages 2 to 5; None where the decision does not know the effect that is needed, by its name."""
    # 2 fit: an effect, and for an effect on one wheel which wheel, is a candidate; a fit moves its sizes
    tried = candidates(case.effects_to_try, case.replay.body)

    # 3 decide: fits candidates, alone and together, and compares the deviances (or the errors of whole runs)
    if not case.is_filtered:
        return _answered(case, validated_choice(case.prediction, tried, tell), seed, tell).answer
    decision = decide(case.prediction, tried, seed, tell)
    if needed is not None and needed not in decision.names:
        return None
    best = _answered(case, decision, seed, tell)

    def decided_without(names):
        return decide(case.prediction, [candidate for candidate in tried if candidate.name not in names], seed, tell)

    best = best_answered(case, best, lambda one: _answered(case, one, seed, tell), decided_without)
    if best.proof.may_stand is not None:
        rule_out_rivals(best.answer, best.decision, best.proof.may_stand)
    return _with_parts(case, best, tried, seed, tell).answer


def _with_parts(case, best, tried, seed, tell) -> Answered:
    """The answer with what single runs and halves of all runs show besides; the answer that nothing is named where an
    effect is one of single runs.

    Of what goes with time, place or command in any way each run shows whatever comes nearest, and none is another one.
    """
    answer, decision = best.answer, best.decision
    unknown = decision.unknown[0] if decision.unknown is not None else None
    if unknown is not None and answer.unknown is None:  # and taken back: it does not matter on unseen runs
        return best
    if answer.verdict == "incomplete":
        tell("looking at each run by itself")
        if not answer.drifts:
            add_parts(answer, _runs_apart(case, decision, tried, seed, sound_others=True))
            return best
        none = decision.without_effects()  # of an effect of one run all runs have some of it
        shown = _runs_apart(case, none, tried, seed, sound_others=True)
        if not (apart := [one for one in shown if not one.sizes]):
            return best
        sound = _answered(case, none, seed, tell)
        sound.answer.warnings += [*best.dropped, left_out(sound.answer, answer, "comes of what single runs show")]
        add_parts(sound.answer, apart)
        return sound
    if unknown is None or not unknown.is_local:
        tell("looking at each run by itself")
        add_parts(answer, _runs_apart(case, decision, tried, seed))
    if unknown is None or unknown.is_in_time or not unknown.is_local:
        tell("looking at the halves of the runs")
        point = decision.named.point if decision.named else {}
        add_parts(answer, shown_by_half(case.prediction, point, tried, seed))
    return best


def _runs_apart(case, decision, tried, seed, sound_others=False) -> list[OfAPart]:
    """What single runs show beside the effects of the decision, held-out ones as well; sound_others: as there."""
    every = case.prediction if case.held_out is None else joined(case.prediction, case.held_out)
    point, end = decision.named.point if decision.named else {}, decision.end
    known = end.view if end.changes is not None and end.point.keys() == point.keys() else None
    return shown_by_run(every, point, tried, seed, known, sound_others)


def _answered(case, decision, seed, tell) -> Answered:
    """What a decision comes to."""
    # 4 prove: free runs of the model with the effects, on runs that the sizes were not fitted to
    tell("measuring the gap")
    proof = prove_own(case, decision, seed) if case.scenario is None else prove(case, decision, seed)

    # 5 answer
    tell("finding the channels that show it")
    answer = describe(case, decision)
    add_proof(answer, case, proof)
    if answer.effects and case.scenario is not None:
        add_effects(answer, case, proof.sizes)
    return Answered(decision, proof, answer)
