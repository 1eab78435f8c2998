"""The result of proving an answer."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from drake_ispace.explain.decide.decision import Asked, Decision, Rival
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Point
from drake_ispace.explain.prove.errors.gap import GapRow
from drake_ispace.explain.prove.left.remainder import Remainder
from drake_ispace.explain.prove.noise.noise import ProcessNoise


@dataclass(frozen=True)
class PlantParameter:
    """A free parameter of a user's own plant, as fitted without effects (before) and beside the named ones (after)."""

    name: str
    before: float
    after: float


@dataclass(frozen=True)
class Proof:
    """How far an answer goes.

    Attributes:
        by: how the rows "held_out" came about: "held-out runs", "leave-one-run-out" or "blocks of the run"; empty:
            there are none.
        rows: of the gap. remainders: what is left on unseen runs and is not noise; none where the answer suffices.
        noise: process noise that the unseen runs need; None: not computed. sizes: of the named effects.
            least_squares: those that free-run least squares finds, None for each that free runs cannot show; None where
            no effect is named. without: where these are the answer's, the same without each training run in turn.
            plant: free parameters of a plant of the user's own. asked: computes an effect that training runs ask for,
            besides the named ones or instead of a rival, or None; None where they ask for nothing. alone: names of
            training runs that alone tell some of the sizes, and are therefore judged by sizes that were fitted to
            them, too; empty where other runs were held out. may_stand: tells whether a rival suffices on unseen runs
            as the named effects do; None where these do not, or where that cannot be told. unconfirmed: names of
            effects that free runs show, and with which those of unseen runs come no nearer, the worst first; of a plant
            of the user's own those without which unseen runs are likelier.
            instead: computes the decision with a rival in the place of a named effect that training runs prefer, or
            None; None where they are not asked.
    """

    by: str
    rows: list[GapRow]
    remainders: list[Remainder]
    noise: ProcessNoise | None
    sizes: Point
    least_squares: dict[Candidate, list[float | None]] | None
    without: Sequence[Point] = ()
    plant: list[PlantParameter] = field(default_factory=list)
    asked: Callable[[], Asked | None] | None = None
    alone: list[str] = field(default_factory=list)
    may_stand: Callable[[Rival], bool] | None = None
    unconfirmed: Sequence[str] = ()
    instead: Callable[[], Decision | None] | None = None
