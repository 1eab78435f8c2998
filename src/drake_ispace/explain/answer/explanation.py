"""The answer of `explain`: a tree of plain dataclasses that prints itself and saves itself as JSON."""

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from drake_ispace.explain.answer.sentences import gap_sentence, is_place, p_in_words, sentence_of, short
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.decide.proposals.detect import Detection
from drake_ispace.explain.prove.errors.gap import HELD_OUT, GapRow, headlines
from drake_ispace.explain.prove.left.remainder import Remainder
from drake_ispace.explain.prove.proof import PlantParameter
from drake_ispace.files.places import whole_file
from drake_ispace.scenario import Scenario


@dataclass(frozen=True)
class Estimate:
    """A parameter of a named effect.

    Attributes:
        estimate, ci90, unit: value, 90 % interval (low, high), and their unit. on_bound: whether the value sits on the
            bound of what is physically possible, or beyond what a robot that drives about may have. least_squares: the
            value with which free-run simulations come nearest to the training runs; None: not computed, or they cannot
            show it. called: the name of a chosen wheel, "" where it has only its number; of a size what it is of, ""
            where its effect's name says so.
    """

    estimate: float
    ci90: tuple[float, float]
    unit: str
    on_bound: bool = False
    least_squares: float | None = None
    called: str = ""


@dataclass(frozen=True)
class NamedEffect:
    """An effect that the model lacks.

    Attributes:
        name, enters_at: of the effect's card. equivalents: look-alikes that these runs cannot tell from the effect.
        parameters: name -> Estimate; a choice of wheel has no interval. share: drop in deviance that is lost without
            this effect, as a share of the drop by all named effects; of squared errors, where effects were chosen by
            cross-validation. excitation: motion that would separate the effect from its look-alikes. faults: of the
            data that do the same.
    """

    name: str
    enters_at: str
    equivalents: list[str]
    parameters: dict[str, Estimate]
    share: float
    excitation: str = ""
    faults: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Place:
    """A channel that shows the disagreement.

    Attributes:
        channel: sensor and quantity, such as "encoder: wheel 1". share: of the drop in deviance that the explanation
            brings. driver: variable that best predicts what the explanation takes away from the channel's residuals.
    """

    channel: str
    share: float
    driver: str


@dataclass(frozen=True)
class Validated:
    """A set of effects that was tried by cross-validation.

    Attributes:
        effects: names, none for the model as given. error, unit: root mean square error of free-run simulations of each
            half of the runs, with the sizes that fit the other half best.
    """

    effects: list[str]
    error: float
    unit: str


@dataclass(frozen=True)
class Unknown:
    """A disagreement that no effect of the library stands for.

    Attributes:
        link: "force" or "motion", as which it acts. driver: variable that it goes with. share: of the drop in deviance
            that named effects and this disagreement bring together. symmetry, memory, onset: in words.
        nearest: library effect that explains most of it. distance: square root of the deviance that the nearest effect
            leaves of it, in standard deviations. course: of what may go with time in any way, (t [s], share by which
            the command does more than in the model, or the wheel rolls further, its standard deviation) at a few
            instants; else empty.
    """

    link: str
    driver: str
    share: float
    symmetry: str
    memory: str
    onset: str
    nearest: str
    distance: float
    course: Sequence[tuple[float, float, float]] = ()

    @property
    def course_in_words(self) -> str:
        """The course, as shares in per cent; empty where there is none."""
        return ", ".join(f"{100 * share:+.1f}±{100 * std:.1f} % at {t_s:.1f} s" for t_s, share, std in self.course)


@dataclass(frozen=True)
class Untestable:
    """An effect that these runs cannot show.

    Attributes:
        effect: name. needs: the channels and the motion that would show it. parameters: those that these runs cannot
            show, where they show the others; else empty.
    """

    effect: str
    needs: str
    parameters: list[str] = field(default_factory=list)

    @property
    def said(self) -> str:
        """The effect, and the parameters where it is some of them."""
        return f"{self.effect} ({', '.join(self.parameters)})" if self.parameters else self.effect


@dataclass(frozen=True)
class ControllerCheck:
    """How well the scenario's controller explains a recorded torque.

    Attributes:
        unexplained: root mean square of recorded less predicted torque, over that of the recorded one, all wheels
            pooled. gain: factor on the predicted torque that fits the recorded one best, 1 where the controller is the
            scenario's.
    """

    unexplained: float
    gain: float


@dataclass
class Explanation:
    """The answer of `explain`.

    Attributes:
        verdict: "named", "set", "incomplete", "unknown", "none" or "data". data: faults of the recordings, the surest
            first; with the verdict "data" no physics was tried. effects: those that the model lacks. warnings: what
            a reader must know first.
        detection: None where effects were chosen by cross-validation. localization: channels, the largest share first.
        untestable: effects that these runs cannot show. unknown: None unless the verdict is "unknown".
        gap: a row for every measure on unseen runs and on the training runs. proof: how the unseen runs came about,
            "held-out runs", "leave-one-run-out" or "blocks of the run". noise_is_fitted: whether the process noise in
            the gap is as strong as these runs need. forces: in words, those from outside that pass as noise, empty
            where none is stronger than assumed. remainders: what is left on unseen runs and is not noise of a sound
            robot, the worst first.
        validated: every set of effects that was tried by cross-validation. plant: free parameters of the user's plant.
        drifts: a sentence for each parameter of a named effect that differs by more than chance from run to run or
            between the halves of runs, for each further effect that a run, or one half of all, shows and the rest
            contradicts, and for every two named effects that undo each other.
        next_experiment: a sentence, empty where no question is open.
        model: the scenario with the named effects in it, None where there is none. difference: what differs in it from
            the defaults, as plain data. model_path: where it was written.
        controller: how much of the recorded torque the model's controller leaves, median of the runs; None: not known.
        closed_loop: "run", "before_m", "after_m": root mean square distance [m] between the positions that the camera
            saw and those of the model along the same reference, its own controller in the loop; only a written report
            has it.
        runs, held_out: names. seconds: wall time that the explanation took.
    """

    verdict: str
    effects: list[NamedEffect]
    detection: Detection | None
    localization: list[Place]
    untestable: list[Untestable]
    data: list[Finding] = field(default_factory=list)
    gap: list[GapRow] = field(default_factory=list)
    proof: str = ""
    noise_is_fitted: bool = False
    forces: str = ""
    remainders: list[Remainder] = field(default_factory=list)
    validated: list[Validated] = field(default_factory=list)
    plant: list[PlantParameter] = field(default_factory=list)
    unknown: Unknown | None = None
    warnings: list[str] = field(default_factory=list)
    drifts: list[str] = field(default_factory=list)
    next_experiment: str = ""
    model: Scenario | None = None
    model_path: str | None = None
    controller: ControllerCheck | None = None
    closed_loop: dict | None = None
    difference: dict = field(default_factory=dict)
    runs: list[str] = field(default_factory=list)
    held_out: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def mentioned(self) -> list[str]:
        """Names of the effects, and of those that cannot be told from them."""
        return [name for effect in self.effects for name in (effect.name, *effect.equivalents)]

    @property
    def headlines(self) -> list[GapRow]:
        """The rows of the gap that say most, the longest horizon first, one for each of what drives the model.

        Each is of the place on unseen runs, over the longest horizon at which the gap is clear.

        Empty where the gap in metres is small beside what noise may leave.
        """
        return [row for row in self._told if row.closed is not None]

    @property
    def _noise_holds_unexplained(self) -> bool:
        """Whether what is still unexplained is part of what passes as noise in the gap."""
        return self.noise_is_fitted and self.verdict in ("incomplete", "unknown")

    @property
    def _told(self) -> list[GapRow]:
        """The headlines, and where noise holds what is unexplained those that are clear beside sensors alone."""
        return headlines(self.gap, by_sensors=self._noise_holds_unexplained)

    @property
    def headline(self) -> GapRow | None:
        """The first of the headlines."""
        return next(iter(self.headlines), None)

    @property
    def closed(self) -> float | None:
        """The share of the gap that is closed, of the headline; None where there is none."""
        return None if self.headline is None or not self.effects else self.headline.closed

    def to_data(self) -> dict:
        """Plain data, ready for JSON."""
        data = {
            "verdict": self.verdict, "data": [finding.to_data() for finding in self.data],
            "effects": [dataclasses.asdict(effect) for effect in self.effects],
            "detection": None if self.detection is None else dataclasses.asdict(self.detection),
            "localization": [dataclasses.asdict(place) for place in self.localization],
            "untestable": [dataclasses.asdict(entry) for entry in self.untestable],
            "unknown": None if self.unknown is None else dataclasses.asdict(self.unknown),
            "headline": None if self.headline is None else dataclasses.asdict(self.headline), "closed": self.closed,
            "proof": self.proof,
            **{name: [dataclasses.asdict(row) for row in getattr(self, name)] for name in _TABLES},
            "controller": None if self.controller is None else dataclasses.asdict(self.controller),
            "closed_loop": self.closed_loop,
            "warnings": self.warnings, "drifts": self.drifts, "next_experiment": self.next_experiment,
            "difference": self.difference,
            "runs": self.runs, "held_out": self.held_out, "model": self.model_path, "seconds": self.seconds,
        }
        return plain(data)

    @property
    def title(self) -> str:
        """The verdict in a sentence."""
        shows = self.detection is None or self.detection.found
        if self.verdict == "unknown" and self.unknown is None and self.drifts:
            return _PARTS_APART
        if self.verdict == "unknown" and self.unknown is None and not shows:
            return _ONLY_LEFT
        if self.verdict == "none" and self.detection is not None and shows:
            return _ONLY_TRACES.format("on unseen runs" if self.proof else "in free runs")
        in_doubt = self.verdict == "set"
        sure_first = sorted(self.effects, key=lambda effect: bool(in_doubt and _others(effect)))
        *names, last = [_said(effect, in_doubt) for effect in sure_first] or [""]
        return _TITLES[self.verdict].format(f"{', '.join(names)}{',' * in_doubt} and {last}" if names else last)

    @property
    def warned(self) -> list[str]:
        """Drifts and warnings in the order to be read, findings of the data first."""
        of_data = [str(finding) for finding in self.data]
        return sorted([*self.drifts, *self.warnings], key=lambda warning: warning not in of_data)

    def headlines_in_words(self) -> list[str]:
        """A sentence for each of the headlines; where there is none, why, unless nothing is named either."""
        how = self.proof, bool(self.effects), self._noise_holds_unexplained
        said = [gap_sentence(row, *how) for row in self._told or [None]]
        return [sentence for sentence in said if sentence]

    def gap_in_words(self) -> list[str]:
        """The headlines, and the places on unseen runs over each horizon; on the training runs if no other is left."""
        unseen = [other for other in self.gap if other.runs == HELD_OUT]
        shown, where = (unseen, "") if unseen else (self.gap, "training runs, ")
        others = [where + short(other) for other in shown if is_place(other) and other not in self._told]
        return self.headlines_in_words() + others

    def save(self, path: str | Path) -> None:
        """Write the explanation as JSON, whole or not at all.

        Raises:
            InputError: the file cannot be written.
        """
        with whole_file(Path(path)) as beside:
            beside.write_text(json.dumps(self.to_data(), indent=2, allow_nan=False), encoding="utf-8")

    def __str__(self) -> str:
        is_of_effects = self.detection is not None and self.title not in (_ONLY_LEFT, _PARTS_APART)
        lines = [self.title + (f" ({p_in_words(self.detection.p_value)})" if is_of_effects else "")]
        lines += [f"! {warning}" for warning in self.warned]
        if self.verdict == "data":
            lines += [f"  {finding}" for finding in self.data]
        for effect in self.effects:
            effects = [name for name in effect.equivalents if name not in effect.faults]
            faults = [f"{fault} (a fault of the data)" for fault in effect.faults if fault != effect.name]
            alike = [*effects, *faults]
            others = f", or {', '.join(alike)}" if alike else ""
            lines.append(f"  {effect.name}{others}; enters at: {effect.enters_at}")
            for name, p in effect.parameters.items():
                low, high = p.ci90
                if p.unit == "wheel":
                    lines.append(f"    {name} = {p.estimate:g}{f' ({p.called})' if p.called else ''}")
                    continue
                plain = "" if p.least_squares is None else f", by free-run least squares {p.least_squares:.4g}"
                called = f"{name} ({p.called})" if p.called else name
                lines.append(f"    {called} = {p.estimate:.4g} [{low:.4g}, {high:.4g}] {p.unit}{plain}")
        if self.unknown is not None:
            unknown = self.unknown
            lines.append(f"  a {unknown.link} that goes with {unknown.driver}; nearest: {unknown.nearest}")
            if unknown.course:
                lines.append(f"    more than in the model, as a smooth curve: {unknown.course_in_words}")
        lines += [f"  left: {sentence_of(remainder)}" for remainder in self.remainders[:3]]
        lines += [f"  {line}" for line in self.gap_in_words()]
        lines += [f"  {row.name}: {row.before:.4g} -> {row.after:.4g}" for row in self.plant]
        for row in self.validated:
            lines.append(f"  cross-validated, {' + '.join(row.effects) or 'no effect'}: {row.error:.4g} {row.unit}")
        if self.untestable:
            names = [entry.said for entry in self.untestable]
            more = f" and {len(names) - 6} more" if len(names) > 6 else ""
            lines.append(f"  these runs cannot show: {', '.join(names[:6])}{more}")
        if self.next_experiment:
            lines.append(f"  next: {self.next_experiment}")
        return "\n".join(lines)


_TABLES = ("gap", "remainders", "validated", "plant")
_TITLES = {
    "named": "The model lacks {}", "incomplete": "The model lacks {}, and something more",
    "set": "The model lacks {}: these runs do not tell which",
    "none": "The model lacks nothing that these runs could show",
    "unknown": "The model lacks something that no effect of the library stands for",
    "data": "The recordings contradict each other, or the model's dimensions",
}
_MOST_SAID = 2  # look-alikes of an effect in the verdict
_ONLY_TRACES = "Something is detectable, but {} the model is as good without it"
_PARTS_APART = "A part of the runs shows an effect that the rest shows otherwise or not: no one model is right for all"
_ONLY_LEFT = "No effect shows, but these runs leave more than noise of a sound robot"


def _said(effect, with_others: bool) -> str:
    """The name of an effect in words; with_others: and what may be in its place."""
    name, others = effect.name.replace("_", " "), _others(effect)
    if len(others) > _MOST_SAID:
        others = [others[0], f"one of {len(others) - 1} others"]
    return f"either {' or '.join([name, *others])}" if with_others and others else name


def _others(effect) -> list[str]:
    """What may be in the place of an effect, in words."""
    alike = [name for name in effect.equivalents if name != effect.name]
    of_data = "a fault of the data"
    faults = [
        f"{fault} ({of_data})" if fault != effect.name else of_data for fault in effect.faults[:1] if fault not in alike
    ]
    return [one.replace("_", " ") for one in alike + faults]


def plain(value):
    """Return plain data for JSON: NumPy's numbers as Python's, infinite numbers and NaN as None."""
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value
