"""Which way to read a channel makes it agree with the wheels, over all runs together.

A channel's readings are hypotheses; their log likelihoods stand in a table, a row a run. Two of them accuse
nobody: that the channel is right as given, and that it does not tell of the robot's motion at all.
"""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.links import FEWEST, Base, Link, inside
from drake_ispace.explain.check.regression import scores
from drake_ispace.faults.repair import Repair

#: A log likelihood ratio above which a fault is said, and one below which two faults cannot be told apart.
SAID, ALIKE = 6.0, 2.0


class Hypothesis(Protocol):
    """A way to read a channel: fault (empty: as given), in words, and a loss of log likelihood, its prior."""

    fault: str
    what: str
    loss: float


def row(hypotheses: Sequence[Hypothesis], *parts: np.ndarray | None) -> np.ndarray:
    """(hypotheses,) log likelihoods of one run, added over what was compared; zeros where nothing was."""
    total = -np.array([hypothesis.loss for hypothesis in hypotheses])
    present = [part for part in parts if part is not None]
    return total + sum(present) if present else np.zeros(len(hypotheses))


def gains(scored: np.ndarray, hypotheses: Sequence[Hypothesis]) -> np.ndarray:
    """(runs, hypotheses) by how much each is more likely than all that accuse nobody."""
    innocent = [not hypothesis.fault for hypothesis in hypotheses]
    return scored - scored[:, innocent].max(axis=1, keepdims=True)


def best(gain: np.ndarray) -> tuple[int, tuple[int, ...], float] | None:
    """The hypothesis that gains most (runs, hypotheses): its number, the runs that have it, and what it gains.

    It is of all runs unless a run speaks against it. None where nothing gains enough.
    """
    together = np.maximum(gain, 0.0).sum(axis=0)
    k = int(np.argmax(together))
    if together[k] < SAID:
        return None
    return k, tuple(np.flatnonzero(gain[:, k] >= -ALIKE).tolist()), float(together[k])


def disagreement(
    scored: np.ndarray, hypotheses: Sequence[Hypothesis], channel: Callable[[Any], str],
    repairs: Callable[[Any], tuple[Repair, ...]],
) -> Finding | None:
    """The hypothesis under which the runs agree with the wheels, as a finding; None where they do as given.

    scored: (runs, hypotheses). channel, repairs: of a hypothesis.
    """
    each = gains(scored, hypotheses)
    found = best(each)
    if found is None:
        return None
    k, which, gain = found
    together = np.maximum(each, 0.0).sum(axis=0)
    chosen, rivals = hypotheses[k], []
    for j in np.argsort(-together):
        name = hypotheses[j].fault
        if together[j] > gain - ALIKE and name not in ("", chosen.fault, *rivals):
            rivals.append(name)
    return Finding(
        chosen.fault, chosen.what, "", which, channel(chosen), drop_in_deviance=2.0 * gain, rivals=tuple(rivals),
        repairs=repairs(chosen),
    )


def compared(
    link: Link, base: Base, matrices: Sequence[np.ndarray], related: np.ndarray | float = 1.0
) -> np.ndarray | None:
    """(matrices,) log likelihoods of a link whose measured columns are multiplied by matrices; None: too short.

    related: (matrices, 1, 1) factor on what the wheels predict, 0 where there is no relation.
    """
    kept = inside(base, link.since_s, link.until_s)
    if kept.sum() < FEWEST:
        return None
    since, until = link.since_s[kept], link.until_s[kept]
    y = np.stack([link.measured[kept] @ matrix.T for matrix in matrices])
    x = np.broadcast_to(related * link.predicted(since, until), y.shape)
    besides = None if link.besides is None else link.besides(since, until)
    return scores(x, y, link.groups, np.broadcast_to(link.noise, (len(y), y.shape[2])), besides)


