"""The commands `explain`, which finds what a model lacks, and `hide`, which makes recordings to try it on.

Heavy libraries are imported inside the functions, so that `--help` answers at once.
"""

import os
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from drake_ispace.blocks.errors import InputError, expected_one_of, shown
from drake_ispace.cli.options import Json, Seconds, Seed, Sets, whole
from drake_ispace.cli.terminal import print_json, progress, say, stages
from drake_ispace.files.places import check_folder, check_own_folder

_SECONDS = 20.0  # duration of a hidden run, unless given


def register(app: App) -> None:
    """Add the commands of this module to the app."""
    app.command(explain)
    app.command(hide)


def explain(
    *runs: Path, model: Annotated[str, Parameter(help="scenario that should describe the robot: a name or YAML file")],
    held_out: Annotated[
        list[Path] | None,
        Parameter(negative="", consume_multiple=True, help="runs to prove the answer on, best of another motion"),
    ] = None,
    out: Annotated[Path | None, Parameter(help="folder of the report: page, pictures, new scenario")] = None,
    trust_data: Annotated[
        bool, Parameter(negative="", help="go on although the recordings contradict each other")
    ] = False,
    most_seconds: Annotated[
        float, Parameter(help="of training runs under torque that are used, stretches of longer ones")
    ] = 160.0,
    seed: Seed = None, set_: Sets = None, as_json: Json = False,
) -> None:
    """Find which physical effect a model lacks, from measured runs, and prove that adding it closes the gap."""
    held_out, seed = held_out or [], _checked_seed(seed)
    _check_runs(runs, held_out)
    if out is not None:
        check_own_folder(out, "an explanation")
    from drake_ispace.robots.recordings import load
    from drake_ispace.scenario import load_scenario

    scenario = load_scenario(model, set_ or [])
    recordings, held_out = [load(run) for run in runs], [load(run) for run in held_out]
    with stages("reading the library of effects") as tell:
        from drake_ispace.explain.explain import explain as explain_runs

        explanation = explain_runs(
            scenario, recordings, held_out=held_out, seed=seed, tell=tell, trust_data=trust_data, most_s=most_seconds,
        )
        if out is not None:
            from drake_ispace.report.explain_page import write_explanation

            explanation = write_explanation(explanation, scenario, recordings, held_out, out, tell)
    if as_json:
        print_json(explanation.to_data())
        return
    say(explanation)
    if out is not None:
        say(f"open {out / 'index.html'}")


def hide(
    scenario: str, /, *,
    effect: Annotated[list[str] | None, Parameter(negative="", help="name:parameter=value,... of one or more")] = None,
    out: Annotated[Path, Parameter(help="folder of the recordings and the answer")],
    runs: Annotated[int, Parameter(help="how many; the kinds of motion take turns", converter=whole)] = 4,
    robot: Annotated[str | None, Parameter(help="which robot, of a Diagram with two")] = None,
    seconds: Seconds = None, seed: Seed = None, set_: Sets = None, as_json: Json = False,
) -> None:
    """Make recordings with effects hidden in them, and write the answer into a file of its own."""
    seed = _checked_seed(seed)
    if not 1 <= runs <= 1000:
        raise InputError(f"--runs: expected 1 to 1000, got {runs}")
    check_folder(out)
    if out.exists() and not (out.is_dir() and not any(out.iterdir())):
        raise InputError(f"{out}: is there already, expected a new or an empty folder")
    from drake_ispace.scenario import load_scenario, with_option

    given = load_scenario(scenario, [f"seconds={_SECONDS}", *(set_ or [])])
    if seconds is not None:
        given = with_option(given, "seconds", seconds)
    robots = _robots(given, scenario)
    if robot is not None and robot not in robots:
        raise InputError(f"--robot: {scenario} has no {shown(robot)}, {expected_one_of(robot, robots)}")
    effects = {}
    for name, values in (_read_effect(text) for text in effect or []):
        if name in effects:
            raise InputError(f"--effect {name}: is given twice, expected once")
        effects[name] = values
    from drake_ispace.hiding import MOTIONS, save_hidden
    from drake_ispace.hiding import hide as hide_effects

    robot = robot or robots[0]
    motions = [list(MOTIONS)[i % len(MOTIONS)] for i in range(runs)]
    with progress(None, "hiding"):
        hidden = hide_effects(given, robot, effects, motions, seed, given.seconds)
    digest = save_hidden(hidden, robot, effects, seed, out)
    recordings = {name: str(out / name) for name in hidden}
    if as_json:
        print_json({"recordings": recordings, "answer": str(out / "answer.json"), "sha256": digest})
        return
    for path in recordings.values():
        say(path)
    say(f"answer: {out / 'answer.json'}, SHA-256 {digest}")


def _checked_seed(seed):
    if seed is not None and seed < 0:
        raise InputError(f"--seed: expected at least 0, got {seed}")
    return seed or 0


def _check_runs(runs, held_out):
    """Refuse no run at all, and a folder that is named twice."""
    if not runs:
        raise InputError("explain: expected the folder of at least one run")
    named = [("RUN", run) for run in runs] + [("--held-out", run) for run in held_out]
    seen = set()
    for option, run in named:
        place = os.path.realpath(run)
        if place in seen:
            expected = "runs that the effects are not fitted to" if option == "--held-out" else "different runs"
            raise InputError(f"{option} {run}: is named twice, expected {expected}")
        seen.add(place)


def _robots(scenario, name):
    """The names of the robots of the scenario's Diagram.

    Raises:
        InputError: no such Diagram, or values that do not go together.
    """
    from drake_ispace.scenario import blaming
    from drake_ispace.wiring.catalog import build_diagram, entry_of

    with blaming(name):
        build_diagram(scenario)
    return list(entry_of(scenario).robots)


def _read_effect(text):
    """Split name:parameter=value,parameter=value into the name and a mapping of parameters."""
    from drake_ispace.files.yaml_guard import load_yaml

    name, colon, settings = text.partition(":")
    values = {}
    for setting in settings.split(","):
        key, equals, value = setting.partition("=")
        if not colon or not equals or not key.strip() or not text.isprintable():
            raise InputError(
                f"--effect {shown(text)}: expected name:parameter=value, such as coulomb_friction:torque_n_m=0.01"
            )
        if key.strip() in values:
            raise InputError(f"--effect {shown(text)}: {shown(key.strip())} is given twice, expected once")
        values[key.strip()] = load_yaml(f"value: {value}\n", f"--effect {name}:{key}")["value"]
    return name.strip(), values
