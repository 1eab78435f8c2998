"""What `explain` returns: a tree of plain dataclasses that prints itself and saves itself as JSON."""

import dataclasses
import json
from dataclasses import dataclass, field
from pathlib import Path

from drake_ispace.files.places import whole_file
from drake_ispace.scenario import Scenario


@dataclass(frozen=True)
class Estimate:
    """A parameter of a named effect.

    Attributes:
        estimate, ci90, unit: value, 90 % interval (low, high), and their unit. on_bound: whether the value sits on the
            bound of what is physically possible. free_run: the value with which free-run simulations come nearest to
            the training runs; None where there are no such simulations.
    """

    estimate: float
    ci90: tuple[float, float]
    unit: str
    on_bound: bool = False
    free_run: float | None = None


@dataclass(frozen=True)
class NamedEffect:
    """An effect that the model lacks.

    Attributes:
        name, enters_at: of the effect's card. equivalents: look-alikes that these runs cannot tell from the effect.
        parameters: name -> Estimate; a choice of wheel has no interval. share: drop in deviance that is lost without
            this effect, as a share of the drop by all named effects (free_run: of squared errors). excitation: motion
            that would separate the effect from its look-alikes.
    """

    name: str
    enters_at: str
    equivalents: list[str]
    parameters: dict[str, Estimate]
    share: float
    excitation: str = ""


@dataclass(frozen=True)
class DetectionResult:
    """Whether anything is missing at all.

    Attributes:
        p_value: chance that residuals without any effect would show as much as these do, all effects having been
            tried. false_alarm_rate: below which a p-value counts as a detection. minus_log10_p: of the effect that
            stands out most, before correction for trying many. threshold: minus_log10_p at which the p-value is the
            false-alarm rate.
    """

    p_value: float
    threshold: float
    false_alarm_rate: float
    minus_log10_p: float


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
class Gap:
    """How much of the gap in a channel the named effects close on held-out runs.

    Attributes:
        before, after, refitted: root mean square error with the model as given, with the effects in the sizes fitted to
            the training runs, and with the same effects refitted to the held-out runs. The errors are those of
            one-step-ahead prediction, less the runs' own offsets (of their IMU, say). Where the effects were chosen by
            cross-validation, the errors are those of free-run simulation.
        closed: 1 - (after^2 - refitted^2) / (before^2 - refitted^2). What no size of these effects explains is in
            `refitted`, and not in the gap. A refit minimises the deviance of all channels together, so that one channel
            may come out a little better with the sizes of the training runs.
        ci90: 90 % bootstrap interval of `closed`, over blocks of a second (free-run simulation: over runs).
        unit: of the errors.
    """

    before: float
    after: float
    refitted: float
    closed: float
    ci90: tuple[float, float]
    unit: str


@dataclass(frozen=True)
class FreeRun:
    """Root mean square error over whole runs in which nothing corrects the model.

    Attributes:
        runs: "training", or the kind of held-out runs. channel: "dead-reckoned position" (encoders from the start of
            each run, against the camera); of a plant of the user's own "simulated wheel angle" or "simulated wheel
            speed" on the recorded torque, with the sizes of Estimate.free_run. unit: of the errors.
        before, after: with the model as given, and with the named effects.
    """

    runs: str
    channel: str
    unit: str
    before: float
    after: float


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
class PlantParameter:
    """A free parameter of a user's own plant, as fitted without effects (before) and beside the named ones (after)."""

    name: str
    before: float
    after: float


@dataclass(frozen=True)
class Unknown:
    """A disagreement that no effect of the library stands for.

    Attributes:
        link: "force" or "motion", as which it acts. driver: variable that it goes with. share: of the drop in deviance
            that named effects and this disagreement bring together. symmetry, memory, onset: in words.
        nearest: library effect that explains most of it. distance: square root of the deviance that the nearest effect
            leaves of it, in standard deviations.
    """

    link: str
    driver: str
    share: float
    symmetry: str
    memory: str
    onset: str
    nearest: str
    distance: float


@dataclass(frozen=True)
class Untestable:
    """An effect that these runs cannot show.

    Attributes:
        effect: name. needs: the channels and the motion that would show it.
    """

    effect: str
    needs: str


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
        verdict: "named", "set", "none" or "unknown". effects: those that the model lacks. warnings: what a reader must
            know first.
        detection: None where effects were chosen by cross-validation. localization: channels, the largest share first.
        untestable: effects that these runs cannot show. unknown: None unless the verdict is "unknown".
        gap: channel -> Gap on the held-out runs. closed: the share of the gap that is closed over all channels together
            (of whitened residuals), None where there is no gap.
        free_run: a row for the training runs and for each kind of held-out runs.
        validated: every set of effects that was tried by cross-validation. plant: free parameters of the user's plant.
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
    detection: DetectionResult | None
    localization: list[Place]
    untestable: list[Untestable]
    gap: dict[str, Gap] = field(default_factory=dict)
    closed: float | None = None
    free_run: list[FreeRun] = field(default_factory=list)
    validated: list[Validated] = field(default_factory=list)
    plant: list[PlantParameter] = field(default_factory=list)
    unknown: Unknown | None = None
    warnings: list[str] = field(default_factory=list)
    next_experiment: str = ""
    model: Scenario | None = None
    model_path: str | None = None
    controller: ControllerCheck | None = None
    closed_loop: dict | None = None
    difference: dict = field(default_factory=dict)
    runs: list[str] = field(default_factory=list)
    held_out: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def to_data(self) -> dict:
        """Plain data, ready for JSON."""
        data = {
            "verdict": self.verdict,
            "effects": [dataclasses.asdict(effect) for effect in self.effects],
            "detection": None if self.detection is None else dataclasses.asdict(self.detection),
            "localization": [dataclasses.asdict(place) for place in self.localization],
            "untestable": [dataclasses.asdict(entry) for entry in self.untestable],
            "unknown": None if self.unknown is None else dataclasses.asdict(self.unknown),
            "gap": {"held_out": {name: dataclasses.asdict(g) for name, g in self.gap.items()}, "closed": self.closed},
            **{name: [dataclasses.asdict(row) for row in getattr(self, name)] for name in _TABLES},
            "controller": None if self.controller is None else dataclasses.asdict(self.controller),
            "closed_loop": self.closed_loop,
            "warnings": self.warnings, "next_experiment": self.next_experiment, "difference": self.difference,
            "runs": self.runs, "held_out": self.held_out, "model": self.model_path, "seconds": self.seconds,
        }
        return plain(data)

    def save(self, path: str | Path) -> None:
        """Write the explanation as JSON, whole or not at all.

        Raises:
            InputError: the file cannot be written.
        """
        with whole_file(Path(path)) as beside:
            beside.write_text(json.dumps(self.to_data(), indent=2, allow_nan=False), encoding="utf-8")

    def __str__(self) -> str:
        lines = [_VERDICTS[self.verdict] + (f" (p = {self.detection.p_value:.2g})" if self.detection else "")]
        lines += [f"! {warning}" for warning in self.warnings]
        for effect in self.effects:
            others = f", or {', '.join(effect.equivalents)}" if effect.equivalents else ""
            lines.append(f"  {effect.name}{others}; enters at: {effect.enters_at}")
            for name, p in effect.parameters.items():
                low, high = p.ci90
                best = "" if p.free_run in (None, p.estimate) else f", best free-run simulation at {p.free_run:.4g}"
                lines.append(f"    {name} = {p.estimate:.4g} [{low:.4g}, {high:.4g}] {p.unit}{best}")
        if self.unknown is not None:
            unknown = self.unknown
            lines.append(f"  a {unknown.link} that goes with {unknown.driver}; nearest: {unknown.nearest}")
        for name, gap in self.gap.items():
            lines.append(
                f"  held out, {name}: {gap.before:.4g} -> {gap.after:.4g} {gap.unit} (refitted {gap.refitted:.4g}), "
                f"{100 * gap.closed:.0f} % closed"
            )
        lines += [
            f"  {row.runs}, {row.channel}: {row.before:.4g} -> {row.after:.4g} {row.unit}" for row in self.free_run
        ]
        lines += [f"  {row.name}: {row.before:.4g} -> {row.after:.4g}" for row in self.plant]
        for row in self.validated:
            lines.append(f"  cross-validated, {' + '.join(row.effects) or 'no effect'}: {row.error:.4g} {row.unit}")
        if self.untestable:
            names = [entry.effect for entry in self.untestable]
            more = f" and {len(names) - 6} more" if len(names) > 6 else ""
            lines.append(f"  these runs cannot show: {', '.join(names[:6])}{more}")
        if self.next_experiment:
            lines.append(f"  next: {self.next_experiment}")
        return "\n".join(lines)


_TABLES = ("free_run", "validated", "plant")
_VERDICTS = {
    "named": "The model lacks", "set": "The model lacks one of a set that these runs cannot tell apart",
    "none": "The model lacks nothing that these runs could show",
    "unknown": "The model lacks something that no effect of the library stands for",
}


def plain(value):
    """The same data with NumPy's numbers as Python's, and with None for infinite numbers and NaN."""
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value
