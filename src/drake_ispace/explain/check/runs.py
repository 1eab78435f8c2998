"""Runs as a user gives them: folders or recordings, one or several, or by name."""

from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.files.recording import Recording, check_finite
from drake_ispace.robots.library import robots
from drake_ispace.robots.recordings import load
from drake_ispace.robots.robot import Robot
from drake_ispace.scenario import Scenario
from drake_ispace.wiring.catalog import entry_of

_LARGEST = np.reciprocal(np.finfo(float).eps)  # in any unit; above it a number no longer counts by ones

UNNAMED = "held out"  # the kind of held-out runs to which the user gave no kind

Run = Recording | str | Path
Runs = Run | Sequence[Run] | Mapping[str, Run]


def listed(runs: Runs) -> list[Run]:
    """The runs one after the other."""
    if isinstance(runs, Recording | str | Path):
        return [runs]
    return list(runs.values() if isinstance(runs, Mapping) else runs)


def by_kind(held_out: Runs | Mapping[str, Runs]) -> dict[str, list[Run]]:
    """Kind -> held-out runs of it, one after the other."""
    kinds = held_out if isinstance(held_out, Mapping) else {UNNAMED: held_out}
    return {kind: listed(some) for kind, some in kinds.items()}


def loaded(run: Run) -> Recording:
    """The recording of a run.

    Raises:
        InputError: a folder that cannot be read.
    """
    return run if isinstance(run, Recording) else load(run)


def name_of(run: Run, number: int) -> str:
    """The name of a run, for messages; number: of the run, counted from 0."""
    if isinstance(run, Recording):
        return str(run.path) if run.path else f"run {number + 1}"
    return str(run)


def robot_of(scenario: Scenario, runs: Sequence[Recording], names: Sequence[str]) -> Robot:
    """The robot of a scenario that all runs are of; names: of the runs, for messages.

    Raises:
        InputError: a run of another robot, by what the model describes or by the first run.
    """
    known = [robots()[name] for name in entry_of(scenario).robots]
    own = next((robot for robot in known if robot.answers_to(runs[0].robot)), None)
    for name, run in zip(names, runs, strict=True):
        if not any(robot.answers_to(run.robot) for robot in known):
            raise InputError(
                f"{name}: the run is of robot {shown(run.robot)}, expected "
                f"{' or '.join(robot.name for robot in known)}, which the model {scenario.diagram} describes"
            )
        if run.robot != runs[0].robot:
            raise InputError(
                f"{name}: the run is of robot {shown(run.robot)}, expected {shown(runs[0].robot)} as {names[0]}"
            )
    return own


def check_given(recording: Recording, name: str) -> None:
    """Refuse a channel without samples, and what `check_sizes` refuses.

    Raises:
        InputError: naming run and channel.
    """
    for channel, samples in recording.channels.items():
        if not len(samples.t):
            raise InputError(f"{name}: channel {channel} holds no sample, expected some, or no such channel")
    check_sizes(recording, name)


def check_sizes(recording: Recording, name: str) -> None:
    """Refuse what is no number, and numbers that no sensor gives in any unit, with which nothing can be computed.

    Raises:
        InputError: naming run, channel and column.
    """
    for channel, samples in recording.channels.items():
        check_finite(samples, f"{name}: channel {channel}", lambda row: f"sample {row + 1}")
        size = np.abs(samples.values).max(axis=0, initial=0.0)
        for column, largest in zip(samples.columns, size, strict=True):
            if largest > _LARGEST:
                raise InputError(
                    f"{name}: channel {channel}: {column} is as large as {largest:.3g}, expected below {_LARGEST:.0e}"
                )


@contextmanager
def solvable():
    """Say in one sentence where numbers cannot be computed with, or are too many for this machine.

    Raises:
        InputError: for an error of linear algebra, and for one of memory.
    """
    try:
        yield
    except np.linalg.LinAlgError as error:
        raise InputError(
            f"the runs and the model: no fit can be computed from these numbers ({str(error).rstrip('.')}), expected "
            "motion in every run and a model closer to the robot"
        ) from None
    except MemoryError:
        raise InputError("the runs: too long for the memory of this machine, expected shorter or fewer ones") from None
