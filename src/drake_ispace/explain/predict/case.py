"""The case to be explained: a model, runs of one robot, checked, and the prediction Diagram compiled for them."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.effect import Effect
from drake_ispace.explain.check.runs import UNNAMED, Runs, at_least_one, by_kind, loaded, name_of, robot_of
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.explain.predict.own_replay import own_replay, own_track
from drake_ispace.explain.predict.prediction import Prediction, predict
from drake_ispace.explain.predict.replay import Replay, replay_of
from drake_ispace.explain.predict.stretches import begun, in_stretches, stretches_of
from drake_ispace.explain.predict.tracks import SHORTEST_S, Track, coarsest_count, read_ticks, track
from drake_ispace.faults.repair import Clock
from drake_ispace.files.recording import Recording
from drake_ispace.robots.robot import COMMAND, TORQUE
from drake_ispace.scenario import Scenario, as_scenario


@dataclass(frozen=True)
class Case:
    """A model and the runs that it is compared with.

    Attributes:
        scenario: the model; None for a plant of the user's own. robot: its name. runs: the training runs as recorded.
        replay: the compiled prediction Diagram. prediction: of the training runs. held_out: of the held-out runs, None
            without any. kinds: kind of held-out runs -> which of them are of that kind, in the order of `held_out`.
        warning: a sentence where the begin of a run or its IMU is not used, or where runs stand for more than was
            recorded: stretches for long ones, or torques that are held between rare samples; else "".
    """

    scenario: Scenario | None
    robot: str
    runs: list[Recording]
    replay: Replay
    prediction: Prediction
    held_out: Prediction | None
    kinds: Mapping[str, slice]
    warning: str = ""

    @property
    def is_filtered(self) -> bool:
        """Whether the runs are long enough for the statistics of a filter; those of a scenario's robot always are."""
        return max(track.ticks for track in self.prediction.tracks) * TICK_S >= SHORTEST_S

    def with_earlier(self, channel: str, ticks: int) -> "Case":
        """The case with IMU, encoders or what drives the robot so many ticks earlier than their stamps say."""
        clock = Clock(channel, 1.0, -ticks * TICK_S)
        runs = [clock.apply(run) for run in self.runs]
        return replace(self.with_tracks(lambda track: track.earlier(channel, ticks)), runs=runs)

    def with_tracks(self, changed: Callable[[Track], Track]) -> "Case":
        """The case with every track, held out or not, as `changed` returns it."""
        both = [
            prediction and predict(self.replay, [changed(track) for track in prediction.tracks])
            for prediction in (self.prediction, self.held_out)
        ]
        return replace(self, prediction=both[0], held_out=both[1])

    @property
    def effects_to_try(self) -> dict[str, Effect]:
        """Name -> effect that the predictions depend on: without torque, those of geometry, encoders and camera.

        An effect that the model has already is tried as a further one on top of it, unless it selects a wheel, acts in
        a part of the room, or is a limit, for which there is no sum.
        """
        body, known = self.replay.body, self.replay.known
        kinematic = not self.prediction.channels["motion"] and body.robot.driven == TORQUE and body.robot.in_room
        return {
            name: effect for name, effect in self.replay.effects.items() if (effect.kinematic or not kinematic)
            and not (name in known and (
                effect.choices or effect.is_local or any(p.reciprocal for p in effect.parameters_of(body))
            ))
        }


def prepare(
    model: Scenario | OwnModel | str | Path, runs: Runs, held_out: Runs | Mapping[str, Runs] = (),
    effects: Sequence[Effect] | None = None, most_s: float = math.inf,
) -> Case:
    """Load and check runs, and compile the model with every effect in it at its neutral value.

    Args:
        model: a Scenario, the name or file of one, or a plant of the user's own. runs: to train on, one or several, or
            by name; a folder stands for the run in it. held_out: other runs; a mapping has runs by kind. effects: to
            try, default the whole library. most_s: how much of the training runs is used, and half as much of each
            kind of held-out runs [s]; longer ones are represented by stretches of them.

    Raises:
        InputError: no run, a file that cannot be read, runs of another robot, or runs that the model cannot predict.
    """
    scenario = None if isinstance(model, OwnModel) else as_scenario(model)
    training, others = at_least_one(runs), by_kind(held_out)
    n, warning = len(training), ""
    recordings = [
        (name_of(run, i), loaded(run))
        for i, run in enumerate([*training, *(run for some in others.values() for run in some)])
    ]
    if scenario is None:
        robot, tracks = model.name, [own_track(recording, model, name) for name, recording in recordings]
        replay, warning = own_replay(model, tracks[:n], effects, tracks[n:]), _held_between(tracks)
    else:
        known = robot_of(scenario, [recording for _, recording in recordings], [name for name, _ in recordings])
        robot, (tracks, channels) = known.name, _tracks(scenario, known, recordings)
        replay = replay_of(scenario, known, channels, effects, read_ticks(tracks), coarsest_count(tracks))
    tracks = [begun(one, replay.body.wheels, replay.settling_ticks) for one in tracks]
    cut = _cut_begins(tracks)
    if scenario is not None and known.driven == TORQUE:
        tracks, n, others, warning = _shortened(tracks, n, others, most_s, replay)
    warning = "; ".join(said for said in (cut, warning, _not_predicted(replay, recordings)) if said)
    case = Case(
        scenario, robot, [one for _, one in recordings[: len(training)]], replay, predict(replay, tracks[:n]),
        predict(replay, tracks[n:]) if tracks[n:] else None, _slices(others), warning,
    )
    if scenario is not None:
        _check_comparable(case)
    return case


def _not_predicted(replay, loaded) -> str:
    """A sentence where runs have an IMU that the model says nothing of, else nothing."""
    has_imu = any("imu" in recording.channels for _, recording in loaded)
    return "the IMU is not used: this robot's model predicts none" if has_imu and not replay.body.robot.has_imu else ""


def _shortened(tracks, n, kinds, most_s, replay):
    """The tracks, how many of them are training runs, the held-out ones by kind, and what was done in a sentence.

    n: the number of training runs, which come first. kinds: kind of held-out runs -> those of it, in their order.
    """
    how = replay.body.wheels, replay.settling_ticks
    training, spare = stretches_of(tracks[:n], most_s, *how)
    training = in_stretches(training, replay.settling_ticks)
    rest = iter(tracks[n:])
    found = {
        kind: stretches_of(list(itertools.islice(rest, len(runs))), 0.5 * most_s, *how)[0]
        for kind, runs in kinds.items()
    }
    if spare and not any(found.values()):
        found = {UNNAMED: spare}
    held_out = list(itertools.chain.from_iterable(found.values()))
    said = [
        f"of {_seconds(before):.0f} s of {name} {len(after)} stretches, {_seconds(after):.0f} s, were used"
        for name, before, after in (
            ("training runs", tracks[:n], training), ("held-out runs", tracks[n:], held_out),
        ) if before and _seconds(after) < _seconds(before)
    ]
    return [*training, *held_out], len(training), found, "; ".join(said)


def _cut_begins(tracks) -> str:
    """A sentence that names the runs whose begin is not used; empty if there is none."""
    cut = [f"of {track.name} the first {track.since_s:.3g} s" for track in tracks if track.since_s]
    return f"{', '.join(cut)} are not used: encoder or IMU begin later" if cut else ""


def _held_between(tracks) -> str:
    """That torques are taken as held between their samples, where the encoder was read at least twice as often."""
    torque_s, read_s = max(track.command_step_s for track in tracks), read_ticks(tracks) * TICK_S
    if torque_s < 2.0 * read_s:
        return ""
    return (
        f"torque was logged every {1e3 * torque_s:.3g} ms, the encoder every {1e3 * read_s:.3g} ms: the torque is "
        "taken as held in between, and one that changed there looks like a lag or a friction"
    )


def _seconds(tracks):
    """How long they last altogether [s]."""
    return sum(track.ticks - track.unscored_ticks for track in tracks) * TICK_S


def _slices(kinds: Mapping[str, list]) -> dict[str, slice]:
    """Kind -> where its runs lie when the runs of all kinds stand in one list; kinds without a run are left out."""
    slices, end = {}, 0
    for kind, runs in kinds.items():
        if runs:
            slices[kind] = slice(end, end + len(runs))
        end += len(runs)
    return slices


def _tracks(scenario, robot, recordings) -> tuple[list[Track], frozenset[str]]:
    """The runs on 5 ms ticks, and the channels that every run has; the camera, which only compares, if any run has it.
    """
    plant = getattr(scenario, robot.name).plant
    tracks = [track(recording, robot, plant, name) for name, recording in recordings]
    common = frozenset.intersection(*(one.has for one in tracks))
    if not common & {"encoder", "kinect", "imu"}:
        raise InputError(f"{tracks[0].name}: the runs have no measured channel in common, expected encoder or kinect")
    if robot.driven == COMMAND and COMMAND not in common:
        tracks = [
            replace(one, command=np.zeros_like(one.command), unsure=None, measured=one.turned, rounding=None)
            for one in tracks
        ]
    return tracks, common.union(*(one.has & {"kinect"} for one in tracks))


def _check_comparable(case):
    """Refuse runs in which nothing that is predicted was measured."""
    for prediction in (case.prediction, *([case.held_out] if case.held_out is not None else [])):
        if not any(rows.size for run in prediction.residuals({}) for rows in run.values()):
            raise InputError(
                f"{prediction.tracks[0].name}: nothing to compare, expected encoder and torque (of the pendulum imu "
                "too) or encoder and kinect, for some seconds"
            )


def part_of(prediction: Prediction, runs: slice) -> Prediction:
    """A Prediction of some of the runs by the same model."""
    parts = {name: getattr(prediction, name)[runs] for name in ("tracks", "starts", "anchored")}
    return replace(prediction, **parts)


def joined(one: Prediction, other: Prediction) -> Prediction:
    """The model against the runs of both predictions, those of `one` first."""
    both = {name: getattr(one, name) + getattr(other, name) for name in ("tracks", "starts", "anchored")}
    return replace(one, **both)
