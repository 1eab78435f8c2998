"""A page on what is wrong with recordings: each finding with its repair and a picture."""

import json
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from drake_ispace.explain.answer.explanation import plain
from drake_ispace.explain.check.checked import Checked
from drake_ispace.explain.check.compare.links import Base, base_of
from drake_ispace.explain.check.finding import Finding, headline
from drake_ispace.explain.prove.errors.paths import chained
from drake_ispace.faults.library import FAULTS
from drake_ispace.faults.repair import CutOut
from drake_ispace.files.places import fresh_folder
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.report.pages import embedded, render, write_text
from drake_ispace.report.pictures.plots import save
from drake_ispace.robots.library import robots
from drake_ispace.scenario import Scenario
from drake_ispace.wiring.catalog import entry_of

MARK = "findings.json"
_GIVEN, _REPAIRED = "#c0392b", "#1f6fb2"
_MOST_COLUMNS = 3


def write_findings(checked: Checked, model: Scenario, runs: Sequence[Recording], out: Path) -> None:
    """Write the folder `out`: index.html with a picture of each finding, and findings.json.

    Raises:
        InputError: the folder cannot be written.
    """
    with fresh_folder(out, "the page of a check") as fresh:
        text = json.dumps(plain([finding.to_data() for finding in checked.findings]), indent=2, allow_nan=False)
        write_text(fresh / MARK, text)
        write_text(fresh / "index.html", findings_page(checked.findings, model, runs, fresh, checked.compared))


def findings_page(
    findings: Sequence[Finding], model: Scenario, runs: Sequence[Recording], folder: Path, compared: bool = True
) -> str:
    """The page, with the pictures in it, which are written into `folder`; compared: as of `headline`."""
    shown = []
    for number, finding in enumerate(findings, 1):
        picture = folder / f"finding_{number}.png"
        plot_finding(finding, model, runs[finding.runs[0]], picture)
        shown.append({
            "finding": finding, "fault": FAULTS[finding.fault], "sentence": str(finding),
            "picture": embedded(picture),
        })
    title = headline(findings, compared)
    return render("check.html.j2", title=title, shown=shown, runs=len(runs), diagram=model.diagram)


def plot_finding(finding: Finding, model: Scenario, run: Recording, out: Path) -> None:
    """Plot the channel as it was recorded and as it should look, and the path that the wheels then say.

    Raises:
        InputError: the folder cannot be written.
    """
    repaired = run
    for repair in finding.repairs:
        if not isinstance(repair, CutOut):
            repaired = repair.apply(repaired)
    figure, (time, floor) = plt.subplots(1, 2, figsize=(12.5, 4.8), layout="constrained")
    name = finding.channel if finding.channel in run.channels else "encoder" if "encoder" in run.channels else "kinect"
    _plot_channel(time, run.channels.get(name), _GIVEN, "as recorded", 2.2)
    if finding.repairs and repaired is not run:
        _plot_channel(time, repaired.channels.get(name), _REPAIRED, "as it should look", 1.2)
    if finding.limited:
        time.axvspan(finding.from_s, max(finding.to_s, finding.from_s + 0.05), color="0.85", zorder=0)
    time.set(xlabel="time [s]", title=f"{name}: {_columns(run.channels.get(name))}")
    _plot_paths(floor, model, run, repaired if repaired is not run else None)
    for axis in (time, floor):
        axis.grid(alpha=0.3)
        if axis.get_legend_handles_labels()[0]:
            axis.legend(fontsize=9, loc="best")
    save(figure, out)


def _columns(channel):
    return "" if channel is None else ", ".join(channel.columns[:_MOST_COLUMNS])


def _plot_channel(axis, channel: Channel | None, colour, label, width):
    for i in range(min(_MOST_COLUMNS, 0 if channel is None else len(channel.columns))):
        axis.plot(channel.t, channel.values[:, i], color=colour, lw=width, alpha=1.0 - 0.25 * i,
                  label=label if i == 0 else None)


def _plot_paths(axis, model, run, repaired):
    """The camera's path, and that by dead reckoning, as recorded and repaired."""
    axis.set(xlabel="x [m]", ylabel="y [m]", title="Path: camera, and wheels by dead reckoning", aspect="equal")
    for recording, colour, label in ((run, _GIVEN, "as recorded"), (repaired, _REPAIRED, "repaired")):
        if recording is None or not {"kinect", "encoder"} <= recording.channels.keys():
            continue
        seen, base = recording.channels["kinect"], _base(model, recording)
        axis.plot(seen.values[:, 0], seen.values[:, 1], ".", color=colour, ms=4, label=f"camera, {label}")
        if base is not None:
            path = _reckoned(base, seen)
            axis.plot(path[:, 0], path[:, 1], color=colour, lw=1.2, label=f"wheels, {label}")


def _base(model, run) -> Base | None:
    robot = next(robots()[name] for name in entry_of(model).robots if robots()[name].answers_to(run.robot))
    return base_of(run, robot, getattr(model, robot.name))


def _reckoned(base: Base, seen: Channel) -> np.ndarray:
    """(k, 3) poses by the wheels from the first fix on that lies in their time."""
    t = base.encoder.t
    inside = (seen.t >= t[0]) & (seen.t <= t[-1])
    if not inside.any():
        return np.zeros((0, 3))
    times = t[t >= seen.t[inside][0]]
    return chained(seen.values[inside][0, :3], base.moved(times[:-1], times[1:]))
