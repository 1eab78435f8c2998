"""What a check of the recordings makes of the answer."""

from dataclasses import replace

from drake_ispace.explain.answer.explanation import Explanation
from drake_ispace.explain.check.compare.scale import is_unit
from drake_ispace.explain.check.examine import Examined
from drake_ispace.faults.library import FAULTS, same_as


def contradiction(examined: Examined, seconds: float) -> Explanation:
    """The answer where the recordings contradict each other, or the model's dimensions."""
    repair = "repair the recordings (`drake-ispace check RUN... --repair FOLDER`) and ask again"
    if not any(finding.repairs for finding in examined.findings):
        repair = "do what is said of each and ask again"
    return Explanation(
        "data", [], None, [], [], data=examined.findings, runs=examined.names[: examined.trained],
        held_out=examined.names[examined.trained :], seconds=seconds, warnings=examined.warnings,
        next_experiment=repair if examined.runs else "record the runs again: without what is wrong nothing is left",
    )


def add_findings(answer: Explanation, examined: Examined) -> None:
    """Add what was found in the data to an answer that was reached in spite of it.

    An effect that is the same thing as a fault is named beside that fault, as a set. Beside some faults nothing is
    named for certain.
    """
    answer.data = examined.findings
    answer.effects = [replace(effect, faults=_same(effect)) for effect in answer.effects]
    if answer.verdict == "named" and any(effect.faults for effect in answer.effects):
        answer.verdict = "set"
    answer.warnings = [str(finding) for finding in examined.findings] + answer.warnings
    if said := _early_camera(answer):
        answer.warnings.insert(0, said)
    doubts = [finding for finding in examined.findings if FAULTS[finding.fault].doubtful]
    if answer.effects and doubts:
        answer.verdict = "incomplete"
        titles = " and ".join(dict.fromkeys(FAULTS[finding.fault].title for finding in doubts))
        answer.warnings.insert(0, f"what was detected may come of {titles}")


def _same(effect):
    """Names of the faults that are the same thing as an effect: a command in another scale is as a large gain."""
    scaled = effect.name == "velocity_gain" and not all(
        is_unit(1.0 / (1.0 + share.estimate)) for share in effect.parameters.values()
    )
    return same_as(effect.name) + ["wrong_unit"] * scaled


def _early_camera(answer) -> str | None:
    """A sentence where a camera is named that is early: it, or the encoders, have other stamps.

    Nothing sees what is not there yet. A robot that follows as much too late has late encoders.
    """
    offset = next((e.parameters["offset_s"] for e in answer.effects if e.name == "clock_offset"), None)
    if offset is None or offset.ci90[1] >= 0.0:
        return None
    early = f"no camera sees a robot {-offset.estimate:.3g} s before it is there"
    said = f"{early}: its stamps are wrong, or the encoders' are"
    delay = next((e.parameters["delay_s"] for e in answer.effects if "delay_s" in e.parameters), None)
    if delay is None or delay.ci90[0] > -offset.ci90[0] or delay.ci90[1] < -offset.ci90[1]:
        return said
    return f"{said}; a delay of {delay.estimate:.3g} s besides speaks for the encoders'"
