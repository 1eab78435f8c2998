"""Recordings with chosen effects hidden in them, for tests and demonstrations.

A recording holds neither the names nor the sizes of the effects. `explain` does not import this file.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from drake_ispace.alignment import to_recording
from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.effects.effect import BlockEffect, body_of
from drake_ispace.effects.library import checked_effects, library
from drake_ispace.files.places import fresh_folder
from drake_ispace.files.recording import Recording
from drake_ispace.robots.library import robots
from drake_ispace.robots.robot import TORQUE
from drake_ispace.rollout.engine import simulate_compiled
from drake_ispace.scenario import Scenario, as_scenario
from drake_ispace.wiring.catalog import build_diagram, entry_of

#: Kind of motion -> what differs from the scenario's trajectory. All stay within 0.9 m x 0.6 m of the middle.
MOTIONS = {
    "square": {"kind": "square", "side_m": 1.2, "speed_m_s": 0.25},
    "circle": {"kind": "circle", "radius_m": 0.55, "speed_m_s": 0.3, "heading": "tangent"},
    "figure_eight": {"kind": "figure_eight", "radius_m": 0.45, "speed_m_s": 0.25},
    "trapezium": {
        "kind": "polyline", "points_m": [[-0.7, -0.5], [0.7, -0.3], [0.4, 0.55], [-0.5, 0.4], [-0.7, -0.5]],
        "speed_m_s": 0.2,
    },
}
ANSWER, HASH = "answer.json", "answer.sha256"
#: White noise of the wheels' torque [N m] and of slip, drawn every 5 ms, where the scenario has none.
_TORQUE_NOISE_N_M = 0.005
_SLIP_NOISE = 0.02


def hide(
    scenario: Scenario | str | Path, robot: str, effects: Mapping[str, Mapping[str, float]],
    motions: Sequence[str] = tuple(MOTIONS), seed: int = 0, seconds: float = 20.0,
) -> dict[str, Recording]:
    """Simulate runs of a robot with effects that its controller does not know.

    Args:
        scenario: the model, its name or its file; its Diagram has the robot.
        effects: name -> parameters, besides those of the scenario.
        motions: names in MOTIONS; one may occur several times. seed: of all noise; each run draws other noise.
            seconds: duration of each run.

    Returns:
        Name of the run -> recording without truth, settings and notes.

    Raises:
        InputError: an unknown effect, parameter or motion, an effect without a place in the Diagram, a robot that the
            Diagram does not have, or one that falls or gets lost with the effects.
    """
    if robot not in robots():
        raise InputError(f"there is no robot {shown(robot)}, {expected_one_of(robot, robots())}")
    if unknown := [motion for motion in motions if motion not in MOTIONS]:
        raise InputError(f"there is no motion {shown(unknown[0])}, {expected_one_of(unknown[0], MOTIONS)}")
    scenario = as_scenario(scenario)
    given = checked_effects(effects, body_of(scenario, robots()[robot]), "effects")
    runs = {}
    for i, motion in enumerate(motions):
        name = motion if motion not in runs else f"{motion}_{i + 1}"
        runs[name] = _without_truth(_simulated(scenario, robot, given, motion, seed + 1009 * i, seconds, name), robot)
    return runs


def save_hidden(
    runs: Mapping[str, Recording], robot: str, effects: Mapping[str, Mapping[str, float]], seed: int, out: Path,
) -> str:
    """Write each recording into a folder of its own, and the answer and its hash beside them.

    `sha256sum -c answer.sha256` checks that the answer was not changed.

    Returns:
        The SHA-256 of answer.json, in hexadecimal.

    Raises:
        InputError: the folder cannot be written.
    """
    answer = {"robot": robot, "effects": {name: dict(values) for name, values in effects.items()}, "seed": seed,
              "runs": list(runs)}
    text = json.dumps(answer, indent=2) + "\n"
    digest = hashlib.sha256(text.encode()).hexdigest()
    with fresh_folder(out) as fresh:
        for name, recording in runs.items():
            recording.save(fresh / name)
        (fresh / ANSWER).write_text(text, encoding="utf-8")
        (fresh / HASH).write_text(f"{digest}  {ANSWER}\n", encoding="utf-8")
    return digest


def _simulated(scenario, robot, effects, motion, seed, seconds, name):
    """A Run of the scenario with these effects; name: of the run, for messages."""
    section = getattr(scenario, robot)
    changed = {
        "effects": {**section.effects, **effects}, "initial_pose": None,
        "trajectory": replace(section.trajectory, csv=None, laps=0, **MOTIONS[motion]),
    }
    if robots()[robot].driven == TORQUE:  # a robot driven by velocity takes neither noise
        slip = section.plant.slip
        if not any(slip.noise_std):
            changed["plant"] = replace(section.plant, slip=replace(slip, noise_std=[_SLIP_NOISE] * 3))
        if section.actuator.noise_std_n_m == 0.0:
            changed["actuator"] = replace(section.actuator, noise_std_n_m=_TORQUE_NOISE_N_M)
    hidden = replace(scenario, seed=seed, seconds=seconds, **{robot: replace(section, **changed)})
    diagram = build_diagram(hidden)
    _check_places(diagram, hidden, robot, effects)
    run = simulate_compiled(hidden, diagram)
    if run.diverged_s is not None:
        raise InputError(
            f"effects: with {', '.join(effects)} the robot falls or is lost after {run.diverged_s:.2f} s ({name}), "
            "expected smaller ones"
        )
    return run


def _without_truth(run, robot):
    """The recording of a run, without truth, settings and notes."""
    recording = to_recording(run, robot)
    channels = {name: channel for name, channel in recording.channels.items() if name != "truth"}
    return replace(recording, channels=channels, notes="", settings=None)


def _check_places(diagram, scenario, robot, effects):
    """Refuse an effect whose wire the Diagram does not have: without it the recording would not match its answer."""
    blocks = {block.get_name() for block in diagram.GetSystems()}
    if robot not in entry_of(scenario).robots:
        raise InputError(f"the Diagram {scenario.diagram} has no robot {robot}, expected another robot or Diagram")
    for name in effects:
        if isinstance(library()[name], BlockEffect) and f"{robot}_{name}" not in blocks:
            raise InputError(f"effects.{name}: has no place in the Diagram {scenario.diagram}, expected another effect")
