"""The answer of `explain` as a folder: the data, the new scenario, pictures, and a page that tells the story."""

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
    """Write `out`: explanation.json, model.yaml (where there are named effects), before.svg, after.svg, residuals.png
    (where there is a gap on held-out runs), path.png (where a run's reference can be followed again), index.html.

    Args:
        model: as it was given. runs, held_out: what it was explained with. tell: told what is going on.

    Returns:
        The explanation, with the path of its model.

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
    """As `write_explanation`, straight into `folder`, which exists; returns what `write_path` does."""
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
    """The section of the scenario that describes the robot of the runs, whatever they call it."""
    known = entry_of(model).robots
    return runs[0].robot if runs and runs[0].robot in known else known[0]


def new_blocks(explanation: Explanation, robot: str, diagram: Diagram) -> list[str]:
    """Blocks of the new Diagram that the named effects are; of those that are other numbers in it, the plant."""
    blocks = {block.get_name() for block in diagram.GetSystems()}
    names = [f"{robot}_{effect.name}" for effect in explanation.effects]
    return [name if name in blocks else f"{robot}_plant" for name in names]


def draw_diagrams(explanation: Explanation, model: Scenario, robot: str, folder: Path) -> list[tuple[str, str]]:
    """Write before.svg and, with effects, after.svg, the new blocks in colour; (file, title) of each."""
    draw(build_diagram(model), folder / "before.svg")
    found = [("before.svg", "The model as given")]
    if explanation.model is not None:
        diagram = build_diagram(explanation.model)
        draw(diagram, folder / "after.svg", highlight=new_blocks(explanation, robot, diagram))
        found.append(("after.svg", "The model with what it lacks, in colour"))
    return found


def write_path(
    explanation: Explanation, model: Scenario, robot: str, runs: Sequence[Recording], out: Path
) -> dict | None:
    """Draw the first of `runs` whose reference the model's own controller can follow; None where there is none.

    Returns:
        {"run", "before_m", "after_m"}: its name, rms distances to the measurement.
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
    """The page as text, its pictures, which lie in `folder`, inside it."""
    names = " and ".join(effect.name.replace("_", " ") for effect in explanation.effects)
    return render(
        "explain.html.j2", title=_TITLES[explanation.verdict].format(names), e=explanation, path=path,
        cards={name: library()[name].card for name in _mentioned(explanation) if name in library()},
        lines=changed_lines(model, explanation), blocks=[(title, embedded(folder / name)) for name, title in pictures],
        residuals=embedded(folder / "residuals.png") if explanation.gap else None,
        path_picture=embedded(folder / "path.png") if path is not None else None, diagram=model.diagram,
    )


def changed_lines(model: Scenario, explanation: Explanation) -> list[tuple[str, str]]:
    """(" ", "+" or "-", line) of the new scenario's YAML against that of the model as given."""
    if explanation.model is None:
        return []
    before, after = (dump_yaml(difference(one)).splitlines() for one in (model, explanation.model))
    return [(line[0], line[2:]) for line in difflib.ndiff(before, after) if line[0] != "?"]


def embedded(file: Path) -> str:
    """A picture as a data: address, so that a page needs no other file.

    Raises:
        InputError: it cannot be read.
    """
    try:
        data = base64.b64encode(file.read_bytes()).decode()
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
    return f"data:{_MIME[file.suffix]};base64,{data}"


def _mentioned(explanation):
    return [name for effect in explanation.effects for name in (effect.name, *effect.equivalents)]
