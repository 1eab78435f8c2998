"""What a check found: a fault, where it is, how sure that is, and what undoes it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from drake_ispace.faults.library import FAULTS
from drake_ispace.faults.repair import Clock, OfStretch, Repair, Turned, span_text


@dataclass(frozen=True)
class Finding:
    """A fault of the data, or of the model's dimensions.

    Attributes:
        fault: name of its card. what: in words. channel: that is at fault, "model" for the model's dimensions.
            from_s, to_s: stretch of time [s], on the recorded clock; None: the whole run.
        drop_in_deviance: how much better the data agree with each other under this fault than as given, physics of
            plausible size included, -2 log likelihood ratio; None: it shows without comparing readings.
        rivals: faults that explain the same about as well, those of another channel with its name ("clock_drift of
            encoder"). interval: of the number in `what`, 90 %; None: no number.
        repairs: what undoes it, in this order; empty: nothing can. for_now: what undoes it well enough to go on with
            the comparisons, and no more. advice: what to do instead, in words, where not the data should be changed.
            runs: numbers of the runs that have it, empty where no check found it. run: their names; all: every run has
            it. harmless: whether a model can be judged by the repaired data.
    """

    fault: str
    what: str
    channel: str
    from_s: float | None = None
    to_s: float | None = None
    drop_in_deviance: float | None = None
    rivals: tuple[str, ...] = ()
    interval: tuple[float, float] | None = None
    repairs: tuple[Repair, ...] = ()
    for_now: tuple[Repair, ...] = ()
    advice: str = ""
    runs: tuple[int, ...] = ()
    run: str = ""
    harmless: bool = False

    @property
    def limited(self) -> bool:
        """Whether only a stretch of time is at fault."""
        return self.from_s is not None

    @property
    def is_bearable(self) -> bool:
        """Whether a model can be judged in spite of it, or by what is repaired."""
        return self.harmless or FAULTS[self.fault].harmless

    @property
    def stretches(self) -> list[tuple[float, float]]:
        """Begin and end [s] of every stretch that is repaired, or else that is at fault; of a limited finding.

        Headings that are turned are sound again but at the ends of their stretch, and stamps but where a clock jumps.
        """
        repaired = [(one.from_s, one.to_s) for one in self.repairs if isinstance(one, OfStretch)]
        ends = [end for one in self.repairs if isinstance(one, Turned) for end in (one.from_s, one.to_s)]
        ends += [one.since_s for one in self.repairs if isinstance(one, Clock)]
        return repaired + [(end, end) for end in ends] or [(self.from_s, self.to_s)]

    @property
    def repair(self) -> str:
        """What undoes it, in one line."""
        return self.advice or "; ".join(str(one) for one in self.repairs) or "record it again"

    def __str__(self) -> str:
        where = "in all runs" if self.run == "all" else f"in {self.run}"
        when = f" {span_text(self.from_s, self.to_s, 3)}" if self.limited else ""
        others = f" (or {', '.join(self.rivals[:3])})" if self.rivals else ""
        title = FAULTS[self.fault].title
        what = f"{title}{'' if self.what == title else f', {self.what}'}{others}"
        return f"{self.channel} {where}{when}: {what}; repair: {self.repair}"

    def to_data(self) -> dict:
        """Plain data, ready for JSON."""
        numbers = ("from_s", "to_s", "drop_in_deviance")
        names = ("fault", "what", "run", "channel", *numbers, "rivals", "interval", "repair")
        data = {name: getattr(self, name) for name in names}
        return data | {name: None if data[name] is None else list(data[name]) for name in ("rivals", "interval")}


def named(finding: Finding, names: list[str]) -> Finding:
    """The finding with `run` from its `runs` and the names of all runs."""
    whole = len(finding.runs) == len(names) > 1
    return replace(finding, run="all" if whole else ", ".join(names[i] for i in finding.runs))


def joined(findings: Iterable[Finding]) -> list[Finding]:
    """Findings of different runs that are the same, as one."""
    found: dict[tuple, Finding] = {}
    for finding in findings:
        key = (finding.fault, finding.channel, finding.what, finding.from_s, finding.repairs, finding.for_now)
        same = found.get(key)
        found[key] = finding if same is None else replace(same, runs=same.runs + finding.runs)
    return list(found.values())


def serious(findings: Iterable[Finding]) -> list[Finding]:
    """Those on whole runs in spite of which no model can be judged."""
    return [finding for finding in findings if not finding.limited and not finding.is_bearable]


def headline(findings: Sequence[Finding], compared: bool = True) -> str:
    """What was found in a sentence; compared: whether any channel was compared with the wheels."""
    if serious(findings) or not all(finding.repairs for finding in findings):
        return "What is wrong with the recordings"
    if not compared:
        return "Nothing was compared: that takes wheels and another channel, for some seconds together"
    return "The recordings agree with each other" + " once this is repaired or left out" * bool(findings)
