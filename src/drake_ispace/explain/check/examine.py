"""Training and held-out runs, checked together, and without what is limited in time."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.checked import Checked
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.runs import UNNAMED, Runs, listed
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.files.recording import Recording
from drake_ispace.robots.recordings import load
from drake_ispace.scenario import Scenario


@dataclass(frozen=True)
class Examined:
    """Runs that were checked.

    Attributes:
        names: of the runs, those to train on first. trained: how many these are. findings: on all of them. serious:
            those in spite of which no model can be judged, or that leave nothing of the runs. runs: to train on.
        held_out: by kind. repeated: in words, each run that is an earlier one again.
    """

    names: list[str]
    trained: int
    findings: list[Finding]
    serious: list[Finding]
    runs: list[Recording]
    held_out: Mapping[str, list[Recording]]
    repeated: list[str] = field(default_factory=list)


def examine(
    model: Scenario | OwnModel, runs: Runs, held_out: Runs | Mapping[str, Runs], trust_data: bool,
    tell: Callable[[str], None],
) -> Examined:
    """Check all runs.

    Args:
        model, runs, held_out: as of `explain`. trust_data: whether the runs are used as they are.

    Raises:
        InputError: a run that cannot be read or is of another robot.
    """
    kinds = held_out if isinstance(held_out, Mapping) else {UNNAMED: held_out}
    given = {None: listed(runs), **{kind: listed(some) for kind, some in kinds.items()}}
    loaded = {kind: [run if isinstance(run, Recording) else load(run) for run in some] for kind, some in given.items()}
    everything = [run for some in loaded.values() for run in some]
    found = check(model, everything, tell) if everything else Checked([], [], [])
    masked = iter([[run] for run in everything] if trust_data else found.masked(everything))
    kept = {kind: [part for _ in some for part in next(masked)] for kind, some in loaded.items()}
    nothing_left = loaded[None] and not kept[None]
    serious = found.limited if nothing_left else found.serious
    trained, repeated = len(loaded[None]), _repeated(everything, found.names)
    return Examined(found.names, trained, found.findings, serious, kept.pop(None), kept, repeated)


def _repeated(runs, names):
    """As of Examined."""
    pairs = ((i, next((j for j in range(i) if _same(runs[i], runs[j])), None)) for i in range(len(runs)))
    return [
        f"{names[i]} is {names[j]} again: it proves nothing, and counts as if it were another one"
        for i, j in pairs if j is not None
    ]


def _same(one, other):
    channels = [(channel, other.channels.get(name)) for name, channel in one.channels.items()]
    return len(one.channels) == len(other.channels) and all(
        b is not None and np.array_equal(a.t, b.t) and np.array_equal(a.values, b.values) for a, b in channels
    )
