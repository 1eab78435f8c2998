"""Which way to read a channel makes it agree with the wheels, over all runs together.

A channel's readings are hypotheses; their log likelihoods stand in a table, a row a run. Two of them accuse
nobody: that the channel is right as given, and that it does not tell of the robot's motion at all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from drake_ispace.explain.check.compare.links import FEWEST, Base, Link, in_motion, inside
from drake_ispace.explain.check.compare.regression import PHYSICS, Slack, most, scores
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.levels import CHANCE
from drake_ispace.faults.repair import Repair

#: A log likelihood ratio above which a fault is said: by chance, data without it reach that no more often than CHANCE.
SAID = -np.log(CHANCE)
ALIKE = 2.0  # below which two readings cannot be told apart
#: Of what agreement gains over no relation at all, the share below which a channel follows no robot.
RELATED = 0.3
WELL = 1.5 * RELATED  # above which it does well: a sound camera follows by half and more
UNRELATED = "no relation"


class Hypothesis(Protocol):
    """A way to read a channel: fault (empty: as given), in words, and advice.

    rare: whether it is less probable than others, such as a mistake of many wheels; it is then no rival of another one
    that explains as much. of: the mistakes that it consists of; empty: it is one, or none.
    shared: whether it is the model's, and so of all runs.
    """

    fault: str
    what: str
    rare: bool
    advice: str
    of: tuple["Hypothesis", ...]
    shared: bool


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


@dataclass(frozen=True)
class Agreement:
    """What makes a channel agree with the wheels.

    Attributes:
        findings: one for each mistake; empty: it agrees as given, or in no way. follows: how well most runs follow the
            wheels in their best reading, as `following`. explained: whether that is as well as a sound channel does.
    """

    findings: list[Finding]
    follows: float = 1.0
    explained: bool = True


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

    One that leaves the channel nearly as unrelated to the motion as before is no explanation, and gains nothing.
    """
    innocent = [not hypothesis.fault for hypothesis in hypotheses]
    unrelated, found = _unrelated(hypotheses), []
    for one in rows:
        gain = one.scored - one.scored[innocent].max()
        least = one.scored[unrelated] + max(RELATED * (one.most - one.scored[unrelated]), SAID)
        found.append(np.where(one.scored >= least, gain, np.minimum(gain, 0.0)))
    return np.array(found)


class _Choice:
    """What all runs say of some hypotheses.

    rows: of each run. each (runs, hypotheses), together (hypotheses,): what they gain. number: of the best hypothesis;
    None: nothing gains enough. losses (hypotheses,): by how improbable they are, which no run speaks of.
    """

    def __init__(self, rows, hypotheses, well, against, is_others):
        self.is_others = is_others
        self.rows, self.hypotheses, self.each = rows, hypotheses, gains(rows, hypotheses)
        self.unrelated, self.losses = _unrelated(hypotheses), _losses(hypotheses)
        # each mistake must be worth what is said of a fault
        self.worth = SAID * np.array([max(len(mistakes(hypothesis)) - 1, 0) for hypothesis in hypotheses])
        while True:
            self.together = np.maximum(self.each, 0.0).sum(axis=0) - self.worth
            best = int(np.argmax(self.together))
            self.number = best if self.together[best] >= SAID else None
            having = [] if self.number is None else [i for i in self.runs(best) if self.each[i, best] > 0.0]
            odd = [i for i in having if against is not None and against(i, hypotheses[best]) > ALIKE]
            if not odd and self._contradicted(best).any():  # of some runs only, but of no sound one
                odd = [i for i in having if self._is_sound(i, best, well)]
            if not odd:
                return
            self.each[odd, best] = -np.inf

    def runs(self, k):
        """Numbers of the runs that have a mistake: that show it, or if it is the model's do not speak against it."""
        having = ~self._contradicted(k) if self.hypotheses[k].shared else self.each[:, k] >= -ALIKE
        return tuple(np.flatnonzero(having).tolist())

    def _contradicted(self, k):
        """(runs,) whether each speaks against a hypothesis, however improbable that is."""
        return self.each[:, k] + self.losses[k] < -ALIKE

    def alike(self):
        """Numbers of the hypotheses that explain about as much, the best first."""
        near = np.flatnonzero(self.together > self.together[self.number] - ALIKE)
        return [j for j in near[np.argsort(-self.together[near])].tolist() if self.hypotheses[j].fault]

    def cast(self, casting, number):
        """The number of the hypothesis that other channels prefer among those that agree as well as that of a number.

        In the same runs, as what is said of more of them sums up to more.
        """
        there = sum(bool(one.scored.any()) for one in self.rows)
        plain = self.together + self.worth + there * self.losses  # how well they agree, however probable
        equal = np.flatnonzero((plain > plain[number] - ALIKE) & (self.together > 0.0)).tolist()
        equal = [j for j in equal if self.runs(j) == self.runs(number)]
        if len(equal) < 2:
            return number
        return max(equal, key=lambda j: self.together[j] + casting(self.hypotheses[j], self.runs(j)))

    def follows(self):
        """How well most runs follow the wheels in their best reading, as `following`; 1 where none can say."""
        told = self._shares()
        return float(np.median(told)) if told else 1.0

    def least(self):
        """How well the run follows them that does so least; 1 where none can say."""
        return min(self._shares(), default=1.0)

    def _shares(self):
        told = [self._share(one, int(one.scored.argmax())) for one in self.rows]
        return [share for share in told if np.isfinite(share)]

    def _share(self, one, k):
        """How well a run follows the wheels by a hypothesis, as `following`; NaN where it cannot say."""
        share = following(one.scored[k], one.scored[self.unrelated], one.most)
        return np.nan if share is None else share

    def _is_sound(self, i, k, well):
        """Whether run i follows the wheels well as given, and a hypothesis explains little of what that leaves.

        So it does where the channel is another run's.
        """
        given, read = (self._share(self.rows[i], j) for j in (0, k))
        return given >= well and (read < plainly_better(given) or self.is_others(i, self.hypotheses[k]))

    def is_better_than(self, other, well, least_share):
        """Whether two mistakes explain plainly more than a single one, or as much as a sound channel does.

        Of any run below least_share, where most runs follow as well as a sound channel without any mistake.
        """
        if other.number is not None:
            return self.follows() >= plainly_better(other.follows())
        if other.follows() < well:
            return self.follows() >= well
        both = zip(self._shares(), other._shares(), strict=True)
        return any(mine >= plainly_better(theirs) for mine, theirs in both if theirs < least_share)


def plainly_better(share):
    """The share, as of `following`, from which on RELATED of what another one leaves is explained."""
    return share + RELATED * (1.0 - share)


def disagreement(
    rows_of: Callable[[Sequence[Any]], list[Row]], hypotheses: Sequence[Hypothesis],
    pairs: Callable[[], Sequence[Hypothesis]] | None, channel: Callable[[Any], str],
    repairs: Callable[[Any], tuple[Repair, ...]], casting: Callable[[Any, tuple[int, ...]], float] | None = None,
    against: Callable[[int, Any], float] | None = None, well: float = WELL,
    is_others: Callable[[int, Any], bool] = lambda i, hypothesis: False, least_share: float = 0.0,
) -> Agreement:
    """The hypothesis under which the runs agree with the wheels: of one mistake, or of two at once.

    rows_of: some hypotheses, of each run. pairs: hypotheses of two mistakes; None: none are tried. channel, repairs: of
    a hypothesis. casting: of a hypothesis and the runs that have it, a log likelihood by other channels, which decides
    between those that are alike. against: of a run's number and a hypothesis, how much parts of the run speak against
    it, as a loss of log likelihood: what explains some seconds is no mistake of the whole run. well: share, as of
    `following`, above which a sound channel follows the wheels. is_others: of a run's number and a hypothesis,
    whether the channel that this accuses moves with the wheels of another run. least_share:
    below which in any run two mistakes at once are tried, too.
    """
    choice, at_once = _Choice(rows_of(hypotheses), hypotheses, well, against, is_others), None
    if pairs is not None and (choice.number is not None or choice.follows() < well or choice.least() < least_share):
        two = [*hypotheses, *pairs()]
        at_once = _Choice(rows_of(two), two, well, against, is_others)
        choice = at_once if at_once.is_better_than(choice, well, least_share) else choice
    follows = choice.follows()
    if choice.number is None:
        return Agreement([], follows, follows >= well)
    k, preferred = choice.number, choice
    if casting is not None:
        k = choice.cast(casting, k)
        if at_once is not None and choice.hypotheses[k].rare:  # no simpler than two of which other channels know
            k, preferred = at_once.cast(casting, k), at_once
    chosen, alike = mistakes(preferred.hypotheses[k]), choice.alike()
    names = dict.fromkeys(one.fault for j in alike for one in mistakes(choice.hypotheses[j]))
    rivals = tuple(name for name in names if name not in [one.fault for one in chosen])
    return Agreement([
        Finding(one.fault, one.what, channel(one), runs=preferred.runs(k), rivals=rivals, repairs=repairs(one),
                drop_in_deviance=2.0 * float(choice.together[choice.number]), advice=one.advice)
        for one in chosen
    ], follows, follows >= well)


def _unrelated(hypotheses):
    return [hypothesis.what == UNRELATED for hypothesis in hypotheses].index(True)


def compared(
    link: Link, base: Base, matrices: Sequence[np.ndarray], related: np.ndarray | float = 1.0,
    measured: Sequence[np.ndarray] | None = None,
) -> Part | None:
    """Log likelihoods (matrices,) of a link whose measured columns are multiplied by matrices; None: too short.

    related: (matrices, 1, 1 or d) factor on what the wheels predict, 0 where there is no relation. measured: (n, d)
    for each matrix; None: the link's.
    """
    kept = inside(base, link.since_s, link.until_s)
    kept &= in_motion(link.predicted(link.since_s, link.until_s), link.measured, link.noise)
    if kept.sum() < FEWEST:
        return None
    since, until = link.since_s[kept], link.until_s[kept]
    measured = [link.measured] * len(matrices) if measured is None else measured
    y = np.stack([motion[kept] @ matrix.T for motion, matrix in zip(measured, matrices, strict=True)])
    x = np.broadcast_to(related * link.predicted(since, until), y.shape)
    besides = None if link.besides is None else link.besides(since, until)
    return part(x, y, link.groups, np.broadcast_to(link.noise, (len(y), y.shape[2])), besides)


