"""Runs as a user gives them: folders or recordings, one or several, or by name."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
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
Runs = Run | Sequence[Run] | Mapping[str, Run] | None


def listed(runs: Runs, given: str = "runs") -> list[Run]:
    """The runs one after the other; a recording that is given by name has that name in messages. None are none.

    given: what they were given as, for messages.

    Raises:
        InputError: something else than recordings and folders.
    """
    if isinstance(runs, Run):
        return [runs]
    if runs is None:
        return []
    every = [runs]
    if isinstance(runs, Mapping):
        every = [_called(run, name) for name, run in runs.items()]
    elif isinstance(runs, Iterable) and not isinstance(runs, np.ndarray | bytes):
        every = list(runs)
    for run in every:
        if not isinstance(run, Run):
            raise InputError(f"{given}: expected recordings or folders of runs, got {type(run).__name__} {shown(run)}")
    return every


def at_least_one(runs: Runs) -> list[Run]:
    """As `listed`.

    Raises:
        InputError: there is none, or something else than recordings and folders.
    """
    every = listed(runs)
    if not every:
        raise InputError("runs: there is none, expected at least one")
    return every


def by_kind(held_out: Runs | Mapping[str, Runs]) -> dict[str, list[Run]]:
    """Kind -> held-out runs of it, one after the other; one recording by itself is named by its kind."""
    if not isinstance(held_out, Mapping):
        return {UNNAMED: listed(held_out, "held_out")}
    return {
        kind: listed({kind: some} if isinstance(some, Run) else some, f"held_out: {kind}")
        for kind, some in held_out.items()
    }


def _called(run: Run, name: str) -> Run:
    """A recording in memory under the name that its user gives it; one that was read has that of its folder."""
    if not isinstance(run, Recording) or run.path is not None:
        return run
    return replace(run, path=Path(str(name).replace("/", "_")))


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
    """Refuse a channel without samples, an encoder of one, which tells of no motion, and what `check_sizes` refuses.

    Raises:
        InputError: naming run and channel, and its file.
    """
    for channel, samples in recording.channels.items():
        where = f"{name}: channel {channel}" + (f" ({samples.file})" if samples.file else "")
        if not samples.t.size:
            raise InputError(f"{where} holds no sample, expected some, or no such channel")
        if samples.t.size == 1 and channel == "encoder":
            raise InputError(f"{where} holds one sample, which tells of no motion, expected more")
    check_sizes(recording, name)


def check_sizes(recording: Recording, name: str) -> None:
    """Refuse values that are not one for each time and column, what is no number, and numbers that no sensor gives in
    any unit, with which nothing can be computed.

    Raises:
        InputError: naming run, channel and column.
    """
    for channel, samples in recording.channels.items():
        if samples.values.shape != (*samples.t.shape, len(samples.columns)) or samples.t.ndim != 1:
            raise InputError(
                f"{name}: channel {channel}: t has shape {samples.t.shape} and values {samples.values.shape}, expected "
                f"(n,) and (n, {len(samples.columns)}) for the columns {', '.join(samples.columns)}"
            )
        check_finite(samples, f"{name}: channel {channel}", lambda row: f"sample {row + 1}")
        size = np.abs(np.column_stack([samples.t, samples.values])).max(axis=0, initial=0.0)
        for column, largest in zip(("t", *samples.columns), size, strict=True):
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
