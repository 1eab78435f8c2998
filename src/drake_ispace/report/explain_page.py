"""The answer of `explain` as a folder: the data, the new scenario, pictures, and a page for people."""

import difflib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from pydrake.systems.framework import Diagram

from drake_ispace.blocks.errors import InputError
from drake_ispace.effects.library import library
from drake_ispace.explain.answer.controller import FOREIGN
from drake_ispace.explain.answer.explanation import Explanation
from drake_ispace.explain.answer.sentences import most_in, over, p_in_words
from drake_ispace.explain.prove.errors.free_run import RUN, STEP
from drake_ispace.explain.prove.errors.gap import HELD_OUT, TRAINING, GapRow
from drake_ispace.explain.prove.left.remainder import amount
from drake_ispace.faults.repair import from_zero
from drake_ispace.files.places import fresh_folder
from drake_ispace.files.recording import Recording
from drake_ispace.files.yaml_guard import dump_yaml
from drake_ispace.report.check_page import findings_page
from drake_ispace.report.closed_loop import closed_loop
from drake_ispace.report.dead_reckoning import reckoned
from drake_ispace.report.pages import embedded, render, write_text
from drake_ispace.report.pictures.drawing import draw
from drake_ispace.report.pictures.explain_plots import plot_gap, plot_path
from drake_ispace.scenario import Scenario, difference
from drake_ispace.wiring.catalog import build_diagram, entry_of

MARK = "explanation.json"
_REFERENCE = "reference"  # what drives the model along it: its own controller
_AHEAD = {RUN: "whole run", STEP: "next sample"}


def write_explanation(
    explanation: Explanation, model: Scenario, runs: Sequence[Recording], held_out: Sequence[Recording], out: Path,
    tell: Callable[[str], None] = lambda text: None,
) -> Explanation:
    """Write the folder `out`: explanation.json, index.html and its pictures.

    There are also model.yaml and after.svg where effects are named, residuals.png where there are unseen runs, and
    path.png where a camera saw the robot.

    Args:
        model: as it was given. runs, held_out: those that the explanation was made with. tell: called with the name of
            each step.

    Returns:
        The explanation, with the path of model.yaml.

    Raises:
        InputError: the folder cannot be written.
    """
    if explanation.model is not None:
        explanation = replace(explanation, model_path=str(out / "model.yaml"))
    with fresh_folder(out, "an explanation") as fresh:
        write_files(explanation, model, runs, held_out, fresh, tell)
    return explanation


def write_files(
    explanation: Explanation, model: Scenario, runs: Sequence[Recording], held_out: Sequence[Recording], folder: Path,
    tell: Callable[[str], None] = lambda text: None,
) -> dict | None:
    """Write the files of `write_explanation` straight into `folder`, which exists.

    Returns:
        The distances of `write_path`.

    Raises:
        InputError: the folder cannot be written.
    """
    if explanation.verdict == "data":
        explanation.save(folder / MARK)
        write_text(folder / "index.html", findings_page(explanation.data, model, [*runs, *held_out], folder))
        return None
    robot = robot_of(model, [*runs, *held_out])
    tell("drawing")
    pictures = draw_diagrams(explanation, model, robot, folder)
    if shown := [row for row in explanation.gap if row.runs == HELD_OUT and None not in (row.sensors, row.chance)]:
        plot_gap(shown, folder / "residuals.png")
    tell("simulating the path")
    path = write_path(explanation, model, robot, [*held_out, *runs], folder / "path.png")
    explanation.closed_loop = path if path is not None and path["closed_loop"] else None
    if explanation.closed_loop is not None:
        of_unseen = any(path["run"] == name_of(recording) for recording in held_out)
        others = [row for row in explanation.gap if row.driven_by != _REFERENCE]
        explanation.gap = [_closed_loop_row(path, HELD_OUT if of_unseen else TRAINING), *others]
    if explanation.model is not None:
        write_text(folder / "model.yaml", _mark(explanation) + dump_yaml(explanation.difference))
    explanation.save(folder / MARK)
    write_text(folder / "index.html", page(explanation, model, pictures, path, folder))
    return path


def robot_of(model: Scenario, runs: Sequence[Recording]) -> str:
    """The name of the scenario's section that describes the robot of the runs, whatever the runs call the robot."""
    known = entry_of(model).robots
    return runs[0].robot if runs and runs[0].robot in known else known[0]


def new_blocks(explanation: Explanation, robot: str, diagram: Diagram) -> list[str]:
    """Names of the blocks that the named effects are in the new Diagram; the plant for effects without a block."""
    blocks = {block.get_name() for block in diagram.GetSystems()}
    names = [f"{robot}_{effect.name}" for effect in explanation.effects]
    return [name if name in blocks else f"{robot}_plant" for name in names]


def draw_diagrams(explanation: Explanation, model: Scenario, robot: str, folder: Path) -> list[tuple[str, str]]:
    """Draw before.svg and, where effects are named, after.svg with the new blocks in colour.

    Returns:
        (file, title) of each picture. None where the model's own path is none for its wheels or its room, which is then
        a warning of the explanation.
    """
    try:
        draw(build_diagram(model), folder / "before.svg")
    except InputError as refused:
        told = f"the Diagram could not be drawn: {refused}"
        if told not in explanation.warnings:
            explanation.warnings.append(told)
        return []
    pictures = [("before.svg", "The model as given")]
    if explanation.model is not None:
        diagram = build_diagram(explanation.model)
        draw(diagram, folder / "after.svg", highlight=new_blocks(explanation, robot, diagram))
        pictures.append(("after.svg", "The model with what it lacks, in colour"))
    return pictures


def write_path(
    explanation: Explanation, model: Scenario, robot: str, runs: Sequence[Recording], out: Path
) -> dict | None:
    """Plot the measured path beside that of the model, as given and with the effects.

    The model follows the reference of the first run for which that can be done, with its own controller. Where there
    is no such run, or the robot has another controller, the first run is dead-reckoned.

    Returns:
        {"run", "before_m", "after_m", "closed_loop"}: name of the run, root mean square distances [m] to the measured
        positions, and whether the model followed the reference. None where nothing was seen.
    """
    models = [model] if explanation.model is None else [model, explanation.model]
    controller = explanation.controller
    followed = runs if controller is None or controller.unexplained <= FOREIGN else []
    for recording in (from_zero(run, ("kinect",)) for run in followed if "kinect" in run.channels):
        paths = [closed_loop(one, robot, recording) for one in models]
        if paths[0] is not None:
            distances = plot_path(recording.channels["kinect"], recording.channels["reference"], paths, out)
            return _told(recording, distances, True)
    for recording in runs:
        if found := reckoned(models, recording):
            seen, *paths = found
            return _told(recording, plot_path(seen, None, paths, out), False)
    return None


def _told(recording, distances, is_closed_loop):
    before, after = [*distances, None][:2]
    return {"run": name_of(recording), "before_m": before, "after_m": after, "closed_loop": is_closed_loop}


def name_of(recording: Recording) -> str:
    """The name of a recording on the page."""
    return recording.path.name if recording.path is not None else "a run"


def _closed_loop_row(path, runs) -> GapRow:
    """The row of the gap for the model in closed loop along the reference."""
    after = path["before_m"] if path["after_m"] is None else path["after_m"]
    return GapRow(
        runs, "ATE", "run", "position", "m", _REFERENCE, path["before_m"], after, None, None, None, None, None
    )


def _mark(explanation):
    """The first line of the model.yaml of an incomplete answer."""
    if explanation.verdict != "incomplete":
        return ""
    names = ", ".join(effect.name for effect in explanation.effects)
    return f"# incomplete: has {names}, but something more is missing; see index.html beside this file\n"


def page(
    explanation: Explanation, model: Scenario, pictures: Sequence[tuple[str, str]], path: dict | None, folder: Path
) -> str:
    """The HTML page, with the pictures in it that lie in `folder`."""
    cells = {which: [_cells(row) for row in explanation.gap if row.runs == which] for which in (HELD_OUT, TRAINING)}
    return render(
        "explain.html.j2", title=explanation.title, e=explanation, path=path,
        cards={name: library()[name].card for name in explanation.mentioned if name in library()},
        lines=changed_lines(model, explanation), blocks=[(title, embedded(folder / name)) for name, title in pictures],
        lead=_sentence(explanation), unseen=cells[HELD_OUT], seen=cells[TRAINING], left=_left(explanation),
        residuals=embedded(folder / "residuals.png") if (folder / "residuals.png").is_file() else None,
        path_picture=embedded(folder / "path.png") if path is not None else None, diagram=model.diagram,
        chance=p_in_words(explanation.detection.p_value) if explanation.detection else "",
    )


def _sentence(explanation):
    """What the gap is, and was, in a sentence for each headline."""
    return " ".join(f"{text[:1].upper()}{text[1:]}." for text in explanation.headlines_in_words())


def _cells(row: GapRow) -> dict[str, str]:
    """A row of the gap as text."""
    def share(value):
        return "below -100" if value < -1.0 else f"{100.0 * value:.0f}"

    numbers = {name: getattr(row, name) for name in ("before", "after", "sensors", "chance", "least_squares")}
    cells = {name: "–" if value is None else amount(value, row.unit) for name, value in numbers.items()}
    interval = "–" if row.ci90 is None else f"{share(row.ci90[0])} to {share(row.ci90[1])} %"
    return cells | {
        "channel": f"{row.channel}{f', {row.kind}' if row.kind else ''}",
        "horizon": _AHEAD.get(row.horizon, row.horizon.replace("s", " s")),
        "driven_by": row.driven_by, "closed": "–" if row.closed is None else f"{share(row.closed)} %",
        "interval": interval,
    }


def _left(explanation):
    """The Remainders as text."""
    return [
        {"channel": r.channel, "size": f"{amount(r.size, r.unit)} {over(r.horizon)}", "driver": r.driver,
         "since": r.since or "–", "because": r.because, "runs": most_in(r) or "–"} for r in explanation.remainders
    ]


def changed_lines(model: Scenario, explanation: Explanation) -> list[tuple[str, str]]:
    """Lines of the new scenario's YAML compared with the given one: (" ", "+" or "-", line)."""
    if explanation.model is None:
        return []
    before, after = (dump_yaml(difference(one)).splitlines() for one in (model, explanation.model))
    return [(line[0], line[2:]) for line in difflib.ndiff(before, after) if line[0] != "?"]
