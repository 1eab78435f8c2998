"""The first section of the demonstration: an effect is hidden in fresh data, and `explain` finds it.

    python -m drake_ispace.report.hidden_effect docs/pictures/explained.png

writes the picture at the top of the README.
"""

import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from drake_ispace.explain.answer.explanation import Explanation
from drake_ispace.explain.answer.sentences import gap_sentence
from drake_ispace.explain.explain import explain
from drake_ispace.hiding import hide
from drake_ispace.report.explain_page import write_files
from drake_ispace.scenario import load_scenario
from drake_ispace.wiring.catalog import entry_of

MODEL = "omni_multirate"
#: The hidden effect: a floor that slopes by 1.7 and -1.1 degrees, of which neither controller nor model knows.
HIDDEN = {"floor_tilt": {"slope_x_rad": 0.03, "slope_y_rad": -0.02}}
_RUNS, _HELD_OUT, _SECONDS = ("square", "figure_eight"), ("circle",), 14.0
#: Picture of the answer -> its name on the page of the demonstration.
_PICTURES = {
    "path.png": "explained_path.png", "residuals.png": "explained_residuals.png", "after.svg": "explained_model.svg",
}


def write_hidden_effect(folder: Path, seed: int, tell: Callable[[str], None] = lambda text: None) -> tuple[dict, dict]:
    """Hide an effect, explain the runs, and write the page explained.html and its pictures into `folder`.

    The folder is made where it is not there.

    Args:
        seed: of all noise in the data. tell: called with the name of each step.

    Returns:
        What the page shows: "hidden", "found" and the "gap" in words, "path", "seconds" and the names of its
        "pictures"; and the numbers for its data, with the three "lines" for the terminal.

    Raises:
        InputError: the folder cannot be written.
    """
    tell("hiding an effect")
    model = load_scenario(MODEL)
    runs = hide(model, entry_of(model).robots[0], HIDDEN, (*_RUNS, *_HELD_OUT), seed, _SECONDS)
    named = {name: replace(recording, path=Path(name)) for name, recording in runs.items()}
    training, held_out = [named[name] for name in _RUNS], [named[name] for name in _HELD_OUT]
    explanation = explain(model, training, held_out=held_out, seed=seed, tell=tell)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as beside:
        path = write_files(explanation, model, training, held_out, Path(beside), tell)
        pictures = {file: name for file, name in _PICTURES.items() if (Path(beside) / file).is_file()}
        for file, name in {**pictures, "index.html": "explained.html"}.items():
            shutil.move(Path(beside) / file, folder / name)
    shown = {
        "hidden": _words(HIDDEN), "found": found_words(explanation), "path": path,
        "gap": gap_sentence(explanation.headline, "the unseen run", True),
        "pictures": list(pictures.values()), "seconds": explanation.seconds,
    }
    lines = [f"hidden: {'; '.join(shown['hidden'])}", f"found: {'; '.join(shown['found'])}", f"gap: {shown['gap']}"]
    return shown, {"hidden": HIDDEN, "explanation": explanation.to_data(), "path": path, "lines": lines}


def found_words(explanation: Explanation) -> list[str]:
    """A line for each named effect: its parameters with intervals, and its look-alikes."""
    lines = []
    for effect in explanation.effects:
        numbers = ", ".join(
            f"{name} = {p.estimate:.3g} ({p.ci90[0]:.3g} to {p.ci90[1]:.3g})" for name, p in effect.parameters.items()
        )
        others = f", or {', '.join(effect.equivalents)}" if effect.equivalents else ""
        lines.append(f"{effect.name}: {numbers}{others}")
    return lines or [f"verdict: {explanation.verdict}"]


def _words(effects):
    return [
        f"{name}: {', '.join(f'{key} = {value:g}' for key, value in values.items())}"
        for name, values in effects.items()
    ]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        write_hidden_effect(Path(folder), 0, lambda text: print(text, file=sys.stderr))
        shutil.move(Path(folder) / "explained_path.png", sys.argv[1])
