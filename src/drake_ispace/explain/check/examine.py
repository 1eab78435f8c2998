"""Training and held-out runs, checked together, and without what is limited in time."""

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from drake_ispace.explain.check.check import check
from drake_ispace.explain.check.checked import Checked
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.runs import Runs, by_kind, listed, loaded, name_of
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.faults.repair import repaired
from drake_ispace.files.recording import Recording
from drake_ispace.scenario import Scenario


@dataclass(frozen=True)
class Examined:
    """Runs that were checked.

    Attributes:
        names: of the runs, those to train on first. trained: how many these are. findings: on all of them. serious:
            those in spite of which no model can be judged, or that leave nothing of the runs. runs: to train on.
        held_out: by kind. warnings: in words, each run that is an earlier one again, and what is not left to prove on.
    """

    names: list[str]
    trained: int
    findings: list[Finding]
    serious: list[Finding]
    runs: list[Recording]
    held_out: Mapping[str, list[Recording]]
    warnings: list[str] = field(default_factory=list)

    @property
    def every(self) -> list[Recording]:
        """All runs, held-out ones after the others."""
        return [*self.runs, *itertools.chain(*self.held_out.values())]

    def with_repaired(self, found: Mapping[int, Finding]) -> "Examined":
        """The runs after the repairs of further findings, by the number of the run in `every`."""
        after = iter([repaired(run, found[i].repairs) if i in found else run for i, run in enumerate(self.every)])
        runs = list(itertools.islice(after, len(self.runs)))
        held_out = {kind: list(itertools.islice(after, len(some))) for kind, some in self.held_out.items()}
        return replace(self, findings=[*self.findings, *found.values()], runs=runs, held_out=held_out)


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
    given = {None: listed(runs), **by_kind(held_out)}
    everything = [_named(loaded(run), i) for i, run in enumerate(run for some in given.values() for run in some)]
    found = check(model, everything, tell) if everything else Checked([], [], [])
    masked = iter([[run] for run in everything] if trust_data else found.masked(everything))
    kept = {kind: [part for _ in some for part in next(masked)] for kind, some in given.items()}
    trained, training = len(given[None]), kept.pop(None)
    serious = found.limited if trained and not training else found.serious
    warnings = _repeated(everything, found.names)
    if len(everything) > trained and not any(kept.values()):
        warnings.append("nothing is left of the held-out runs: the answer is proved without them")
    return Examined(found.names, trained, found.findings, serious, training, kept, warnings)


def _named(run, number):
    """The run under the name that all messages give it, also where parts of other runs come before it."""
    return run if run.path is not None else replace(run, path=Path(name_of(run, number)))


def _repeated(runs, names):
    """A sentence on each run that is an earlier one again."""
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
