"""`explain`: where do simulation and measurement disagree, which effect is missing, and does adding it close the gap?

Read `explain` and `_decided` from top to bottom: predict, detect, hypothesise and decide, localise, add, confirm, and
let whole runs go free.
"""

import copy
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.effects.effect import Effect
from drake_ispace.effects.library import library
from drake_ispace.explain.answer.confirm import Confirmation, confirm
from drake_ispace.explain.answer.controller import ControllerCheck, check_controller
from drake_ispace.explain.answer.describe import described, described_choice, with_free_run
from drake_ispace.explain.answer.explanation import Explanation, PlantParameter
from drake_ispace.explain.answer.free_run import Sizes, channel_of, dead_reckoning, fitted, part_of, simulation
from drake_ispace.explain.answer.validate import held_out_gap, validated_choice
from drake_ispace.explain.decide.decide import decide
from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.decide.joint import decide_jointly
from drake_ispace.explain.fit.candidates import candidates
from drake_ispace.explain.fit.likelihood import merged
from drake_ispace.explain.predict.own_model import OwnModel, own_replay, own_track
from drake_ispace.explain.predict.prediction import Prediction, predict
from drake_ispace.explain.predict.replay import Replay, replay_of
from drake_ispace.explain.predict.tracks import track
from drake_ispace.files.recording import Recording
from drake_ispace.robots.library import robots
from drake_ispace.robots.recordings import load
from drake_ispace.robots.robot import COMMAND, TORQUE, Robot
from drake_ispace.scenario import Scenario, as_scenario, difference
from drake_ispace.wiring.catalog import entry_of

_THREADS = 2
_FOREIGN_CONTROL = 0.12  # share of the torque that the model's controller may leave (its own one leaves 0 to 0.09)
_DECIDERS = {"largest": decide, "together": decide_jointly}
_VALIDATED = "free_run"

Run = Recording | str | Path
Runs = Run | Sequence[Run] | Mapping[str, Run]


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
    model: Scenario | OwnModel | str | Path, runs: Runs, held_out: Runs | Mapping[str, Runs] = (),
    effects: Sequence[Effect] | None = None, seed: int = 0, tell: Callable[[str], None] = lambda text: None,
    choice: str = "largest",
) -> Explanation:
    """Find what the model lacks.

    Args:
        model: a Scenario, the name or file of one, or a plant of your own (own_model.py).
        runs: measured: one or several, or by name as `hide` returns them; a folder stands for the run in it.
        held_out: others, to prove the answer on; a mapping has kinds of runs whose errors are reported apart.
        effects: to try, default the whole library. seed: of the bootstraps. tell: told about every stage.
        choice: "largest": the effect that explains most, and further ones unless they are small beside it. For a model
            that lacks little. "together": all effects that the runs support, each weighed against the others. For
            somebody else's robot, whose model mostly lacks several of very different size. "free_run": the fewest
            effects that simulate whole runs well, fitted to one half of the runs and judged on the other. For a plant
            of your own, and runs that are too short for a filter.

    Raises:
        InputError: a run that the model cannot predict, an unknown choice, or one that this model cannot have.
    """
    started = time.perf_counter()
    _check_choice(choice, model)
    tell("preparing the predictions")
    kinds = held_out if isinstance(held_out, Mapping) else {"held out": held_out}
    kinds = {name: _listed(some) for name, some in kinds.items()}
    case = prepare(model, _listed(runs), [run for some in kinds.values() for run in some], effects)
    if choice == _VALIDATED:
        answer, base, best = _validated(case, seed, tell)
    else:
        answer, base, best = _decided(case, _DECIDERS[choice], seed, tell)
    tell("letting whole runs go free")
    _free_runs(case, {name: len(some) for name, some in kinds.items()}, answer, base, best)
    if case.scenario is not None:
        tell("checking the controller")
        _controlled(answer, [check_controller(case.scenario, case.robot, run) for run in case.runs])
    answer.runs = [track.name for track in case.prediction.tracks]
    answer.held_out = [track.name for track in case.held_out.tracks] if case.held_out else []
    answer.seconds = time.perf_counter() - started
    return answer


def _decided(case, decider, seed, tell) -> tuple[Explanation, Sizes, Sizes]:
    """By the likelihood of what the model held on the measured motion could not predict; sizes without the effects and
    with them."""
    with ThreadPoolExecutor(_THREADS) as pool:
        decision = decider(case.prediction, candidates(_triable(case), case.replay.body), seed, pool, tell)
        tell("localising")
        answer = described(case, decision)
        if decision.named is not None and case.scenario is not None:
            _add(case, decision, answer)
        if decision.named is not None and case.held_out is not None:
            tell("confirming on the held-out runs")
            _confirmed(answer, confirm(case.held_out, decision, seed, pool))
    point = {} if decision.named is None else decision.named.point
    if case.scenario is not None:
        return answer, Sizes({}, {}), Sizes(point, {})
    base = fitted(case.replay, case.prediction.tracks, {})
    return answer, base, fitted(case.replay, case.prediction.tracks, point) if point else base


def _validated(case, seed, tell) -> tuple[Explanation, Sizes, Sizes]:
    """By simulations of whole runs; sizes as `_decided`."""
    choice = validated_choice(case.prediction, candidates(_triable(case), case.replay.body), tell)
    answer = described_choice(case, choice)
    if case.held_out is not None and choice.named:
        gap = held_out_gap(case.replay, case.held_out.tracks, choice, seed)
        if gap is not None:
            answer.gap, answer.closed = {channel_of(case.replay): gap}, gap.closed
    return answer, choice.base, choice.sizes


def _free_runs(case: Case, kinds: Mapping[str, int], answer: Explanation, base: Sizes, best: Sizes) -> None:
    """The errors of whole runs that nothing corrects; kinds: how many of the held-out runs are of each."""
    parts, end = {"training": case.prediction}, 0
    for name, count in kinds.items():
        if count:
            parts[name] = part_of(case.held_out, slice(end, end + count))
        end += count
    for name, part in parts.items():
        if case.scenario is not None:
            answer.free_run += dead_reckoning(name, part, merged(best.point))
        else:
            answer.free_run += simulation(name, case.replay, part.tracks, base, best)
    if case.scenario is None:
        answer.effects = with_free_run(answer.effects, case.replay, best)
        answer.plant = [PlantParameter(name, value, best.plant[name]) for name, value in base.plant.items()]


def _listed(runs):
    if isinstance(runs, Recording | str | Path):
        return [runs]
    return list(runs.values() if isinstance(runs, Mapping) else runs)


def _check_choice(choice, model):
    known = [*_DECIDERS, _VALIDATED]
    if choice not in known:
        raise InputError(f"choice: there is no {shown(choice)}, {expected_one_of(choice, known)}")
    if choice == _VALIDATED and not isinstance(model, OwnModel):
        others = " or ".join(repr(name) for name in _DECIDERS)
        raise InputError(f"choice: {_VALIDATED!r} is for a plant of your own (OwnModel), expected {others}")


def prepare(model, runs, held_out=(), effects=None) -> Case:
    """Load, check and compile; arguments as `explain`.

    Raises:
        InputError: as `explain`.
    """
    scenario = model if isinstance(model, OwnModel) else as_scenario(model)
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
        replay = own_replay(model, tracks, effects)
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
    return effect.parameters_of(case.replay.body)


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
