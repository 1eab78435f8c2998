"""Which way to read a channel makes it agree with the wheels, over all runs together.

A channel's readings are hypotheses; their log likelihoods stand in a table, a row a run. Two of them accuse
nobody: that the channel is right as given, and that it does not tell of the robot's motion at all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from drake_ispace.explain.check.compare.links import FEWEST, Base, Link, inside
from drake_ispace.explain.check.compare.regression import PHYSICS, Slack, most, scores
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.levels import CHANCE
from drake_ispace.faults.repair import Repair

#: A log likelihood ratio above which a fault is said: by chance, data without it reach that no more often than CHANCE.
SAID = -np.log(CHANCE)
ALIKE = 2.0  # below which two readings cannot be told apart
#: Of what agreement gains over no relation at all, the share below which a channel follows no robot.
RELATED = 0.3
UNRELATED = "no relation"


class Hypothesis(Protocol):
    """A way to read a channel: fault (empty: as given), in words, and advice.

    rare: whether it is less probable than others, such as two mistakes at the same time; it is then no rival of another
    one that explains as much.
    """

    fault: str
    what: str
    rare: bool
    advice: str


@dataclass(frozen=True)
class Part:
    """Log likelihoods (hypotheses,) of one comparison in one run, and that of exact agreement."""

    scored: np.ndarray
    most: float


@dataclass(frozen=True)
class Row:
    """Log likelihoods (hypotheses,) of all comparisons of a run together, priors included, and of exact agreement.

    Zeros where nothing was compared.
    """

    scored: np.ndarray
    most: float = 0.0


def following(related: float, unrelated: float, exact: float) -> float | None:
    """How well a channel follows the robot: 1 up to noise, 0 as if unrelated, below 0 against it; None: nobody can say.

    All three are logarithms of likelihood.
    """
    if RELATED * (exact - unrelated) < SAID:  # one that hardly follows would gain too little to be said
        return None
    return (related - unrelated) / (exact - unrelated)


def row(hypotheses: Sequence[Hypothesis], *parts: Part | None) -> Row:
    """All comparisons of one run. Of many mistakes that are tried each is as many times less probable."""
    present = [part for part in parts if part is not None]
    if not present:
        return Row(np.zeros(len(hypotheses)))
    many = np.log(len(hypotheses))
    losses = np.array([ALIKE * hypothesis.rare + many * bool(hypothesis.fault) for hypothesis in hypotheses])
    return Row(sum(part.scored for part in present) - losses, sum(part.most for part in present))


def part(
    x: np.ndarray, y: np.ndarray, groups, noise: np.ndarray, z: np.ndarray | None = None, slack: Slack = PHYSICS
) -> Part:
    """One comparison; arguments as of regression.scores."""
    return Part(scores(x, y, groups, noise, z, slack), float(most(y[:1], groups, np.zeros_like(noise[:1]))[0]))


def gains(rows: Sequence[Row], hypotheses: Sequence[Hypothesis]) -> np.ndarray:
    """(runs, hypotheses) by how much each is more likely than those that accuse nobody.

    One that leaves the channel nearly as unrelated to the motion as before is no explanation, and gains nothing.
    """
    innocent = [not hypothesis.fault for hypothesis in hypotheses]
    unrelated = [hypothesis.what == UNRELATED for hypothesis in hypotheses].index(True)
    found = []
    for one in rows:
        gain = one.scored - one.scored[innocent].max()
        least = one.scored[unrelated] + max(RELATED * (one.most - one.scored[unrelated]), SAID)
        found.append(np.where(one.scored >= least, gain, np.minimum(gain, 0.0)))
    return np.array(found)


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
    rows: Sequence[Row], hypotheses: Sequence[Hypothesis], channel: Callable[[Any], str],
    repairs: Callable[[Any], tuple[Repair, ...]], casting: Callable[[Any], float] | None = None,
    against: Callable[[int, Any], float] | None = None,
) -> Finding | None:
    """The hypothesis under which the runs agree with the wheels, as a finding; None where they do as given.

    rows: of each run. channel, repairs: of a hypothesis. casting: a log likelihood of a hypothesis by other channels,
    which decides between those that are alike. against: of a run's number and a hypothesis, how much parts of the run
    speak against it, as a loss of log likelihood: what explains some seconds is no mistake of the whole run.
    """
    each = gains(rows, hypotheses)
    while True:
        found = best(each)
        if found is None:
            return None
        k, which, gain = found
        odd = [i for i in which if against is not None and each[i, k] > 0.0 and against(i, hypotheses[k]) > ALIKE]
        if not odd:
            break
        each[odd, k] = -np.inf
    together = np.maximum(each, 0.0).sum(axis=0)
    alike = [j for j in np.flatnonzero(together > gain - ALIKE).tolist() if hypotheses[j].fault]
    if casting is not None and len({hypotheses[j].fault for j in alike}) > 1:
        k = max(alike, key=lambda j: together[j] + casting(hypotheses[j]))
        which = tuple(np.flatnonzero(each[:, k] >= -ALIKE).tolist())
    chosen, rivals = hypotheses[k], []
    for j in np.argsort(-together):
        name = hypotheses[j].fault
        if together[j] > gain - ALIKE and name not in ("", chosen.fault, *rivals):
            rivals.append(name)
    return Finding(
        chosen.fault, chosen.what, "", which, channel(chosen), drop_in_deviance=2.0 * gain, rivals=tuple(rivals),
        repairs=repairs(chosen), advice=chosen.advice,
    )


def compared(
    link: Link, base: Base, matrices: Sequence[np.ndarray], related: np.ndarray | float = 1.0
) -> Part | None:
    """Log likelihoods (matrices,) of a link whose measured columns are multiplied by matrices; None: too short.

    related: (matrices, 1, 1) factor on what the wheels predict, 0 where there is no relation.
    """
    kept = inside(base, link.since_s, link.until_s)
    if kept.sum() < FEWEST:
        return None
    since, until = link.since_s[kept], link.until_s[kept]
    y = np.stack([link.measured[kept] @ matrix.T for matrix in matrices])
    x = np.broadcast_to(related * link.predicted(since, until), y.shape)
    besides = None if link.besides is None else link.besides(since, until)
    return part(x, y, link.groups, np.broadcast_to(link.noise, (len(y), y.shape[2])), besides)


