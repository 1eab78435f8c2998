"""`explain`: where do simulation and measurement disagree, which effect is missing, and does adding it close the gap?

Read `explain` from top to bottom: predict, detect, hypothesise and decide, localise, add, confirm.
"""

import copy
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.effects.effect import Effect
from drake_ispace.effects.library import library
from drake_ispace.explain.answer.confirm import Confirmation, confirm, drift, on_bound
from drake_ispace.explain.answer.controller import ControllerCheck, check_controller
from drake_ispace.explain.answer.explanation import (
    DetectionResult,
    Estimate,
    Explanation,
    NamedEffect,
    Unknown,
    Untestable,
)
from drake_ispace.explain.answer.localize import localize, onset
from drake_ispace.explain.answer.next_experiment import needs, next_experiment
from drake_ispace.explain.decide.decide import Decision, LeftOver, decide
from drake_ispace.explain.decide.generic import Generic
from drake_ispace.explain.decide.survey import without
from drake_ispace.explain.fit.candidates import Candidate, candidates, value_of
from drake_ispace.explain.fit.profile import profile_interval
from drake_ispace.explain.predict.own_model import OwnModel, own_replay, own_track
from drake_ispace.explain.predict.prediction import Prediction, Residuals, predict
from drake_ispace.explain.predict.replay import Replay, replay_of
from drake_ispace.explain.predict.tracks import track
from drake_ispace.files.recording import Recording
from drake_ispace.robots.library import robots
from drake_ispace.robots.recordings import load
from drake_ispace.robots.robot import COMMAND, TORQUE, Robot
from drake_ispace.scenario import Scenario, difference, load_scenario
from drake_ispace.wiring.catalog import entry_of

_VISIBLE = 3.0  # length of an effect's signature at its largest probe, in noise, from which on these runs can show it
_FORM_SHARE = 0.025  # of a parameter: how far its estimate is off because no model has exactly the robot's form
_THREADS = 2
_FOREIGN_CONTROL = 0.12  # share of the torque that the model's controller may leave (its own one leaves 0 to 0.09)


@dataclass(frozen=True)
class Case:
    """What is to be explained: model (None for a user's own plant), robot, runs, and the compiled prediction."""

    scenario: Scenario | None
    robot: str
    runs: list[Recording]
    replay: Replay
    prediction: Prediction
    held_out: Prediction | None


def explain(
    model: Scenario | OwnModel | str, runs: Sequence[Recording | str | Path],
    held_out: Sequence[Recording | str | Path] = (), effects: Sequence[Effect] | None = None, seed: int = 0,
    tell: Callable[[str], None] = lambda text: None,
) -> Explanation:
    """Find what the model lacks.

    Args:
        model: a Scenario, the name or file of one, or a plant of your own (own_model.py). runs: measured.
        held_out: others, to prove the answer on. effects: to try, default the whole library. seed: of the bootstraps.
        tell: told about every stage.

    Raises:
        InputError: a run that the model cannot predict.
    """
    started = time.perf_counter()
    tell("preparing the predictions")
    case = prepare(model, runs, held_out, effects)
    with ThreadPoolExecutor(_THREADS) as pool:
        tried = candidates(_triable(case), case.replay.body)
        decision = decide(case.prediction, tried, seed, pool, tell)
        tell("localising")
        answer = _described(case, decision)
        if decision.named is not None and case.scenario is not None:
            _add(case, decision, answer)
        if case.held_out is not None and decision.named is not None:
            tell("confirming on the held-out runs")
            _confirmed(answer, confirm(case.held_out, decision, seed, pool))
    if case.scenario is not None:
        tell("checking the controller")
        _controlled(answer, [check_controller(case.scenario, case.robot, run) for run in case.runs])
    answer.runs = [track.name for track in case.prediction.tracks]
    answer.held_out = [track.name for track in case.held_out.tracks] if case.held_out else []
    answer.seconds = time.perf_counter() - started
    return answer


def prepare(model, runs, held_out=(), effects=None) -> Case:
    """Load, check and compile; arguments as `explain`.

    Raises:
        InputError: as `explain`.
    """
    scenario = load_scenario(model) if isinstance(model, str) else model
    if not runs:
        raise InputError("explain: there is no run, expected at least one")
    recordings = [(_name(run, i), run if isinstance(run, Recording) else load(run)) for i, run in enumerate(runs)]
    given = [recording for _, recording in recordings]
    others = [
        (_name(run, i + len(runs)), run if isinstance(run, Recording) else load(run)) for i, run in enumerate(held_out)
    ]
    if isinstance(model, OwnModel):
        tracks = [own_track(recording, model, name) for name, recording in recordings]
        proof = [own_track(recording, model, name) for name, recording in others]
        replay = own_replay(model, tracks + proof, effects)
        return Case(None, model.name, given, replay, predict(replay, tracks), predict(replay, proof) if proof else None)
    robot = _robot(scenario, recordings + others)
    wheels = len(getattr(scenario, robot.name).plant.geometry.wheels)
    tracks = [track(recording, robot, wheels, name) for name, recording in recordings]
    proof = [track(recording, robot, wheels, name) for name, recording in others]
    has = frozenset.intersection(*(t.has for t in tracks + proof))
    if not has & {"encoder", "kinect", "imu"}:
        raise InputError(f"{tracks[0].name}: the runs have no measured channel in common, expected encoder or kinect")
    if robot.driven == COMMAND and COMMAND not in has:
        tracks, proof = ([replace(t, command=np.zeros_like(t.command)) for t in part] for part in (tracks, proof))
    replay = replay_of(scenario, robot, has, effects)
    case = Case(scenario, robot.name, given, replay, predict(replay, tracks), predict(replay, proof) if proof else None)
    for prediction in (case.prediction, *([case.held_out] if proof else [])):
        if not any(rows.size for run in prediction.residuals({}) for rows in run.values()):
            raise InputError(
                f"{prediction.tracks[0].name}: nothing to compare, expected encoder and torque (of the pendulum imu "
                "too) or encoder and kinect, for some seconds"
            )
    return case


def _triable(case: Case) -> dict[str, Effect]:
    """Effects that the predictions depend on: without torque, only those of geometry, encoders and camera."""
    robot = case.replay.body.robot
    kinematic = not case.prediction.channels["motion"] and robot.driven == TORQUE and robot.in_room
    return {
        name: effect for name, effect in case.replay.effects.items() if (effect.kinematic or not kinematic)
        and not (name in case.replay.known and (effect.choices or any(p.reciprocal for p in _parameters(case, effect))))
    }


def _parameters(case, effect):
    return effect.parameters(case.replay.body)


def _name(run, i):
    if isinstance(run, Recording):
        return str(run.path) if run.path else f"run {i + 1}"
    return str(run)


def _robot(scenario, recordings) -> Robot:
    """The robot of the model that all recordings are of."""
    first, known = recordings[0][1].robot, [robots()[name] for name in entry_of(scenario).robots]
    own = next((robot for robot in known if robot.answers_to(first)), None)
    for name, recording in recordings:
        if own is None or not own.answers_to(recording.robot):
            raise InputError(
                f"{name}: the run is of robot {recording.robot or 'unknown'}, expected "
                f"{' or '.join(robot.name for robot in known)}, which the model {scenario.diagram} describes"
            )
    return own


def _described(case: Case, decision: Decision) -> Explanation:
    """The Explanation before anything is added and confirmed."""
    start, named = decision.start, decision.named
    found = decision.detection
    detection = DetectionResult(found.p_value, found.threshold, found.false_alarm_rate, found.evidence)
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
    warnings += [
        f"{name} of {effect.name} sits on its bound" for effect in effects
        for name, p in effect.parameters.items() if p.on_bound
    ]
    return Explanation(
        verdict, effects, detection, places, untestable, unknown=unknown, warnings=warnings,
        next_experiment=next_experiment(effects, unknown, untestable if verdict == "none" else []),
    )


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
    inflation = decision.start.screen.inflation_of(candidate)
    for i, (parameter, z) in enumerate(zip(candidate.parameters, named.point[candidate], strict=True)):
        form = 1.645 * _FORM_SHARE * abs(z - candidate.neutral[i])
        low, high = candidate.bounds[i]
        lower, upper = profile_interval(likelihood, named, candidate, i, 1.645**2 * inflation)
        lower, upper = z - np.hypot(z - lower, form), z + np.hypot(upper - z, form)
        ends = sorted(value_of(parameter, min(max(end, low), high)) for end in (lower, upper))
        known = case.replay.known.get(card.name, {}).get(parameter.name, parameter.neutral)
        more = known - parameter.neutral if np.isfinite(known) else 0.0  # what was found comes on top of it
        interval = (float(ends[0] + more), float(ends[1] + more))
        at = float(value_of(parameter, z) + more)
        parameters[parameter.name] = Estimate(at, interval, parameter.unit, on_bound(named, candidate, i))
    rivals = list(dict.fromkeys(rival.candidate.name for rival in decision.rivals.get(candidate, [])))
    share = decision.gains.get(candidate, 0.0) / max(decision.total_gain, 1e-12)
    return NamedEffect(card.name, card.home, rivals, parameters, float(min(share, 1.0)), card.excitation)


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
    for signature, length in zip(screen.signatures, screen.length, strict=True):
        if not isinstance(signature.candidate.effect, Generic):
            name = signature.candidate.name
            longest[name] = max(longest.get(name, 0.0), float(np.sqrt(max(length, 0.0))))
    return [
        Untestable(name, needs(case.replay.effects[name])) for name in case.replay.effects
        if longest.get(name, 0.0) < _VISIBLE
    ]


def _add(case: Case, decision: Decision, answer: Explanation) -> None:
    """Stage 5, add: the scenario with the named effects in it, if a scenario can list them."""
    if foreign := [candidate.name for candidate in decision.named.point if candidate.name not in library()]:
        answer.warnings.append(
            f"{', '.join(foreign)}: no entry point drake_ispace.effects, so there is no model with the effect in it"
        )
        return
    scenario = copy.deepcopy(case.scenario)
    section = getattr(scenario, case.robot)
    for candidate, z in decision.named.point.items():
        together = case.replay.combined({candidate.name: candidate.values(z)})[candidate.name]
        values = {name: int(value) if name in dict(candidate.choices) else float(value)
                  for name, value in together.items() if np.isfinite(value)}
        section.effects = {**section.effects, candidate.name: values}
    answer.model, answer.difference = scenario, difference(scenario)


def _controlled(answer: Explanation, checks: Sequence[ControllerCheck | None]) -> None:
    known = [check for check in checks if check is not None]
    if not known:
        return
    left, gain = (float(np.median([getattr(check, name) for check in known])) for name in ("unexplained", "gain"))
    answer.controller = ControllerCheck(left, gain)
    if left > _FOREIGN_CONTROL:
        answer.warnings.append(
            f"the controller is not the model's: {100.0 * left:.0f} % of the recorded torque is not what it makes of "
            f"the measured sensors (it fits best {gain:.2f} times as large); effects are found from the recorded "
            "torque all the same, but closed-loop simulations of the model will differ"
        )


def _confirmed(answer: Explanation, confirmation: Confirmation) -> None:
    answer.gap, answer.closed = confirmation.gaps, confirmation.closed
    answer.warnings = confirmation.warnings + answer.warnings
