"""The answer of `explain` as a folder: the data, the new scenario, pictures, and a page for people."""

import base64
import difflib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from pydrake.systems.framework import Diagram

from drake_ispace.blocks.errors import InputError
from drake_ispace.effects.library import library
from drake_ispace.explain.answer.explanation import Explanation
from drake_ispace.files.places import fresh_folder
from drake_ispace.files.recording import Recording
from drake_ispace.files.yaml_guard import dump_yaml
from drake_ispace.report.closed_loop import closed_loop
from drake_ispace.report.drawing import draw
from drake_ispace.report.explain_plots import plot_path, plot_residuals
from drake_ispace.report.pages import render, write_text
from drake_ispace.scenario import Scenario, difference
from drake_ispace.wiring.catalog import build_diagram, entry_of

MARK = "explanation.json"
_TITLES = {
    "named": "The model lacks {}", "set": "The model lacks one of a few effects that these runs cannot tell apart",
    "none": "The model lacks nothing that these runs could show",
    "unknown": "The model lacks something that no effect of the library stands for",
}
_MIME = {".png": "image/png", ".svg": "image/svg+xml"}


def write_explanation(
    explanation: Explanation, model: Scenario, runs: Sequence[Recording], held_out: Sequence[Recording], out: Path,
    tell: Callable[[str], None] = lambda text: None,
) -> Explanation:
    """Write the folder `out`: explanation.json, index.html and its pictures.

    There are also model.yaml and after.svg where effects are named, residuals.png where there is a gap on held-out
    runs, and path.png where the reference of a run can be followed again.

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
    with fresh_folder(out) as fresh:
        write_files(explanation, model, runs, held_out, fresh, tell)
    return explanation


def write_files(
    explanation: Explanation, model: Scenario, runs: Sequence[Recording], held_out: Sequence[Recording], folder: Path,
    tell: Callable[[str], None] = lambda text: None,
) -> dict | None:
    """Write the files of `write_explanation` straight into `folder`, which exists.

    Returns:
        The distances of `write_path`, None where no reference can be followed again.

    Raises:
        InputError: the folder cannot be written.
    """
    robot = robot_of(model, [*runs, *held_out])
    tell("drawing")
    pictures = draw_diagrams(explanation, model, robot, folder)
    if explanation.gap:
        plot_residuals(explanation.gap, folder / "residuals.png")
    tell("simulating the closed loop")
    path = explanation.closed_loop = write_path(explanation, model, robot, [*held_out, *runs], folder / "path.png")
    if explanation.model is not None:
        write_text(folder / "model.yaml", dump_yaml(explanation.difference))
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
        (file, title) of each picture.
    """
    draw(build_diagram(model), folder / "before.svg")
    pictures = [("before.svg", "The model as given")]
    if explanation.model is not None:
        diagram = build_diagram(explanation.model)
        draw(diagram, folder / "after.svg", highlight=new_blocks(explanation, robot, diagram))
        pictures.append(("after.svg", "The model with what it lacks, in colour"))
    return pictures


def write_path(
    explanation: Explanation, model: Scenario, robot: str, runs: Sequence[Recording], out: Path
) -> dict | None:
    """Plot the first of `runs` whose reference the model's own controller can follow again.

    Returns:
        {"run", "before_m", "after_m"}: name of the run, and root mean square distances [m] to the measured positions;
        None where there is no such run.
    """
    for recording in runs:
        before = closed_loop(model, robot, recording)
        if before is None:
            continue
        after = None if explanation.model is None else closed_loop(explanation.model, robot, recording)
        distances = plot_path(recording, before, after, out)
        name = recording.path.name if recording.path is not None else "a run"
        return {"run": name, "before_m": distances[0], "after_m": distances[1]}
    return None


def page(
    explanation: Explanation, model: Scenario, pictures: Sequence[tuple[str, str]], path: dict | None, folder: Path
) -> str:
    """The HTML page, with the pictures in it that lie in `folder`."""
    names = " and ".join(effect.name.replace("_", " ") for effect in explanation.effects)
    return render(
        "explain.html.j2", title=_TITLES[explanation.verdict].format(names), e=explanation, path=path,
        cards={name: library()[name].card for name in _mentioned(explanation) if name in library()},
        lines=changed_lines(model, explanation), blocks=[(title, embedded(folder / name)) for name, title in pictures],
        residuals=embedded(folder / "residuals.png") if explanation.gap else None,
        path_picture=embedded(folder / "path.png") if path is not None else None, diagram=model.diagram,
    )


def changed_lines(model: Scenario, explanation: Explanation) -> list[tuple[str, str]]:
    """Lines of the new scenario's YAML compared with the given one: (" ", "+" or "-", line)."""
    if explanation.model is None:
        return []
    before, after = (dump_yaml(difference(one)).splitlines() for one in (model, explanation.model))
    return [(line[0], line[2:]) for line in difflib.ndiff(before, after) if line[0] != "?"]


def embedded(file: Path) -> str:
    """A picture as a data: address, so that the page needs no other file.

    Raises:
        InputError: the picture cannot be read.
    """
    try:
        data = base64.b64encode(file.read_bytes()).decode()
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
    return f"data:{_MIME[file.suffix]};base64,{data}"


def _mentioned(explanation):
    return [name for effect in explanation.effects for name in (effect.name, *effect.equivalents)]
