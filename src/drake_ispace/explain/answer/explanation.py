"""What `explain` returns: a tree of plain dataclasses that prints itself and saves itself as JSON."""

import dataclasses
import json
from dataclasses import dataclass, field
from pathlib import Path

from drake_ispace.explain.answer.controller import ControllerCheck
from drake_ispace.files.places import whole_file
from drake_ispace.scenario import Scenario


@dataclass(frozen=True)
class Estimate:
    """A parameter of a named effect: value, 90 % interval, unit; whether it sits on its bound; free_run: the value with
    which free-run simulations come nearest to the runs, None where there is none (FreeRun)."""

    estimate: float
    ci90: tuple[float, float]
    unit: str
    on_bound: bool = False
    free_run: float | None = None


@dataclass(frozen=True)
class NamedEffect:
    """An effect that the model lacks.

    Attributes:
        name, enters_at: of its card. equivalents: effects that these runs cannot tell from it.
        parameters: name -> Estimate; a choice of wheel has no interval. share: of what all named effects explain.
        excitation: motion that would separate it from its equivalents.
    """

    name: str
    enters_at: str
    equivalents: list[str]
    parameters: dict[str, Estimate]
    share: float
    excitation: str = ""


@dataclass(frozen=True)
class DetectionResult:
    """p-value of the disagreement on noise alone; the false-alarm rate it was judged at, and the threshold."""

    p_value: float
    threshold: float
    false_alarm_rate: float
    minus_log10_p: float


@dataclass(frozen=True)
class Place:
    """Where the disagreement shows: share of the explained deviance that a channel carries, and what it goes with."""

    channel: str
    share: float
    driver: str


@dataclass(frozen=True)
class Gap:
    """Root mean square prediction error of a channel on held-out runs, less the runs' own offsets (of their IMU, say):
    with the model as given, with the effects, and with their sizes fitted to these very runs (the floor); the share of
    the gap between their squares that is closed, with a 90 % bootstrap interval over blocks of a second."""

    before: float
    after: float
    floor: float
    closed: float
    ci90: tuple[float, float]
    unit: str


@dataclass(frozen=True)
class FreeRun:
    """Root mean square error over whole runs in which nothing corrects the model, with the model as given and with the
    effects.

    Attributes:
        runs: "training", or the name of held-out ones. channel: "dead-reckoned position" (encoders from the start of
            each run, against the camera), or of a user's own plant "simulated wheel angle" or "simulated wheel speed",
            on the recorded torque. Its own sizes are those of Estimate.free_run.
    """

    runs: str
    channel: str
    unit: str
    before: float
    after: float


@dataclass(frozen=True)
class Validated:
    """A set of effects that was tried: root mean square error of free-run simulations of each half of the runs, with
    the sizes that fit the other half best."""

    effects: list[str]
    error: float
    unit: str


@dataclass(frozen=True)
class PlantParameter:
    """A free parameter of a user's own plant: what it is without effects, and beside the named ones."""

    name: str
    before: float
    after: float


@dataclass(frozen=True)
class Unknown:
    """A disagreement that no effect of the library stands for.

    Attributes:
        link: "force" or "motion". driver: with what it goes. share: of the deviance that effects and it explain together.
        symmetry, memory, onset: in words. nearest: library effect; distance: deviance that it leaves of it, in standard
            deviations.
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
    """An effect that these runs cannot show, and the channel or motion that it would take."""

    effect: str
    needs: str


@dataclass
class Explanation:
    """The answer of `explain`.

    Attributes:
        verdict: "named", "set", "none" or "unknown". warnings: what a reader must know first.
        model: the scenario with the named effects in it, None where there is none; difference: as plain data.
        detection: None where effects were chosen by validation.
        gap: channel -> Gap on the held-out runs. free_run: a row for the training runs and each kind of held-out ones.
        validated: every set of effects, where they were chosen by validation. plant: of the user's own, fitted.
        seconds: it took.
        controller: how much of the recorded torque the model's controller leaves, median of the runs; None: not known.
        closed_loop: "run", "before_m", "after_m": rms distance from where the camera saw the robot to where the model
            goes along the same reference, its own controller in the loop; only a written report has it.
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
        """Write it as JSON, whole or not at all.

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
                free = "" if p.free_run in (None, p.estimate) else f", simulates best at {p.free_run:.4g}"
                lines.append(f"    {name} = {p.estimate:.4g} [{low:.4g}, {high:.4g}] {p.unit}{free}")
        if self.unknown is not None:
            of = self.unknown
            lines.append(f"  a {of.link} that goes with {of.driver}; nearest: {of.nearest}")
        for name, gap in self.gap.items():
            lines.append(
                f"  held out, {name}: {gap.before:.4g} -> {gap.after:.4g} {gap.unit} (floor {gap.floor:.4g}), "
                f"{100 * gap.closed:.0f} % closed"
            )
        lines += [
            f"  {row.runs}, {row.channel}: {row.before:.4g} -> {row.after:.4g} {row.unit}" for row in self.free_run
        ]
        lines += [f"  {row.name}: {row.before:.4g} -> {row.after:.4g}" for row in self.plant]
        for row in self.validated:
            lines.append(f"  validated, {' + '.join(row.effects) or 'no effect'}: {row.error:.4g} {row.unit}")
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
    "none": "Nothing is missing", "unknown": "Something is missing that no effect of the library stands for",
}


def plain(value):
    """Numbers of NumPy as Python's, infinite ones as None."""
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value
