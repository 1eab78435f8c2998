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

    rare: whether it is less probable than others, such as a mistake of many wheels; it is then no rival of another one
    that explains as much. of: the mistakes that it consists of; empty: it is one, or none.
    """

    fault: str
    what: str
    rare: bool
    advice: str
    of: tuple["Hypothesis", ...]


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


def mistakes(hypothesis: Hypothesis) -> tuple[Hypothesis, ...]:
    """Those that a hypothesis consists of, each by itself."""
    return hypothesis.of or (hypothesis,) if hypothesis.fault else ()


def row(hypotheses: Sequence[Hypothesis], *parts: Part | None) -> Row:
    """All comparisons of one run. Of many mistakes that are tried each is as many times less probable."""
    present = [part for part in parts if part is not None]
    if not present:
        return Row(np.zeros(len(hypotheses)))
    return Row(sum(part.scored for part in present) - _losses(hypotheses), sum(part.most for part in present))


def _losses(hypotheses):
    many = np.log(sum(not hypothesis.of for hypothesis in hypotheses))
    return np.array([ALIKE * hypothesis.rare + many * len(mistakes(hypothesis)) for hypothesis in hypotheses])


def part(
    x: np.ndarray, y: np.ndarray, groups, noise: np.ndarray, z: np.ndarray | None = None, slack: Slack = PHYSICS
) -> Part:
    """One comparison; arguments as of regression.scores."""
    return Part(scores(x, y, groups, noise, z, slack), float(most(y[:1], groups, np.zeros_like(noise[:1]))[0]))


def gains(rows: Sequence[Row], hypotheses: Sequence[Hypothesis]) -> np.ndarray:
    """(runs, hypotheses) by how much each is more likely than those that accuse nobody.

    One that leaves the channel nearly as unrelated to the motion as before is no explanation, and gains nothing; two
    mistakes at once must explain what made them be tried.
    """
    required = np.array([(2.0 if hypothesis.of else 1.0) * RELATED for hypothesis in hypotheses])
    innocent = [not hypothesis.fault for hypothesis in hypotheses]
    unrelated, found = _unrelated(hypotheses), []
    for one in rows:
        gain = one.scored - one.scored[innocent].max()
        least = one.scored[unrelated] + np.maximum(required * (one.most - one.scored[unrelated]), SAID)
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
    rows_of: Callable[[Sequence[Any]], list[Row]], hypotheses: Sequence[Hypothesis],
    pairs: Callable[[], Sequence[Hypothesis]], channel: Callable[[Any], str],
    repairs: Callable[[Any], tuple[Repair, ...]], casting: Callable[[Any], float] | None = None,
    against: Callable[[int, Any], float] | None = None,
) -> list[Finding]:
    """The hypothesis under which the runs agree with the wheels, as a finding for each of its mistakes.

    Empty where they do as given. Two mistakes at once are tried where after any single one no run follows the wheels well.

    rows_of: some hypotheses, of each run. pairs: hypotheses of two mistakes. channel, repairs: of a hypothesis.
    casting: a log likelihood of a hypothesis by other channels, which decides between those that are alike.
    against: of a run's number and a hypothesis, how much parts of the run speak against it, as a loss of log
    likelihood: what explains some seconds is no mistake of the whole run.
    """
    rows = rows_of(hypotheses)
    told = [follows for follows in (_follows(one, hypotheses) for one in rows) if follows is not None]
    if told and max(told) < 2.0 * RELATED:
        hypotheses = [*hypotheses, *pairs()]
        rows = rows_of(hypotheses)
    each = gains(rows, hypotheses)
    while True:
        found = best(each)
        if found is None:
            return []
        k, which, gain = found
        odd = [i for i in which if against is not None and each[i, k] > 0.0 and against(i, hypotheses[k]) > ALIKE]
        if not odd:
            break
        each[odd, k] = -np.inf
    together = np.maximum(each, 0.0).sum(axis=0)
    alike = [j for j in np.argsort(-together).tolist() if together[j] > gain - ALIKE and hypotheses[j].fault]
    if casting is not None:
        plain = together + sum(bool(one.scored.any()) for one in rows) * _losses(hypotheses)
        equal = [j for j in np.flatnonzero(plain > plain[k] - ALIKE).tolist() if hypotheses[j].fault and together[j] > 0.0]
        k = max(equal, key=lambda j: together[j] + casting(hypotheses[j])) if len(equal) > 1 else k
        which = tuple(np.flatnonzero(each[:, k] >= -ALIKE).tolist())
    chosen = mistakes(hypotheses[k])
    names = dict.fromkeys(one.fault for j in alike for one in mistakes(hypotheses[j]))
    rivals = tuple(name for name in names if name not in [one.fault for one in chosen])
    return [
        Finding(one.fault, one.what, "", which, channel(one), drop_in_deviance=2.0 * gain, rivals=rivals,
                repairs=repairs(one), advice=one.advice)
        for one in chosen
    ]


def _follows(one, hypotheses):
    """How well a run follows the wheels at best, as `following`."""
    return following(one.scored.max(), one.scored[_unrelated(hypotheses)], one.most)


def _unrelated(hypotheses):
    return [hypothesis.what == UNRELATED for hypothesis in hypotheses].index(True)


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


