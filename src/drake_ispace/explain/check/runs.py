"""Runs as a user gives them: folders or recordings, one or several, or by name."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from drake_ispace.files.recording import Recording

UNNAMED = "held out"  # the kind of held-out runs to which the user gave no kind

Run = Recording | str | Path
Runs = Run | Sequence[Run] | Mapping[str, Run]


def listed(runs: Runs) -> list[Run]:
    """The runs one after the other."""
    if isinstance(runs, Recording | str | Path):
        return [runs]
    return list(runs.values() if isinstance(runs, Mapping) else runs)


def name_of(run: Run, number: int) -> str:
    """The name of a run, for messages; number: of the run, counted from 0."""
    if isinstance(run, Recording):
        return str(run.path) if run.path else f"run {number + 1}"
    return str(run)
