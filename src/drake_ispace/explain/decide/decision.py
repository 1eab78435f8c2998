"""The result of deciding: which effects are named, and what these runs cannot tell from them."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from drake_ispace.explain.decide.proposals.detect import CLEAR_MINUS_LOG10_P, FALSE_ALARM_RATE, Detection
from drake_ispace.explain.decide.survey.generic import Generic
from drake_ispace.explain.decide.survey.screen import gain_at
from drake_ispace.explain.decide.survey.survey import Survey
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Fit, Point

MARGIN = gain_at(-math.log10(FALSE_ALARM_RATE))  # lead in deviance of one of two that noise makes as rarely as that
LEAST_FURTHER = gain_at(CLEAR_MINUS_LOG10_P)  # drop in deviance that a further effect of one number must reach
NEXT_TO_NOTHING = 0.01  # share of what effects explain: no model is as good as that


def margin(compared: int) -> float:
    """The lead in deviance from which an effect is ruled out that is compared with the best of so many look-alikes.

    Each of them has its chance to gain by noise what the true effect does not: they share the level of `MARGIN`.
    """
    return gain_at(math.log10(max(compared, 1) / FALSE_ALARM_RATE))


def least_further(candidate: Candidate) -> float:
    """The drop in deviance that this further effect must reach.

    Noise gains as much with the same probability, however many numbers are fitted, and wheels or places tried.
    """
    return gain_at(least_clear(candidate), len(candidate.parameters))


def least_clear(candidate: Candidate) -> float:
    """The -log10 p of `least_further`."""
    return CLEAR_MINUS_LOG10_P + math.log10(candidate.among)


@dataclass(frozen=True)
class Rival:
    """An effect that could stand in the place of a named one.

    Attributes:
        candidate: the effect. behind: by how much the deviance is larger with it, complexity penalties included.
        point: all effects, with it in the place of the named one; None: not fitted.
    """

    candidate: Candidate
    behind: float
    point: Point | None = None


@dataclass(frozen=True)
class LeftOver:
    """A disagreement that is still detectable beside the named effects.

    Attributes:
        candidate: an effect, or a generic disagreement. gain: drop in deviance by it over the overdispersion.
        p_value: probability that noise shows as much. is_more: whether it is a generic disagreement that small flaws in
            the form of the named effects cannot stand for: something is missing.
    """

    candidate: Candidate
    gain: float
    p_value: float
    is_more: bool


@dataclass(frozen=True)
class Asked:
    """An effect that the proof asks for.

    Attributes:
        effect: the effect. point: all effects that are to be named then. rivals: those that the proof cannot tell from
            it; None: the proof does not say.
    """

    effect: Candidate
    point: Point
    rivals: list[Rival] | None = None


@dataclass
class Decision:
    """Which effects the runs support.

    Attributes:
        detection: whether anything is missing. start: survey of the model as given. end: survey with the named
            effects in the model. named: fit of the named effects, None where there is none. rivals: named effect ->
            those that cannot be ruled out in its place. gains: named effect -> rise of the deviance without it.
        unknown: a generic disagreement that explains more than any effect, and its gain. nearest: where unknown, the
            effect that explains most, and its gain. left_over: what is still detectable beside the named effects.
        total_gain: drop in deviance by the named effects under the noise of `end`. otherwise: the Decision to fall
            back on should the named effects not suffice on unseen runs. further: the named effects and one more beside
            them, the clearest one first. kept: effect that a proof asked for -> its rivals by what asked for it, None
            if that does not say. naming: computes the Decision that names the effects of a point instead.
    """

    detection: Detection
    start: Survey
    end: Survey
    named: Fit | None = None
    rivals: dict[Candidate, list[Rival]] = field(default_factory=dict)
    gains: dict[Candidate, float] = field(default_factory=dict)
    unknown: tuple[Generic, float] | None = None
    nearest: tuple[Candidate, float] | None = None
    left_over: LeftOver | None = None
    total_gain: float = 0.0
    otherwise: "Decision | None" = None
    further: list[Point] = field(default_factory=list)
    kept: Mapping[Candidate, list[Rival] | None] = field(default_factory=dict)
    naming: "Callable[[Decision, Point], Decision] | None" = None

    @property
    def names(self) -> set[str]:
        """Names of the effects that it names or would fall back on, and of their rivals."""
        named = () if self.named is None else self.named.point
        rivals = (rival.candidate for rivals in self.rivals.values() for rival in rivals)
        return {c.name for c in (*named, *rivals)} | (self.otherwise.names if self.otherwise is not None else set())

    def with_named(self, end: Survey, named: Fit) -> "Decision":
        """The Decision for these named effects, `end` being the survey with them in the model."""
        return replace(self, end=end, named=named, total_gain=end.gain_of(named.point))

    def with_effects(self, point: Point) -> "Decision":
        """The Decision that names the effects of `point` instead."""
        return self.naming(self, point)

    def light(self) -> "Decision":
        """The Decision with surveys that only say what was found."""
        return replace(self, start=self.start.light(), end=self.end.light())

    def without_effects(self) -> "Decision":
        """The Decision that nothing is named."""
        return Decision(self.detection, self.start, self.start, naming=self.naming)
