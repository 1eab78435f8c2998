"""Which of several decisions becomes the answer: the one that unseen runs prefer."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

from drake_ispace.explain.answer.explanation import Explanation
from drake_ispace.explain.answer.verdict import (
    RULED_OUT,
    UNCONFIRMED,
    add_trace,
    doubtful,
    lacks_little,
    left_out,
    nonsense,
)
from drake_ispace.explain.decide.decide import MOST_EFFECTS
from drake_ispace.explain.decide.decision import NEXT_TO_NOTHING, Decision
from drake_ispace.explain.predict.case import Case
from drake_ispace.explain.prove.proof import Proof
from drake_ispace.robots.robot import COMMAND


@dataclass(frozen=True)
class Answered:
    """A decision and what it comes to.

    Attributes:
        decision: which effects are named. proof: how far they go on unseen runs. answer: what is said of both.
        dropped: a sentence on effects that are named no longer, and why.
    """

    decision: Decision
    proof: Proof
    answer: Explanation
    dropped: tuple[str, ...] = ()

    @property
    def suffices(self) -> bool:
        """Whether unseen runs show nothing that the answer lacks."""
        return self.answer.verdict in (("named", "set") if self.answer.effects else ("none",))

    @property
    def too_large(self) -> float:
        """How much unseen runs leave in the channels that have too much left."""
        return sum(remainder.ratio**2 for remainder in self.answer.remainders)

    def is_worse_than(self, other: "Answered") -> bool:
        """Whether unseen runs show what this answer lacks and the other one does not, or more than of the other."""
        return (other.suffices and not self.suffices) or self.too_large > other.too_large


def best_answered(
    case: Case, first: Answered, answered: Callable[[Decision], Answered],
    decided_without: Callable[[Collection[str]], Decision],
) -> Answered:
    """A first answer, or another one that unseen runs prefer.

    answered: computes what a decision comes to. decided_without: computes the decision between all effects but those of
        these names.
    """
    best = _preferred(case, first, answered, decided_without)
    best.answer.warnings += best.dropped
    return best


def _preferred(case, first, answered, decided_without) -> Answered:
    """As `best_answered`, but for the sentences on what was dropped."""
    best = _within_bounds(_with_asked(_with_preferred(first, answered), answered), answered, decided_without)
    is_driven_by_command = case.replay.body.robot.driven == COMMAND
    if best.answer.verdict == "incomplete" or (best.answer.verdict == "unknown" and is_driven_by_command):
        best = _with_further(best, answered)
    doubted = best.answer.verdict == "incomplete" and best.decision.otherwise is not None
    if doubted and not lacks_little(best.answer, best.decision):
        best = answered(best.decision.otherwise)
    senseless, why = nonsense(best.answer)
    best = _without(best, senseless, f"makes no sense: {why}", answered)
    needed = _needed(case, best) if best.answer.effects else best.decision
    if needed is not best.decision and (without := answered(needed)).suffices:
        add_trace(without.answer, best.answer)
        return replace(without, dropped=best.dropped)
    best, lacks_more = _without_small(case, best, answered), False
    while best.proof.unconfirmed:  # without the worst of them the others may be confirmed
        worst, why = best.proof.unconfirmed[0], UNCONFIRMED if case.scenario is not None else RULED_OUT
        lacks_more |= case.scenario is None and not _is_trace(best.decision, worst)
        best = _without(best, {worst}, f"is not confirmed: {why}", answered)
        if lacks_more:  # the rest is no answer then: what the effect stood for is missing
            best.answer.verdict = "incomplete" if best.answer.effects else "unknown"
    return _without_all(case, best, answered)


def _is_trace(decision, name) -> bool:
    """Whether a named effect explains next to nothing beside what all of them do."""
    (gain,) = (gain for effect, gain in decision.gains.items() if effect.name == name)
    return gain < NEXT_TO_NOTHING * decision.total_gain


def _with_preferred(first, answered) -> Answered:
    """With the look-alike of a named effect that training runs prefer, unless the answer gets worse."""
    if first.proof.instead is None or (instead := first.proof.instead()) is None:
        return first
    other = answered(instead)
    return first if other.is_worse_than(first) else other


def _within_bounds(first, answered, decided_without) -> Answered:
    """With the effects that are decided on without those on a bound or at senseless sizes, if the answer suffices then.

    One that is at the end of what it can do may be a look-alike of another, or of several together.
    """
    beyond = {effect.name for effect in first.answer.effects if any(p.on_bound for p in effect.parameters.values())}
    if not beyond:
        return first
    other = answered(decided_without(beyond))
    return other if other.answer.effects and other.suffices else first


def _with_asked(first, answered) -> Answered:
    """With what training runs ask for besides, as long as the answer gets no worse.

    Where it is known that something is missing, but not what, all that they ask for must suffice.
    """
    best = first
    while best.proof.asked is not None and (asked := best.proof.asked()) is not None:
        kept = {**best.decision.kept, asked.effect: asked.rivals}
        other = answered(replace(best.decision, kept=kept).with_effects(asked.point))
        if other.is_worse_than(best):
            break
        best = other
    return first if first.answer.verdict == "unknown" and not best.suffices else best


def _with_further(first, answered) -> Answered:
    """With traces without which the others do not suffice; unchanged if none do.

    Each is the clearest one, so that the next ones explain less. What is left is divided by the number of effects that
    may still be named: one that takes less than this share is the last that is tried.
    """
    last = first
    while last.decision.further and last.proof.by and last.answer.remainders:
        clearest = last.decision.further[0]
        may_follow = MOST_EFFECTS - len(clearest)
        before, last = last.too_large, answered(last.decision.with_effects(clearest))
        if last.suffices:
            return last
        if not before - last.too_large >= before / (1 + may_follow):
            break
    return first


def _without(first, names, why, answered) -> Answered:
    """Without these effects, if there are any; why: in words."""
    if not names:
        return first
    kept = {c: z for c, z in first.decision.named.point.items() if c.name not in names}
    without = answered(first.decision.with_effects(kept) if kept else first.decision.without_effects())
    return replace(without, dropped=(*first.dropped, left_out(without.answer, first.answer, why)))


def _without_small(case, best, answered) -> Answered:
    """Without effects whose sizes are those of a sound robot, or may be none, if an answer that does not suffice leaves
    no more without them."""
    why = {} if best.suffices else doubtful(best.answer, case, best.proof)
    why = {name: said for name, said in why.items() if name not in best.proof.unconfirmed}
    if not why:
        return best
    without = _without(best, why.keys(), f"is doubtful: {'; '.join(why.values())}", answered)
    return without if without.too_large <= best.too_large else best


def _without_all(case, best, answered) -> Answered:
    """Without any effect, if an answer that does not suffice names none but doubtful ones: they stand for another.

    Not so of a user's own plant: unknown torques may lead whole runs to the size none although the effect is there.
    """
    if best.suffices or not best.answer.effects or case.scenario is None:
        return best
    doubts = doubtful(best.answer, case, best.proof)
    if doubts.keys() != {effect.name for effect in best.answer.effects}:
        return best
    return _without(best, doubts.keys(), f"is doubtful: {'; '.join(doubts.values())}", answered)


def _needed(case, best) -> Decision:
    """The decision without doubtful effects, or without any where it is in doubt and nothing was asked for."""
    decision, why = best.decision, doubtful(best.answer, case, best.proof)
    kept = {c: z for c, z in decision.named.point.items() if c.name not in why}
    if why and kept:
        return decision.with_effects(kept)
    in_doubt = decision.detection.in_doubt and not decision.kept
    return decision.without_effects() if why or in_doubt else decision
